"""Reading a site again and again: only what came since the last time is read."""

from __future__ import annotations

import uuid
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from sqlalchemy import Connection, func, select

from ..framework.core.errors import InputError
from .drive_rows import OBSERVATIONS, drive_rows, read_drive
from .observations import Drive
from .physics import read_physics
from .snapshot import Snapshot
from .tables import DriveRow, table_of

if TYPE_CHECKING:
    from .store import TerrainDatabase


class SiteReader:
    """Gives snapshots of a site as a database grows; `TerrainDatabase.reader` makes one.

    It keeps the drives that it has read, about 120 bytes a look, and reads only those that are new or have got
    observations since. For one thread.
    """

    def __init__(self, database: TerrainDatabase, site: str | None):
        self._database, self._site = database, site
        self._drives: dict[uuid.UUID, _Held] = {}
        self._physics: list[uuid.UUID] = []
        self._last: Snapshot | None = None

    def snapshot(self) -> Snapshot:
        """Give the snapshot of what the database holds now; the same one again where nothing has come since.

        Raises
        ------
        InputError
            The database cannot be read, holds no such site, or several and none was named.
        """
        with self._database.reading() as connection:
            site, rows = rows_in_use(connection, self._database.name, self._site)
            counts = _counts(connection, site)
            drives = {row.id: self._held(connection, row, counts.get(row.id, ())) for row in rows}
            physics = read_physics(connection, self._database.name, site)
        held, self._drives = self._drives, drives
        before, self._last = self._last, None  # an interruption from here on costs time, nothing else
        by_class = {found.class_name: found.physics for found in physics}
        ids = [found.id for found in physics]
        changed = [each.drive for each in _differing(drives, held) + _differing(held, drives)]
        in_order = [each for each in held if each in drives] == [each for each in drives if each in held]
        everything = [each.drive for each in drives.values()]
        if before is None or before.site != site or not in_order:
            before = Snapshot.derive(site, everything, by_class)
        elif changed or ids != self._physics:
            before = before.with_drives(everything, changed, by_class)
        self._last, self._physics = before, ids
        return before

    @property
    def drives(self) -> tuple[Drive, ...]:
        """The drives that the last snapshot rests on, with their fused looks, in the order of their last import."""
        return tuple(held.drive for held in self._drives.values())

    def _held(self, connection: Connection, row: Any, count: tuple[int, ...]) -> _Held:
        there = self._drives.get(row.id)
        if there is not None and there.count == count:
            return there
        return _Held(count, read_drive(connection, row, senses=("fused",)))


def rows_in_use(connection: Connection, database: str, site: str | None) -> tuple[str, list]:
    """Find the site, and the rows of its drives in use; no site (empty) where there is none yet.

    Raises
    ------
    InputError
        The database holds no such site, or several and none was named.
    """
    rows = drive_rows(connection, None, newest=True)
    known = sorted({row.site for row in rows})
    if site is None and len(known) > 1:
        raise InputError(database, "several sites, each with its own frame", expected="one of " + ", ".join(known))
    if site is not None and site not in known:
        raise InputError(database, f"no site {site!r}", expected="one of " + (", ".join(known) or "none yet"))
    named = site if site is not None else (known[0] if known else "")
    return named, [row for row in rows if row.site == named]


@dataclass(frozen=True, eq=False)
class _Held:
    """A drive that was read, and the numbers of its observations that the database had then, or before."""

    count: tuple[int, ...]
    drive: Drive


def _differing(some: dict[uuid.UUID, _Held], others: dict[uuid.UUID, _Held]) -> list[_Held]:
    """Those of some drives that are not, or not so, among others."""
    return [held for identity, held in some.items() if others.get(identity) != held]


def _counts(connection: Connection, site: str) -> dict[uuid.UUID, tuple[int, ...]]:
    """Numbers of observations of a site's drives."""
    drive = table_of(DriveRow)
    there = select(drive.c.id).where(drive.c.site == site)
    found: dict[uuid.UUID, list[int]] = {}
    for place, table in enumerate(map(table_of, OBSERVATIONS)):
        query = select(table.c.drive_id, func.count()).where(table.c.drive_id.in_(there)).group_by(table.c.drive_id)
        for identity, number in connection.execute(query):
            found.setdefault(identity, [0] * len(OBSERVATIONS))[place] = number
    return {identity: tuple(numbers) for identity, numbers in found.items()}
