"""Blocks of rows that are held out together."""

from __future__ import annotations

import math

import numpy as np
from scipy.cluster.hierarchy import fcluster, linkage

from ...framework.core.track.positions import runs_of
from ..effects.effect import Drive

_BLOCKS, _PIECES = 12, 3
"""Blocks that are held out, and pieces of each of the two blocks of a ground where there are several grounds."""

_WIDEST = 0.09
"""Largest range of slip, or of load relative to the largest load, in one level that is held out [-]."""


def blocks_of(drive: Drive, grounds: int, classes: int) -> tuple[np.ndarray, str]:
    """Number the blocks to hold out, (n,), and describe them.

    They are conditions of trials, else stretches of time within runs and passes, or pieces of each ground in turn.

    Parameters
    ----------
    drive
        Covariates of n rows, in order of time within each stretch.
    grounds, classes
        Number of grounds, and of their classes.
    """
    count = len(drive)
    block = np.empty(count, dtype=int)
    if grounds > 1:
        for ground in range(grounds):
            rows = np.flatnonzero(drive.ground == ground)
            order = rows[np.argsort(drive.time_s[rows], kind="stable")]
            piece = np.arange(len(order)) * 2 * _PIECES // len(order)
            block[order] = 2 * ground + piece % 2
        by_class = ", effects from other classes, soil from the other half" if classes > 1 else ""
        return block, f"halves of grounds held out in turn{by_class}"
    if drive.timed:
        size, number = max(count // _BLOCKS, 1), 0
        for rows in runs_of(drive.stretch):
            parts = max(round(len(rows) / size), 1)
            for part in np.array_split(rows, parts):
                block[part] = number
                number += 1
        if number > 2 * _BLOCKS:
            return block * _BLOCKS // number, "groups of neighbouring runs held out in turn"
        return block, "stretches of time held out in turn"
    level, kind = np.arange(count) * min(_BLOCKS, count) // count, "groups of trials held out in turn"
    for name, values in (("slips", drive.slip), ("loads", drive.load_N / float(np.max(drive.load_N)))):
        apart = levels(values)
        if apart.max() >= 2:
            level, kind = levels(values, widest=_WIDEST), f"{name} held out in turn, all their repeats together"
            if level.max() > apart.max():
                kind = f"groups of like {name} held out in turn"
            break
    if level.max() >= _BLOCKS:
        level = level * _BLOCKS // (level.max() + 1)
    return level, kind


def levels(values: np.ndarray, apart: float = 0.03, widest: float = math.inf) -> np.ndarray:
    """Number the levels of a quantity (n,): sorted values that differ by at most `apart` are one level.

    A chain of such values that is wider than `widest` is divided into levels that are not.
    """
    order = np.argsort(values)
    along = values[order]
    ends = np.diff(along) > apart
    for chain in np.split(np.arange(len(values)), np.flatnonzero(ends) + 1):
        if len(chain) > 1 and np.ptp(along[chain]) > widest:
            like = fcluster(linkage(along[chain, None], "complete"), widest, "distance")
            ends[chain[:-1]] |= np.diff(like) != 0
    answer = np.empty(len(values), dtype=int)
    answer[order] = np.concatenate([[0], np.cumsum(ends)])
    return answer
