"""Whether a terrain database is sound: its rows can be read, are what their identities say, and belong to a drive."""

from __future__ import annotations

import uuid
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from sqlalchemy import Connection, func, inspect, select, type_coerce
from sqlalchemy.exc import DBAPIError
from sqlalchemy.types import NullType

from ..framework.core.class_names import check_class_name, check_class_names, spelt_alike
from ..framework.core.errors import InputError
from .observations import Drive
from .physics import check_likely, identity_of, physics_of
from .rows import TERRAIN_COLUMNS, drive_of, soil_observation, terrain_observations
from .schema import REVISIONS, VERSION_TABLE, DamagedFile, check_known, opened_as_it_is, revision_of, tables_of
from .stored_rows import UNREADABLE, StoredRow, check_identity, check_text, keep_damaged_text, stored_rows, text_of
from .tables import Base, DriveRow, ImportRow, PhysicsRow, SoilRow, TerrainRow, table_of
from .urls import parse_url, shown

_FURTHER = 1000
"""So many more identities than rows are tried where rows are lost [-]."""

UNFINISHED = (
    "is not complete, and nothing uses it: no import is there; run the merge, push or pull that brings it again"
)

_TYPES: Mapping[str, tuple[type, ...]] = {
    "time_s": (float, int), "cell_x": (int,), "cell_y": (int,), "sense": (str,), "quality": (float, int),
    "unknown": (bool, int), "probabilities": (bytes,), "reasons": (str,),
}  # fmt: skip
"""Of the columns of looks, as drivers give them."""


@dataclass(frozen=True)
class Fault:
    """Something in a terrain database that is not as it was stored.

    Parameters
    ----------
    table
        Where; empty for the database as a whole.
    id
        Identity of the row, as it is stored; empty where no one row is at fault.
    problem
        What is wrong.
    damaged
        Is the row itself unusable? Else something that belongs to it is not there.
    """

    table: str
    id: str
    problem: str
    damaged: bool = True

    def as_dict(self) -> dict[str, str]:
        """Table, id and problem, of characters that can be printed."""
        given = {"table": self.table, "id": self.id, "problem": " ".join(self.problem.split())}
        return {name: text.encode(errors="backslashreplace").decode() for name, text in given.items()}


@dataclass(frozen=True)
class CheckReport:
    """What `check` found: the faults, and how many rows of each table it read."""

    faults: tuple[Fault, ...]
    rows: Mapping[str, int]

    @property
    def sound(self) -> bool:
        """Is there no fault?"""
        return not self.faults


def check(url_or_path: str | Path, *, progress: Callable[[str, float], None] | None = None) -> CheckReport:
    """Read every row of a terrain database and name what is wrong; nothing is changed.

    The identity of an observation says which one of its drive it is, and not what was observed: a number that was
    changed into another possible one is not found. Observations of a drive that is damaged are not read.

    Parameters
    ----------
    url_or_path
        A path, or an SQLAlchemy URL.
    progress
        Called with ``"checking"`` and the share of the drives that is done.

    Raises
    ------
    InputError
        No such database, not one of ours, of a newer version, or it cannot be reached.
    """
    try:
        with opened_as_it_is(url_or_path) as connection:
            keep_damaged_text(connection)
            checking = _Check(connection, shown(parse_url(url_or_path)), progress or (lambda stage, share: None))
            checking.run()
            return CheckReport(tuple(checking.faults), checking.rows)
    except DamagedFile as error:
        return CheckReport((Fault("", "", error.problem),), {})


class _Check:
    """One check: what it found so far."""

    def __init__(self, connection: Connection, source: str, report: Callable[[str, float], None]) -> None:
        self.connection, self.source, self.report = connection, source, report
        self.faults: list[Fault] = []
        self.rows: Counter[str] = Counter()
        self.names: set[str] = set()
        self.unfinished: set[uuid.UUID] = set()
        self.revision: str | None = None

    def run(self) -> None:
        """Find all faults."""
        if self.connection.dialect.name == "sqlite":
            self._check_file()
        there = self._check_schema()
        if DriveRow.__tablename__ in there:
            self._check_drives(there)
        if PhysicsRow.__tablename__ in there:
            self._check_physics()
        for group in spelt_alike(self.names):
            alike = " and ".join(map(repr, group))
            self._add("", "", f"classes {alike} differ in case or spaces only: no belief combines them", damaged=False)

    def _add(self, table: str, identity: str, problem: str, *, damaged: bool = True) -> None:
        self.faults.append(Fault(table, identity, problem, damaged))

    @contextmanager
    def _reading(self, row_type: type[Base], what: str = "rows") -> Iterator[None]:
        """Name what the database itself cannot read."""
        try:
            yield
        except (DBAPIError, self.connection.dialect.loaded_dbapi.Error) as error:
            self.connection.rollback()
            cause = error.orig if isinstance(error, DBAPIError) else error
            self._add(row_type.__tablename__, "", f"{what} cannot be read: {cause}")

    def _check_file(self) -> None:
        """Let SQLite check its pages, indices and constraints."""
        try:
            said = self.connection.exec_driver_sql("PRAGMA integrity_check").scalars().all()
        except DBAPIError as error:
            said = [str(error.orig)]
        for line in "\n".join(said).splitlines():
            if line != "ok" and not line.startswith("***"):
                self._add("", "", f"integrity check of SQLite: {line}")

    def _check_schema(self) -> set[str]:
        """Give the tables that are there; those that are not are named."""
        there = set(inspect(self.connection).get_table_names())
        revision = None
        try:
            revision = revision_of(self.connection)
        except DBAPIError as error:
            self._add(VERSION_TABLE, "", f"the version cannot be read: {error.orig}")
        else:
            if revision is None:
                self._add(VERSION_TABLE, "", "no version is stated")
            else:
                check_known(revision, self.source)
                self.revision = revision
        for name in sorted(tables_of(revision or REVISIONS[-1]) - there):
            self._add(name, "", "the table is not there")
        return there

    def _check_drives(self, there: set[str]) -> None:
        drives: dict[uuid.UUID, Drive] = {}
        with self._reading(DriveRow):
            for row in self._rows(DriveRow):
                drive = self._drive(row)
                if drive is not None:
                    drives[drive.id] = drive
        if ImportRow.__tablename__ in there:
            self._check_imports(drives)
        checks = [
            (row_type, check_rows)
            for row_type, check_rows in ((TerrainRow, self._check_looks), (SoilRow, self._check_stretches))
            if row_type.__tablename__ in there
        ]
        for number, drive in enumerate(drives.values()):
            self.report("checking", number / len(drives))
            for row_type, check_rows in checks:
                with self._reading(row_type, f"rows of drive {drive.id.hex}"):
                    check_rows(drive)
        for row_type, _ in checks:
            self._check_orphans(row_type)
        self.report("checking", 1.0)

    def _rows(self, row_type: type[Base], drive_id: uuid.UUID | None = None) -> Iterator[StoredRow]:
        """Read rows; those that cannot be read are named."""
        name = row_type.__tablename__
        for row in stored_rows(self.connection, row_type, drive_id, self.revision):
            self.rows[name] += 1
            if row.values is None:
                self._add(name, row.id, row.problem)
            yield row

    def _drive(self, row: StoredRow) -> Drive | None:
        """Give a drive, without its observations; None where it is damaged."""
        if row.values is None:
            return None
        try:
            drive = drive_of(row.values, (), ())
            check_class_names(drive.terrain.evidence.classes, "classes")
            _check_is(drive.id, row)
        except (InputError, *UNREADABLE) as error:
            self._add(DriveRow.__tablename__, row.id, str(error))
            return None
        self.names |= set(drive.terrain.evidence.classes)
        return drive

    def _check_imports(self, drives: Mapping[uuid.UUID, Drive]) -> None:
        imported = set()
        with self._reading(ImportRow):
            imported = {row.values.drive_id for row in self._rows(ImportRow) if row.values is not None}
        self.unfinished = drives.keys() - imported
        for identity in self.unfinished:
            self._add(DriveRow.__tablename__, identity.hex, UNFINISHED, damaged=False)
        self._check_orphans(ImportRow)

    def _check_orphans(self, row_type: type[Base]) -> None:
        """Name drives that are not there, though rows belong to them."""
        table, drive = table_of(row_type), table_of(DriveRow)
        raw = type_coerce(table.c.drive_id, NullType())
        lonely = ~select(drive.c.id).where(drive.c.id == table.c.drive_id).exists()
        with self._reading(row_type):
            for drive_id, count in self.connection.execute(select(raw, func.count()).where(lonely).group_by(raw)):
                self._add(row_type.__tablename__, "", f"{count} of drive {text_of(drive_id)}, which is not there")

    def _check_looks(self, drive: Drive) -> None:
        name, table = TerrainRow.__tablename__, table_of(TerrainRow)
        columns = [table.c[each] for each in ("id", *TERRAIN_COLUMNS)]
        # As the driver gives them, a drive at once: one by one takes many times as long.
        cursor = self.connection.execute(select(*columns).where(table.c.drive_id == drive.id)).cursor
        assert cursor is not None
        rows = cursor.fetchall()
        self.rows[name] += len(rows)
        for row, problem in _damaged(rows, drive):
            self._add(name, text_of(row[0]), problem)
        self._check_identities(name, drive, "terrain", [text_of(row[0]) for row in rows])

    def _check_stretches(self, drive: Drive) -> None:
        name, identities = SoilRow.__tablename__, []
        for row in self._rows(SoilRow, drive.id):
            identities.append(row.id)
            if row.values is None:
                continue
            try:
                soil = soil_observation(row.values)
                check_class_names(soil.class_probabilities, "class_probabilities")
            except (InputError, *UNREADABLE) as error:
                self._add(name, row.id, str(error))
            else:
                self.names |= set(soil.class_probabilities)
        self._check_identities(name, drive, "soil", identities)

    def _check_identities(self, table: str, drive: Drive, kind: str, identities: Sequence[str]) -> None:
        """Name rows whose identities are none of the drive's, and a drive some of whose rows are not there.

        Of a drive that is not complete anyhow, any of the rows may be there.
        """
        if drive.id in self.unfinished:
            return
        number = {each.hex: index for index, each in enumerate(drive.row_ids(kind, len(identities)))}
        if number.keys() == set(identities):
            return
        further = drive.row_ids(kind, 2 * len(identities) + _FURTHER)
        number = {each.hex: index for index, each in enumerate(further)}
        found = [number[each] for each in identities if each in number]
        named = {fault.id for fault in self.faults if fault.table == table}
        for each in identities:
            if each not in number and each not in named:
                self._add(table, each, f"its identity is that of no row of drive {drive.id.hex}")
        lost = max(found, default=-1) + 1 - len(found)
        if lost:
            self._add(DriveRow.__tablename__, drive.id.hex, f"{lost} of its rows of {table} are lost", damaged=False)

    def _check_physics(self) -> None:
        name = PhysicsRow.__tablename__
        with self._reading(PhysicsRow):
            for row in self._rows(PhysicsRow):
                if row.values is None:
                    continue
                try:
                    found = physics_of(row.values, self.source)
                    check_likely(found.physics, "physics")
                    check_class_name(found.class_name, "class_name")
                    _check_is(identity_of(row.values, row.values.physics), row)
                except (InputError, *UNREADABLE) as error:
                    self._add(name, row.id, str(error))
                else:
                    self.names.add(found.class_name)


def _check_is(identity: uuid.UUID, row: StoredRow) -> None:
    """Refuse a row that is not what its identity says; raises ValueError."""
    if identity.hex != row.id:
        raise ValueError(f"is not what its identity says; that of what it holds is {identity.hex}")


def _damaged(rows: Sequence[tuple], drive: Drive) -> Iterator[tuple[tuple, str]]:
    """Find the looks of a drive that cannot be read, and why: halves of what cannot be read are read again."""
    try:
        _check_read(rows, drive)
    except UNREADABLE as error:
        if len(rows) == 1:
            yield rows[0], str(error)
            return
        middle = len(rows) // 2
        yield from _damaged(rows[:middle], drive)
        yield from _damaged(rows[middle:], drive)


def _check_read(rows: Sequence[tuple], drive: Drive) -> None:
    """Read looks (their identity first); raises what says why they cannot be read."""
    if not rows:
        return
    identities, *columns = zip(*rows, strict=True)
    for name, column in zip(TERRAIN_COLUMNS, columns, strict=True):
        for strange in set(map(type, column)) - set(_TYPES[name]):
            value: Any = next(each for each in column if type(each) is strange)
            raise ValueError(f"{name}: {value!r:.60}, expected {_TYPES[name][0].__name__}")
        if name in ("sense", "reasons"):
            for value in set(column):
                check_text(value)
    for identity in identities:
        check_identity(identity)
    flags = set(columns[TERRAIN_COLUMNS.index("unknown")]) - {0, 1}
    if flags:
        raise ValueError(f"unknown: {flags.pop()}, expected true or false")
    terrain_observations([[row[1:] for row in rows]], drive.terrain.evidence.classes, drive.terrain.cell_size_m)
