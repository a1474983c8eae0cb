"""Positions as they are recorded: set down elsewhere, held between updates, lost for a while."""

from __future__ import annotations

import math

import numpy as np

_JUMP = 20.0
"""Usual steps [-] by which a place that is reached from one sample to the next cannot have been driven to."""

_SEEN = 0.9
"""Share of the places of a stretch that have to be known for the others to be put between them [-]."""

_UPDATED = 0.5
"""Most of the rows that have a new position where positions are held between updates [-]."""


def runs_of(number: np.ndarray) -> list[np.ndarray]:
    """Rows that follow each other with one number (n,)."""
    return np.split(np.arange(len(number)), np.flatnonzero(np.diff(number)) + 1)


def set_down(plane: np.ndarray) -> np.ndarray:
    """Say after which rows (n - 1,) a wheel was set down elsewhere: its position, (n, k) [m], jumps, and does not come
    back with the next row, as a single one that is wrong does. Where one coordinate is not known, the others tell.
    """
    moved = _distance(np.diff(plane, axis=0), 0.0)
    if not (moved > 0.0).any():
        return np.zeros(len(moved), dtype=bool)
    over_two = np.concatenate([[math.inf], _distance(plane[2:] - plane[:-2], math.inf), [math.inf]])
    far = _JUMP * np.median(moved[moved > 0.0])
    return (moved > far) & (over_two[:-1] > far) & (over_two[1:] > far)


def _distance(apart: np.ndarray, unknown: float) -> np.ndarray:
    known = np.isfinite(apart)
    return np.where(known.any(axis=1), np.linalg.norm(np.where(known, apart, 0.0), axis=1), unknown)


def continuous(plane: np.ndarray, time_s: np.ndarray, stretch: np.ndarray) -> np.ndarray:
    """Positions (n, 2) [m] of stretches (n,) as a wheel runs through them: those that a slower receiver or a coarse
    encoder holds, on the line in time between its updates; lost ones on that between the ones that were seen.
    """
    if not np.isfinite(time_s).all():
        return plane
    plane = plane.copy()
    for rows in runs_of(stretch):
        plane[rows] = _between_updates(plane[rows], time_s[rows])
        for axis in range(plane.shape[1]):
            plane[rows, axis] = _bridged(plane[rows, axis], time_s[rows])
    return plane


def _between_updates(plane: np.ndarray, time_s: np.ndarray) -> np.ndarray:
    """Positions (m, 2) of one stretch, held ones between their updates, and on for no longer than one update."""
    seen = np.isfinite(plane)
    new = np.flatnonzero((np.nan_to_num(np.diff(plane, axis=0)) != 0.0).any(axis=1)) + 1
    if len(new) < 2 or len(new) > _UPDATED * len(plane) or (seen.any(axis=0) != seen.all(axis=0)).any():
        return plane
    at = time_s[new]
    first, last = at[1] - at[0], at[-1] - at[-2]
    ends = np.concatenate([[at[0] - first], at, [at[-1] + last]])
    there = np.vstack([2.0 * plane[new[0]] - plane[new[1]], plane[new], 2.0 * plane[new[-1]] - plane[new[-2]]])
    return np.column_stack([np.interp(time_s, ends, axis) for axis in there.T])


def _bridged(place: np.ndarray, time_s: np.ndarray) -> np.ndarray:
    """Places (m,) [m] of one stretch, those that were not observed on the straight line in time between the ones that
    were, or on the line through its first and last at its ends; as they are where much of it was not observed.
    """
    seen = np.isfinite(place)
    if seen.all() or seen.sum() < max(2.0, _SEEN * len(place)):
        return place
    first, last = np.flatnonzero(seen)[[0, -1]]
    speed = (place[last] - place[first]) / (time_s[last] - time_s[first])
    before, after = time_s - time_s[first], time_s - time_s[last]
    between = np.interp(time_s, time_s[seen], place[seen])
    return between + speed * (np.minimum(before, 0.0) + np.maximum(after, 0.0))
