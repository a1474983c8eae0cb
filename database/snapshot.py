"""The planner's view: everything that is known of a site, frozen in memory; no SQL behind its answers."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from functools import cached_property
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from ..framework.core.arguments import number, numbers, refused, shown
from ..framework.core.errors import InputError
from ..framework.core.origin import Origin
from ..framework.core.pooling import LARGEST_CELL_INDEX, cell_keys, cells_from_keys
from .answer import GroundAnswer
from .belief import Cells, classes_of, combine, grid_size, keys_of, put_in
from .bounds import Corners
from .cell_index import CellIndex
from .freezing import freeze
from .grid import LAYERS, Grid, rasterise
from .ground_table import GroundTable
from .observations import Drive
from .posterior import ClassSoil, class_soils

if TYPE_CHECKING:
    from ..identification.effects.stored import AugmentedSimulator

DEFAULT_NORMAL_STRESS = 20e3
"""Normal stress [Pa] at which strength is given where nobody says: about what a light rover's wheel exerts."""

_GREATEST_STRESS = 1e9
"""No wheel presses harder [Pa]."""

_TABLES, _REMEMBERED = 8, 64
"""Most tables of all cells, and most other results, that are kept."""


@dataclass(frozen=True)
class Snapshot:
    """What is known of one site, immutable: threads may share it, and what is learnt later does not change it.

    Places are in the site's frame [m]. Answers cover all places, unknown ones included (`GroundAnswer.known`).

    Parameters
    ----------
    site
        Name of the site; empty where the database holds no drive.
    cell_size_m
        Edge of a ground cell [m].
    class_names
        The k classes, sorted.
    cells
        Belief over classes by ground cell.
    soils
        What is known of the soil, by class; a class whose soil was not measured is absent.
    drives
        Number of drives that it rests on (newest processing of each recording).
    physics
        By class, what the textbook wheel lacks on it, with the soil that goes with that: predictions of the wheel use
        it (`mobility`); a class without is the textbook's.
    bounds
        Corners x0, y0, x1, y1 [m] of the cells that it was limited to; None where it covers all ground of the site.
    origin
        Where on Earth x = y = 0 lies; None where no drive says it.
    """

    site: str
    cell_size_m: float
    class_names: tuple[str, ...]
    cells: Cells
    soils: Mapping[str, ClassSoil]
    drives: int
    physics: Mapping[str, AugmentedSimulator] = field(default_factory=lambda: MappingProxyType({}))
    bounds: Corners | None = None
    origin: Origin | None = None
    _tables: dict[tuple[float, float], GroundTable] = field(default_factory=dict, repr=False, compare=False)
    _memory: dict[tuple, Any] = field(default_factory=dict, repr=False, compare=False)

    @staticmethod
    def derive(
        site: str, drives: Sequence[Drive], physics: Mapping[str, AugmentedSimulator] | None = None, *,
        cell_size_m: float | None = None, bounds: Corners | None = None,
    ) -> Snapshot:  # fmt: skip
        """Derive a snapshot from a site's drives and its classes' physics; `TerrainDatabase.snapshot` does this.

        With `bounds` the drives hold only looks at cells within them, and `cell_size_m` is that of the whole site.
        """
        soils = class_soils([soil for drive in drives for soil in drive.soils])
        classes, size = classes_of(drives, soils), grid_size(drives) if cell_size_m is None else cell_size_m
        cells = combine(drives, classes, size)
        return Snapshot.of(site, size, classes, cells, soils, drives, physics or {}, bounds)

    @staticmethod
    def of(
        site: str,
        cell_size_m: float,
        class_names: tuple[str, ...],
        cells: Cells,
        soils: Mapping[str, ClassSoil],
        drives: Sequence[Drive],
        physics: Mapping[str, AugmentedSimulator],
        bounds: Corners | None = None,
    ) -> Snapshot:
        """Freeze what was derived."""
        freeze(cells)
        freeze(soils)
        own = MappingProxyType(dict(soils)), len(drives), MappingProxyType(dict(physics))
        origin = next((drive.origin for drive in drives if drive.origin is not None), None)
        return Snapshot(site, cell_size_m, class_names, cells, *own, bounds, origin)

    def with_drives(
        self, drives: Sequence[Drive], changed: Sequence[Drive], physics: Mapping[str, AugmentedSimulator]
    ) -> Snapshot:
        """Derive the snapshot of a site's drives from this one, which knew all of them but `changed` ones.

        The same as `derive`, to the last digit; only what `changed` drives (new ones and those that are gone) touch is
        computed. Drives that are neither are in the order that they had.
        """
        soils = dict(self.soils)
        if any(drive.soils for drive in changed):
            soils = class_soils([soil for drive in drives for soil in drive.soils])
        classes, size = classes_of(drives, soils), grid_size(drives)
        if (classes, size) != (self.class_names, self.cell_size_m):
            return Snapshot.derive(self.site, drives, physics)
        touched = keys_of(changed, size)
        cells = put_in(combine(drives, classes, size, touched), self.cells, touched)
        return Snapshot.of(self.site, size, classes, cells, soils, drives, physics)

    def __getstate__(self) -> dict[str, Any]:
        """What other processes are given: all that is known, and nothing that is computed from it."""
        return {name: value for name, value in self.__dict__.items() if not name.startswith("_")}

    def __setstate__(self, state: Mapping[str, Any]) -> None:
        self.__dict__.update(state, _tables={}, _memory={})
        freeze(self)  # arrays arrive writable

    @property
    def typical_load_N(self) -> float:
        """Mean load on one wheel while soil was measured [N]; NaN where no soil was."""
        known = [soil for soil in self.soils.values() if math.isfinite(soil.load_N)]
        total = sum(soil.weight for soil in known)
        return sum(soil.weight * soil.load_N for soil in known) / total if total else math.nan

    @property
    def extent(self) -> tuple[float, float, float, float]:
        """Corners x0, y0, x1, y1 of the ground that somebody has seen [m]; raises `InputError` where nobody has."""
        if not len(self.cells.key):
            raise InputError("site", shown(self.site), expected="ground that somebody has seen")
        cells = cells_from_keys(self.cells.key)
        (x0, y0), (x1, y1) = cells.min(axis=0) * self.cell_size_m, (cells.max(axis=0) + 1) * self.cell_size_m
        return float(x0), float(y0), float(x1), float(y1)

    def along(
        self,
        path: ArrayLike,
        *,
        normal_stress: float = DEFAULT_NORMAL_STRESS,
        confidence: float = 0.95,
        now: float | datetime | None = None,
        half_life: float | None = None,
    ) -> GroundAnswer:
        """Say what the ground along a path can bear.

        Parameters
        ----------
        path : (n, 2)
            Places x, y [m].
        normal_stress
            At which the shear strength is wanted [Pa].
        confidence
            With which the strength exceeds its lower bound, in [0.5, 1).
        now
            Moment that ages refer to: POSIX seconds, or a datetime (UTC where it has no zone); the present if absent.
        half_life
            Time after which what was seen of a cell counts half [s]: its log-probabilities shrink towards equal ones,
            and no lower bound rises by that. Looks of unknown age count nothing. All count whole if absent.

        Returns
        -------
        GroundAnswer
            n places, in the order given.

        Raises
        ------
        InputError
            A path that is not (n, 2), a stress that is negative or not finite, a confidence out of range.
        """
        if type(path) is not np.ndarray or path.dtype != np.float64:
            path = numbers("path", path, "(n, 2): x, y [m]")
        if path.ndim != 2 or path.shape[1] != 2:
            raise InputError("path", f"shape {path.shape}", expected="(n, 2): x, y [m]")
        places = np.array(path)  # a copy: the caller's path stays the caller's
        return self._answer(places, self._index.rows(places), normal_stress, confidence, now, half_life)

    def at(
        self,
        x: ArrayLike,
        y: ArrayLike,
        *,
        normal_stress: float = DEFAULT_NORMAL_STRESS,
        confidence: float = 0.95,
        now: float | datetime | None = None,
        half_life: float | None = None,
    ) -> GroundAnswer:
        """Say what the ground can bear at one place, or at many (arrays of equal size) [m]; else as `along`."""
        if isinstance(x, float) and isinstance(y, float):
            places = np.array([[x, y]])
            return self._answer(places, self._index.rows(places), normal_stress, confidence, now, half_life)
        xs, ys = (np.ravel(numbers(name, each, "numbers [m]")) for name, each in (("x", x), ("y", y)))
        if 1 != len(xs) != len(ys) != 1:
            raise InputError("x and y", f"{len(xs)} and {len(ys)} places", expected="as many of each [m]")
        places = np.stack(np.broadcast_arrays(xs, ys), axis=1)
        return self.along(places, normal_stress=normal_stress, confidence=confidence, now=now, half_life=half_life)

    def box(
        self,
        x0: float,
        y0: float,
        x1: float,
        y1: float,
        *,
        normal_stress: float = DEFAULT_NORMAL_STRESS,
        confidence: float = 0.95,
        now: float | datetime | None = None,
        half_life: float | None = None,
    ) -> GroundAnswer:
        """Give all cells that somebody has seen whose centres lie between the corners [m]; else as `along`."""
        rows, x, y = self._within(x0, y0, x1, y1)
        return self._answer(np.column_stack([x, y]), rows, normal_stress, confidence, now, half_life)

    def near(
        self,
        x: float,
        y: float,
        radius: float,
        *,
        normal_stress: float = DEFAULT_NORMAL_STRESS,
        confidence: float = 0.95,
        now: float | datetime | None = None,
        half_life: float | None = None,
    ) -> GroundAnswer:
        """Give all cells that somebody has seen and that reach into a circle of a radius [m]; else as `along`."""
        x, y, radius = (number(*each, "a number [m]") for each in (("x", x), ("y", y), ("radius", radius)))
        if not (math.isfinite(radius) and radius >= 0):
            raise InputError("radius", f"{radius!r}", expected="a finite length, not negative [m]")
        half = 0.5 * self.cell_size_m
        far = radius + half
        rows, cell_x, cell_y = self._within(x - far, y - far, x + far, y + far)
        off_x, off_y = (np.maximum(np.abs(each) - half, 0.0) for each in (cell_x - x, cell_y - y))
        inside = np.hypot(off_x, off_y) <= radius
        centres = np.column_stack([cell_x, cell_y])[inside]
        return self._answer(centres, rows[inside], normal_stress, confidence, now, half_life)

    def grid(
        self,
        bounds: Sequence[float],
        resolution: float,
        layers: Sequence[str] = LAYERS,
        *,
        normal_stress: float = DEFAULT_NORMAL_STRESS,
        confidence: float = 0.95,
        now: float | datetime | None = None,
        half_life: float | None = None,
    ) -> Grid:
        """Sample a region as a regular raster; else as `along`.

        A cell of the raster is what the snapshot says of its centre. Where the resolution is coarser than
        `cell_size_m`, ground between the centres is not looked at: take `cell_size_m` or less to miss nothing.

        Parameters
        ----------
        bounds
            Corners x0, y0, x1, y1 [m] with x0 < x1 and y0 < y1; the last row and column may reach beyond.
        resolution
            Edge of a cell [m].
        layers
            Names among `grid.LAYERS`; all where absent.

        Returns
        -------
        Grid
            Row 0 in the south, column 0 in the west.

        Raises
        ------
        InputError
            Also where bounds, resolution or layers are none, or the grid has more than `grid.MOST_CELLS` cells.
        """
        return rasterise(
            self, bounds, resolution, layers, normal_stress=normal_stress, confidence=confidence, now=now,
            half_life=half_life,
        )  # fmt: skip

    def class_answer(
        self, name: str, *, normal_stress: float = DEFAULT_NORMAL_STRESS, confidence: float = 0.95
    ) -> GroundAnswer:
        """Say what ground can bear that is certainly of one class, at no place in particular; else as `along`.

        Raises
        ------
        InputError
            There is no such class.
        """
        if name not in self.class_names:
            raise InputError("class", shown(name), expected="one of " + (", ".join(self.class_names) or "none yet"))
        probability = np.array([[float(other == name) for other in self.class_names]])
        nothing = np.zeros(1, dtype=int)
        sure = Cells(nothing, probability, np.full(1, np.nan), nothing, nothing, ("",))
        table = GroundTable(sure, self.class_names, self.soils, *_asked(normal_stress, confidence))
        return GroundAnswer(self, table, np.zeros(1, dtype=int), np.full((1, 2), np.nan), math.nan)

    def _within(self, x0: float, y0: float, x1: float, y1: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Rows and centres [m] of the seen cells between two corners."""
        x0, y0, x1, y1 = (number("box", each, "a number [m]") for each in (x0, y0, x1, y1))
        if not all(map(math.isfinite, (x0, y0, x1, y1))):
            raise InputError("box", f"corners {(x0, y0, x1, y1)}", expected="finite numbers [m]")
        farthest = LARGEST_CELL_INDEX - 1
        west, east = np.clip(np.floor(np.sort([x0, x1]) / self.cell_size_m), -farthest, farthest).astype(int)
        # Keys are sorted by x first: the columns of the box are one slice.
        corners = cell_keys(np.array([[west, -(2**31)], [east + 1, -(2**31)]]))
        first, last = np.searchsorted(self.cells.key, corners)
        x, y = (cells_from_keys(self.cells.key[first:last]).T + 0.5) * self.cell_size_m
        inside = (x >= min(x0, x1)) & (x <= max(x0, x1)) & (y >= min(y0, y1)) & (y <= max(y0, y1))
        return first + np.flatnonzero(inside), x[inside], y[inside]

    def _answer(
        self,
        places: np.ndarray,
        rows: np.ndarray,
        normal_stress: float,
        confidence: float,
        now: float | datetime | None,
        half_life: float | None,
    ) -> GroundAnswer:
        moment = time.time() if now is None else _posix(now)
        answer = GroundAnswer(self, self._table(normal_stress, confidence), rows, places, moment)
        return answer if half_life is None else answer.aged(half_life)

    @cached_property
    def _index(self) -> CellIndex:
        return CellIndex.of(self.cells.key, self.cell_size_m)

    def _table(self, normal_stress: float, confidence: float) -> GroundTable:
        if not (type(normal_stress) is type(confidence) is float):
            normal_stress, confidence = _asked(normal_stress, confidence)
        found = self._tables.get((normal_stress, confidence))
        if found is None:
            stress, level = _asked(normal_stress, confidence)
            found = GroundTable(self.cells, self.class_names, self.soils, stress, level)
            if len(self._tables) >= _TABLES:
                self._tables.clear()
            self._tables[stress, level] = found
        return found

    def remembered(self, key: tuple, compute: Callable[[], Any]) -> Any:
        """Give what was computed for a key before; the answer never changes, only the time it takes."""
        found = self._memory.get(key)
        if found is None:
            found = compute()
            for oldest in list(self._memory)[: 1 - _REMEMBERED]:
                self._memory.pop(oldest, None)
            self._memory[key] = found
        return found


def _asked(normal_stress: float, confidence: float) -> tuple[float, float]:
    """Check a normal stress [Pa] and a confidence [-]; raises `InputError`."""
    stress = number("normal stress", normal_stress, "a number [Pa]")
    level = number("confidence", confidence, "a number")
    if not 0.0 <= stress <= _GREATEST_STRESS:
        raise InputError("normal stress", f"{normal_stress!r}", expected=f"0 to {_GREATEST_STRESS:g} [Pa]")
    if not 0.5 <= level < 1.0:
        raise InputError("confidence", f"{confidence!r}", expected="at least 0.5 and less than 1")
    return stress, level


def _posix(now: float | datetime) -> float:
    if isinstance(now, datetime):
        return (now if now.tzinfo is not None else now.replace(tzinfo=UTC)).timestamp()
    moment = number("now", now, "POSIX seconds, or a datetime")
    if not math.isfinite(moment):
        raise refused("now", now, "POSIX seconds, or a datetime")
    return moment
