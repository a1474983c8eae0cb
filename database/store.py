"""The terrain database: observations go in, a snapshot for the planner comes out."""

from __future__ import annotations

import uuid
from collections.abc import Callable, Collection, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING

from sqlalchemy import Connection, Engine, select
from sqlalchemy.exc import DBAPIError

from ..framework.core.arguments import refused
from ..framework.core.class_names import check_class_names, check_spelling
from ..framework.core.errors import InputError
from .bounds import corners_of, whole_cells
from .connections import begin_reading, check_unchanged, check_writable
from .drive_rows import (
    drive_in_use,
    drive_rows,
    imported,
    insert_columns,
    insert_drive,
    insert_rows,
    is_complete,
    read_drive,
)
from .excerpt import common_cell_size, drives_within
from .frames import SiteFrame, check_origin, check_origins, drive_of_recording, read_frames
from .merge import merge
from .observations import Drive
from .physics import (
    ClassPhysics,
    add_rows,
    driven_classes,
    newest_row,
    physics_classes,
    physics_row,
    read_physics,
    sound_physics,
)
from .reader import SiteReader, rows_in_use
from .rows import drive_row, soil_rows, terrain_columns
from .schema import holds_database, open_engine
from .snapshot import Snapshot
from .storable import check_storable
from .tables import DriveRow, ImportRow, SoilRow, TerrainRow, table_of
from .urls import parse_url, shown, unreachable

if TYPE_CHECKING:
    from ..identification.effects.stored import AugmentedSimulator


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
        A path, or an SQLAlchemy URL such as ``sqlite:///terrain.db`` or ``postgresql://user@host/terrain``. Where there
        is no database yet, the first writing makes one, and until then reading is refused.
    must_exist
        Refuse at once where there is no database; none is made.

    Raises
    ------
    InputError
        The database is missing though it must exist, is another program's, is of a newer version, or cannot be
        reached; nothing was written.
    """

    def __init__(self, url_or_path: str | Path = "sqlite:///terrain.db", *, must_exist: bool = False):
        self._given, self._url = url_or_path, parse_url(url_or_path)
        there = must_exist or holds_database(url_or_path)
        self._engine = open_engine(url_or_path, must_exist=True) if there else None

    @property
    def name(self) -> str:
        """The file's path, or the URL without its password."""
        return shown(self._url)

    @property
    def there(self) -> bool:
        """Whether the database has been made."""
        self._forget_removed_file()
        return self._engine is not None or holds_database(self._given)

    def make(self) -> None:
        """Make the database, empty, where there is none yet; raises `InputError` where that cannot be."""
        self._opened(make=True)

    def _forget_removed_file(self) -> None:
        """Let go of a file that somebody has removed: SQLite would make an empty one."""
        of_file = self._engine is not None and self._url.get_backend_name() == "sqlite"
        if of_file and not Path(str(self._url.database)).exists():
            self.close()
            self._engine = None

    def _opened(self, *, make: bool) -> Engine:
        self._forget_removed_file()
        if self._engine is None:
            self._engine = open_engine(self._given, must_exist=not make)
        return self._engine

    def close(self) -> None:
        """Let go of all connections; the object can still be used, and then opens new ones."""
        if self._engine is not None:
            self._engine.dispose()

    def __enter__(self) -> TerrainDatabase:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def add_drive(self, drive: Drive) -> Added:
        """Add a drive's observations, all or none of them; a drive that is there already adds nothing.

        Of a drive that a merge has not finished bringing, what lacks is added. Where its recording was processed
        otherwise since, a drive that is there already becomes the processing in use again.

        Raises
        ------
        InputError
            A class of the drive is `unknown`, or two of them differ in case or spaces only; a text or number of it is
            none that every database takes, or an estimate that of no soil; drives of other recordings have another
            origin of its site; the database cannot be written.
        """
        if not isinstance(drive, Drive):
            raise refused("drive", drive, "a Drive")
        check_storable(drive)
        of_soils = (name for soil in drive.soils for name in soil.class_probabilities)
        check_class_names([*drive.terrain.evidence.classes, *of_soils], f"drive {drive.name!r}", "classes")
        total = len(drive.terrain) + len(drive.soils)
        moment = {"id": uuid.uuid4(), "drive_id": drive.id, "imported_at": datetime.now(UTC)}
        with self.writing() as connection:
            if not insert_drive(connection, drive_row(drive)) and is_complete(connection, drive.id):
                if drive_in_use(connection, drive.recording_digest) != drive.id:
                    check_origin(connection, self.name, drive)
                    insert_rows(connection, ImportRow, [moment])
                return Added(0, total)
            check_origin(connection, self.name, drive)
            new = insert_columns(connection, TerrainRow, terrain_columns(drive))
            new += insert_rows(connection, SoilRow, soil_rows(drive))
            insert_rows(connection, ImportRow, [moment])
        return Added(new, total - new)

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
        self.make()
        self.check_class(class_name)
        with self.reading() as connection:
            newest = newest_row(connection, class_name, site)
        found = replace(found, physics=sound_physics(physics, f"physics of {class_name}"))
        if time is None and newest is not None:
            again = replace(found, source=newest.source, observed_at=newest.observed_at)
            if again.id == newest.id:
                return Added(0, 1)
        with self.writing() as connection:
            new = add_rows(connection, [physics_row(found)])
        return Added(new, 1 - new)

    def physics(self, class_name: str | None = None) -> list[ClassPhysics]:
        """Read the physics of classes back, oldest first; of one class where one is named.

        Raises
        ------
        InputError
            The database cannot be read, or holds what is no physics.
        """
        with self.reading() as connection:
            found = read_physics(connection, self.name)
        return [each for each in found if class_name in (None, each.class_name)]

    def merge(
        self,
        other: TerrainDatabase,
        *,
        sites: Collection[str] | None = None,
        progress: Callable[[str, float], None] | None = None,
    ) -> Added:
        """Add every observation of another database, physics of classes included: set union by identity.

        A drive comes in portions of `merge.PORTION` rows, each of them a transaction, and nothing derived uses it
        before the last one is there. An interrupted merge has brought whole drives and a part of one; the same merge
        again goes on from there. Only what differs is sent: of a drive that is here already, observations that are
        lacking. Drives that are not complete in the other database are left out.

        Parameters
        ----------
        other
            Where the observations come from; it is not changed.
        sites
            Only recordings that were made at these, and physics that holds there or anywhere; all where absent.
        progress
            Called with ``"merging"`` and the share of the drives that is done; what it raises ends the merge.

        Raises
        ------
        InputError
            The other database has no such site, or another origin of a site that both have; it cannot be read, or holds
            physics that is not here and that
            `add_physics` refuses (of a class as the drives of both spell it): nothing is merged then. Or one of the two
            cannot be reached any more, with the number of drives that are complete.
        """
        if not isinstance(other, TerrainDatabase):
            raise refused("other", other, "a TerrainDatabase")
        if sites is not None:
            if not isinstance(sites, Collection) or isinstance(sites, str) or not sites:
                raise refused("sites", sites, "names of sites")
            for site in sites:
                other.check_site(site)
        report = progress or (lambda stage, share: None)
        with other.reading() as theirs:  # what cannot be read leaves no new database behind
            if self.there:
                with self.reading() as own:
                    check_origins(theirs, other.name, own, self.name, sites)
            self.make()
        return Added(*merge(other, self, None if sites is None else sorted(set(sites)), report))

    def drive(self, identity: uuid.UUID) -> Drive | None:
        """Read one drive back by its `Drive.id`; None where it is not there, whole."""
        table = table_of(DriveRow)
        with self.reading() as connection:
            row = connection.execute(select(table).where(table.c.id == identity, imported(table))).one_or_none()
            return None if row is None else read_drive(connection, row, senses=None)

    def drive_ids(self) -> frozenset[uuid.UUID]:
        """Identities (`Drive.id`) of all drives that are there, whole, whichever processing of a recording they are."""
        table = table_of(DriveRow)
        with self.reading() as connection:
            return frozenset(connection.execute(select(table.c.id).where(imported(table))).scalars())

    def frames(self) -> dict[str, SiteFrame]:
        """Frames of the sites that places were observed at."""
        with self.reading() as connection:
            return read_frames(connection)

    def recorded(self, recording_digest: str) -> Drive | None:
        """Give the drive in use of a recording, without its observations; None where there is none."""
        with self.reading() as connection:
            return drive_of_recording(connection, recording_digest)

    def sites(self) -> list[str]:
        """Names of the sites that drives were made at, sorted."""
        with self.reading() as connection:
            return sorted({row.site for row in drive_rows(connection, None, newest=True)})

    def check_site(self, site: str) -> None:
        """Refuse the name of a site that no drive was made at, with those that there are; raises `InputError`."""
        with self.reading() as connection:
            rows_in_use(connection, self.name, site)

    def check_class(self, class_name: str, source: str = "class_name") -> None:
        """Refuse a name that no class may have, and one that differs in case or spaces only from a class that is known.

        Raises
        ------
        InputError
            It names `source`, and the spelling that is known.
        """
        with self.reading() as connection:
            check_spelling(class_name, (driven_classes(connection), physics_classes(connection)), source)

    def drives(self, site: str | None = None, *, newest: bool = False) -> list[Drive]:
        """Read the drives back, whole, in the order of their last import.

        Parameters
        ----------
        site
            Only those of this site.
        newest
            Of a recording that was processed several times, only the newest processing: what derived results use.
        """
        with self.reading() as connection:
            return [read_drive(connection, row, senses=None) for row in drive_rows(connection, site, newest)]

    def snapshot(self, site: str | None = None, *, bounds: Sequence[float] | None = None) -> Snapshot:
        """Derive what is known of a site from its observations and freeze it in memory.

        Parameters
        ----------
        site
            Name of the site; may be left out where the database holds one.
        bounds
            Corners x0, y0, x1, y1 [m] with x0 <= x1 and y0 <= y1: only cells that they cut are read, of a spatial index
            where there is one. Answers there are those of the whole snapshot, soils included; elsewhere nothing is
            known, and the reason says that it is outside. The whole site if absent.

        Raises
        ------
        InputError
            The database holds no such site, or several and none was named; or the bounds are none.
        """
        if bounds is None:
            return self.reader(site).snapshot()
        corners = corners_of(bounds, extended=False)
        with self.reading() as connection:
            site, rows = rows_in_use(connection, self.name, site)
            size = common_cell_size(connection, rows)
            corners = whole_cells(corners, size)
            drives = drives_within(connection, site, rows, corners, size)
            physics = {found.class_name: found.physics for found in read_physics(connection, self.name, site)}
        return Snapshot.derive(site, drives, physics, cell_size_m=size, bounds=corners)

    def reader(self, site: str | None = None) -> SiteReader:
        """Give a reader of a site, whose snapshots after the first read only what is new; else as `snapshot`."""
        return SiteReader(self, site)

    @contextmanager
    def reading(self) -> Iterator[Connection]:
        """Open a connection that sees the database as it is at its first statement, whatever others write meanwhile.

        Faults come out as one line.
        """
        with self._reached(self._opened(make=False).connect) as connection:
            try:
                begin_reading(connection)
                yield connection
            except (ValueError, RecursionError) as error:
                # The driver decodes numbers, times and JSON as it goes.
                what = f"holds what cannot be read: {error}".splitlines()[0][:200]
                raise InputError(self.name, what, expected="what was stored by bevameter") from error
            check_unchanged(connection)

    @contextmanager
    def _reached(self, opened: Callable[[], AbstractContextManager[Connection]]) -> Iterator[Connection]:
        try:
            with opened() as connection:
                yield connection
        except (DBAPIError, self._opened(make=False).dialect.loaded_dbapi.Error) as error:
            raise unreachable(self._url, error) from error

    @contextmanager
    def writing(self) -> Iterator[Connection]:
        """Open a transaction: everything or nothing of it is stored, whatever ends it."""
        with self._reached(self._opened(make=True).begin) as connection:
            check_writable(connection)
            yield connection

    @contextmanager
    def committing(self) -> Iterator[Connection]:
        """Open a connection of which all is stored that was done before a `commit`."""
        with self._reached(self._opened(make=True).connect) as connection:
            check_writable(connection)
            yield connection
