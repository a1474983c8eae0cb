"""Rows of drives and of their observations: inserted, counted, read back."""

from __future__ import annotations

import uuid
from collections.abc import Iterable, Iterator, Mapping
from itertools import islice
from typing import Any

from sqlalchemy import Connection, func, select

from .observations import Drive
from .rows import TERRAIN_COLUMNS, drive_of
from .tables import Base, DriveRow, ImportRow, SoilRow, TerrainRow, insertion, table_of

CHUNK = 5000
"""Rows that are read or written at a time."""

_CACHED = 2000
"""Rows of which the processor's cache holds all values."""

OBSERVATIONS = (TerrainRow, SoilRow)
"""What a drive brings."""


def insert_drive(connection: Connection, row: dict[str, Any]) -> bool:
    """Insert a drive row; False where it is there already. Another process that is adding the same drive is awaited."""
    statement = insertion(connection, DriveRow).returning(table_of(DriveRow).c.id)
    return connection.execute(statement, row).first() is not None


def drive_in_use(connection: Connection, recording_digest: str) -> uuid.UUID | None:
    """Give the drive that derived results use for a recording: its processing that was imported last."""
    drive, imported = table_of(DriveRow), table_of(ImportRow)
    query = (
        select(drive.c.id)
        .join(imported, imported.c.drive_id == drive.c.id)
        .where(drive.c.recording_digest == recording_digest)
        .order_by(imported.c.imported_at.desc(), drive.c.id.desc())
        .limit(1)
    )
    return connection.execute(query).scalar_one_or_none()


def insert_rows(connection: Connection, row_type: type[Base], rows: Iterable[dict[str, Any]]) -> None:
    """Insert rows whose identity is not there yet."""
    remaining = iter(rows)
    while chunk := list(islice(remaining, CHUNK)):
        connection.execute(insertion(connection, row_type), chunk)


def insert_columns(connection: Connection, row_type: type[Base], columns: Mapping[str, list[Any]]) -> None:
    """Insert rows whose identity is not there yet, past SQLAlchemy, which takes as long as the database."""
    dialect, table = connection.dialect, table_of(row_type)
    statement = insertion(connection, row_type).compile(dialect=dialect, column_keys=list(columns))
    names = statement.positiontup or list(columns)
    values = []
    for name in names:
        column, process = columns[name], table.c[name].type.dialect_impl(dialect).bind_processor(dialect)
        if process is not None and column:
            same = column.count(column[0]) == len(column)
            column = [process(column[0])] * len(column) if same else list(map(process, column))
        values.append(column)
    rows = zip(*values, strict=True)
    while chunk := list(islice(rows, CHUNK)):
        given = chunk if dialect.positional else [dict(zip(names, row, strict=True)) for row in chunk]
        connection.exec_driver_sql(str(statement), given)


def merge_drive(source: Connection, connection: Connection, drive: Any) -> tuple[int, int]:
    """Add a drive row of another database, with all that it has there; give the numbers of observations that were new
    and that were known.
    """
    insert_drive(connection, drive._asdict())
    insert_rows(connection, ImportRow, _rows_of(source, ImportRow, drive.id))
    new = known = 0
    for table in OBSERVATIONS:
        theirs = _identities(source, table, drive.id)
        lacking = theirs - _identities(connection, table, drive.id)
        if lacking:
            insert_rows(connection, table, _rows_of(source, table, drive.id))
        new, known = new + len(lacking), known + len(theirs) - len(lacking)
    return new, known


def _rows_of(connection: Connection, row_type: type[Base], drive_id: uuid.UUID) -> Iterator[dict[str, Any]]:
    table = table_of(row_type)
    query = select(table).where(table.c.drive_id == drive_id)
    return (row._asdict() for row in connection.execute(query, execution_options={"yield_per": CHUNK}))


def _identities(connection: Connection, row_type: type[Base], drive_id: uuid.UUID) -> set[str]:
    """Identities of a drive's rows, in hexadecimal digits."""
    table = table_of(row_type)
    cursor = connection.execute(select(table.c.id).where(table.c.drive_id == drive_id)).cursor
    assert cursor is not None  # SQLAlchemy would take longer to make UUIDs of text than all else takes
    return {row[0] if isinstance(row[0], str) else row[0].hex for row in cursor.fetchall()}


def drive_rows(connection: Connection, site: str | None, newest: bool) -> list[Any]:
    """Drive rows in the order of their last import; with `newest` only the last one of each recording."""
    drive, imported = table_of(DriveRow), table_of(ImportRow)
    latest = (
        select(imported.c.drive_id, func.max(imported.c.imported_at).label("last_import"))
        .group_by(imported.c.drive_id)
        .subquery()
    )
    query = select(drive).join(latest, latest.c.drive_id == drive.c.id).order_by(latest.c.last_import, drive.c.id)
    rows = list(connection.execute(query))
    if newest:  # before the site is looked at: a recording may have been processed again under its right site
        last = {row.recording_digest: row.id for row in rows}
        rows = [row for row in rows if last[row.recording_digest] == row.id]
    return [row for row in rows if site is None or row.site == site]


def read_drive(connection: Connection, row: Any, senses: tuple[str, ...] | None) -> Drive:
    """Read one drive back; `senses` limits the terrain observations to those of some senses."""
    terrain, soil = table_of(TerrainRow), table_of(SoilRow)
    wanted = (terrain.c[name] for name in TERRAIN_COLUMNS)
    looks = select(*wanted).where(terrain.c.drive_id == row.id)
    if senses is not None:
        looks = looks.where(terrain.c.sense.in_(senses))
    stretches = select(soil).where(soil.c.drive_id == row.id).order_by(soil.c.start_s, soil.c.id)
    # As the driver gives them: making rows of them takes as long as reading them.
    seen = connection.execute(looks).cursor
    assert seen is not None
    return drive_of(row, iter(lambda: seen.fetchmany(_CACHED), []), connection.execute(stretches).all())
