"""Opening a terrain database: is it one, is it of this version, and may it be made where there is none?"""

from __future__ import annotations

import logging
import sqlite3
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any

from sqlalchemy import URL, Connection, Engine, create_engine, event, func, inspect, select, text
from sqlalchemy.exc import NoSuchModuleError, OperationalError, SQLAlchemyError
from sqlalchemy.pool import NullPool

from ..framework.core.errors import InputError, reading
from .connections import (
    begin_reading,
    check_unchanged,
    check_writable,
    read_only,
    read_only_where_no_log_can_be,
    uri_for_reading,
)
from .spatial import add_spatial_index
from .tables import Base
from .urls import parse_url, shown, unreachable

REVISIONS = ("0001", "0002", "0003")
"""The schema's revisions, oldest first; each has its file in `migrations/versions`."""

_ADDED_TABLES = {"0002": frozenset({"class_physics"})}
"""Tables that came with a revision: a database of an earlier one has not got them yet."""

VERSION_TABLE = "bevameter_schema"
APPLICATION_ID = 0x42657661
"""Marks an SQLite file as ours ("Beva" in ASCII)."""

BUSY_TIMEOUT_S = 60.0
"""How long a writer waits for another process that writes to the same SQLite file [s]."""

_LOST_LINKS = {
    "connect_timeout": 30, "keepalives_idle": 30, "keepalives_interval": 10, "keepalives_count": 3,
    "tcp_user_timeout": 60_000,
}  # fmt: skip
"""Options of libpq by which a link that is silent for a minute counts as lost [s, and the last one ms]. By default it
takes hours. What a URL states comes first."""

READ_IF_CUT_OFF = "PRAGMA writable_schema = ON"
"""Makes SQLite read the tables of a truncated file up to its end; it refuses such a file otherwise."""

EXPECTED = "a terrain database of Bevameter"
_OF_POSTGIS = frozenset({"spatial_ref_sys"})
_OUR_TABLES = frozenset(Base.metadata.tables)
_MIGRATIONS = Path(__file__).parent / "migrations"


class DamagedFile(InputError):
    """A terrain database in an SQLite file of which not even the list of tables can be read."""


def open_engine(url_or_path: str | Path, *, must_exist: bool) -> Engine:
    """Open a terrain database of the current schema version, making or upgrading it where that is wanted.

    Parameters
    ----------
    url_or_path
        A path of an SQLite file, or an SQLAlchemy URL.
    must_exist
        Open for reading: where there is no terrain database nothing is made.

    Raises
    ------
    InputError
        No such database, not one of ours, made by a newer version, or it cannot be reached or written. Nothing was
        written then.
    """
    url = parse_url(url_or_path)
    if url.get_backend_name() == "sqlite":
        _check_file(Path(str(url.database)), must_exist)
    engine = _engine(url)
    try:
        _bring_up_to_date(engine, must_exist)
    except InputError:
        engine.dispose()
        raise
    except (SQLAlchemyError, OSError) as error:
        engine.dispose()
        raise unreachable(url, error) from error
    return engine


def _engine(url: URL, *, only_reads: bool = False) -> Engine:
    """Give the engine of a URL; it connects to nothing yet."""
    try:
        engine = create_engine(url, **_options(url))
    except (ImportError, NoSuchModuleError) as error:
        raise InputError(shown(url), f"its driver is not installed: {error}", expected="psycopg") from None
    # The pool logs what interrupts it, with a traceback; the error or the command line says it.
    logging.getLogger("sqlalchemy.pool").addHandler(logging.NullHandler())
    if url.get_backend_name() == "sqlite":
        event.listen(engine, "do_connect", read_only if only_reads else read_only_where_no_log_can_be)
        event.listen(engine, "connect", _prepare_to_read if only_reads else _prepare_sqlite)
    else:
        # The driver writes a line of its own when a link is lost in the midst of a COPY; the error says it.
        logging.getLogger("psycopg").addHandler(logging.NullHandler())
        event.listen(engine, "connect", _prepare_postgresql)
    return engine


def holds_database(url_or_path: str | Path) -> bool:
    """Say whether there is a terrain database, without making one; False where there is none and one can be made.

    Raises
    ------
    InputError
        What is there is another program's, or there can be none.
    """
    url = parse_url(url_or_path)
    if url.get_backend_name() == "sqlite":
        return _check_file(Path(str(url.database)), must_exist=False)
    engine = _engine(url)
    try:
        with engine.connect() as connection:
            return _version(connection, shown(url)) is not None
    except SQLAlchemyError as error:
        raise unreachable(url, error) from error
    finally:
        engine.dispose()


@contextmanager
def opened_as_it_is(url_or_path: str | Path) -> Iterator[Connection]:
    """Connect to a terrain database of any version and state, to read it only: nothing is made, migrated or repaired.

    An SQLite file and its write-ahead log are not changed.

    Raises
    ------
    InputError
        No such database, not one of ours, or it cannot be reached.
    """
    url = parse_url(url_or_path)
    if url.get_backend_name() == "sqlite":
        _check_file(Path(str(url.database)), must_exist=True)
    engine = _engine(url, only_reads=True)
    try:
        with engine.connect() as connection:
            begin_reading(connection)
            if url.get_backend_name() != "sqlite" and not inspect(connection).has_table(VERSION_TABLE):
                raise InputError(shown(url), "holds no terrain database", expected=EXPECTED)
            yield connection
            check_unchanged(connection)
    except (SQLAlchemyError, engine.dialect.loaded_dbapi.Error) as error:
        raise unreachable(url, error) from error
    finally:
        engine.dispose()


def revision_of(connection: Connection) -> str | None:
    """Read the schema's revision; None where none is stated."""
    return connection.execute(text(f"SELECT version_num FROM {VERSION_TABLE}")).scalar()  # noqa: S608


def _options(url: URL) -> dict[str, Any]:
    if url.get_backend_name() == "sqlite":
        # Each connection is closed after use, which leaves one whole file to copy and no log.
        return {"connect_args": {"timeout": BUSY_TIMEOUT_S}, "poolclass": NullPool}
    given = {name: value for name, value in _LOST_LINKS.items() if name not in url.query}
    return {"pool_pre_ping": True, "connect_args": given}


def _prepare_postgresql(connection: Any, _record: object) -> None:
    """Let the server, too, find out soon that a link is lost: until then it holds rows that the next try waits for."""
    connection.autocommit = True
    connection.execute("SET tcp_keepalives_idle = 30; SET tcp_keepalives_interval = 10; SET tcp_keepalives_count = 3")
    connection.autocommit = False


def _prepare_sqlite(connection: sqlite3.Connection, _record: object) -> None:
    connection.execute("PRAGMA foreign_keys = ON")
    connection.execute("PRAGMA synchronous = FULL")  # a drive that was acknowledged outlives a power cut
    connection.execute("PRAGMA cache_size = -65536")  # 64 MiB: identities arrive in random order


def _prepare_to_read(connection: sqlite3.Connection, _record: object) -> None:
    connection.execute(READ_IF_CUT_OFF)
    connection.execute("PRAGMA query_only = ON")
    connection.execute("PRAGMA cache_size = -65536")


def _check_file(path: Path, must_exist: bool) -> bool:
    """Look at an SQLite file without ever writing to it or making it; say whether there are tables of ours in it."""
    with reading(path, EXPECTED):
        return _holds_tables(path, must_exist)


def _holds_tables(path: Path, must_exist: bool) -> bool:
    if path.is_dir():
        raise InputError(path, "is a folder", expected=EXPECTED)
    if not path.exists():
        if must_exist:
            raise InputError(path, "no such file", expected=EXPECTED)
        if not path.parent.is_dir():
            raise InputError(path, f"no such folder: {path.parent}", expected="a folder that exists")
        return False
    if path.stat().st_size == 0:
        if must_exist and not path.with_name(path.name + "-wal").exists():
            raise InputError(path, "is empty", expected=EXPECTED)
        return False
    try:
        with closing(sqlite3.connect(uri_for_reading(path), uri=True, timeout=BUSY_TIMEOUT_S)) as look:
            look.execute("PRAGMA query_only = ON")
            look.execute(READ_IF_CUT_OFF)
            (mark,) = look.execute("PRAGMA application_id").fetchone()
            names = {row[0] for row in look.execute("SELECT name FROM sqlite_master WHERE type = 'table'")}
    except sqlite3.OperationalError as error:
        raise InputError(path, str(error), expected=EXPECTED) from error
    except sqlite3.DatabaseError as error:
        if _is_marked(path):
            raise DamagedFile(path, f"its list of tables cannot be read: {error}", expected=EXPECTED) from None
        raise InputError(path, "is not a database", expected=EXPECTED) from None
    strange = sorted(names - _OUR_TABLES - {VERSION_TABLE})
    if mark not in (0, APPLICATION_ID) or (names and VERSION_TABLE not in names):
        tables = ", ".join(strange[:4]) or "none"
        raise InputError(path, f"is a database of another program (tables: {tables})", expected=EXPECTED)
    if must_exist and not names:
        raise InputError(path, "is an empty database", expected=EXPECTED)
    return bool(names)


def _is_marked(path: Path) -> bool:
    """Say whether the header of a file is that of an SQLite database of ours (sqlite.org/fileformat.html, 1.3)."""
    with path.open("rb") as file:
        header = file.read(72)
    return header.startswith(b"SQLite format 3\0") and header[68:] == APPLICATION_ID.to_bytes(4, "big")


def _bring_up_to_date(engine: Engine, must_exist: bool) -> None:
    source = shown(engine.url)
    with engine.connect() as connection:
        version = _version(connection, source)
    if version == REVISIONS[-1]:
        return
    if version is None and must_exist:
        raise InputError(source, "holds no terrain database", expected=EXPECTED)
    if version is not None:
        check_known(version, source)
    migrate(engine)


def check_known(version: str, source: str) -> None:
    """Refuse a schema that this version does not know; raises `InputError`."""
    if version not in REVISIONS:
        raise InputError(source, f"its schema {version!r} is of a newer version of Bevameter",
                         expected=f"schema {REVISIONS[-1]} or older")  # fmt: skip


def _version(connection: Connection, source: str) -> str | None:
    """Give the schema's revision, None where there is no terrain database."""
    names = set(inspect(connection).get_table_names())
    if VERSION_TABLE not in names:
        if others := sorted(names - _OF_POSTGIS):
            raise InputError(
                source, f"holds tables of another program ({', '.join(others[:4])})",
                expected=f"{EXPECTED}, or an empty one",
            )  # fmt: skip
        return None
    version = revision_of(connection)
    if version in REVISIONS:
        missing = tables_of(version) - names
        if missing:
            raise InputError(source, f"lacks the table {min(missing)}", expected=EXPECTED)
    return version


def tables_of(revision: str) -> frozenset[str]:
    """Names of the tables that a revision has."""
    later = REVISIONS[REVISIONS.index(revision) + 1 :]
    return _OUR_TABLES.difference(*(_ADDED_TABLES.get(each, ()) for each in later))


def migrate(engine: Engine) -> None:
    """Bring the schema to the newest revision in one transaction; a second process meanwhile waits, then finds it done.

    Alembic is imported here: reading a database that is up to date does without it.
    """
    from alembic import command
    from alembic.config import Config

    config = Config()
    config.set_main_option("script_location", str(_MIGRATIONS).replace("%", "%%"))
    config.attributes["version_table"] = VERSION_TABLE
    sqlite = engine.dialect.name == "sqlite"
    if sqlite:
        with engine.connect() as connection:
            check_writable(connection)
            _write_ahead(connection)
    with engine.connect() as connection:
        connection.exec_driver_sql("BEGIN IMMEDIATE" if sqlite else f"SELECT pg_advisory_xact_lock({APPLICATION_ID})")
        if sqlite:
            connection.exec_driver_sql(f"PRAGMA application_id = {APPLICATION_ID}")
        config.attributes["connection"] = connection
        command.upgrade(config, "head")
        add_spatial_index(connection)
        connection.commit()


def _write_ahead(connection: Connection) -> None:
    """Have SQLite write ahead into a log; of processes that make one file at a time, one waits for the other."""
    until = time.monotonic() + BUSY_TIMEOUT_S
    while connection.exec_driver_sql("PRAGMA journal_mode").scalar_one() != "wal":
        try:
            connection.exec_driver_sql("PRAGMA journal_mode = WAL")
        except OperationalError as error:  # SQLite itself does not wait here
            if "locked" not in str(error.orig) or time.monotonic() > until:
                raise
            time.sleep(0.05)


def index_places(engine: Engine) -> None:
    """Add a spatial index where PostGIS has come since the database was made; a second process meanwhile waits."""
    if engine.dialect.name != "postgresql":
        return
    try:
        with engine.begin() as connection:
            connection.execute(select(func.pg_advisory_xact_lock(APPLICATION_ID)))
            add_spatial_index(connection)
    except SQLAlchemyError as error:
        raise unreachable(engine.url, error) from error
