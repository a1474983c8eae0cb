"""Care of a terrain database: what newer processings have replaced is removed, and its schema is brought up to date."""

from __future__ import annotations

import sqlite3
import uuid
from collections.abc import Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from sqlalchemy import Connection, delete, func, select, update

from ..framework.core.errors import InputError
from ..framework.core.files import whole
from .connections import uri_for_reading
from .drive_rows import OBSERVATIONS, drive_rows
from .schema import (
    BUSY_TIMEOUT_S,
    EXPECTED,
    REVISIONS,
    check_known,
    index_places,
    open_engine,
    opened_as_it_is,
    revision_of,
)
from .spatial import has_spatial_index
from .store import TerrainDatabase
from .tables import DriveRow, ImportRow, PhysicsRow, table_of
from .urls import parse_url, shown


@dataclass(frozen=True)
class SupersededDrive:
    """A processing of a recording that a newer one has replaced, and the number of its observations."""

    id: uuid.UUID
    name: str
    site: str
    observations: int


@dataclass(frozen=True)
class OlderPhysics:
    """Physics of a class at a site (empty: anywhere) that is not the newest, and where it came from."""

    id: uuid.UUID
    class_name: str
    site: str
    source: str


@dataclass(frozen=True)
class Superseded:
    """What nothing derived uses any more."""

    drives: tuple[SupersededDrive, ...]
    physics: tuple[OlderPhysics, ...]

    def rows(self) -> list[dict[str, Any]]:
        """One row a drive and one a physics, in types of JSON."""
        drives = [
            {"what": "drive", "id": each.id.hex, "site": each.site, "name": each.name,
             "observations": each.observations}
            for each in self.drives
        ]  # fmt: skip
        return drives + [
            {"what": "physics", "id": each.id.hex, "site": each.site, "name": f"{each.class_name}, {each.source}",
             "observations": None}
            for each in self.physics
        ]  # fmt: skip


def superseded(database: TerrainDatabase) -> Superseded:
    """Find processings of recordings, and physics of classes, that are not the newest: what `prune` removes.

    Raises
    ------
    InputError
        The database cannot be read.
    """
    with database.reading() as connection:
        drives = [
            SupersededDrive(row.id, row.name, row.site, _count(connection, row.id))
            for row in _replaced(connection)
        ]  # fmt: skip
        return Superseded(tuple(drives), tuple(_older_physics(connection)))


def prune(database: TerrainDatabase) -> Superseded:
    """Remove what `superseded` finds, for good, and give it; then an SQLite file is made as small as it can be.

    Snapshots answer as before. One transaction a drive: interrupted, it has removed whole drives, and the same again
    removes the rest. A drive that another process brings back into use meanwhile stays.

    Raises
    ------
    InputError
        The database cannot be read or written.
    """
    found = superseded(database)
    drives = [drive for drive in found.drives if _remove_drive(database, drive.id)]
    with database.writing() as connection:
        table = table_of(PhysicsRow)
        for each in found.physics:
            connection.execute(delete(table).where(table.c.id == each.id))
    with database.writing() as connection:
        if connection.dialect.name == "sqlite":
            connection.exec_driver_sql("VACUUM")
    return Superseded(tuple(drives), found.physics)


def _replaced(connection: Connection) -> list:
    """Rows of the drives that a newer processing of the same recording has replaced."""
    newest = {row.id for row in drive_rows(connection, None, newest=True)}
    return [row for row in drive_rows(connection, None, newest=False) if row.id not in newest]


def _count(connection: Connection, drive_id: uuid.UUID) -> int:
    tables = map(table_of, OBSERVATIONS)
    return sum(
        connection.execute(select(func.count()).select_from(table).where(table.c.drive_id == drive_id)).scalar_one()
        for table in tables
    )


def _older_physics(connection: Connection) -> Sequence[OlderPhysics]:
    table = table_of(PhysicsRow)
    rows = connection.execute(
        select(table.c.id, table.c.class_name, table.c.site, table.c.source).order_by(table.c.observed_at, table.c.id)
    ).all()
    newest = {(row.class_name, row.site): row.id for row in rows}
    return [OlderPhysics(*row) for row in rows if newest[row.class_name, row.site] != row.id]


def _remove_drive(database: TerrainDatabase, drive_id: uuid.UUID) -> bool:
    """Remove a drive and all that belongs to it; False where it is in use again."""
    drive = table_of(DriveRow)
    with database.writing() as connection:
        # From here on no other process can bring the drive back into use: the first holds on PostgreSQL, the second,
        # which changes nothing, on SQLite.
        connection.execute(select(drive.c.id).where(drive.c.id == drive_id).with_for_update())
        connection.execute(update(drive).where(drive.c.id == drive_id).values(name=drive.c.name))
        if drive_id not in {row.id for row in _replaced(connection)}:
            return False
        for table in map(table_of, (*OBSERVATIONS, ImportRow)):
            connection.execute(delete(table).where(table.c.drive_id == drive_id))
        connection.execute(delete(drive).where(drive.c.id == drive_id))
    return True


@dataclass(frozen=True)
class Migrated:
    """Schema before and after, the copy of the SQLite file as it was before, None where there was nothing to do, and
    whether a spatial index was added.
    """

    before: str
    after: str
    copy: Path | None
    spatial_index_added: bool = False


def migrate(url_or_path: str | Path) -> Migrated:
    """Bring a database to the newest schema, in one transaction; an SQLite file is copied beside itself before.

    On a PostgreSQL server that has got PostGIS since, it adds the spatial index (`spatial`) that is lacking.

    Interrupted, it leaves the database as it was, and the same again begins anew. The copy is named by the schema that
    it has, ``terrain.schema-0001.db``; where there is such a file already, by a number, too.

    Raises
    ------
    InputError
        No such database, not one of ours, of a newer version, or it cannot be reached or written.
    """
    url = parse_url(url_or_path)
    with opened_as_it_is(url_or_path) as connection:
        before, indexed = revision_of(connection), has_spatial_index(connection)
    if before is None:
        raise InputError(shown(url), "states no version of its schema", expected=EXPECTED)
    check_known(before, shown(url))
    copy = None
    if before != REVISIONS[-1] and url.get_backend_name() == "sqlite":
        copy = _copied(Path(str(url.database)), before)
    engine = open_engine(url_or_path, must_exist=True)
    try:
        index_places(engine)
    finally:
        engine.dispose()
    with opened_as_it_is(url_or_path) as connection:
        return Migrated(before, REVISIONS[-1], copy, has_spatial_index(connection) and not indexed)


def _copied(path: Path, revision: str) -> Path:
    """Copy an SQLite file, its log included, beside itself, whole or not at all."""
    names = (
        f"{path.stem}.schema-{revision}{number}{path.suffix}" for number in ("", *(f"-{i}" for i in range(2, 1000)))
    )
    copy = next(path.with_name(name) for name in names if not path.with_name(name).exists())
    try:
        with (
            whole(copy) as part,
            closing(sqlite3.connect(uri_for_reading(path), uri=True, timeout=BUSY_TIMEOUT_S)) as source,
            closing(sqlite3.connect(part)) as target,
        ):
            source.backup(target)
            target.execute("PRAGMA journal_mode = DELETE")
    except sqlite3.Error as error:
        raise InputError(copy, f"cannot be written: {error}", expected="room for a copy of the database") from error
    return copy
