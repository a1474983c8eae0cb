"""Which rows lie on one piece of ground, side by side or one pass over the other."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ...effects.effect import Drive

if TYPE_CHECKING:
    from .samples import Samples


def lanes(drive: Drive, width_m: float) -> np.ndarray:
    """Number the tracks, (n,): a wheel that starts over on fresh ground, or on ground unsaid, is on another, and so is
    one that runs more than the width of a wheel beside, where tracks are straight.
    """
    first = np.flatnonzero(np.diff(drive.stretch, prepend=drive.stretch[0] - 1) != 0)
    last = np.append(first[1:], len(drive)) - 1
    fresh = ~(np.nan_to_num(drive.pass_number[first], nan=1.0) > 1.0)
    beside = _beside(drive, first, fresh, width_m)
    order = np.argsort(beside, kind="stable")
    back = np.concatenate([[False], drive.place_m[first[order][1:]] < drive.place_m[last[order][:-1]]])
    other = np.diff(beside[order], prepend=beside[order[0]]) != 0
    lane = np.empty(len(first), dtype=int)
    lane[order] = np.cumsum(other | (back & fresh[order]))
    return np.repeat(lane, last - first + 1)


def _beside(drive: Drive, first: np.ndarray, fresh: np.ndarray, width_m: float) -> np.ndarray:
    """Number of the lane, side by side, that each stretch runs on, (s,), by its `first` row (s,).

    Lanes are where stretches on `fresh` ground (s,) ran; a later pass is on the nearest one.
    """
    one = np.zeros(len(first), dtype=int)
    if drive.axis is None:
        return one
    across = drive.axis[0] * drive.y_m - drive.axis[1] * drive.x_m
    seen = np.isfinite(across)
    count = np.add.reduceat(seen.astype(float), first)
    if not count.all():
        return one
    middle = np.add.reduceat(np.where(seen, across, 0.0), first) / count
    known = np.sort(middle[fresh] if fresh.any() else middle)
    number = np.cumsum(np.diff(known, prepend=known[0]) > width_m)
    return number[np.argmin(np.abs(middle[:, None] - known), axis=1)]


def passes_apart(samples: Samples) -> Samples:
    """Give the samples with each pass on ground of its own, as where the pass before has stirred it."""
    number = samples.drive.pass_number
    if not (np.isfinite(samples.drive.place_m).all() and np.isfinite(number).all()):
        return samples
    changes = np.concatenate([[0], np.cumsum(np.diff(number) != 0.0)])
    lane = np.unique(np.stack([samples.lane, changes]), axis=1, return_inverse=True)[1]
    return replace(samples, lane=lane.reshape(-1))
