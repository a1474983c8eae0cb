"""What a terrain database holds: sites, drives, observations, classes and physics; no look is read whole."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
from sqlalchemy import Connection, func, select

from ..framework.core.errors import InputError
from ..framework.core.origin import Origin
from ..framework.core.pooling import cell_keys
from .belief import cells_on_grid
from .drive_rows import drive_rows, imported
from .frames import origin_of
from .observations import SENSES
from .posterior import measured_class
from .rows import soil_observation
from .schema import REVISIONS, check_known, opened_as_it_is, revision_of, tables_of
from .spatial import has_spatial_index
from .stored_rows import UNREADABLE
from .tables import DriveRow, PhysicsRow, SoilRow, TerrainRow, table_of
from .urls import parse_url, shown


@dataclass(frozen=True)
class SiteInfo:
    """What a database holds of one site: of each recording its newest processing.

    Parameters
    ----------
    site
        Its name.
    drives, superseded
        Recordings, and earlier processings of recordings that a newer one, here or at another site, has replaced [-].
    looks
        Looks at cells, by sense [-].
    stretches, stretches_with_soil
        Stretches of slow driving, and those of them on which soil of a class was measured [-].
    cells
        Ground cells that the fused looks cover, on the common grid [-].
    first, last
        Times of the earliest and of the latest observation; None where no drive has a start time.
    bounds_m
        Least x and y, greatest x and y of all cells seen [m]; None where none was.
    classes, classes_with_soil
        Names of the classes that drives brought, and of those whose soil was measured.
    origin
        Where on Earth the site's frame lies; None where nobody knows.
    """

    site: str
    drives: int
    superseded: int
    looks: Mapping[str, int]
    stretches: int
    stretches_with_soil: int
    cells: int
    first: datetime | None
    last: datetime | None
    bounds_m: tuple[float, float, float, float] | None
    classes: tuple[str, ...]
    classes_with_soil: tuple[str, ...]
    origin: Origin | None

    def as_dict(self) -> dict[str, Any]:
        """Everything in types of JSON, times in ISO 8601."""
        times = {
            name: None if time is None else time.isoformat()
            for name, time in (("first", self.first), ("last", self.last))
        }
        lists = {name: list(getattr(self, name)) for name in ("classes", "classes_with_soil")}
        bounds = None if self.bounds_m is None else list(self.bounds_m)
        origin = None if self.origin is None else asdict(self.origin)
        return {**vars(self), **times, **lists, "looks": dict(self.looks), "bounds_m": bounds, "origin": origin}


@dataclass(frozen=True)
class PhysicsInfo:
    """Physics stored of a class at a site (empty: anywhere): how many, and when the newest was found."""

    class_name: str
    site: str
    stored: int
    newest: datetime

    def as_dict(self) -> dict[str, Any]:
        """Everything in types of JSON."""
        return {"class": self.class_name, "site": self.site, "stored": self.stored, "newest": self.newest.isoformat()}


@dataclass(frozen=True)
class DatabaseInfo:
    """What a database holds.

    Parameters
    ----------
    database, schema
        Its name, and the version of its schema.
    size_bytes
        Size on disk: of an SQLite file and its log, or of the tables of a server.
    sites, physics
        By site; by class and site.
    unfinished_drives
        Drives that a merge has brought a part of: they count nowhere else, and nothing uses them.
    spatial_index
        Is there one? On PostgreSQL servers with PostGIS.
    """

    database: str
    schema: str
    size_bytes: int
    sites: tuple[SiteInfo, ...]
    physics: tuple[PhysicsInfo, ...]
    unfinished_drives: int
    spatial_index: bool

    @property
    def newest_schema(self) -> str:
        """The newest schema that this version knows."""
        return REVISIONS[-1]

    def as_dict(self) -> dict[str, Any]:
        """Everything in types of JSON."""
        lists = {name: [each.as_dict() for each in getattr(self, name)] for name in ("sites", "physics")}
        return {"database": self.database, "schema_version": self.schema, "newest_schema_version": self.newest_schema,
                "size_bytes": self.size_bytes, "unfinished_drives": self.unfinished_drives,
                "spatial_index": self.spatial_index, **lists}  # fmt: skip


@dataclass(frozen=True)
class _Looks:
    """What the looks of one sense of one drive span."""

    sense: str
    count: int
    first_s: float
    last_s: float
    cells: tuple[int, int, int, int]


def info(url_or_path: str | Path) -> DatabaseInfo:
    """Say what a terrain database holds; nothing is changed, and no older schema migrated.

    Raises
    ------
    InputError
        No such database, not one of ours, of a newer version, or damaged: see `check.check`.
    """
    with opened_as_it_is(url_or_path) as connection:
        name = shown(parse_url(url_or_path))
        revision = revision_of(connection)
        if revision is None:
            raise InputError(name, "states no version of its schema", expected=f"schema {REVISIONS[-1]} or older")
        check_known(revision, name)
        try:
            drives, in_use = (drive_rows(connection, None, newest, revision) for newest in (False, True))
            spans = _spans(connection)
            sites = [_site(connection, site, drives, in_use, spans) for site in sorted({row.site for row in drives})]
            physics = _physics(connection) if PhysicsRow.__tablename__ in tables_of(revision) else ()
        except UNREADABLE as error:
            raise InputError(name, f"holds what cannot be read: {error}", expected="what was stored") from error
        return DatabaseInfo(
            name, revision, _size(connection), tuple(sites), physics, _unfinished(connection),
            has_spatial_index(connection),
        )  # fmt: skip


def _unfinished(connection: Connection) -> int:
    drive = table_of(DriveRow)
    return connection.execute(select(func.count()).select_from(drive).where(~imported(drive))).scalar_one()


def _spans(connection: Connection) -> dict[Any, list[_Looks]]:
    """Number and extent of each drive's looks, by drive."""
    table = table_of(TerrainRow)
    query = select(
        table.c.drive_id, table.c.sense, func.count(), func.min(table.c.time_s), func.max(table.c.time_s),
        func.min(table.c.cell_x), func.min(table.c.cell_y), func.max(table.c.cell_x), func.max(table.c.cell_y),
    ).group_by(table.c.drive_id, table.c.sense)  # fmt: skip
    spans: dict[Any, list[_Looks]] = {}
    for drive_id, sense, count, first, last, *cells in connection.execute(query):
        spans.setdefault(drive_id, []).append(_Looks(sense, count, first, last, tuple(cells)))
    return spans


def _site(
    connection: Connection, site: str, drives: Sequence[Any], in_use: Sequence[Any], spans: Mapping[Any, list[_Looks]]
) -> SiteInfo:
    here = [row for row in in_use if row.site == site]
    looks: Counter[str] = Counter()
    moments: list[datetime] = []
    corners: list[np.ndarray] = []
    soils = []
    for row in here:
        ours = spans.get(row.id, [])
        stretches = _stretches(connection, row.id)
        soils += stretches
        for each in ours:
            looks[each.sense] += each.count
            corners.append(np.add(each.cells, (0, 0, 1, 1)) * row.cell_size_m)
        times = [time for each in ours for time in (each.first_s, each.last_s)]
        times += [time for soil in stretches for time in (soil.start_s, soil.end_s)]
        if row.start_time is not None and times:
            start = row.start_time.timestamp()
            moments += [datetime.fromtimestamp(start + time, UTC) for time in (min(times), max(times))]
    boxes = np.array(corners).reshape(-1, 4)
    bounds = (*boxes[:, :2].min(axis=0).tolist(), *boxes[:, 2:].max(axis=0).tolist()) if len(boxes) else None
    measured = [name for soil in soils if (name := measured_class(soil)) is not None]
    return SiteInfo(
        site=site,
        drives=len(here),
        superseded=sum(row.site == site for row in drives) - len(here),
        looks={sense: looks[sense] for sense in SENSES},
        stretches=len(soils),
        stretches_with_soil=len(measured),
        cells=_cells(connection, [row for row in here if row.id in spans]),
        first=min(moments, default=None),
        last=max(moments, default=None),
        bounds_m=bounds,
        classes=tuple(sorted({*_names(row.classes for row in here), *measured})),
        classes_with_soil=tuple(sorted(set(measured))),
        origin=origin_of(here),
    )


def _stretches(connection: Connection, drive_id: Any) -> list[Any]:
    table = table_of(SoilRow)
    return [soil_observation(row) for row in connection.execute(select(table).where(table.c.drive_id == drive_id))]


def _names(given: Iterable[Sequence[str]]) -> set[str]:
    return {name for names in given for name in names}


def _cells(connection: Connection, drives: Sequence[Any]) -> int:
    """Count the cells of the common grid that fused looks of drives cover."""
    table = table_of(TerrainRow)
    common = max((row.cell_size_m for row in drives), default=math.nan)
    keys = []
    for row in drives:
        query = select(table.c.cell_x, table.c.cell_y).where(table.c.drive_id == row.id, table.c.sense == "fused")
        places = np.array([tuple(each) for each in connection.execute(query.distinct())]).reshape(-1, 2)
        keys.append(cell_keys(cells_on_grid(places[:, 0], places[:, 1], row.cell_size_m, common)))
    return len(np.unique(np.concatenate(keys))) if keys else 0


def _physics(connection: Connection) -> tuple[PhysicsInfo, ...]:
    table = table_of(PhysicsRow)
    each = (table.c.class_name, table.c.site)
    query = select(*each, func.count(), func.max(table.c.observed_at)).group_by(*each).order_by(*each)
    return tuple(PhysicsInfo(*row) for row in connection.execute(query))


def _size(connection: Connection) -> int:
    url = connection.engine.url
    if url.get_backend_name() == "sqlite":
        pages = connection.exec_driver_sql("PRAGMA page_count").scalar_one()
        return pages * connection.exec_driver_sql("PRAGMA page_size").scalar_one()
    sizes = (func.pg_total_relation_size(func.to_regclass(name)) for name in tables_of(REVISIONS[-1]))
    return sum(connection.execute(select(func.coalesce(size, 0))).scalar_one() for size in sizes)
