"""What all recordings of one run have in common: what the database holds already, and what was asked for."""

from __future__ import annotations

import math
import uuid
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path

from ..database.physics import ClassPhysics
from ..database.schema import parse_url, shown
from ..database.store import TerrainDatabase
from .core.arguments import number, path_of, refused
from .core.vehicle import Vehicle, as_vehicle
from .segments import CELL_SIZE_M

METHOD = f"bevameter {version('bevameter')}, traverse 2"
"""Version of what a run makes of a recording; a change of it is another processing of the same drive."""


@dataclass(frozen=True)
class Conditions:
    """What all recordings of a run have in common, read once before: plain data, to be sent to another process.

    Parameters
    ----------
    database
        The database's path, or its URL without a password.
    known
        Identities of the drives that it holds.
    physics
        What it knows of the physics of classes, oldest first.
    cell_size_m
        Edge of a ground cell [m].
    vehicle, topics
        Instead of the recordings' own: the vehicle; and the topic map of bags.
    method
        Version of the processing; another program that runs another one may not take part.
    """

    database: str
    known: frozenset[uuid.UUID]
    physics: tuple[ClassPhysics, ...]
    cell_size_m: float
    vehicle: Vehicle | None = None
    topics: Path | None = None
    method: str = METHOD

    @staticmethod
    def of(
        database: TerrainDatabase | str | Path,
        *,
        vehicle: Vehicle | str | Path | None = None,
        topics: str | Path | None = None,
        cell_size_m: float = CELL_SIZE_M,
    ) -> Conditions:
        """Read them; where there is no database yet it knows nothing, and none is made.

        Raises
        ------
        InputError
            The database is another program's or cannot be read; vehicle, topics or cell size are none.
        """
        cell_size_m = _cell_size(cell_size_m)
        driven = None if vehicle is None else as_vehicle(vehicle)
        mapped = None if topics is None else path_of("topics", topics, "the path of a topic map")
        own = isinstance(database, TerrainDatabase)
        opened = nullcontext(database if database.there else None) if own else _if_there(database)
        with opened as store:
            known, physics = (frozenset(), ()) if store is None else (store.drive_ids(), tuple(store.physics()))
        return Conditions(shown(parse_url(url_of(database))), known, physics, cell_size_m, driven, mapped)


@contextmanager
def _if_there(database: str | Path) -> Iterator[TerrainDatabase | None]:
    """Open a database for as long as it is read; None where there is none yet."""
    store = TerrainDatabase.open_if_there(database)
    with store if store is not None else nullcontext() as opened:
        yield opened


def url_of(database: TerrainDatabase | str | Path) -> str | Path:
    """Give the path or URL of a database."""
    return database.name if isinstance(database, TerrainDatabase) else database


def _cell_size(cell_size_m: float) -> float:
    """Give the edge of a cell [m]; raises `InputError` where it is none."""
    wanted = "a finite length, greater than 0 [m]"
    edge = number("cell_size_m", cell_size_m, wanted)
    if not 0.0 < edge < math.inf:
        raise refused("cell_size_m", cell_size_m, wanted)
    return edge
