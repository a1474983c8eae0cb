"""From one terrain database into another: set union by identity, in portions, over connections that are often cut.

Each portion is a transaction of its own, and the drive's imports come with the last one. Until then nothing derived
uses the drive (`drive_rows.imported`). The same merge again compares what both sides have by `fingerprints` and sends
what differs: where it was cut, it goes on.
"""

from __future__ import annotations

import math
import uuid
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from sqlalchemy import Connection, func, select

from ..framework.core.errors import InputError
from .drive_rows import OBSERVATIONS, insert_columns, insert_drive, insert_rows
from .fingerprints import NONE, Fingerprint, in_portions, of_drives, of_parts, part_of
from .physics import add_rows, checked_rows, driven_classes, lacking_physics, physics_classes, read_physics
from .tables import Base, DriveRow, ImportRow, table_of
from .urls import Unreachable

if TYPE_CHECKING:
    from .store import TerrainDatabase

PORTION = 2000
"""Rows that are sent in one transaction, about 250 kB: a connection has to last that long to bring a drive on."""

_ATTEMPTS = 5
"""How often a drive is brought that somebody removes from the target meanwhile."""

_PART = 500
"""Rows of a drive that are compared at a time, about: if one of them is lacking, all of them are sent."""


@dataclass(frozen=True)
class _Held:
    """What a database has of a drive: its imports, and its rows of each of `OBSERVATIONS`."""

    imports: frozenset[uuid.UUID]
    observations: tuple[Fingerprint, ...]


def merge(
    source: TerrainDatabase, target: TerrainDatabase, sites: Sequence[str] | None, report: Callable[[str, float], None]
) -> tuple[int, int]:
    """Add what `source` has to `target`; give the numbers of rows that were new and that were known.

    `TerrainDatabase.merge` is its door.
    """
    physics, further = _physics(source, target, sites)
    with source.reading() as connection:
        theirs = _held(connection, _complete(connection, sites))
    with target.reading() as connection:
        own = _held(connection, list(theirs))
    differing = [each for each, held in theirs.items() if _lacks(own[each], held)]
    new, complete = 0, len(theirs) - len(differing)
    try:
        for drive_id in differing:
            report("merging", complete / len(theirs))
            new += _bring_whole(
                source, target, drive_id, theirs[drive_id], own[drive_id],
                lambda share, before=complete: report("merging", (before + share) / len(theirs)),
            )  # fmt: skip
            complete += 1
        with target.writing() as connection:
            found = add_rows(connection, physics)
    except Unreachable as error:
        problem = f"{error.problem}; {complete} of {len(theirs)} drives are complete, the same again goes on from there"
        raise InputError(error.source, problem, expected=error.expected) from error
    report("merging", 1.0)
    total = sum(each.rows for held in theirs.values() for each in held.observations)
    return new + found, total - new + further + len(physics) - found


def _physics(
    source: TerrainDatabase, target: TerrainDatabase, sites: Sequence[str] | None
) -> tuple[list[dict[str, Any]], int]:
    """Rows of physics that the target lacks, and the number of those that it has."""
    with source.reading() as connection:
        found = read_physics(connection, source.name)
    if sites is not None:
        found = [each for each in found if each.site in ("", *sites)]
    with target.reading() as connection:
        lacking = lacking_physics(connection, found)
        if not lacking:
            return [], len(found)
        driven, own = driven_classes(connection), physics_classes(connection)
    with source.reading() as connection:
        driven |= driven_classes(connection)
    return checked_rows(lacking, source.name, driven, own), len(found) - len(lacking)


def _complete(connection: Connection, sites: Sequence[str] | None) -> list[uuid.UUID]:
    """Drives that are complete, in order; with sites all processings of the recordings that were made there."""
    drive, imports = table_of(DriveRow), table_of(ImportRow)
    query = select(drive.c.id).join(imports, imports.c.drive_id == drive.c.id).distinct().order_by(drive.c.id)
    if sites is not None:
        # Wherever they are: which of them is in use is not to depend on the sites.
        there = select(drive.c.recording_digest).where(drive.c.site.in_(sites))
        query = query.where(drive.c.recording_digest.in_(there))
    return list(connection.execute(query).scalars())


def _held(connection: Connection, drives: Sequence[uuid.UUID]) -> dict[uuid.UUID, _Held]:
    """What a database has of drives."""
    table = table_of(ImportRow)
    imports: dict[uuid.UUID, set[uuid.UUID]] = {}
    for some in in_portions(drives):
        query = select(table.c.drive_id, table.c.id).where(table.c.drive_id.in_(some))
        for drive_id, identity in connection.execute(query):
            imports.setdefault(drive_id, set()).add(identity)
    found = [of_drives(connection, row_type, drives) for row_type in OBSERVATIONS]
    return {
        each: _Held(frozenset(imports.get(each, ())), tuple(rows.get(each, NONE) for rows in found)) for each in drives
    }


def _lacks(own: _Held, theirs: _Held) -> bool:
    return not theirs.imports <= own.imports or own.observations != theirs.observations


class _Removed(Exception):
    """Somebody removed observations of a drive from the target while it was brought."""


def _bring_whole(
    source: TerrainDatabase, target: TerrainDatabase, drive_id: uuid.UUID, theirs: _Held, own: _Held,
    report: Callable[[float], None],
) -> int:  # fmt: skip
    """Bring a drive, anew where `prune` removed it from the target meanwhile; give the number of new observations."""
    for _ in range(_ATTEMPTS):
        try:
            return _bring(source, target, drive_id, theirs, own, report)
        except _Removed:
            with target.reading() as connection:
                own = _held(connection, [drive_id])[drive_id]
    raise InputError(target.name, f"drive {drive_id} is removed again and again", expected="the same command later")


def _bring(
    source: TerrainDatabase, target: TerrainDatabase, drive_id: uuid.UUID, theirs: _Held, own: _Held,
    report: Callable[[float], None],
) -> int:  # fmt: skip
    """Bring a drive, its imports last; give the number of observations that were new."""
    differing: dict[type[Base], _Parts | None] = {
        row_type: _differing_parts(source, target, row_type, drive_id, there, here)
        for row_type, there, here in zip(OBSERVATIONS, theirs.observations, own.observations, strict=True)
        if there != here
    }
    total, sent, new = sum(each.rows for each in theirs.observations), 0, 0
    with closing(_portions(source, drive_id, differing)) as portions, target.committing() as connection:
        for portion in portions:
            insert_drive(connection, portion.drive)
            for row_type, columns in portion.observations:
                new += insert_columns(connection, row_type, columns)
                sent += len(columns["id"])
            if portion.imports:
                _check_whole(connection, drive_id, theirs)
            insert_rows(connection, ImportRow, portion.imports)
            connection.commit()
            if not portion.imports:
                report(sent / total)
    return new


def _check_whole(connection: Connection, drive_id: uuid.UUID, theirs: _Held) -> None:
    """Make sure, until the transaction ends, that no observation of a drive is lacking; raises `_Removed`."""
    drive = table_of(DriveRow)
    connection.execute(select(drive.c.id).where(drive.c.id == drive_id).with_for_update())
    for row_type, rows in zip(OBSERVATIONS, theirs.observations, strict=True):
        if of_drives(connection, row_type, [drive_id]).get(drive_id, NONE).rows < rows.rows:
            raise _Removed


@dataclass(frozen=True)
class _Parts:
    """Parts of a drive's rows (`fingerprints.part_of`): names of so many digits."""

    digits: int
    names: tuple[str, ...]


def _differing_parts(
    source: TerrainDatabase, target: TerrainDatabase, row_type: type[Base], drive_id: uuid.UUID, there: Fingerprint,
    here: Fingerprint,
) -> _Parts | None:  # fmt: skip
    """Give the parts of a drive's rows that differ; None for all of them."""
    digits = math.ceil(math.log(max(there.rows, 1) / _PART, 16))
    if digits <= 0 or not here.rows:
        return None
    with source.reading() as connection:
        theirs = of_parts(connection, row_type, drive_id, digits)
    with target.reading() as connection:
        own = of_parts(connection, row_type, drive_id, digits)
    return _Parts(digits, tuple(name for name, rows in theirs.items() if own.get(name) != rows))


@dataclass(frozen=True)
class _Portion:
    """What one transaction brings of a drive: its row, columns of observations, and its imports with the last one."""

    drive: dict[str, Any]
    observations: list[tuple[type[Base], dict[str, list[Any]]]]
    imports: list[dict[str, Any]]


def _portions(
    source: TerrainDatabase, drive_id: uuid.UUID, differing: dict[type[Base], _Parts | None]
) -> Generator[_Portion]:
    """Read a drive's observations that differ, in the order of their identities; nothing if it is there no more."""
    with source.reading() as connection:
        if connection.dialect.name == "postgresql":
            # All rows will be fetched: else they would be read by the index of identities, past those of other drives.
            connection.execute(select(func.set_config("cursor_tuple_fraction", "1", True)))
        drive, imports = _rows(connection, DriveRow.id, drive_id), _rows(connection, ImportRow.drive_id, drive_id)
        if not drive or not imports:
            return
        gathered, size = [], 0
        for row_type, parts in differing.items():
            for columns in _columns(connection, row_type, drive_id, parts):
                gathered.append((row_type, columns))
                size += len(columns["id"])
                if size >= PORTION:
                    yield _Portion(drive[0], gathered, [])
                    gathered, size = [], 0
        yield _Portion(drive[0], gathered, imports)


def _rows(connection: Connection, column: Any, drive_id: uuid.UUID) -> list[dict[str, Any]]:
    table = table_of(column.class_)
    return [row._asdict() for row in connection.execute(select(table).where(column == drive_id))]


def _columns(
    connection: Connection, row_type: type[Base], drive_id: uuid.UUID, parts: _Parts | None
) -> Iterator[dict[str, list[Any]]]:
    """Read the observations of a drive, of some parts of it where they are given, as columns."""
    table = table_of(row_type)
    query = select(table).where(table.c.drive_id == drive_id).order_by(table.c.id)
    if parts is not None:
        query = query.where(part_of(table, parts.digits).in_(parts.names))
    for rows in connection.execute(query, execution_options={"yield_per": PORTION}).partitions():
        yield dict(zip(table.columns.keys(), map(list, zip(*rows, strict=True)), strict=True))
