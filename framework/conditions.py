"""What all recordings of one run have in common: what the database holds already, and what was asked for."""

from __future__ import annotations

import math
import uuid
from collections.abc import Mapping
from contextlib import nullcontext
from dataclasses import dataclass, replace
from importlib.metadata import version
from pathlib import Path

from ..database.frames import SiteFrame
from ..database.physics import ClassPhysics
from ..database.store import TerrainDatabase
from ..database.urls import parse_url, shown
from .core.arguments import number, path_of, refused
from .core.errors import InputError
from .core.origin import Offset, Origin
from .core.recording.bag_places import FIXES, stays
from .core.recording.readers import read_recording
from .core.recording.types import Recording
from .core.vehicle import Vehicle, as_vehicle
from .segments import CELL_SIZE_M

METHOD = f"bevameter {version('bevameter')}, traverse 3"
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
    frames
        Frames of the sites that it knows.
    physics
        What it knows of the physics of classes, oldest first.
    cell_size_m
        Edge of a ground cell [m].
    vehicle, topics, site, origin, offset
        Instead of the recordings' own: the vehicle; the topic map of bags; the site, where on Earth the frame of the
        places lies, and where in the site's.
    ground
        Class of the ground, where it is stated of the recordings as a whole.
    several
        Whether there are several recordings.
    method
        Version of the processing; another program that runs another one may not take part.
    """

    database: str
    known: frozenset[uuid.UUID]
    frames: Mapping[str, SiteFrame]
    physics: tuple[ClassPhysics, ...]
    cell_size_m: float
    vehicle: Vehicle | None = None
    topics: Path | None = None
    site: str | None = None
    origin: Origin | None = None
    offset: Offset | None = None
    ground: str | None = None
    several: bool = False
    method: str = METHOD

    @staticmethod
    def of(
        database: TerrainDatabase | str | Path,
        *,
        vehicle: Vehicle | str | Path | None = None,
        topics: str | Path | None = None,
        cell_size_m: float = CELL_SIZE_M,
        site: str | None = None,
        origin: Origin | None = None,
        offset: Offset | None = None,
        ground: str | None = None,
        several: bool = False,
    ) -> Conditions:
        """Read them; where there is no database yet it knows nothing, and none is made.

        Raises
        ------
        InputError
            The database is another program's or cannot be read; vehicle, topics, cell size, frame or ground are none.
        """
        _check_frame(site, origin, offset)
        if ground is not None and not isinstance(ground, str):
            raise refused("ground", ground, "the name of a class")
        cell_size_m = _cell_size(cell_size_m)
        driven = None if vehicle is None else as_vehicle(vehicle)
        mapped = None if topics is None else path_of("topics", topics, "the path of a topic map")
        own = isinstance(database, TerrainDatabase)
        with nullcontext(database) if own else TerrainDatabase(database) as store:
            known, frames, physics = frozenset(), {}, ()
            if store.there:
                known, frames, physics = store.drive_ids(), store.frames(), tuple(store.physics())
                if ground is not None:
                    store.check_class(ground, "ground")
        return Conditions(
            shown(parse_url(url_of(database))), known, frames, physics, cell_size_m,
            vehicle=driven, topics=mapped, site=site, origin=origin, offset=offset, ground=ground,
            several=several,
        )  # fmt: skip

    def read(self, recording: Recording | str | Path) -> Recording:
        """Read a recording; raises `InputError` where it cannot be read."""
        if not isinstance(recording, Recording):
            return read_recording(recording, vehicle=self.vehicle, topics=self.topics)
        return recording if self.vehicle is None else replace(recording, vehicle=self.vehicle)

    def stated(self, recording: Recording) -> Recording:
        """Give a recording the frame that is stated instead of its own; raises `InputError` where it cannot be."""
        if self.site is not None:
            moved = None if self.site.strip() != recording.site else recording.offset  # it was stated for that site
            recording = replace(recording, site=self.site.strip(), offset=moved)
        if self.origin is not None or self.offset is not None:
            self._check_statement(recording)
            origin = recording.origin if self.origin is None else self.origin
            recording = replace(recording, origin=origin, offset=self.offset)
        if recording.offset is not None and not recording.site:
            raise InputError(recording.source, "an offset is stated, and no site", expected="the site's name")
        return recording

    def _check_statement(self, recording: Recording) -> None:
        """Refuse an origin or offset that cannot be that of the recording; raises `InputError`."""
        if self.several and not stays(recording.frame):
            raise InputError(
                recording.source,
                "one origin or offset is stated for several recordings, and the frame of its places starts with the "
                "recording",
                expected="a run of its own for each",
            )  # fmt: skip
        if self.origin is not None and recording.frame == FIXES:
            raise InputError(
                recording.source, "an origin is stated, and its places are metres about its first satellite fix",
                expected="`origin` under [pose] of a topic map, or none",
            )  # fmt: skip


def url_of(database: TerrainDatabase | str | Path) -> str | Path:
    """Give the path or URL of a database."""
    return database.name if isinstance(database, TerrainDatabase) else database


def _check_frame(site: str | None, origin: Origin | None, offset: Offset | None) -> None:
    if site is not None and not (isinstance(site, str) and site.strip()):
        raise refused("site", site, "a name")
    if origin is not None and not isinstance(origin, Origin):
        raise refused("origin", origin, "an Origin")
    if offset is not None and not isinstance(offset, Offset):
        raise refused("offset", offset, "an Offset")
    if origin is not None and offset is not None:
        raise InputError("offset", "stated, and the origin, too", expected="one of them")


def _cell_size(cell_size_m: float) -> float:
    """Give the edge of a cell [m]; raises `InputError` where it is none."""
    wanted = "a finite length, greater than 0 [m]"
    edge = number("cell_size_m", cell_size_m, wanted)
    if not 0.0 < edge < math.inf:
        raise refused("cell_size_m", cell_size_m, wanted)
    return edge
