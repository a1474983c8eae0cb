"""A snapshot as a regular raster, for planners on graphs and for the formats that hold rasters."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np

from ..framework.core.arguments import number, refused, shown
from ..framework.core.errors import InputError
from .bounds import corners_of

if TYPE_CHECKING:
    from .answer import GroundAnswer
    from .snapshot import Snapshot

MOST_CELLS = 16_000_000
"""Largest grid: 4000 by 4000 cells, 128 MB a layer."""

_ROUNDING = 1e-9
"""Share of a cell by which a side may exceed whole cells and need no further one [-]: rounding of the division."""


def _where_known(values: Callable[[GroundAnswer], np.ndarray]) -> Callable[[GroundAnswer], np.ndarray]:
    return lambda answer: np.where(answer.known, values(answer), np.nan)


_LAYERS: Mapping[str, Callable[[GroundAnswer], np.ndarray]] = {
    "class_index": lambda answer: np.where(answer.class_index >= 0, answer.class_index, np.nan),
    "known": lambda answer: answer.known.astype(float),
    "cohesion": lambda answer: answer.cohesion,
    "friction_angle": lambda answer: answer.friction_angle,
    "shear_strength": lambda answer: answer.shear_strength,
    "shear_strength_lower": lambda answer: answer.shear_strength_lower,
    "age": lambda answer: answer.age,
    "observation_count": lambda answer: answer.observation_count.astype(float),
    "extrapolated": _where_known(lambda answer: answer.extrapolated),
}

LAYERS = tuple(_LAYERS)
"""Layers that a grid may have: the columns of a `GroundAnswer` that are one number a cell."""

UNITS: Mapping[str, str] = {
    "cohesion": "Pa",
    "friction_angle": "rad",
    "shear_strength": "Pa",
    "shear_strength_lower": "Pa",
    "age": "s",
}
"""Units of the layers that have one."""


@dataclass(frozen=True)
class Grid:
    """A raster of square cells, immutable: row 0 lies in the south, column 0 in the west.

    Element ``[i, j]`` of a layer is of the cell ``[x0 + j r, x0 + (j + 1) r) x [y0 + i r, y0 + (i + 1) r)``, with
    (x0, y0) the origin and r the resolution: rows run along +y, columns along +x, as in nav_msgs/OccupancyGrid.

    Parameters
    ----------
    site
        Name of the site whose frame x and y are of.
    origin
        South-west corner x0, y0 [m].
    resolution
        Edge of a cell [m].
    shape
        Rows and columns (h, w).
    layers
        By name, (h, w) float; NaN where unknown. ``known`` and ``extrapolated`` are 0 or 1, and the latter is NaN where
        the soil is unknown. ``class_index`` counts in `class_names`. ``observation_count`` is 0 where nobody was.
    class_names
        The k classes.
    normal_stress, confidence
        At which the strengths hold [Pa], [-].
    time_s
        Moment that ages refer to, POSIX seconds.
    """

    site: str
    origin: tuple[float, float]
    resolution: float
    shape: tuple[int, int]
    layers: Mapping[str, np.ndarray]
    class_names: tuple[str, ...]
    normal_stress: float
    confidence: float
    time_s: float

    @property
    def x(self) -> np.ndarray:
        """(w,): x of the cells' centres, by column [m]."""
        return _centres(self.origin[0], self.shape[1], self.resolution)

    @property
    def y(self) -> np.ndarray:
        """(h,): y of the cells' centres, by row [m]."""
        return _centres(self.origin[1], self.shape[0], self.resolution)

    def layer(self, name: str) -> np.ndarray:
        """Give a layer (h, w); raises `InputError` where the grid lacks it."""
        if name not in self.layers:
            raise InputError("layer", shown(name), expected="one of " + ", ".join(self.layers))
        return self.layers[name]


def rasterise(
    view: Snapshot,
    bounds: Sequence[float],
    resolution: float,
    layers: Sequence[str],
    *,
    normal_stress: float,
    confidence: float,
    now: float | datetime | None,
    half_life: float | None,
) -> Grid:
    """Sample a snapshot at the centres of a raster's cells; `Snapshot.grid` is its door."""
    x0, y0, x1, y1 = corners_of(bounds, extended=True)
    edge = number("resolution", resolution, "a length [m]")
    if not (math.isfinite(edge) and edge > 0):
        raise refused("resolution", resolution, "a finite, positive length [m]")
    names = _names(layers)
    shape = _shape(x1 - x0, y1 - y0, edge)
    places = np.empty((*shape, 2))
    places[:, :, 0], places[:, :, 1] = _centres(x0, shape[1], edge), _centres(y0, shape[0], edge)[:, None]
    answer = view.along(
        places.reshape(-1, 2), normal_stress=normal_stress, confidence=confidence, now=now, half_life=half_life
    )
    found = {name: _LAYERS[name](answer).reshape(shape) for name in names}
    for layer in found.values():
        layer.setflags(write=False)
    return Grid(
        view.site, (x0, y0), edge, shape, MappingProxyType(found), view.class_names, answer.normal_stress,
        answer.confidence, answer.moment,
    )  # fmt: skip


def _centres(start: float, count: int, edge: float) -> np.ndarray:
    return start + (np.arange(count) + 0.5) * edge


def _names(layers: Sequence[str]) -> tuple[str, ...]:
    expected = "names among " + ", ".join(LAYERS)
    if isinstance(layers, str) or not isinstance(layers, Sequence) or not layers:
        raise refused("layers", layers, expected)
    for name in layers:
        if name not in LAYERS:
            raise refused("layers", name, expected)
    return tuple(dict.fromkeys(layers))


def _shape(width: float, height: float, resolution: float) -> tuple[int, int]:
    """Rows and columns that cover a width and a height [m]; the last ones may reach beyond."""
    rows, columns = (max(side / resolution - _ROUNDING, 1.0) for side in (height, width))
    if not rows * columns <= MOST_CELLS:  # nor is infinity
        raise InputError(
            "grid",
            f"{width:g} m by {height:g} m at {resolution:g} m are {rows * columns:.3g} cells",
            expected=f"at most {MOST_CELLS}: smaller bounds or a coarser resolution",
        )
    return math.ceil(rows), math.ceil(columns)
