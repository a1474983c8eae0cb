"""The terrain database: observations go in, a snapshot for the planner comes out."""

from __future__ import annotations

import uuid
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from itertools import islice
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any

from sqlalchemy import Connection, func, select
from sqlalchemy.exc import DBAPIError

from ..framework.core.arguments import refused
from ..framework.core.class_names import check_class_names, check_spelling
from ..framework.core.errors import InputError
from .observations import Drive
from .physics import (
    ClassPhysics,
    add_rows,
    driven_classes,
    found_by_others,
    newest_row,
    physics_classes,
    physics_row,
    read_physics,
    sound_physics,
)
from .rows import TERRAIN_COLUMNS, drive_of, drive_row, soil_rows, terrain_columns
from .schema import holds_database, open_engine, shown, unreachable
from .snapshot import Snapshot
from .tables import Base, DriveRow, ImportRow, SoilRow, TerrainRow, insertion, table_of

if TYPE_CHECKING:
    from ..identification.effects.stored import AugmentedSimulator

_CHUNK = 5000
"""Rows that are written at a time."""

_OBSERVATIONS = (TerrainRow, SoilRow)


@dataclass(frozen=True)
class Added:
    """How many observations were new to the database, and how many it knew already."""

    new: int
    known: int


class TerrainDatabase:
    """What vehicles have learnt about the ground, in an SQLite file or on a PostgreSQL server.

    Observations are only ever added; what is derived from them is computed when a snapshot is taken. Several
    processes may read and write the same database.

    Parameters
    ----------
    url_or_path
        A path, or an SQLAlchemy URL such as ``sqlite:///terrain.db`` or ``postgresql://user@host/terrain``.
    must_exist
        Open what is there, never make a new database: what reading needs.

    Raises
    ------
    InputError
        The database is missing though it must exist, is another program's, is of a newer version, or cannot be
        reached; nothing was written.
    """

    def __init__(self, url_or_path: str | Path = "sqlite:///terrain.db", *, must_exist: bool = False):
        self._engine = open_engine(url_or_path, must_exist=must_exist)

    @classmethod
    def open_if_there(cls, url_or_path: str | Path) -> TerrainDatabase | None:
        """Open the database without making one: None where there is none yet and one can be made.

        Raises
        ------
        InputError
            What is there is no terrain database, or there can be none.
        """
        return cls(url_or_path, must_exist=True) if holds_database(url_or_path) else None

    @property
    def name(self) -> str:
        """The file's path, or the URL without its password."""
        return shown(self._engine.url)

    def close(self) -> None:
        """Let go of all connections; the object can still be used, and then opens new ones."""
        self._engine.dispose()

    def __enter__(self) -> TerrainDatabase:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def add_drive(self, drive: Drive) -> Added:
        """Add a drive's observations, all or none of them; a drive that is there already adds nothing.

        Where its recording was processed otherwise since, a drive that is there already becomes the processing in use
        again.

        Raises
        ------
        InputError
            A class of the drive is `unknown`, or two of them differ in case or spaces only; the database cannot be
            written.
        """
        if not isinstance(drive, Drive):
            raise refused("drive", drive, "a Drive")
        of_soils = (name for soil in drive.soils for name in soil.class_probabilities)
        check_class_names([*drive.terrain.evidence.classes, *of_soils], f"drive {drive.name!r}", "classes")
        total = len(drive.terrain) + len(drive.soils)
        moment = {"id": uuid.uuid4(), "drive_id": drive.id, "imported_at": datetime.now(UTC)}
        with self._written() as connection:
            if not _is_new(connection, drive_row(drive)):
                if _in_use(connection, drive.recording_digest) != drive.id:
                    _insert(connection, ImportRow, [moment])
                return Added(0, total)
            _insert(connection, ImportRow, [moment])
            _insert_columns(connection, TerrainRow, terrain_columns(drive))
            _insert(connection, SoilRow, soil_rows(drive))
        return Added(total, 0)

    def add_physics(
        self,
        class_name: str,
        physics: AugmentedSimulator,
        *,
        source: str,
        time: datetime | None = None,
        site: str = "",
    ) -> Added:
        """Add what the textbook wheel was found to lack on ground of a class; the same again adds nothing.

        Of several for one class the newest is used for predictions (`GroundAnswer.drawbar_pull`, `mobility`), as long
        as soil of the class was measured; older ones are kept.

        Parameters
        ----------
        class_name
            The class, spelt as drives have it. It may be one that no drive has brought yet: its physics is used once
            its soil was measured.
        physics
            Soil and effects, fitted together. Faults of instruments among them are kept and never act on predictions.
        source
            Where it came from, for people.
        time
            When it was found. The present if absent, and then physics that is the newest of the class and site already,
            whatever its source, adds nothing: a recording that is explained again is no newer physics.
        site
            The site that it holds at; empty for ground of the class anywhere.

        Raises
        ------
        InputError
            The class is `unknown`, or differs in case or spaces only from one that the database knows; the physics
            is none, a number in it is not finite or out of bounds, or an effect is less likely than not; or the
            database cannot be written.
        """
        found = ClassPhysics(class_name, physics, source, time if time is not None else datetime.now(UTC), site)
        with self._read() as connection:
            check_spelling(class_name, (driven_classes(connection), physics_classes(connection)), "class_name")
            newest = newest_row(connection, class_name, site)
        found = replace(found, physics=sound_physics(physics, f"physics of {class_name}"))
        if time is None and newest is not None:
            again = replace(found, source=newest.source, observed_at=newest.observed_at)
            if again.id == newest.id:
                return Added(0, 1)
        with self._written() as connection:
            new = add_rows(connection, [physics_row(found)])
        return Added(new, 1 - new)

    def physics(self, class_name: str | None = None) -> list[ClassPhysics]:
        """Read the physics of classes back, oldest first; of one class where one is named.

        Raises
        ------
        InputError
            The database cannot be read, or holds what is no physics.
        """
        with self._read() as connection:
            found = read_physics(connection, self.name)
        return [each for each in found if class_name in (None, each.class_name)]

    def merge(self, other: TerrainDatabase) -> Added:
        """Add every observation of another database, physics of classes included: set union.

        One transaction a drive, and one for the physics.

        Raises
        ------
        InputError
            This database cannot be written, or the other cannot be read, or holds physics that `add_physics` refuses
            (of a class as the drives of both spell it): nothing is merged then.
        """
        if not isinstance(other, TerrainDatabase):
            raise refused("other", other, "a TerrainDatabase")
        new = known = 0
        with other._read() as source, self._read() as own:
            driven = driven_classes(own) | driven_classes(source)
            found = found_by_others(source, other.name, driven, physics_classes(own))
        with other._read() as source:
            for drive in source.execute(select(table_of(DriveRow)).order_by(DriveRow.id)).all():
                with self._written() as connection:
                    is_new = _is_new(connection, drive._asdict())
                    _insert(connection, ImportRow, _rows_of(source, ImportRow, drive.id))
                    for table in _OBSERVATIONS if is_new else ():
                        _insert(connection, table, _rows_of(source, table, drive.id))
                size = sum(_count(source, table, drive.id) for table in _OBSERVATIONS)
                new, known = (new + size, known) if is_new else (new, known + size)
            with self._written() as connection:
                added = add_rows(connection, found)
        return Added(new + added, known + len(found) - added)

    def drive(self, identity: uuid.UUID) -> Drive | None:
        """Read one drive back, whole, by its `Drive.id`; None where it is not there."""
        table = table_of(DriveRow)
        with self._read() as connection:
            row = connection.execute(select(table).where(table.c.id == identity)).one_or_none()
            return None if row is None else _read_drive(connection, row, senses=None)

    def sites(self) -> list[str]:
        """Names of the sites that drives were made at, sorted."""
        with self._read() as connection:
            return sorted({row.site for row in _drive_rows(connection, None, newest=True)})

    def drives(self, site: str | None = None, *, newest: bool = False) -> list[Drive]:
        """Read the drives back, whole, in the order of their last import.

        Parameters
        ----------
        site
            Only those of this site.
        newest
            Of a recording that was processed several times, only the newest processing: what derived results use.
        """
        with self._read() as connection:
            return [_read_drive(connection, row, senses=None) for row in _drive_rows(connection, site, newest)]

    def snapshot(self, site: str | None = None) -> Snapshot:
        """Derive what is known of a site from its observations and freeze it in memory.

        Parameters
        ----------
        site
            Name of the site; may be left out where the database holds one.

        Raises
        ------
        InputError
            The database holds no such site, or several and none was named.
        """
        known = self.sites()
        if site is None and len(known) > 1:
            raise InputError(self.name, "several sites, each with its own frame", expected="one of " + ", ".join(known))
        if site is not None and site not in known:
            raise InputError(self.name, f"no site {site!r}", expected="one of " + (", ".join(known) or "none yet"))
        site = site if site is not None else (known[0] if known else "")
        with self._read() as connection:
            rows = _drive_rows(connection, site, newest=True)
            physics = {found.class_name: found.physics for found in read_physics(connection, self.name, site)}
            return Snapshot.derive(site, [_read_drive(connection, row, senses=("fused",)) for row in rows], physics)

    @contextmanager
    def _read(self) -> Iterator[Connection]:
        """Open a connection whose faults come out as one line."""
        with self._reached(self._engine.connect) as connection:
            try:
                yield connection
            except (ValueError, RecursionError) as error:
                # The driver decodes numbers, times and JSON as it goes.
                what = f"holds what cannot be read: {error}".splitlines()[0][:200]
                raise InputError(self.name, what, expected="what was stored by bevameter") from error

    @contextmanager
    def _reached(self, opened: Callable[[], AbstractContextManager[Connection]]) -> Iterator[Connection]:
        try:
            with opened() as connection:
                yield connection
        except (DBAPIError, self._engine.dialect.loaded_dbapi.Error) as error:
            raise unreachable(self._engine.url, error) from error

    def _written(self) -> AbstractContextManager[Connection]:
        """Open a transaction: everything or nothing of it is stored, whatever ends it."""
        return self._reached(self._engine.begin)


def _is_new(connection: Connection, row: dict[str, Any]) -> bool:
    """Insert a drive row; False where it is there already. Another process that is adding the same drive is awaited."""
    statement = insertion(connection, DriveRow).returning(table_of(DriveRow).c.id)
    return connection.execute(statement, row).first() is not None


def _in_use(connection: Connection, recording_digest: str) -> uuid.UUID | None:
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


def _insert(connection: Connection, row_type: type[Base], rows: Iterable[dict[str, Any]]) -> None:
    """Insert rows whose identity is not there yet."""
    remaining = iter(rows)
    while chunk := list(islice(remaining, _CHUNK)):
        connection.execute(insertion(connection, row_type), chunk)


def _insert_columns(connection: Connection, row_type: type[Base], columns: Mapping[str, list[Any]]) -> None:
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
    while chunk := list(islice(rows, _CHUNK)):
        given = chunk if dialect.positional else [dict(zip(names, row, strict=True)) for row in chunk]
        connection.exec_driver_sql(str(statement), given)


def _rows_of(connection: Connection, row_type: type[Base], drive_id: uuid.UUID) -> Iterator[dict[str, Any]]:
    table = table_of(row_type)
    result = connection.execution_options(yield_per=_CHUNK).execute(select(table).where(table.c.drive_id == drive_id))
    return (row._asdict() for row in result)


def _count(connection: Connection, row_type: type[Base], drive_id: uuid.UUID) -> int:
    table = table_of(row_type)
    return connection.execute(select(func.count()).where(table.c.drive_id == drive_id)).scalar_one()


def _drive_rows(connection: Connection, site: str | None, newest: bool) -> list[Any]:
    """Drive rows in the order of their last import; with `newest` only the last one of each recording."""
    drive, imported = table_of(DriveRow), table_of(ImportRow)
    last = (
        select(imported.c.drive_id, func.max(imported.c.imported_at).label("last_import"))
        .group_by(imported.c.drive_id)
        .subquery()
    )
    query = select(drive).join(last, last.c.drive_id == drive.c.id).order_by(last.c.last_import, drive.c.id)
    rows = list(connection.execute(query))
    if newest:  # before the site is looked at: a recording may have been processed again under its right site
        rows = list({row.recording_digest: row for row in rows}.values())
    return [row for row in rows if site is None or row.site == site]


def _read_drive(connection: Connection, row: Any, senses: tuple[str, ...] | None) -> Drive:
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
    return drive_of(row, seen.fetchall(), connection.execute(stretches).all())
