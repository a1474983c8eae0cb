"""Where along its track a wheel is: along an axis of the plane where that runs straight, by the way gone where not; and
which ground a later pass runs on again.
"""

from __future__ import annotations

import math
from typing import Literal

import numpy as np
from scipy.ndimage import median_filter, uniform_filter1d
from scipy.spatial import KDTree
from scipy.stats import median_abs_deviation

from .positions import runs_of

Axis = tuple[float, float]
"""Direction in which a track runs in the plane of x and y."""

ALONG_X: Axis = (1.0, 0.0)

_ASIDE = 0.1
"""Spread across the main direction as a share of that along it from which on a track turns [-]; and as much of one
axis in the direction of another from which on it does not run along that; and as much of its way from which on it
comes back, or runs next to itself.
"""

_NOISES = 3.0
"""Standard deviations of positions by which two on one track may be apart, besides the width of the wheel [-]."""

_ALONE, _CHORD, _SMOOTH = 5, 10, 4.0
"""Rows whose median a place that stands alone is not, rows from which a step is estimated, and how many times the
positions' noise rows are averaged over, in steps."""

_STANDS, _FAST = 0.1, 0.9
"""Share of the steps at that quantile below which a wheel stands [-]."""

_AFTER = 20.0
"""Usual steps up to which a stretch goes on from the end of another one [-]."""

_NEAREST, _PARALLEL = 32, 0.7
"""Earlier rows that are looked at, and the cosine of the angle from which on both run along one track [-]."""


def coordinate(axis: Axis | None) -> Literal["x_m", "y_m", "distance_m"]:
    """Column of the place on a track: the one that runs along it, or the way gone, along the track."""
    if axis is None:
        return "distance_m"
    x, y = map(abs, axis)
    return "x_m" if y < _ASIDE * x else "y_m" if x < _ASIDE * y else "distance_m"


def axis_of(plane: np.ndarray, stretch: np.ndarray, width_m: float) -> Axis | None:
    """Direction in which stretches (n,) run over places (n, 2), that of the first; None where they turn, or come back
    more than the width of the wheel to the side.

    Lanes side by side, each a stretch of its own, are one direction. It is x where nothing moves or is seen.
    """
    seen = np.isfinite(plane).all(axis=1)
    if not seen.any():
        return ALONG_X
    number = np.unique(stretch[seen], return_inverse=True)[1]
    plane, noise = _calmed(plane[seen], number)
    count = np.bincount(number)
    middle = np.column_stack([np.bincount(number, each) for each in plane.T]) / count[:, None]
    away = plane - middle[number]
    spread, directions = np.linalg.eigh(away.T @ away / len(away))
    # Positions that only scatter go nowhere.
    if spread[1] <= (_NOISES * noise) ** 2:
        return ALONG_X
    if spread[0] > _ASIDE**2 * spread[1]:
        return None
    across, along = (away @ directions).T
    if _returns_aside(along, across, number, width_m + _NOISES * noise):
        return None
    ends = np.diff(away[number == number[0]][[0, -1]] @ directions[:, 1])
    return tuple((directions[:, 1] * (-1.0 if ends[0] < 0.0 else 1.0)).tolist())


def _returns_aside(along: np.ndarray, across: np.ndarray, number: np.ndarray, near: float) -> bool:
    """Say whether stretches of a `number` (n,) come back further than `near` from where they ran before [m]."""
    for rows in runs_of(number):
        steps = np.diff(along[rows])
        if min(steps.clip(min=0.0).sum(), -steps.clip(max=0.0).sum()) <= _ASIDE * np.ptp(along[rows]):
            continue
        order = np.lexsort((across[rows], np.floor(along[rows] / near)))
        cell, aside = np.floor(along[rows] / near)[order], across[rows][order]
        first = np.flatnonzero(np.diff(cell, prepend=-np.inf))
        last = np.append(first[1:], len(rows)) - 1
        if np.mean(aside[last] - aside[first] > near) > _ASIDE:
            return True
    return False


def place_of(
    plane: np.ndarray, axis: Axis | None, pass_number: np.ndarray, stretch: np.ndarray, width_m: float
) -> np.ndarray:
    """Place along the track (n,) [m], NaN where not observed.

    Parameters
    ----------
    plane : (n, 2)
        Places in the plane, of each stretch in the order of time, y NaN where there is none.
    axis
        Direction of the track (`axis_of`).
    pass_number : (n,)
        1 on fresh ground.
    stretch : (n,)
        Number of the stretch, one that began earlier first.
    width_m
        Of the wheel: a later pass that comes so near to an earlier one runs on its ground.
    """
    name = coordinate(axis)
    if name != "distance_m":
        return plane[:, 0 if name == "x_m" else 1]
    seen = np.flatnonzero(np.isfinite(plane).all(axis=1))
    place = np.full(len(plane), math.nan)
    if axis is not None:
        place[seen] = (plane[seen] - plane[seen[0]]) @ axis
        return place
    plane, noise = _calmed(plane[seen], stretch[seen])
    heading = _heading(plane, stretch[seen])
    way = _way(plane, stretch[seen])
    number = np.nan_to_num(pass_number[seen], nan=1.0)
    near = width_m + _NOISES * noise
    along = near + float(np.median(np.linalg.norm(np.diff(plane, axis=0), axis=1))) if len(plane) > 1 else near
    for before, rows in _later_passes(number):
        way[rows] = _on_ground_of(plane, heading, number, way, before, rows, (along, near))
    place[seen] = way
    return place


def _calmed(plane: np.ndarray, stretch: np.ndarray) -> tuple[np.ndarray, float]:
    """Positions (n, 2) without such as stand alone and without most of their noise, and what noise they had [m]."""
    noise = _noise(plane)
    plane = plane.copy()
    for rows in (each for each in runs_of(stretch) if len(each) >= _ALONE):
        plane[rows] = median_filter(plane[rows], (_ALONE, 1), mode="nearest")
    chord = np.linalg.norm(plane[_CHORD:] - plane[:-_CHORD], axis=1) / _CHORD
    # A wheel that stands most of the time has no step then.
    moving = chord[chord > 0.5 * noise]
    step = float(np.median(moving if len(moving) else chord)) if len(chord) else 0.0
    if noise <= _ASIDE * step or not len(chord):
        return plane, noise
    for rows in (each for each in runs_of(stretch) if len(each) >= _ALONE):
        half = min(math.ceil(_SMOOTH * noise / max(step, 1e-12)), len(rows) // 4)
        plane[rows] = uniform_filter1d(plane[rows], 2 * half + 1, axis=0, mode="nearest")
    return plane, noise


def _noise(plane: np.ndarray) -> float:
    """Standard deviation of the positions (n, 2) [m] by their second differences, of which motion makes little."""
    if len(plane) < 4:
        return 0.0
    bends = np.diff(plane, n=2, axis=0)
    spread = median_abs_deviation(bends, axis=0, scale="normal")  # pyright: ignore[reportArgumentType]
    return float(np.max(spread) / math.sqrt(6.0))


def _way(plane: np.ndarray, stretch: np.ndarray) -> np.ndarray:
    """Way gone (n,) [m]; a stretch goes on from the nearest end of an earlier one, else on a track of its own: several
    wheels take turns.
    """
    steps = np.linalg.norm(np.diff(plane, axis=0, prepend=plane[:1]), axis=1)
    runs = runs_of(stretch)
    reach = _AFTER * float(np.median(steps))
    way, ends, gone = np.empty(len(plane)), np.empty((len(runs), 2)), np.empty(len(runs))
    track = np.arange(len(runs))
    for each, rows in enumerate(runs):
        began = 0.0
        if each:
            apart = np.linalg.norm(ends[:each] - plane[rows[0]], axis=1)
            last = each - 1 - int(np.argmin(apart[::-1]))
            if apart[last] <= reach:
                began, track[each] = gone[last] + apart[last], track[last]
        way[rows] = began + np.cumsum(steps[rows]) - steps[rows[0]]
        ends[each], gone[each] = plane[rows[-1]], way[rows[-1]]
    # Tracks one after the other: none runs on where another one is.
    length = np.zeros(len(runs))
    np.maximum.at(length, track, gone + reach)
    start = np.cumsum(length) - length
    return way + np.repeat(start[track], [len(rows) for rows in runs])


def _later_passes(number: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
    """Rows of each later pass, by the passes' `number` (n,), after all those of lower ones that came before."""
    answer = []
    for rows in runs_of(number):
        lower = np.flatnonzero(number[: rows[0]] < number[rows[0]])
        if len(lower):
            answer.append((lower, rows))
    return answer


def _on_ground_of(
    plane: np.ndarray, heading: np.ndarray, number: np.ndarray, place: np.ndarray, before: np.ndarray,
    rows: np.ndarray, near: tuple[float, float],
) -> np.ndarray:  # fmt: skip
    """Places (k,) of some rows: those of the last earlier pass that ran so near, along and across, and parallel, else
    their own: where a track is driven again, what ran there before is gone.
    """
    tree = KDTree(plane[before])
    _, at = map(np.asarray, tree.query(plane[rows], k=min(_NEAREST, len(before))))
    at = before[at.reshape(len(rows), -1)]
    apart = plane[rows][:, None] - plane[at]
    along = np.sum(apart * heading[at], axis=2)
    across = np.abs(apart[..., 0] * heading[at][..., 1] - apart[..., 1] * heading[at][..., 0])
    parallel = np.abs(np.sum(heading[rows][:, None] * heading[at], axis=2)) > _PARALLEL
    good = parallel & (across < near[1]) & (np.abs(along) <= near[0])
    # Of one pass the nearest row, of several the last.
    started = np.cumsum(np.diff(number, prepend=number[0]) != 0.0)
    last = np.argmax(np.where(good, _NEAREST * started[at] - np.arange(at.shape[1]), -_NEAREST), axis=1)
    each = np.arange(len(rows))
    return np.where(good.any(axis=1), place[at[each, last]] + along[each, last], place[rows])


def _heading(plane: np.ndarray, stretch: np.ndarray) -> np.ndarray:
    """Unit vectors (n, 2) along the way; where a wheel stands, that in which it came, or goes on."""
    heading = np.zeros_like(plane)
    for rows in runs_of(stretch):
        if len(rows) < 2:
            continue
        gradient = np.gradient(plane[rows], axis=0)
        size = np.linalg.norm(gradient, axis=1)
        moving = np.flatnonzero(size > _STANDS * np.quantile(size, _FAST))
        if len(moving):
            last = np.clip(np.searchsorted(moving, np.arange(len(rows)), side="right") - 1, 0, None)
            heading[rows] = (gradient[moving] / size[moving, None])[last]
    return heading
