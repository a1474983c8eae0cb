"""Which wheels ran on one track before, and with which slip."""

from __future__ import annotations

import math

import numpy as np

from .place import Axis
from .positions import runs_of

_APART = 0.5
"""Share of a wheel's width from which on two tracks have less than half of their ground in common [-]."""

_CELLS, _MOST_CELLS = 50, 10000
"""Pieces of a stretch over which the slip of an earlier pass is averaged (its noise is no compaction), and the most of
all places.
"""


def side_by_side(
    axis: Axis | None, plane: np.ndarray, pass_number: np.ndarray, stretch: np.ndarray, width_m: float
) -> np.ndarray:
    """Number of the lane, side by side, that each row runs on, (n,).

    Lanes are where stretches on fresh ground ran; a later pass is on the nearest one. One whose place across was not
    seen is on a lane of its own. Where tracks turn there is one lane.
    """
    stretches = runs_of(stretch)
    lane = np.zeros(len(stretches), dtype=int)
    across = np.full(len(plane), math.nan) if axis is None else axis[0] * plane[:, 1] - axis[1] * plane[:, 0]
    if not np.isfinite(across).any():
        return np.zeros(len(plane), dtype=int)
    fresh = np.array([not pass_number[rows[0]] > 1.0 for rows in stretches])
    middle = np.array([np.nanmean(across[rows]) if np.isfinite(across[rows]).any() else math.nan for rows in stretches])
    seen = np.isfinite(middle)
    known = np.sort(middle[fresh & seen] if (fresh & seen).any() else middle[seen])
    number = np.cumsum(np.diff(known, prepend=known[0]) > _APART * width_m)
    lane[seen] = number[np.abs(middle[seen][:, None] - known).argmin(axis=1)]
    lane[~seen] = number[-1] + 1 + np.arange((~seen).sum())
    return np.repeat(lane, [len(rows) for rows in stretches])


def slip_before(
    slip: np.ndarray, pass_number: np.ndarray, place_m: np.ndarray, stretch: np.ndarray, lane: np.ndarray
) -> np.ndarray:  # fmt: skip
    """Size of the slip of the wheel that ran before at the same place (n,) [-]; on first passes it says nothing.

    That is the last one of a lower pass in a stretch before, else the next one in a stretch after: a wheel that is
    behind another one may begin earlier, and runs may have clocks of their own. Where none ran on the same lane any
    lane counts (positions drift), and where none ran at all the mean of the last lower pass, or of all.

    Parameters
    ----------
    slip, pass_number, place_m : (n,)
        As observed, NaN where not; the place along the track [m].
    stretch : (n,)
        Number of the stretch, in the order in which they were driven.
    lane : (n,)
        Number of the lane (`side_by_side`).
    """
    size, number = np.abs(slip), np.nan_to_num(pass_number, nan=1.0)
    answer = _of_the_pass_before(size, number)
    ran = np.isfinite(place_m) & np.isfinite(slip)
    if not ran.any():
        return answer
    cell = _cells(place_m, ran, stretch)
    found = np.full(len(size), math.nan)
    # Any lane first: what ran on the same one is then put in its place, and what ran before in that of what ran after.
    for group in (np.zeros_like(lane), lane) if lane.any() else (lane,):
        by_group = np.flatnonzero(ran)[np.argsort(group[ran], kind="stable")]
        for rows in np.split(by_group, np.flatnonzero(np.diff(group[by_group])) + 1):
            for order in (rows[::-1], rows):
                there = _ran_before(slip, number, place_m, cell, stretch, order)
                found[order] = np.where(np.isnan(there), found[order], there)
    return np.where(np.isnan(found), answer, found)


def _of_the_pass_before(size: np.ndarray, number: np.ndarray) -> np.ndarray:
    """Mean size of the slip of the next lower pass since the number last fell, else of all rows, (n,)."""
    since = np.cumsum(np.diff(number, prepend=number[:1]) < 0.0)
    (group, _), which = np.unique(np.stack([since, number]), axis=1, return_inverse=True)
    which, seen = which.reshape(-1), np.isfinite(size)
    count = np.bincount(which, seen)
    total = np.bincount(which, np.where(seen, size, 0.0))
    mean = np.divide(total, count, out=np.full(len(count), math.nan), where=count > 0.0)
    before = np.where(np.diff(group, prepend=-1) == 0, np.roll(mean, 1), math.nan)
    overall = float(size[seen].mean()) if seen.any() else math.nan
    return np.where(np.isnan(before), overall, before)[which]


def _ran_before(
    slip: np.ndarray, number: np.ndarray, place_m: np.ndarray, cell: np.ndarray, stretch: np.ndarray, rows: np.ndarray
) -> np.ndarray:  # fmt: skip
    """Sizes of the slip (k,) of the last stretch of a lower pass near the places of `rows` (k,); NaN where none."""
    starts = np.flatnonzero(np.diff(stretch[rows], prepend=-1))
    numbers = number[rows[starts]]
    # What the highest pass leaves nobody finds.
    left = {each: np.full((2, int(cell.max()) + 1), math.nan) for each in np.unique(numbers)[1:].tolist()}
    answer = np.full(len(rows), math.nan)
    if not left:
        return answer
    for own, at in zip(numbers.tolist(), np.split(np.arange(len(rows)), starts[1:]), strict=True):
        places, cells = place_m[rows[at]], cell[rows[at]]
        there = np.flatnonzero(np.isfinite(left[own][0])) if own in left else np.empty(0, dtype=int)
        if len(there):
            center, slips = left[own][:, there]
            nearest = np.searchsorted(0.5 * (center[1:] + center[:-1]), places)
            answer[at] = np.where(np.abs(there[nearest] - cells) <= 1, slips[nearest], math.nan)
        ran, means = _means(cells, places, slip[rows[at]])
        for later, grid in left.items():
            if later > own:
                grid[:, ran] = means
    return answer


def _cells(place_m: np.ndarray, ran: np.ndarray, stretch: np.ndarray) -> np.ndarray:
    """Number of the cell of each place (n,), `_CELLS` of them in a usual stretch, and none that a wheel steps over."""
    known = place_m[ran]
    usual = float(np.median([np.ptp(known[rows]) for rows in runs_of(stretch[ran])]))
    step = float(np.median(np.abs(np.diff(known)))) if len(known) > 1 else 0.0
    width = max(usual / _CELLS, 2.0 * step, float(np.ptp(known)) / _MOST_CELLS)
    cell = np.zeros(len(place_m), dtype=int)
    if width > 0.0:
        cell[ran] = np.floor((known - known.min()) / width).astype(int)
    return cell


def _means(cell: np.ndarray, place_m: np.ndarray, slip: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Cells (k,) that a stretch ran through, and its mean places and the sizes of its mean slips there (2, k)."""
    ran, which = np.unique(cell, return_inverse=True)
    count = np.bincount(which)
    # Noise about no slip has a size, and its mean none.
    return ran, np.array([np.bincount(which, place_m) / count, np.abs(np.bincount(which, slip)) / count])
