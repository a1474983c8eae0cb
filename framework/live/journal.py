"""The journal of a drive that goes on: what a power cut leaves of it.

An SQLite file beside the database. Each checkpoint is one transaction, so that the journal is whole at any moment. It
goes when the drive is stored.
"""

from __future__ import annotations

import glob
import io
import json
import sqlite3
from collections.abc import Iterator, Mapping, Sequence
from contextlib import closing, contextmanager, suppress
from pathlib import Path
from typing import Any

import numpy as np

from ...database.urls import parse_url
from ..core.errors import InputError
from .log import Part

EXPECTED = "the journal of a drive of this version of Bevameter"
_VERSION = 3
_TABLES = (
    "CREATE TABLE IF NOT EXISTS state (name TEXT PRIMARY KEY, value TEXT NOT NULL)",
    "CREATE TABLE IF NOT EXISTS parts (number INTEGER PRIMARY KEY, stream TEXT NOT NULL, rows BLOB NOT NULL)",
)


class Journal:
    """Parts of a drive, and its state by name; the file is made with the first of them.

    All methods raise `InputError` where the file cannot be read or written, is of another program or version, or is
    that of a drive that goes on.

    Parameters
    ----------
    path
        The file.
    """

    def __init__(self, path: Path):
        self.path = path
        self._connection: sqlite3.Connection | None = None

    @contextmanager
    def _connected(self) -> Iterator[sqlite3.Connection]:
        """Give the connection; a file that could not be opened is tried again the next time."""
        try:
            if self._connection is None:
                self._connection = self._opened()
            yield self._connection
        except sqlite3.Error as error:
            raise InputError(self.path, str(error), expected=EXPECTED) from error

    def _opened(self) -> sqlite3.Connection:
        connection = sqlite3.connect(self.path, timeout=0.0, check_same_thread=False, isolation_level=None)
        try:
            connection.execute("PRAGMA locking_mode = EXCLUSIVE")
            connection.execute("PRAGMA synchronous = FULL")
            with _transaction(connection):
                for statement in _TABLES:
                    connection.execute(statement)
            found = connection.execute("SELECT value FROM state WHERE name = 'version'").fetchone()
            if found is not None and json.loads(found[0]) != _VERSION:
                raise InputError(self.path, f"version {found[0]}", expected=EXPECTED)
        except BaseException:
            connection.close()
            raise
        return connection

    def write(self, parts: Sequence[Part], state: Mapping[str, Any]) -> None:
        """Add parts, and state in place of what had the same names, all or nothing."""
        rows = [(stream, _packed(columns)) for stream, columns in parts]
        values = [(name, json.dumps(value)) for name, value in {"version": _VERSION, **state}.items()]
        with self._connected() as connection, _transaction(connection):
            connection.executemany("INSERT INTO parts (stream, rows) VALUES (?, ?)", rows)
            connection.executemany("INSERT OR REPLACE INTO state (name, value) VALUES (?, ?)", values)

    def state(self) -> dict[str, Any]:
        """Read the state back."""
        with self._connected() as connection:
            found = connection.execute("SELECT name, value FROM state").fetchall()
        try:
            return {name: json.loads(value) for name, value in found}
        except ValueError as error:
            raise InputError(self.path, f"damaged: {error}", expected=EXPECTED) from error

    def parts(self, stream: str) -> Iterator[dict[str, np.ndarray]]:
        """Read the parts of a stream back, in the order in which they were written."""
        query = "SELECT rows FROM parts WHERE stream = ? ORDER BY number"
        with self._connected() as connection:
            for (rows,) in connection.execute(query, (stream,)):
                try:
                    columns = _unpacked(rows)
                except Exception as error:  # zipfile, zlib and numpy raise whatever they stumble over
                    raise InputError(self.path, f"damaged: {error}", expected=EXPECTED) from error
                yield columns

    def close(self) -> None:
        """Leave the file as it is."""
        if self._connection is not None:
            self._connection.close()
            self._connection = None

    def remove(self) -> None:
        """Remove the file: the drive is stored."""
        self.close()
        self.path.unlink(missing_ok=True)


@contextmanager
def _transaction(connection: sqlite3.Connection) -> Iterator[None]:
    connection.execute("BEGIN IMMEDIATE")
    try:
        yield
        connection.execute("COMMIT")
    except BaseException:
        with suppress(sqlite3.Error):
            connection.execute("ROLLBACK")
        raise


def _packed(columns: Mapping[str, np.ndarray]) -> bytes:
    file = io.BytesIO()
    np.savez(file, **{f"c {name}": values for name, values in columns.items()})  # type: ignore[arg-type]
    return file.getvalue()


def _unpacked(rows: bytes) -> dict[str, np.ndarray]:
    with np.load(io.BytesIO(rows), allow_pickle=False) as found:
        return {name.removeprefix("c "): found[name] for name in found.files}


def place_of_journal(database: str | Path, digest: str) -> Path:
    """Give the path of a drive's journal: beside the database, in the working folder where that is a server's."""
    return _stem(database).with_name(f"{_stem(database).name}.live-{digest[:8]}")


def unfinished(database: str | Path) -> tuple[Path, ...]:
    """Find the journals of drives into a database that neither were stored nor go on."""
    stem = _stem(database)
    found = []
    for path in sorted(stem.parent.glob(f"{glob.escape(stem.name)}.live-????????")):
        with suppress(InputError), closing(Journal(path)) as journal:
            if "drive" in journal.state():
                found.append(path)
    return tuple(found)


def _stem(database: str | Path) -> Path:
    url = parse_url(database)
    of_file = url.get_backend_name() == "sqlite" and url.database
    return Path(str(url.database)) if of_file else Path(str(url.database or "terrain"))
