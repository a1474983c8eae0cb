"""Positions as they are recorded: set down elsewhere, wrong for some rows, held between updates, lost for a while."""

from __future__ import annotations

import math

import numpy as np
from scipy.ndimage import median_filter

_JUMP = 20.0
"""Usual steps [-] by which a place that is reached from one sample to the next cannot have been driven to."""

_AWAY, _LONGEST, _BACK = 5.0, 5, 0.5
"""Usual steps [-] by which wrong positions leave the track at least, updates that they last at most, and how near to
where they left it they come back, as a share of how far they were away [-]."""

_ABOUT = 7
"""Steps whose median is the usual one about the middle of them: wheels drive fast after they crept."""

_SEEN, _INTERVALS = 0.9, 3.0
"""Share of the places of a stretch that have to be known for all others to be put between them, and usual intervals
between those that are known up to which a gap is bridged in any case [-]."""

_LESS = 1.0 - 1e-6
"""Share of a usual interval by which places go on before and after those that are known: of one for each row no row
further [-]."""

_UPDATED, _OVERDUE = 0.5, 1.5
"""Most of the rows that have a new position where positions are held between updates [-], and usual intervals between
these after which one is overdue: the wheel stands [-]."""


def runs_of(number: np.ndarray) -> list[np.ndarray]:
    """Rows that follow each other with one number (n,)."""
    return np.split(np.arange(len(number)), np.flatnonzero(np.diff(number)) + 1)


def set_down(plane: np.ndarray, label: np.ndarray) -> np.ndarray:
    """Say after which rows (n - 1,) a wheel was set down elsewhere: its position, (n, k) [m], jumps and is not wrong.

    Rows with another label (n,) are those of another wheel, run or pass. Where one coordinate is not known, the others
    decide.
    """
    answer = np.zeros(max(len(plane) - 1, 0), dtype=bool)
    for rows in runs_of(label):
        believed = _believed(plane[rows])
        new = _updates(believed)
        if len(new) < 2:
            continue
        moved = _distance(np.diff(believed[new], axis=0))
        # While positions were lost the wheel went on.
        seen = np.flatnonzero(np.isfinite(believed).any(axis=1))
        lost = new[1:] - seen[np.searchsorted(seen, new[1:]) - 1]
        longer = np.maximum(lost / np.median(np.diff(new)), 1.0)
        answer[rows[new[1:]] - 1] = moved > _JUMP * longer * _usual(moved)
    return answer


def _distance(apart: np.ndarray) -> np.ndarray:
    """Lengths of the coordinates that are known; zero where none is."""
    return np.linalg.norm(np.nan_to_num(apart), axis=-1)


def _updates(plane: np.ndarray) -> np.ndarray:
    """Rows (u,) whose position (n, k) was seen and is not that of the row before that was seen."""
    there = np.isfinite(plane).any(axis=0)
    seen = np.flatnonzero(np.isfinite(plane[:, there]).all(axis=1)) if there.any() else np.empty(0, dtype=int)
    if not len(seen):
        return seen
    return seen[np.append(True, (np.diff(plane[seen][:, there], axis=0) != 0.0).any(axis=1))]


def _usual(moved: np.ndarray) -> np.ndarray:
    """Usual step (n,) about each of some: the median of its neighbours, or of all where that is more."""
    if not (moved > 0.0).any():
        return np.full(len(moved), math.inf)
    return np.maximum(median_filter(moved, min(_ABOUT, len(moved)), mode="mirror"), np.median(moved[moved > 0.0]))


def _believed(plane: np.ndarray) -> np.ndarray:
    """Positions (n, k), NaN where they leave the track for some updates and come back to where they left it, and where
    the first update, or the last one, is off it alone.
    """
    new = _updates(plane)
    at = plane[new]
    moved = _distance(np.diff(at, axis=0))
    usual = _usual(moved)
    wrong = np.zeros(len(new), dtype=bool)
    jumps = np.flatnonzero(moved > _AWAY * usual)
    back = -1
    for out, home in zip(jumps[:-1].tolist(), jumps[1:].tolist(), strict=True):
        lasted, away = home - out, min(moved[out], moved[home])
        if out > back and lasted <= _LONGEST and _distance(at[home + 1] - at[out]) < _BACK * away:
            wrong[out + 1 : home + 1] = True
            back = home
    if len(moved) > _LONGEST:
        far = moved > _JUMP * usual
        wrong[0] |= far[0] and not far[1]
        wrong[-1] |= far[-1] and not far[-2]
    answer = plane.copy()
    held = np.searchsorted(new, np.arange(len(plane)), side="right") - 1
    answer[(held >= 0) & np.append(wrong, False)[held]] = math.nan
    return answer


def continuous(plane: np.ndarray, time_s: np.ndarray, stretch: np.ndarray) -> np.ndarray:
    """Positions (n, 2) [m] of stretches (n,) as a wheel runs through them: those that a slower receiver or a coarse
    encoder holds on the line in time between its updates, and lost and wrong ones between the others.
    """
    if not np.isfinite(time_s).all():
        return plane
    plane = plane.copy()
    for rows in runs_of(stretch):
        plane[rows] = _between_updates(_believed(plane[rows]), time_s[rows])
        for axis in range(plane.shape[1]):
            plane[rows, axis] = _bridged(plane[rows, axis], time_s[rows])
    return plane


def _between_updates(plane: np.ndarray, time_s: np.ndarray) -> np.ndarray:
    """Positions (m, 2) of one stretch, held ones between their updates, and on for no longer than one update."""
    there = np.isfinite(plane).any(axis=0)
    seen = np.isfinite(plane[:, there]).all(axis=1)
    new = _updates(plane)
    # When the first position came nobody knows.
    first, new = new[:1], new[1:]
    if len(new) < 2 or len(new) > _UPDATED * seen.sum():
        return plane
    at, updates = _knots(time_s, time_s[new], plane[new][:, there], plane[first[0], there])
    answer = plane.copy()
    near = _near(time_s, at)
    answer[np.ix_(near, there)] = np.column_stack([np.interp(time_s[near], at, axis) for axis in updates.T])
    return answer


def _knots(
    time_s: np.ndarray, at: np.ndarray, updates: np.ndarray, first: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:  # fmt: skip
    """Moments (k,) and positions (k, d) between which a wheel ran, from those of updates and its `first` position (d,).

    Where no update comes for longer than usual, the wheel stood until one before the next.
    """
    gaps = np.diff(at)
    usual = float(np.median(gaps))
    stood = np.flatnonzero(gaps > _OVERDUE * usual)
    before, after = 2.0 * updates[0] - updates[1], 2.0 * updates[-1] - updates[-2]
    began, ended = at[0] - usual, at[-1] + usual
    if at[0] - time_s[0] > _OVERDUE * usual:
        before = first
    if time_s[-1] - at[-1] > _OVERDUE * usual:
        after = updates[-1]
    moments = np.insert(at, stood + 1, at[stood + 1] - usual)
    positions = np.insert(updates, stood + 1, updates[stood], axis=0)
    return np.concatenate([[began], moments, [ended]]), np.vstack([before, positions, after])


def _bridged(place: np.ndarray, time_s: np.ndarray) -> np.ndarray:
    """Places (m,) [m] of one stretch, those that were not observed on the straight line in time between the ones that
    were, or on the line through its first and last at its ends; as they are in a long gap, or by a usual one before
    or after all, where much was not observed.
    """
    seen = np.isfinite(place)
    if seen.all() or seen.sum() < 2:
        return place
    first, last = np.flatnonzero(seen)[[0, -1]]
    speed = (place[last] - place[first]) / (time_s[last] - time_s[first])
    before, after = time_s - time_s[first], time_s - time_s[last]
    between = np.interp(time_s, time_s[seen], place[seen])
    whole = between + speed * (np.minimum(before, 0.0) + np.maximum(after, 0.0))
    if seen.mean() >= _SEEN:
        return whole
    known = time_s[seen]
    usual = _LESS * float(np.median(np.diff(known)))
    return np.where(_near(time_s, np.concatenate([[known[0] - usual], known, [known[-1] + usual]])), whole, place)


def _near(time_s: np.ndarray, known_s: np.ndarray) -> np.ndarray:
    """Say which moments (m,) lie in a gap between known ones (k,), k at least 2, that is no longer than usual."""
    gaps = np.diff(known_s)
    gap = np.clip(np.searchsorted(known_s, time_s, side="right") - 1, 0, len(gaps) - 1)
    inside = (time_s >= known_s[0]) & (time_s <= known_s[-1])
    return inside & (gaps[gap] <= _INTERVALS * np.median(gaps) * (1.0 + 1e-9))
