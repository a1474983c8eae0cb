"""Which observations of a drive two databases do not both have, found by counts and sums: identities are not sent.

Identities are UUIDs of hashes: their last digits are as good as random numbers, and the sum of these over some rows
does not depend on the order of the rows. Their first digits divide a drive's rows into parts of about equal size.
"""

from __future__ import annotations

import uuid
from collections.abc import Iterator, Sequence
from itertools import islice
from typing import Any, NamedTuple

from sqlalchemy import BigInteger, ColumnElement, Connection, Table, Text, cast, func, select, type_coerce
from sqlalchemy.dialects import postgresql
from sqlalchemy.types import NullType

from .tables import Base, table_of

_DIGITS = 8
"""Last digits of an identity that are summed: 2^31 rows of them fit into the 64 bits of a sum."""

_AT_A_TIME = 500
"""Drives that one query asks for."""


class Fingerprint(NamedTuple):
    """Number of rows, and the sum of the last digits of their identities."""

    rows: int
    total: int


NONE = Fingerprint(0, 0)
"""Of no rows."""


def last_digits(identity: object) -> int:
    """Give the last digits of an identity in hexadecimal digits as a number; 0 where it is damaged."""
    try:
        return int(str(identity)[-_DIGITS:], 16)
    except ValueError:
        return 0


def of_drives(
    connection: Connection, row_type: type[Base], drives: Sequence[uuid.UUID]
) -> dict[uuid.UUID, Fingerprint]:
    """Fingerprints of the rows of drives; a drive without rows is absent."""
    table = table_of(row_type)
    return {
        drive_id if isinstance(drive_id, uuid.UUID) else uuid.UUID(drive_id): rows
        for some in in_portions(drives)
        for drive_id, rows in _sums(connection, table, table.c.drive_id, table.c.drive_id.in_(some)).items()
    }


def of_parts(connection: Connection, row_type: type[Base], drive_id: uuid.UUID, digits: int) -> dict[str, Fingerprint]:
    """Fingerprints of the parts of a drive's rows, by the first digits of their identities."""
    table = table_of(row_type)
    return _sums(connection, table, part_of(table, digits), table.c.drive_id == drive_id)


def part_of(table: Table, digits: int) -> ColumnElement[str]:
    """In which part of a drive's rows a row is, in SQL: the first digits of its identity, 8 at most."""
    return func.substr(cast(table.c.id, Text), 1, digits)


def in_portions(drives: Sequence[uuid.UUID]) -> Iterator[list[uuid.UUID]]:
    """Divide drives into as many as one query may ask for."""
    remaining = iter(drives)
    while some := list(islice(remaining, _AT_A_TIME)):
        yield some


def _sums(
    connection: Connection, table: Table, key: ColumnElement[Any], condition: ColumnElement[bool]
) -> dict[Any, Fingerprint]:
    """Fingerprints of rows by a key, which is as the database has it."""
    if connection.dialect.name == "postgresql":
        digits = func.concat("x", func.right(cast(table.c.id, Text), _DIGITS))
        number = cast(cast(digits, postgresql.BIT(4 * _DIGITS)), BigInteger)
        query = select(key.label("key"), func.count(), func.sum(number)).where(condition).group_by("key")
        return {name: Fingerprint(count, int(total)) for name, count, total in connection.execute(query)}
    # SQLite has no function that reads hexadecimal digits, and in one of Python's Ctrl-C would be lost.
    found: dict[Any, tuple[int, int]] = {}
    query = select(type_coerce(key, NullType()), type_coerce(table.c.id, NullType())).where(condition)
    for name, identity in connection.execute(query, execution_options={"yield_per": 10_000}):
        rows, total = found.get(name, NONE)
        found[name] = rows + 1, total + last_digits(identity)
    return {name: Fingerprint(*sums) for name, sums in found.items()}
