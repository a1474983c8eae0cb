"""The server: pages on one database, by default on the loopback address alone, with every asset from a package."""

from __future__ import annotations

import asyncio
import errno
import logging
import signal
import socket
import webbrowser
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from functools import partial
from http import HTTPStatus
from ipaddress import ip_address
from typing import TYPE_CHECKING, Any
from uuid import UUID

import numpy as np
from bokeh.application import Application
from bokeh.application.handlers import FunctionHandler
from bokeh.server.server import Server
from bokeh.settings import settings
from jinja2 import Template
from tornado.ioloop import IOLoop
from tornado.web import HTTPError, RequestHandler

from ...database.drive_rows import drive_rows
from ...database.observations import Drive
from ...database.reader import SiteReader
from ...database.store import TerrainDatabase
from ..core.errors import BevameterError, InputError
from ..core.recording.types import Recording
from ..core.track.way import track_of
from ..core.vehicle import Vehicle
from ..placement import Placement, moved
from .map_page import MapPage
from .pages import PAGE_BODIES
from .recordings import Recordings, frame_jpeg, sound_wav
from .site import Site
from .style import PAGES, VIEW_STYLE, header, page

if TYPE_CHECKING:
    from bokeh.document import Document

LOOPBACK = "127.0.0.1"
"""Nobody but users of this machine gets at pages there."""

_ANY = ("0.0.0.0", "::")  # noqa: S104
"""All addresses of this machine."""

_DAY_S = 86400
"""A page that was loaded so long ago still gets its numbers, as after the computer slept [s]."""

_MAP = Template(
    """{% extends base %}
{% block postamble %}<style>{{ style }}</style>{% endblock %}
{% block contents %}{{ header }}
<main id=map><section aria-label="Map of the ground">{{ embed(roots.controls) }}
<div id=legend role=status></div>
<div id=area tabindex=0 role=application aria-label="Map. Arrow keys move the selected cell.">
{{ embed(roots.area) }}</div>
<p class=keys><kbd>&larr;</kbd> <kbd>&uarr;</kbd> <kbd>&rarr;</kbd> <kbd>&darr;</kbd> move the selection, with
<kbd>Shift</kbd> by ten cells; <kbd>+</kbd> <kbd>-</kbd> zoom, <kbd>0</kbd> shows the whole site. White circles: soil
measured. Crosses: soil not measured; point at one to read why.</p></section>
<aside aria-label="Selected cell"><div id=details aria-live=polite></div>{{ embed(roots.regions) }}
<div id=observations></div>{{ embed(roots.hidden) }}</aside></main>{% endblock %}"""
)

_PROBLEM = Template(
    "{% extends base %}{% block postamble %}<style>{{ style }}</style>{% endblock %}"
    "{% block contents %}<main><h1>Bevameter</h1><p class=warn>{{ problem | e }}</p></main>{% endblock %}"
)


def is_loopback(address: str) -> bool:
    """Say whether nobody but users of this machine gets at pages on an address."""
    try:
        return ip_address(address).is_loopback
    except ValueError:
        return address == "localhost"


@dataclass
class Shared:
    """What all browser tabs share.

    Parameters
    ----------
    database
        The database, which is only read.
    recordings
        Recordings of its drives, as far as they were found.
    vehicles
        Vehicles whose speed can be limited, by name.
    vehicle
        Name of the one that is chosen at first; None for none.
    first
        The site that is shown where none is named; None for the first by name.
    """

    database: TerrainDatabase
    recordings: Recordings
    vehicles: Mapping[str, Vehicle] = field(default_factory=dict)
    vehicle: str | None = None
    first: str | None = None

    def __post_init__(self) -> None:
        self._sites: dict[str, Site] = {}
        self._readers: dict[str, SiteReader] = {}
        self._tracks: dict[UUID, tuple[np.ndarray, np.ndarray] | None] = {}

    def site(self, name: str | None) -> Site:
        """Give a site as the database has it now; the first one where none is named.

        Raises
        ------
        InputError
            There is no such site, or the database cannot be read.
        """
        names = self.database.sites()
        if name is None:
            name = self.first or (names[0] if names else "")
        reader = self._readers.setdefault(name, self.database.reader(name or None))
        self._sites[name] = Site.read(self.database, reader, self._sites.get(name))
        return self._sites[name]

    def digests(self) -> frozenset[str]:
        """Digests of the recordings that the database's drives in use came from."""
        with self.database.reading() as connection:
            return frozenset(row.recording_digest for row in drive_rows(connection, None, newest=True))

    def track_of(self, drive: Drive) -> tuple[np.ndarray, np.ndarray] | None:
        """Give the way of a drive, x and y [m] in the site's frame; None where its recording was not found."""
        recording = self.recordings.of(drive.recording_digest)
        if recording is None:
            return None
        if drive.id not in self._tracks:
            self._tracks[drive.id] = _track(recording, drive)
        return self._tracks[drive.id]


def _track(recording: Recording, drive: Drive) -> tuple[np.ndarray, np.ndarray] | None:
    """Give the way of a recording in the frame of its drive's site, without lines over holes."""
    track = track_of(moved(recording, Placement(drive.site, drive.origin, drive.offset)))
    if track is None:
        return None
    holes = np.searchsorted(track.time_s, track.holes_s[:, 0], side="right")
    return np.insert(track.x_m, holes, np.nan), np.insert(track.y_m, holes, np.nan)


class _Handler(RequestHandler):
    """Answers GET of a browser on this machine that was sent to this machine's own name."""

    def initialize(self, shared: Shared, hosts: tuple[str, ...], which: str) -> None:
        self.shared, self.hosts, self.which = shared, hosts, which

    def prepare(self) -> None:
        if self.request.host not in self.hosts:  # a page elsewhere whose name was made to lead here
            raise HTTPError(HTTPStatus.FORBIDDEN)
        self.set_header("Cache-Control", "no-store")
        self.set_header("X-Content-Type-Options", "nosniff")


class _Page(_Handler):
    def get(self) -> None:
        try:
            site = self.shared.site(self.get_argument("site", None))
            body = PAGE_BODIES[self.which](site, self.shared, self.get_argument("drive", ""))
        except BevameterError as error:
            raise HTTPError(HTTPStatus.NOT_FOUND, reason=str(error).encode("ascii", "replace").decode()) from error
        self.finish(page(f"{PAGES[self.which]}: {site.name}", self.which, site, self.shared.database.sites(), body))


_READ = {"frame": ("image/jpeg", frame_jpeg), "sound": ("audio/wav", sound_wav)}
"""What is given of a recording at a time: its kind, and what reads it."""


class _Media(_Handler):
    async def get(self) -> None:
        recording = self.shared.recordings.of(self.get_argument("recording"))
        try:
            time_s = float(self.get_argument("t"))
        except ValueError:
            raise HTTPError(HTTPStatus.BAD_REQUEST) from None
        if recording is None:
            raise HTTPError(HTTPStatus.NOT_FOUND)
        kind, read = _READ[self.which]
        data = await IOLoop.current().run_in_executor(None, read, recording, time_s)
        if data is None:
            raise HTTPError(HTTPStatus.NOT_FOUND)
        self.set_header("Content-Type", kind)
        self.finish(data)


class _Nothing(RequestHandler):
    def get(self) -> None:
        self.set_status(HTTPStatus.NO_CONTENT)


def open_map(shared: Shared, document: Document) -> None:
    """Fill the document of one browser tab."""
    context: Any = document.session_context
    arguments = context.request.arguments if context is not None else {}
    name = arguments["site"][0].decode() if arguments.get("site") else None
    document.template_variables["style"] = VIEW_STYLE
    try:
        names = shared.database.sites()
        site = shared.site(name if name in names else None)
    except BevameterError as error:
        document.title, document.template = "Bevameter", _PROBLEM
        document.template_variables["problem"] = str(error)
        return
    document.title = f"Map: {site.name}" if site.name else "Map"
    document.template = _MAP
    document.template_variables["header"] = header("", site, names)
    MapPage(site, shared).add_to(document)


class View:
    """The running server.

    Parameters
    ----------
    shared
        What it shows.
    port
        Where it listens; 0 for any free port.
    address
        On which of this machine's addresses.

    Raises
    ------
    InputError
        The port is taken or not allowed, or the address is none of this machine.
    """

    def __init__(self, shared: Shared, port: int, address: str = LOOPBACK) -> None:
        settings.resources = "server"  # whatever the environment says: nothing is fetched from elsewhere
        self._shared = shared
        try:
            port = port or _free_port(address)
        except OSError as error:
            raise _refused(error, address, port) from error
        self.port, self.address = port, address
        # Pages and websockets are refused under any other name.
        own = {LOOPBACK, "localhost", address} | (set() if is_loopback(address) else {socket.gethostname()})
        hosts = tuple(sorted(f"[{each}]:{port}" if ":" in each else f"{each}:{port}" for each in own))
        given = {"shared": shared, "hosts": hosts}
        patterns: list[tuple] = [(f"/{path}", _Page, {"which": path, **given}) for path in PAGE_BODIES]
        patterns += [(f"/{kind}", _Media, {"which": kind, **given}) for kind in _READ]
        patterns.append(("/favicon.ico", _Nothing))
        try:
            self._server = Server(
                {"/": Application(FunctionHandler(partial(open_map, shared)))}, address=address, port=port,
                allow_websocket_origin=list(hosts), extra_patterns=patterns, keep_alive_milliseconds=10_000,
                session_token_expiration=_DAY_S,
            )  # fmt: skip
        except OSError as error:
            raise _refused(error, address, port) from error
        for name in ("tornado.access", "tornado.general"):  # what browsers ask for in vain is no news
            logging.getLogger(name).setLevel(logging.ERROR)
        # It names an option that this command has not got.
        logging.getLogger("bokeh.server.views.ws").addFilter(lambda record: "Refusing" not in str(record.msg))

    @property
    def url(self) -> str:
        """Where the pages are."""
        name = "localhost" if self.address in (LOOPBACK, *_ANY) else self.address
        return f"http://{f'[{name}]' if ':' in name else name}:{self.port}/"

    def run(self, *, show: bool) -> None:
        """Answer until Ctrl-C or SIGTERM."""
        loop = self._server.io_loop
        with suppress(NotImplementedError, RuntimeError):  # Windows, or a thread that gets no signals
            for number in (signal.SIGINT, signal.SIGTERM):
                asyncio.get_event_loop_policy().get_event_loop().add_signal_handler(number, loop.stop)
        self._server.start()
        if show:
            loop.run_in_executor(None, webbrowser.open, self.url)
        with suppress(KeyboardInterrupt):
            loop.start()
        self._server.stop()

    def stop(self) -> None:
        """End `run`, from another thread."""
        self._server.io_loop.add_callback(self._server.io_loop.stop)


def _refused(error: OSError, address: str, port: int) -> InputError:
    """Say why the server cannot listen there."""
    if error.errno in (errno.EADDRINUSE, errno.EACCES):
        taken = "is taken" if error.errno == errno.EADDRINUSE else str(error.strerror)
        return InputError("--port", f"{port} {taken}", expected="a free port; 0 finds one")
    return InputError("--address", f"{address}: {error.strerror}", expected="an address of this machine")


def _free_port(address: str) -> int:
    from bokeh.server.util import bind_sockets

    sockets, port = bind_sockets(address, 0)
    for each in sockets:
        each.close()
    return port
