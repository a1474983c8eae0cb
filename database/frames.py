"""The frames of sites: where on Earth they lie, as the drives there say."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import Any

from sqlalchemy import Connection, and_, or_, select

from ..framework.core.errors import InputError
from ..framework.core.origin import Origin
from .drive_rows import drive_in_use, drive_rows
from .observations import Drive
from .rows import drive_of, unpack_frame
from .tables import DriveRow, SoilRow, TerrainRow, table_of


class OriginsDiffer(InputError):
    """Drives of one site whose frame lies in different places on Earth."""


@dataclass(frozen=True)
class SiteFrame:
    """The frame of a site.

    Parameters
    ----------
    origin
        Where on Earth it lies; None where nobody knows.
    recordings
        Digests of recordings whose places are in it, two of them at most, and an empty one where a drive was moved into
        it: with a single one it is that recording's own.
    """

    origin: Origin | None
    recordings: frozenset[str]


def origin_of(rows: Collection[Any]) -> Origin | None:
    """Where on Earth the frame of drives of one site lies, by their rows; None where no drive says it."""
    return next((origin for origin in (unpack_frame(row.frame)[0] for row in rows) if origin is not None), None)


def read_frames(connection: Connection) -> dict[str, SiteFrame]:
    """Read the frames of the sites that places were observed at, or whose origin is known, by drives in use."""
    placed = _placed(connection)
    by_site: dict[str, list[Any]] = {}
    for row in drive_rows(connection, None, newest=True):
        if row.id in placed or row.frame is not None:
            by_site.setdefault(row.site, []).append(row)
    return {site: _frame(rows) for site, rows in by_site.items()}


def _frame(rows: Sequence[Any]) -> SiteFrame:
    """Frame of drives of one site. One that was moved there found a frame: it was others'."""
    recordings = {row.recording_digest for row in rows[:2]}
    if any(unpack_frame(row.frame)[1] is not None for row in rows):
        recordings.add("")
    return SiteFrame(origin_of(rows), frozenset(recordings))


def check_origin(connection: Connection, database: str, drive: Drive) -> None:
    """Refuse a drive where those of other recordings have another origin of its site; raises `OriginsDiffer`."""
    if drive.origin is None:
        return
    table = table_of(DriveRow)
    others = select(table.c.id, table.c.recording_digest, table.c.frame).where(
        table.c.site == drive.site, table.c.frame.is_not(None), table.c.recording_digest != drive.recording_digest
    )
    for row in connection.execute(others):
        origin, _ = unpack_frame(row.frame)
        if origin not in (None, drive.origin) and drive_in_use(connection, row.recording_digest) == row.id:
            raise _differ(drive.site, database, origin, f"drive {drive.name}", drive.origin)


def drive_of_recording(connection: Connection, recording_digest: str) -> Drive | None:
    """Give the drive in use of a recording, without its observations; None where there is none."""
    table, identity = table_of(DriveRow), drive_in_use(connection, recording_digest)
    row = connection.execute(select(table).where(table.c.id == identity)).one_or_none()
    return None if row is None else drive_of(row, (), ())


def check_origins(
    source: Connection, name: str, target: Connection, database: str, sites: Collection[str] | None
) -> None:
    """Refuse to join sites of one name with different origins; raises `OriginsDiffer`.

    Of a recording that both have, the processing that was imported last counts, as it will when they are joined.
    """
    in_use: dict[str, tuple[Any, str]] = {}
    for connection, where in ((target, database), (source, name)):
        for row in drive_rows(connection, None, newest=True):
            before = in_use.get(row.recording_digest)
            if before is None or before[0].last_import <= row.last_import:
                in_use[row.recording_digest] = row, where
    origins: dict[str, tuple[Origin, str]] = {}
    for row, where in in_use.values():
        origin, _ = unpack_frame(row.frame)
        if origin is None or not (sites is None or row.site in sites):
            continue
        other, there = origins.setdefault(row.site, (origin, where))
        if other != origin and there != where:
            raise _differ(row.site, there, other, where, origin)


def _differ(site: str, database: str, here: Origin, other: str, there: Origin) -> OriginsDiffer:
    return OriginsDiffer(
        database, f"the origin of the site {site!r} is {here}; in {other} it is {there}",
        expected="one origin: `bevameter run` the recordings of the one again, into a database that holds the site of "
        "the other, or with another --site",
    )  # fmt: skip


def _placed(connection: Connection) -> set[Any]:
    """Identities of drives that observed places."""
    drive, terrain, soil = (table_of(each) for each in (DriveRow, TerrainRow, SoilRow))
    looked = select(terrain.c.id).where(terrain.c.drive_id == drive.c.id).exists()
    measured = select(soil.c.id).where(and_(soil.c.drive_id == drive.c.id, soil.c.x_m.is_not(None))).exists()
    return set(connection.execute(select(drive.c.id).where(or_(looked, measured))).scalars())
