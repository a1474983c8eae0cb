"""Rows in which the wheel carries nothing though its load cell reads a little: the noise of its zero."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from ...framework.core.track.positions import runs_of

_IN_THE_AIR, _LOADED = 0.5, 0.15
"""Share of readings at or below zero where the wheel carries nothing, and the most where it carries a little: one noise
of the load cell [-]."""

_BELOW, _ABOVE = math.log(_IN_THE_AIR / _LOADED), math.log((1.0 - _IN_THE_AIR) / (1.0 - _LOADED))
"""Nats by which a reading at or below zero, or one above it, adds to the evidence for a wheel in the air."""

_ENOUGH, _OVER = 3.5, 5.0
"""Nats from which on a stretch is in the air, three such readings in a row, and nats lost again at its end."""

_EDGE = 3
"""Readings above zero that a stretch in the air begins or ends with: by chance more once in eight."""

_MOST, _NEAR = 0.9, 2.0
"""Quantile of what is below zero that measures its noise, and how many of it lie above zero at most: 3.3 standard
deviations of a normal noise [-]."""


def carries_nothing(load_N: np.ndarray, stretch: np.ndarray) -> np.ndarray:
    """Rows (n,) whose load is at or below zero, or within the noise of zero where about half of the rows are so.

    How noisy the zero is shows in what lies below it, for no wheel carries less than nothing. Where the wheel is in the
    air is found as a run of readings that are below zero too often (E. S. Page, Biometrika 41 (1954), 100-115).

    Parameters
    ----------
    load_N : (n,)
        Load [N] in order of time; NaN where it was not observed.
    stretch : (n,)
        Number of the uninterrupted stretch of each row.
    """
    answer = load_N <= 0.0
    if not answer.any():
        return answer
    for rows in runs_of(stretch):
        load, below = load_N[rows], answer[rows]
        aloft = _in_the_air(below) | _in_the_air(below[::-1])[::-1]
        for there in runs_of(aloft):
            if aloft[there[0]]:
                noise = _NEAR * float(np.quantile(-load[there][below[there]], _MOST))
                there = np.arange(max(there[0] - _EDGE, 0), min(there[-1] + _EDGE + 1, len(rows)))
                answer[rows[there]] |= load[there] <= noise
    return answer


@njit(cache=True)
def _in_the_air(below: np.ndarray) -> np.ndarray:
    """(n,) True from the first to the last row of each run of rows that are too often `below` zero, (n,) of bool."""
    answer = np.zeros(len(below), dtype=np.bool_)
    first, last, nats, most = 0, 0, 0.0, 0.0
    for row in range(len(below)):
        each = below[row]
        if nats <= 0.0:
            first, nats, most = row, 0.0, 0.0
        nats += _BELOW if each else _ABOVE
        last, most = (row if each else last), max(most, nats)
        over = nats <= 0.0 or most - nats > _OVER or row == len(below) - 1
        if over and most >= _ENOUGH:
            answer[first : last + 1] = True
        if over:
            nats = 0.0
    return answer
