"""What is believed of the ground by now: ahead, under the wheels, and along the way up to here."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np

from ..core.pooling import cells_of
from ..core.track.way import Track, cells_under_wheels
from ..core.vehicle import Vehicle
from ..fusion import Belief, fuse
from ..segments import LEAST_CLASS_PROBABILITY, change_probability
from ..sense_map import PRIOR_CORRELATION, SenseMap, look_correlation

FARTHEST_M = 100.0
"""Longest and widest strip ahead [m]: no sense sees farther, and a cell of each square is made."""


class GroundByNow:
    """The senses' maps, fused where one asks.

    Parameters
    ----------
    maps
        One for each sense that is there.
    cell_size_m
        Edge of a cell [m].
    """

    def __init__(self, maps: Sequence[SenseMap], cell_size_m: float):
        self._maps, self._cell_size_m = maps, cell_size_m
        self._correlation = {each.sense: PRIOR_CORRELATION for each in maps}

    def estimate_correlation(self) -> None:
        """Estimate again how far looks at one cell go together, from all of them."""
        self._correlation = {each.sense: look_correlation(each.summed()) for each in self._maps}

    def belief(self, cells: np.ndarray) -> Belief:
        """Fuse what was seen of cells (m, 2)."""
        return fuse(self._maps, only=cells, correlation=self._correlation)

    def ahead(self, x_m: float, y_m: float, yaw_rad: float, length_m: float, width_m: float) -> Belief:
        """Give what is believed of a strip that begins at a place [m] and lies ahead."""
        reach = np.array([-1.0, 1.0]) * np.hypot(length_m, width_m)
        low, high = cells_of(x_m + reach, y_m + reach, self._cell_size_m)
        grid = np.stack(np.meshgrid(*(np.arange(a, b + 1) for a, b in zip(low, high, strict=True))), axis=-1)
        cells = grid.reshape(-1, 2)
        off_x, off_y = ((cells + 0.5) * self._cell_size_m - [x_m, y_m]).T
        along = off_x * np.cos(yaw_rad) + off_y * np.sin(yaw_rad)
        aside = off_y * np.cos(yaw_rad) - off_x * np.sin(yaw_rad)
        return self.belief(cells[(along >= 0.0) & (along <= length_m) & (np.abs(aside) <= 0.5 * width_m)])


@dataclass(frozen=True)
class UnderWheels:
    """The ground under the wheels by now.

    Parameters
    ----------
    time_s
        When the wheels were at the end of what is judged [s].
    since_s
        Since when they have been on it [s].
    class_name
        Its class; empty where none is probable enough.
    probabilities
        By class [-], of all that was seen up to here.
    """

    time_s: float
    since_s: float
    class_name: str
    probabilities: dict[str, float]


@dataclass
class WayByNow:
    """Follows the class along the way, piece by piece of a cell's length.

    The chain of classes is that of `segments.classes_along`, which looks back from the end; this one knows only what
    was before (the forward filter of the same hidden Markov model: Rabiner 1989, doi:10.1109/5.18626).
    """

    vehicle: Vehicle
    cell_size_m: float
    now: UnderWheels | None = None
    contradiction: str = ""
    _from_s: float | None = None
    _probabilities: dict[str, float] = field(default_factory=dict)

    def go_on(self, track: Track, ground: GroundByNow) -> Iterator[UnderWheels]:
        """Judge the pieces that were driven since the last time, and give the ground where it is of another class."""
        for start_s, end_s, length_m in self._pieces(track):
            bounds = np.array([start_s]), np.array([end_s])
            _, cells = cells_under_wheels(track, self.vehicle, *bounds, self.cell_size_m)
            self._from_s = end_s
            belief = ground.belief(cells)
            said = zip(belief.reasons, belief.unknown, strict=True)
            self.contradiction = next((texts[0] for texts, unknown in said if texts and not unknown), "")
            self._follow(belief, length_m)
            before = self.now
            best = max(self._probabilities, key=self._probabilities.__getitem__, default="")
            name = best if self._probabilities.get(best, 0.0) >= LEAST_CLASS_PROBABILITY else ""
            is_new = before is None or (name != before.class_name and bool(name))
            since_s = start_s if before is None or is_new else before.since_s
            kept = name if is_new or before is None else before.class_name
            self.now = UnderWheels(end_s, since_s, kept, dict(self._probabilities))
            if is_new:
                yield self.now

    def _pieces(self, track: Track) -> Iterator[tuple[float, float, float]]:
        """Give beginning and end [s], and length [m], of pieces of the way that were driven."""
        time_s, way = track.time_s, track.way_m
        first_s = time_s[0] if self._from_s is None else max(self._from_s, time_s[0])
        moving = np.concatenate([[True], np.diff(way) > 0])
        begin = float(np.interp(first_s, time_s, way))
        ends = np.arange(begin + self.cell_size_m, way[-1], self.cell_size_m)
        at = np.interp(ends, way[moving], time_s[moving]).tolist()
        for start_s, end_s in zip([first_s, *at], at, strict=False):
            yield float(start_s), float(end_s), self.cell_size_m

    def _follow(self, belief: Belief, length_m: float) -> None:
        """Take a step of the chain, and what was seen of the piece."""
        names = belief.classes
        if not names:
            return
        k, known = len(names), ~belief.unknown
        before = np.array([self._probabilities.get(name, 1.0 / k) for name in names])
        before /= before.sum()
        change = float(change_probability(np.array([length_m]))[0]) if k > 1 else 0.0
        after = (1.0 - change) * before + change * (1.0 - before) / max(k - 1, 1)
        weight = belief.quality[known]
        if weight.sum() > 0:
            after *= np.maximum(weight @ belief.probabilities[known] / weight.sum(), 1e-9)
        self._probabilities = dict(zip(names, (after / after.sum()).tolist(), strict=True))
