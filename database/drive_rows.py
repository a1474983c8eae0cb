"""Rows of drives and of their observations: inserted, counted, read back."""

from __future__ import annotations

import uuid
from collections.abc import Iterable, Mapping, Sequence
from itertools import islice
from typing import Any

from sqlalchemy import Column, ColumnElement, Connection, FromClause, MetaData, Table, func, select
from sqlalchemy.dialects import postgresql
from sqlalchemy.schema import CreateTable

from .observations import Drive
from .rows import TERRAIN_COLUMNS, drive_of
from .tables import Base, DriveRow, ImportRow, SoilRow, TerrainRow, columns_of, insertion, table_of

CHUNK = 5000
"""Rows that are read or written at a time."""

_WORTH_COPYING = 100
"""So many rows are worth the further round trips of a COPY."""

_CACHED = 2000
"""Rows of which the processor's cache holds all values."""

OBSERVATIONS = (TerrainRow, SoilRow)
"""What a drive brings."""


def insert_drive(connection: Connection, row: dict[str, Any]) -> bool:
    """Insert a drive row; False where it is there already. Another process that is adding the same drive is awaited."""
    statement = insertion(connection, DriveRow).returning(table_of(DriveRow).c.id)
    return connection.execute(statement, row).first() is not None


def imported(drive: FromClause) -> ColumnElement[bool]:
    """Say that a drive is complete: its import is stored last. Nothing derived uses a drive without one."""
    table = table_of(ImportRow)
    return select(table.c.id).where(table.c.drive_id == drive.c.id).exists()


def is_complete(connection: Connection, drive_id: uuid.UUID) -> bool:
    """Say whether a drive is there, whole."""
    drive = table_of(DriveRow)
    query = select(drive.c.id).where(drive.c.id == drive_id, imported(drive))
    return connection.execute(query).first() is not None


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


def insert_rows(connection: Connection, row_type: type[Base], rows: Iterable[dict[str, Any]]) -> int:
    """Insert rows whose identity is not there yet, and count them."""
    given = list(rows)
    if not given:
        return 0
    return insert_columns(connection, row_type, {name: [row[name] for row in given] for name in given[0]})


def insert_columns(connection: Connection, row_type: type[Base], columns: Mapping[str, list[Any]]) -> int:
    """Insert rows whose identity is not there yet, and count them.

    It goes past SQLAlchemy, which takes as long as the database. Rows in the order of their identities keep two
    processes that write the same drive at a time from waiting for each other for ever.
    """
    dialect, table = connection.dialect, table_of(row_type)
    values = []
    for name, column in columns.items():
        process = table.c[name].type.dialect_impl(dialect).bind_processor(dialect)
        if process is not None and column:
            same = column.count(column[0]) == len(column)
            column = [process(column[0])] * len(column) if same else list(map(process, column))
        values.append(column)
    rows = zip(*values, strict=True)
    if dialect.name == "postgresql" and len(values[0]) >= _WORTH_COPYING:
        return _copy_rows(connection, table, list(columns), rows)
    statement = insertion(connection, row_type).compile(dialect=dialect, column_keys=list(columns))
    new = 0
    while chunk := list(islice(rows, CHUNK)):
        given = [dict(zip(columns, row, strict=True)) for row in chunk]
        if dialect.positional:
            names = [list(columns).index(name) for name in statement.positiontup or columns]
            given = [tuple(row[name] for name in names) for row in chunk]
        new += connection.exec_driver_sql(str(statement), given).rowcount
    return new


def _copy_rows(connection: Connection, table: Table, names: Sequence[str], rows: Iterable[tuple]) -> int:
    """Insert rows by PostgreSQL's binary COPY, which sends half as many bytes as statements do, in half of the time."""
    arriving = Table(
        f"arriving_{table.name}", MetaData(), *(Column(name, table.c[name].type) for name in names),
        prefixes=["TEMPORARY"], postgresql_on_commit="DELETE ROWS",
    )  # fmt: skip
    connection.execute(CreateTable(arriving, if_not_exists=True))
    quoted = connection.dialect.identifier_preparer
    into = f"{quoted.format_table(arriving)} ({', '.join(map(quoted.quote, names))})"
    kinds = [column.type.compile(dialect=connection.dialect) for column in arriving.columns]
    driver: Any = connection.connection.driver_connection
    with driver.cursor() as cursor, cursor.copy(f"COPY {into} FROM STDIN (FORMAT BINARY)") as copy:
        copy.set_types([kind.partition("(")[0].lower() for kind in kinds])
        for row in rows:
            copy.write_row(row)
    added = postgresql.insert(table).from_select(list(names), select(arriving)).on_conflict_do_nothing()
    return connection.execute(select(func.count()).select_from(added.returning(table.c.id).cte())).scalar_one()


def drive_rows(connection: Connection, site: str | None, newest: bool, revision: str | None = None) -> list[Any]:
    """Drive rows in the order of their last import; with `newest` only the last one of each recording.

    `revision` is that of the schema, where it may be an older one.
    """
    drive, imported = table_of(DriveRow), table_of(ImportRow)
    latest = (
        select(imported.c.drive_id, func.max(imported.c.imported_at).label("last_import"))
        .group_by(imported.c.drive_id)
        .subquery()
    )
    query = (
        select(*columns_of(DriveRow, revision), latest.c.last_import)
        .join(latest, latest.c.drive_id == drive.c.id)
        .order_by(latest.c.last_import, drive.c.id)
    )
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
