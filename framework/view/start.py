"""From what the command line says to the running server."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from pydantic import ValidationError

from ...database.schema import REVISIONS, opened_as_it_is, revision_of
from ...database.store import TerrainDatabase
from ...database.urls import parse_url, shown
from ..core.errors import InputError
from ..core.vehicle import Vehicle, load_vehicle
from ..core.vehicle_templates import vehicle_templates
from .recordings import Recordings
from .server import LOOPBACK, Shared, View, is_loopback


def serve(
    db: str, *, site: str | None = None, vehicle: Path | None = None, recordings: Path | None = None, port: int = 0,
    address: str = LOOPBACK, show: bool = False, say: Callable[[str], None] = lambda text: None,
) -> None:  # fmt: skip
    """Show a database in a browser until it is interrupted.

    Parameters
    ----------
    db
        Path or URL.
    site
        The site that is shown first.
    vehicle
        File of a vehicle that can be chosen beside the templates.
    recordings
        Folder in which the drives' recordings are looked for.
    port
        Where the server listens; 0 for any free port.
    address
        On which of this machine's addresses. Anybody who reaches another one than the loopback address can read all.
    show
        Open a browser.
    say
        Called with each line for people.

    Raises
    ------
    InputError
        No such database, site, vehicle or folder; a schema that is not the newest; a port that is taken; an address
        that is none of this machine.
    """
    _check_newest(db)
    if recordings is not None and not recordings.is_dir():
        raise InputError(recordings, "no such folder", expected="a folder that holds recordings")
    own = None if vehicle is None else load_vehicle(vehicle)
    with TerrainDatabase(db, must_exist=True) as database:
        if site is not None:
            database.check_site(site)
        shared = Shared(database, Recordings(recordings), _vehicles(own), None if own is None else own.name, site)
        shared.site(None)  # read before anybody waits for it
        view = View(shared, port, address)
        shared.recordings.start(shared.digests())
        say(f"{database.name} is shown at {view.url} until Ctrl-C")
        if not is_loopback(address):
            say(
                f"warning: the page is not protected: anybody who reaches port {view.port} at {address} can read the "
                "database, frames and sound. Safer: ssh -L"
            )
        view.run(show=show)


def _check_newest(db: str) -> None:
    """Refuse an older schema, which opening the database would migrate; raises `InputError`."""
    with opened_as_it_is(db) as connection:
        revision = revision_of(connection)
    if revision in REVISIONS[:-1]:
        name = shown(parse_url(db))
        raise InputError(
            name, f"its schema is {revision}, and this only reads", expected=f"bevameter db migrate {name} before"
        )


def _vehicles(own: Vehicle | None) -> dict[str, Vehicle]:
    """Give the user's vehicle, and the templates of which no number is left out, by name."""
    found = {} if own is None else {own.name: own}
    for name, template in vehicle_templates().items():
        try:
            found.setdefault(name, Vehicle.model_validate(template.data))
        except ValidationError:  # a number is left to be measured
            continue
    return found
