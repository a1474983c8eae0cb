"""Rows as the driver gives them, decoded one by one: a damaged one hides no other, and is named."""

from __future__ import annotations

import uuid
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

from sqlalchemy import JSON, Boolean, Column, Connection, Uuid, select, type_coerce
from sqlalchemy.types import NullType

from ..framework.core.arguments import shown
from .drive_rows import CHUNK
from .tables import Base, columns_of, table_of

UNREADABLE = (ArithmeticError, AttributeError, LookupError, RecursionError, TypeError, ValueError)
"""What decoding raises where a value is none of its type."""


@dataclass(frozen=True)
class StoredRow:
    """A row that was read.

    Parameters
    ----------
    id
        The identity (`text_of`).
    values
        The columns by name; None where one cannot be read.
    problem
        Which, and why; empty where all can be read.
    """

    id: str
    values: SimpleNamespace | None
    problem: str = ""


def keep_damaged_text(connection: Connection) -> None:
    """Let SQLite give text that is no UTF-8, bytes as surrogates, instead of ending there."""
    driver = connection.connection.dbapi_connection
    if connection.dialect.name == "sqlite" and driver is not None:
        driver.text_factory = lambda data: data.decode(errors="surrogateescape")  # type: ignore[attr-defined]


def stored_rows(
    connection: Connection, row_type: type[Base], drive_id: uuid.UUID | None = None, revision: str | None = None
) -> Iterator[StoredRow]:
    """Read the rows of a table, of one drive where it is given, as a revision of the schema has them."""
    table = table_of(row_type)
    there = columns_of(row_type, revision)
    query = select(*(type_coerce(column, NullType()).label(column.name) for column in there))
    if drive_id is not None:
        query = query.where(table.c.drive_id == drive_id)
    result = connection.execute(query, execution_options={"yield_per": CHUNK})
    assert result.cursor is not None
    kinds = [about[1] for about in result.cursor.description]
    decode = _decoder(connection, table.columns.values(), kinds)
    for values in result:
        identity = text_of(values.id)
        try:
            yield StoredRow(identity, decode(values))
        except ValueError as error:
            yield StoredRow(identity, None, str(error))


def text_of(identity: object) -> str:
    """Give an identity in hexadecimal digits, as SQLite has it; a damaged one may be anything."""
    if isinstance(identity, uuid.UUID):
        return identity.hex
    return identity.decode(errors="surrogateescape") if isinstance(identity, bytes) else str(identity)


def check_identity(identity: object) -> None:
    """Refuse text that is no UUID as it is stored; raises ValueError."""
    if isinstance(identity, str) and uuid.UUID(identity).hex != identity:
        raise ValueError(f"{shown(identity)}, expected 32 small hexadecimal digits")


def check_text(value: str) -> None:
    """Refuse text that holds what is none; raises ValueError."""
    if any("\ud800" <= letter <= "\udfff" for letter in value):
        raise ValueError(f"{shown(value)}, expected text")


def _decoder(
    connection: Connection, columns: Sequence[Column], kinds: Sequence[Any]
) -> Callable[[Sequence[Any]], SimpleNamespace]:
    dialect = connection.dialect
    processes = [
        column.type.dialect_impl(dialect).result_processor(dialect, kind)
        for column, kind in zip(columns, kinds, strict=True)
    ]

    def decode(values: Sequence[Any]) -> SimpleNamespace:
        decoded = {}
        for column, process, value in zip(columns, processes, values, strict=True):
            try:
                decoded[column.name] = _decoded(column, process, value)
            except UNREADABLE as error:
                raise ValueError(f"{column.name}: {error}") from error
        return SimpleNamespace(**decoded)

    return decode


def _decoded(column: Column, process: Callable[[Any], Any] | None, value: Any) -> Any:
    if value is None:
        if not column.nullable:
            raise ValueError("nothing")
        return None
    if isinstance(value, str):
        check_text(value)
    if isinstance(column.type, Boolean) and value not in (0, 1):
        raise ValueError(f"{shown(value)}, expected true or false")
    if isinstance(column.type, Uuid):
        check_identity(value)
    read = value if process is None else process(value)
    expected = object if isinstance(column.type, JSON) else column.type.python_type
    if not isinstance(read, (int, float) if expected is float else expected):
        raise ValueError(f"{shown(value)}, expected {expected.__name__}")
    return read
