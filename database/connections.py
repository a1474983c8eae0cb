"""Connections to SQLite, also where it cannot create a write-ahead log: in read-only folders and on a full disk."""

from __future__ import annotations

import os
import shutil
from pathlib import Path
from typing import Any

from sqlalchemy import Connection, Dialect
from sqlalchemy.pool import ConnectionPoolEntry

from ..framework.core.errors import InputError

_WITHOUT_LOCKS = "file that is read without locks, and its state"
"""Where a connection keeps it."""

_LEAST_LOG_BYTES = 64 * 1024
"""Room that SQLite needs for a log and its index, however little is written."""


def read_only(_dialect: Dialect, record: ConnectionPoolEntry, arguments: list[Any], options: dict[str, Any]) -> None:
    """Let a connection only read the file that it is to open."""
    file = Path(arguments[0])
    if _has_no_log(file.resolve()):
        record.info[_WITHOUT_LOCKS] = file, _state(file)
    arguments[0] = uri_for_reading(file)
    options["uri"] = True


def read_only_where_no_log_can_be(
    dialect: Dialect, record: ConnectionPoolEntry, arguments: list[Any], options: dict[str, Any]
) -> None:
    """Let a connection read and write the file that it is to open; only read it where no log can be made."""
    if _has_no_log(Path(arguments[0]).resolve()):
        read_only(dialect, record, arguments, options)


def begin_reading(connection: Connection) -> None:
    """Begin a transaction whose statements all see one state of the database; by default each sees its own."""
    if connection.dialect.name == "sqlite":
        connection.exec_driver_sql("BEGIN")
    else:
        connection.execution_options(isolation_level="REPEATABLE READ")


def check_writable(connection: Connection) -> None:
    """Refuse to write where no log can be made; raises `InputError`."""
    file, _ = connection.info.get(_WITHOUT_LOCKS, (None, None))
    if file is not None:
        full = os.access(file.resolve().parent, os.W_OK)
        raise InputError(file, "the disk is full" if full else "its folder may not be written to",
                         expected="a database that may be written")  # fmt: skip


def check_unchanged(connection: Connection) -> None:
    """Refuse what was read of a file without locks if it was changed meanwhile; raises `InputError`."""
    file, before = connection.info.get(_WITHOUT_LOCKS, (None, None))
    if file is not None and _state(file) != before:
        raise InputError(file, "was changed while it was read without locks, which need a log",
                         expected="the same again, or a folder with room that may be written to"
                         )  # fmt: skip


def _state(file: Path) -> tuple[int, int]:
    status = file.stat()
    return status.st_mtime_ns, status.st_size


def uri_for_reading(path: Path) -> str:
    """URI that makes SQLite read a file without changing it or its write-ahead log.

    A connection that may write would remove the log of a process that ended early. A connection that may only read
    would leave a new log behind, so it is used only where there is a log already.
    """
    file = path.resolve()
    log = file.with_name(file.name + "-wal")
    if _has_no_log(file):
        return f"{file.as_uri()}?mode=ro&immutable=1"
    return f"{file.as_uri()}?mode={'ro' if log.exists() and log.stat().st_size else 'rw'}"


def _has_no_log(file: Path) -> bool:
    """Say whether a file has no log and none can be made: its folder may not be written to, or the disk is full.

    SQLite reads such a file only where it is told that nobody changes it (sqlite.org/wal.html, "Read-Only Databases").
    """
    log = file.with_name(file.name + "-wal")
    if not file.exists() or (log.exists() and log.stat().st_size):
        return False
    return not os.access(file.parent, os.W_OK) or shutil.disk_usage(file.parent).free < _LEAST_LOG_BYTES
