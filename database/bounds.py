"""Bounds of a part of a site, in whole cells."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from ..framework.core.arguments import number, refused
from ..framework.core.pooling import LARGEST_CELL_INDEX

Corners = tuple[float, float, float, float]
"""x0, y0, x1, y1 [m]."""


def corners_of(bounds: Sequence[float], *, extended: bool) -> Corners:
    """Check corners; where they are to be `extended`, x0 < x1 and y0 < y1. Raises `InputError`."""
    expected = f"x0, y0, x1, y1 [m] with {'x0 < x1 and y0 < y1' if extended else 'x0 <= x1 and y0 <= y1'}"
    try:
        x0, y0, x1, y1 = (number("bounds", each, expected) for each in bounds)
    except (TypeError, ValueError):
        raise refused("bounds", bounds, expected) from None
    ordered = (x0 < x1 and y0 < y1) if extended else (x0 <= x1 and y0 <= y1)
    if not (all(map(math.isfinite, (x0, y0, x1, y1))) and ordered):
        raise refused("bounds", (x0, y0, x1, y1), expected)
    return x0, y0, x1, y1


def whole_cells(bounds: Corners, cell_size_m: float) -> Corners:
    """Widen bounds to the edges of the cells that they cut."""
    cells = np.clip(np.floor(np.array(bounds) / cell_size_m), -LARGEST_CELL_INDEX, LARGEST_CELL_INDEX)
    x0, y0, x1, y1 = cells.tolist()
    return x0 * cell_size_m, y0 * cell_size_m, (x1 + 1) * cell_size_m, (y1 + 1) * cell_size_m


def outside(places: np.ndarray, bounds: Corners, cell_size_m: float) -> np.ndarray:
    """(n,) bool: which places (n, 2) [m] are in none of the cells within bounds of whole cells."""
    return cells_outside(np.floor(places / cell_size_m), bounds, cell_size_m)


def cells_outside(cells: np.ndarray, bounds: Corners, cell_size_m: float) -> np.ndarray:
    """(n,) bool: which cells (n, 2) are not within bounds of whole cells."""
    x0, y0, x1, y1 = np.rint(np.array(bounds) / cell_size_m)
    x, y = cells.T
    return (x < x0) | (x >= x1) | (y < y0) | (y >= y1)
