"""Drives of a site with those of their looks alone that lie within bounds: large sites are read in part."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from typing import Any

import numpy as np
from sqlalchemy import ColumnElement, Connection, select

from .belief import cells_on_grid
from .bounds import Corners, cells_outside
from .observations import Drive
from .rows import TERRAIN_COLUMNS, drive_of
from .spatial import has_spatial_index, lies_within
from .stored_rows import text_of
from .tables import DriveRow, SoilRow, TerrainRow, table_of


def common_cell_size(connection: Connection, rows: Sequence[Any]) -> float:
    """Cell size of the common grid of drives, as `belief.grid_size` has it [m]; their looks are not read."""
    drive, terrain = table_of(DriveRow), table_of(TerrainRow)
    fused = select(terrain.c.id).where(terrain.c.drive_id == drive.c.id, terrain.c.sense == "fused").exists()
    there = set(connection.execute(select(drive.c.id).where(fused)).scalars())
    return max((row.cell_size_m for row in rows if row.id in there), default=1.0)


def drives_within(
    connection: Connection, site: str, rows: Sequence[Any], bounds: Corners, cell_size_m: float
) -> list[Drive]:
    """Read drives back by their rows, all of one site: all soils, and the fused looks at cells within bounds.

    Parameters
    ----------
    bounds
        Of whole cells (`whole_cells`).
    cell_size_m
        Edge of a cell of the common grid [m].
    """
    drive, terrain, soil = (table_of(each) for each in (DriveRow, TerrainRow, SoilRow))
    x0, y0, x1, y1 = bounds
    # One cell wider, for rounding; then which are within is found out as a snapshot does.
    box = (x0 - cell_size_m, y0 - cell_size_m, x1 + cell_size_m, y1 + cell_size_m)
    near = lies_within(box) if has_spatial_index(connection) else _lies_within(box)
    query = (
        select(terrain.c.drive_id, *(terrain.c[name] for name in TERRAIN_COLUMNS))
        .join(drive, drive.c.id == terrain.c.drive_id)
        .where(drive.c.site == site, terrain.c.sense == "fused", near)
    )
    looks: dict[str, list[tuple]] = defaultdict(list)
    cursor = connection.execute(query).cursor
    assert cursor is not None  # as the driver gives them: see `drive_rows.read_drive`
    for drive_id, *look in cursor.fetchall():
        looks[text_of(drive_id)].append(tuple(look))
    stretches: dict[Any, list[Any]] = defaultdict(list)
    query = select(soil).join(drive, drive.c.id == soil.c.drive_id).where(drive.c.site == site)
    for stretch in connection.execute(query.order_by(soil.c.start_s, soil.c.id)):
        stretches[stretch.drive_id].append(stretch)
    return [
        drive_of(row, [_within(looks[row.id.hex], row.cell_size_m, bounds, cell_size_m)], stretches[row.id])
        for row in rows
    ]


def _lies_within(box: Corners) -> ColumnElement[bool]:
    """As `spatial.lies_within`, without an index."""
    drive, terrain = table_of(DriveRow), table_of(TerrainRow)
    x, y = ((terrain.c[name] + 0.5) * drive.c.cell_size_m for name in ("cell_x", "cell_y"))
    x0, y0, x1, y1 = box
    return x.between(x0, x1) & y.between(y0, y1)


def _within(looks: list[tuple], own_m: float, bounds: Corners, cell_size_m: float) -> list[tuple]:
    """Keep the looks (`TERRAIN_COLUMNS`) of a drive of a cell size of its own [m] that are within bounds."""
    if not looks:
        return []
    x, y = (np.array([look[TERRAIN_COLUMNS.index(name)] for look in looks]) for name in ("cell_x", "cell_y"))
    beyond = cells_outside(cells_on_grid(x, y, own_m, cell_size_m), bounds, cell_size_m)
    return [look for look, far in zip(looks, beyond.tolist(), strict=True) if not far]
