"""What `bevameter db` prints."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

from .printing import counted, print_table

if TYPE_CHECKING:
    from ...database.info import DatabaseInfo, SiteInfo

PRUNED_COLUMNS = ("what", "id", "site", "name", "observations")

_BOUNDS = ("x_min_m", "y_min_m", "x_max_m", "y_max_m")
_ORIGIN = ("latitude_deg", "longitude_deg", "heading_deg")
_OBSERVATIONS = ("terrain_observation", "soil_observation")


def print_info(found: DatabaseInfo) -> None:
    """Print a database: one row a site, one a class and site with physics."""
    newest = "" if found.schema == found.newest_schema else f" (newest: {found.newest_schema})"
    print(f"{found.database}: schema {found.schema}{newest}, {found.size_bytes / 1e6:.1f} MB{_indexed(found)}")
    print_table(
        ["site", "drives", "superseded", "looks", "stretches", "cells", "time (UTC)", "x, y [m]", "classes"],
        [
            [
                site.site, str(site.drives), str(site.superseded), _looks(site),
                f"{site.stretches}, {site.stretches_with_soil} with soil", str(site.cells), _span(site), _box(site),
                ", ".join(f"{name} (soil)" if name in site.classes_with_soil else name for name in site.classes),
            ]
            for site in found.sites
        ],
        empty="no drives",
    )  # fmt: skip
    for site in found.sites:
        if site.origin is not None:
            print(f"site {site.site!r}: x = y = 0 lies at {site.origin}")
    if found.unfinished_drives:
        print(f"drives that are not complete, and that nothing uses: {found.unfinished_drives}")
    print_table(
        ["physics of class", "site", "stored", "newest (UTC)"],
        [[each.class_name, each.site or "any", str(each.stored), _time(each.newest)] for each in found.physics],
        empty="no physics",
    )


def sites_as_rows(found: DatabaseInfo) -> tuple[list[dict[str, Any]], list[str]]:
    """Give a row for each site, and its columns, one a sense and a bound; classes are divided by semicolons."""
    from ...database.observations import SENSES

    looks = {sense: f"looks_{sense}" for sense in SENSES}
    rows = []
    for site in found.sites:
        row = site.as_dict()
        bounds = dict(zip(_BOUNDS, row.pop("bounds_m") or (), strict=False))
        counts = {looks[sense]: count for sense, count in row.pop("looks").items()}
        classes = {name: ";".join(row.pop(name)) for name in ("classes", "classes_with_soil")}
        origin = row.pop("origin") or {}
        rows.append(row | counts | bounds | classes | origin)
    plain = ["site", "drives", "superseded", "stretches", "stretches_with_soil", "cells", "first", "last"]
    return rows, [*plain, *looks.values(), *_BOUNDS, "classes", "classes_with_soil", *_ORIGIN]


def print_check(faults: Sequence[Mapping[str, str]], rows: Mapping[str, int]) -> None:
    """Print one line a fault, or that there is none."""
    _print_faults(faults)
    if faults:
        print(f"{counted(len(faults), 'fault')} in {_counted(rows)}")
    else:
        print(f"sound: {_counted(rows)}")


def print_rebuilt(faults: Sequence[Mapping[str, str]], rows: Mapping[str, int], new: Path) -> None:
    """Print one line a fault, and what the new file holds."""
    _print_faults(faults)
    print(f"{new}: {_counted(rows)}")


def print_pruned(rows: Sequence[Mapping[str, Any]], *, removed: bool) -> None:
    """Print what was removed, or would be."""
    cells = [["" if row[name] is None else str(row[name]) for name in PRUNED_COLUMNS] for row in rows]
    print_table(PRUNED_COLUMNS, cells, empty="nothing is superseded")
    if rows:
        print("removed" if removed else "nothing was removed; --yes removes this for good")


def _print_faults(faults: Sequence[Mapping[str, str]]) -> None:
    for fault in faults:
        where = " ".join(part for part in (fault["table"], fault["id"]) if part)
        print(f"{where}: {fault['problem']}" if where else fault["problem"])


def _counted(rows: Mapping[str, int]) -> str:
    drives, physics = rows.get("drive", 0), rows.get("class_physics", 0)
    observations = sum(rows.get(name, 0) for name in _OBSERVATIONS)
    return f"{counted(drives, 'drive')}, {counted(observations, 'observation')}, {physics} physics of classes"


def _indexed(found: DatabaseInfo) -> str:
    """Say whether a server has a spatial index; a file has none."""
    if not found.database.startswith("postgresql"):
        return ""
    return ", spatial index" if found.spatial_index else ", no spatial index"


def _looks(site: SiteInfo) -> str:
    return ", ".join(f"{sense} {count}" for sense, count in site.looks.items() if count) or "none"


def _span(site: SiteInfo) -> str:
    return "unknown" if site.first is None or site.last is None else f"{_time(site.first)} to {_time(site.last)}"


def _box(site: SiteInfo) -> str:
    if site.bounds_m is None:
        return "none"
    x0, y0, x1, y1 = site.bounds_m
    return f"{x0:g} to {x1:g}, {y0:g} to {y1:g}"


def _time(moment: datetime) -> str:
    return moment.strftime("%Y-%m-%d %H:%M:%S")
