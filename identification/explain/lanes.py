"""Tracks on different ground: rows of one lane lie on the same ground, in one or several passes."""

from __future__ import annotations

import math

import numpy as np

from ...framework.core.track.passes import side_by_side
from ...framework.core.track.positions import runs_of
from ..effects.effect import Drive


def lanes(drive: Drive, width_m: float, wheel: np.ndarray | None = None) -> np.ndarray:
    """Number the tracks, (n,).

    A new track begins where a wheel on fresh ground, or ground whose pass is unknown, overlaps a place where it or
    another `wheel` (n,) ran before, and, where tracks are straight, half a wheel's width to the side.
    """
    stretches = runs_of(drive.stretch)
    names = [""] * len(stretches) if wheel is None else [str(wheel[rows[0]]) for rows in stretches]
    fresh = np.array([not drive.pass_number[rows[0]] > 1.0 for rows in stretches])
    side = side_by_side(drive.axis, np.column_stack([drive.x_m, drive.y_m]), drive.pass_number, drive.stretch, width_m)
    aside = side[[rows[0] for rows in stretches]]
    lane, last = np.empty(len(stretches), dtype=int), -1
    for group in np.unique(aside):
        covered: dict[str, tuple[float, float]] = {}
        of_wheel: dict[str, int] = {}
        last += 1
        current = last
        for each in np.flatnonzero(aside == group):
            low, high = _extent(drive.place_m[stretches[each]])
            name = names[each]
            if fresh[each]:
                ran = [covered[name]] if name in covered else list(covered.values())
                if any(min(end - low, high - start) > width_m for start, end in ran):
                    covered[name] = low, high
                    last += 1
                    of_wheel[name] = last
                start, end = covered.get(name, (low, high))
                covered[name] = min(start, low), max(end, high)
                current = of_wheel.setdefault(name, current)
            lane[each] = current
    return np.repeat(lane, [len(rows) for rows in stretches])


def _extent(place_m: np.ndarray) -> tuple[float, float]:
    """First and last place of a stretch [m]; an empty interval where no place is known."""
    seen = place_m[np.isfinite(place_m)]
    return (float(seen.min()), float(seen.max())) if len(seen) else (math.inf, -math.inf)
