"""A new file from a damaged SQLite database: pages that can be read are copied, rows that are not sound left out."""

from __future__ import annotations

import sqlite3
import uuid
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import closing, contextmanager, suppress
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from sqlalchemy import (
    ColumnElement,
    Connection,
    LargeBinary,
    Text,
    cast,
    delete,
    inspect,
    literal,
    or_,
    select,
    type_coerce,
)
from sqlalchemy.exc import DBAPIError
from sqlalchemy.types import NullType

from ..framework.core.arguments import path_of
from ..framework.core.errors import InputError
from ..framework.core.files import whole
from .check import CheckReport, Fault, check
from .connections import uri_for_reading
from .drive_rows import CHUNK, OBSERVATIONS, imported, insert_rows
from .rows import drive_of
from .schema import BUSY_TIMEOUT_S, READ_IF_CUT_OFF, check_known, opened_as_it_is, revision_of
from .store import TerrainDatabase
from .stored_rows import keep_damaged_text, text_of
from .tables import Base, DriveRow, ImportRow, PhysicsRow, table_of
from .urls import parse_url, shown

_TABLES = (DriveRow, ImportRow, *OBSERVATIONS, PhysicsRow)

_LEAST_ROW_BYTES = 64
"""No row takes less of a file: its identity alone is 32 characters."""

_OF_ROWS = (sqlite3.SQLITE_CORRUPT, sqlite3.SQLITE_CONSTRAINT, sqlite3.SQLITE_MISMATCH, sqlite3.SQLITE_NOTADB)
"""Results of SQLite that say that rows cannot be read, or are none of the table."""

_OF_DISKS = (sqlite3.SQLITE_IOERR_READ, sqlite3.SQLITE_IOERR_SHORT_READ)
"""Those that say that the disk does not give them."""

_ROOM = "room for a copy"

_Unread = tuple[int, int, str]
"""First and last number of rows, and why they cannot be read."""

_LONG_AGO = datetime(1970, 1, 1, tzinfo=UTC)
"""Time of import of a drive whose imports are lost: a processing whose time is known counts as newer."""


def rebuild(
    url_or_path: str | Path, new: str | Path, *, progress: Callable[[str, float], None] | None = None
) -> CheckReport:
    """Write every sound row of a damaged SQLite database into a new file; the damaged one is not changed.

    Rows are looked for in the tables' own pages, past the indices, in ranges of row numbers that are halved where a
    page cannot be read. Then those are left out that `check` names, and observations whose drive is lost. A drive whose
    imports are lost is kept: a processing of the same recording whose time of import is known counts as newer. One that
    lacks observations as well stays incomplete: a merge may have brought no more of it.

    Parameters
    ----------
    url_or_path
        The damaged database, an SQLite file.
    new
        The file to write; it is there once it is whole.
    progress
        Called with the name of each stage and the share of it that is done.

    Returns
    -------
    CheckReport
        How many rows of each table are in the new file, and what is not.

    Raises
    ------
    InputError
        No SQLite file with tables of ours, or their list is damaged; `new` is there already or cannot be written.
    """
    report = progress or (lambda stage, share: None)
    url, target = parse_url(url_or_path), path_of("new", new, "the path of a file")
    if url.get_backend_name() != "sqlite":
        raise InputError(shown(url), "is no SQLite file", expected="SQLite; PostgreSQL has tools of its own")
    source = Path(str(url.database))
    there = _tables_there(url_or_path, source)
    if target.exists():
        raise InputError(target, "is there already", expected="the name of a new file")
    with _whole_database(target) as part:
        TerrainDatabase(part).make()
        faults = _copy(source, part, [each for each in _TABLES if each.__tablename__ in there], report)
        with TerrainDatabase(part) as database:
            faults += _leave_out(database, report)
            faults += _give_imports(database)
        last = check(part)
    return CheckReport((*faults, *last.faults), last.rows)


@contextmanager
def _whole_database(target: Path) -> Iterator[Path]:
    """Give a place for a database, which takes the place of `target` once it is whole, or leaves nothing behind."""
    with whole(target) as part:
        log, index = (part.with_name(part.name + ending) for ending in ("-wal", "-shm"))
        try:
            yield part
            if log.exists():  # SQLite closes a file whose log it found no room for, and says nothing
                raise InputError(target, "cannot be written: the disk is full", expected=_ROOM)
        except sqlite3.Error as error:
            raise InputError(target, f"cannot be written: {error}", expected=_ROOM) from error
        except InputError as error:
            if error.source != str(part):
                raise
            raise InputError(target, f"cannot be written: {error.problem}", expected=_ROOM) from error
        finally:
            for each in (log, index):
                each.unlink(missing_ok=True)


def _tables_there(url_or_path: str | Path, source: Path) -> set[str]:
    """Names of the tables of a damaged database, of no newer version."""
    with opened_as_it_is(url_or_path) as connection:
        there = set(inspect(connection).get_table_names())
        with suppress(DBAPIError):
            revision = revision_of(connection)
            if revision is not None:
                check_known(revision, str(source))
    return there


def _copy(
    source: Path, part: Path, row_types: Sequence[type[Base]], report: Callable[[str, float], None]
) -> list[Fault]:
    """Copy all rows that can be read; the others are named by their numbers."""
    faults = []
    with closing(sqlite3.connect(part, uri=True, isolation_level=None, timeout=BUSY_TIMEOUT_S)) as connection:
        connection.execute("PRAGMA synchronous = OFF")  # the file is of no use before it is whole
        connection.execute(READ_IF_CUT_OFF)
        connection.execute("ATTACH ? AS damaged", (uri_for_reading(source),))
        for row_type in row_types:
            name = row_type.__tablename__
            for first, last, problem in _joined(_copy_table(connection, row_type, report)):
                which = f"row {first}" if first == last else f"rows {first} to {last}"
                faults.append(Fault(name, "", f"{which} of the table cannot be read: {problem}"))
    return faults


def _copy_table(
    connection: sqlite3.Connection, row_type: type[Base], report: Callable[[str, float], None]
) -> Iterator[_Unread]:
    """Copy a table, and give the ranges that cannot be read."""
    name = row_type.__tablename__
    there = {row[1] for row in connection.execute(f"PRAGMA damaged.table_info({name})")}  # an older version has fewer
    columns = ", ".join(f'"{column.name}"' for column in table_of(row_type).columns if column.name in there)
    # Names are those of our own tables.
    statement = f"INSERT INTO main.{name} ({columns}) SELECT {columns} FROM damaged.{name} WHERE rowid BETWEEN ? AND ?"  # noqa: S608
    greatest = _greatest_rowid(connection, name)
    for first in range(1, greatest + 1, CHUNK):
        report(f"copying {name}", first / greatest)
        yield from _copy_range(connection, statement, first, min(first + CHUNK - 1, greatest))
    report(f"copying {name}", 1.0)


def _copy_range(connection: sqlite3.Connection, statement: str, first: int, last: int) -> Iterator[_Unread]:
    try:
        connection.execute(statement, (first, last))
    except sqlite3.Error as error:
        code = getattr(error, "sqlite_errorcode", 0)
        if code not in _OF_DISKS and code & 0xFF not in _OF_ROWS:
            raise InputError("the new file", f"cannot be written: {error}", expected=_ROOM) from error
        if first == last:
            yield first, last, str(error)
            return
        middle = (first + last) // 2
        yield from _copy_range(connection, statement, first, middle)
        yield from _copy_range(connection, statement, middle + 1, last)


def _greatest_rowid(connection: sqlite3.Connection, name: str) -> int:
    """The greatest number of a row, from the table, else from its index of identities, else a bound."""
    for query in (
        f"SELECT max(rowid) FROM damaged.{name}",  # noqa: S608
        f"SELECT max(number) FROM (SELECT rowid AS number FROM damaged.{name} INDEXED BY sqlite_autoindex_{name}_1)",  # noqa: S608
    ):
        with suppress(sqlite3.Error):
            return connection.execute(query).fetchone()[0] or 0
    pages, size = (connection.execute(f"PRAGMA damaged.{each}").fetchone()[0] for each in ("page_count", "page_size"))
    return pages * size // _LEAST_ROW_BYTES


def _joined(ranges: Iterable[_Unread]) -> list[_Unread]:
    """Join ranges that follow one another for the same reason."""
    joined: list[_Unread] = []
    for first, last, problem in ranges:
        if joined and joined[-1][1:] == (first - 1, problem):
            joined[-1] = (joined[-1][0], last, problem)
        else:
            joined.append((first, last, problem))
    return joined


def _leave_out(database: TerrainDatabase, report: Callable[[str, float], None]) -> list[Fault]:
    """Delete damaged rows, and those whose drive is lost; give what was deleted."""
    faults = [fault for fault in check(database.name, progress=report).faults if fault.damaged and fault.id]
    drives = [fault for fault in faults if fault.table == DriveRow.__tablename__]
    with database.writing() as connection:
        keep_damaged_text(connection)
        for fault in faults:
            if fault not in drives:
                table = Base.metadata.tables[fault.table]
                connection.execute(delete(table).where(_is(table.c.id, fault.id)))
        for row_type in (*OBSERVATIONS, ImportRow):
            table, drive = table_of(row_type), table_of(DriveRow)
            damaged = {each.id: _is(table.c.drive_id, each.id) for each in drives}
            absent = {
                text_of(identity): _is(table.c.drive_id, text_of(identity))
                for (identity,) in connection.execute(
                    select(type_coerce(table.c.drive_id, NullType()))
                    .where(~select(drive.c.id).where(drive.c.id == table.c.drive_id).exists())
                    .distinct()
                )
            }
            for identity, theirs in (damaged | absent).items():
                number = connection.execute(delete(table).where(theirs)).rowcount
                if number:
                    faults.append(Fault(table.name, "", f"{number} rows are lost with drive {identity}"))
        for fault in drives:
            table = table_of(DriveRow)
            connection.execute(delete(table).where(_is(table.c.id, fault.id)))
    return faults


def _is(column: ColumnElement, identity: str) -> ColumnElement[bool]:
    """Say that an identity is stored so, be it text, or text that is none, or bytes."""
    stored = literal(identity.encode(errors="surrogateescape"), LargeBinary)
    raw = type_coerce(column, NullType())
    return or_(raw == cast(stored, Text), raw == stored)


def _give_imports(database: TerrainDatabase) -> list[Fault]:
    """Give drives whose imports are lost one, long ago; not those that a merge has brought a part of, and no import."""
    drive = table_of(DriveRow)
    with database.writing() as connection:
        lost = connection.execute(select(drive).where(~imported(drive))).all()
        whole = [row.id for row in lost if _has_all_rows(connection, row)]
        rows = ({"id": uuid.uuid5(each, "import"), "drive_id": each, "imported_at": _LONG_AGO} for each in whole)
        insert_rows(connection, ImportRow, rows)
    problem = "its imports are lost: it counts as older than others of its recording"
    return [Fault(drive.name, each.hex, problem, damaged=False) for each in whole]


def _has_all_rows(connection: Connection, row: Any) -> bool:
    """Say whether the observations of a drive are the first ones: rows come in the order of their identities, so that a
    part of them has gaps.
    """
    for row_type, kind in zip(OBSERVATIONS, ("terrain", "soil"), strict=True):
        table = table_of(row_type)
        there = set(connection.execute(select(table.c.id).where(table.c.drive_id == row.id)).scalars())
        if there != set(drive_of(row, (), ()).row_ids(kind, len(there))):
            return False
    return True
