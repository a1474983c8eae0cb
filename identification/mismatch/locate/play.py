"""Which way a quantity came to where it is: play in a linkage and hysteresis depend on it, and on nothing else.

The play operator of M. A. Krasnosel'skii, A. V. Pokrovskii, "Systems with Hysteresis" (1989).
"""

from __future__ import annotations

import numpy as np
from numba import njit

BEHIND_PLAY = " (behind play)"
"""Ends the public name of what is left of a quantity that play holds back."""

_WIDTHS = 0.03, 0.1
"""Half widths of play as a share of how far the quantity goes: hysteresis takes hold at once, a loose joint later."""


def held_back(values: np.ndarray, stretch: np.ndarray) -> np.ndarray:
    """By how much play holds back a quantity (n,), (n, 2), each in its own half widths: about -1 where it rises, 1
    where it falls.

    The play of each stretch, whose numbers are (n,), begins in its middle: which way it lay nobody knows. Rows stand in
    order of time; unseen values are passed over and stay 0.
    """
    known = np.isfinite(values)
    answer = np.zeros((len(values), len(_WIDTHS)))
    if not known.any() or not np.ptp(values[known]) > 0.0:
        return answer
    for column, share in enumerate(_WIDTHS):
        half = share * float(np.ptp(values[known]))
        answer[known, column] = (_behind(values[known], stretch[known], half) - values[known]) / half
    return answer


@njit(cache=True, nogil=True)
def _behind(values, stretch, half):
    """What play of a half width lets through of values (n,), stretch by stretch."""
    answer = np.empty(len(values))
    for row in range(len(values)):
        if row == 0 or stretch[row] != stretch[row - 1]:
            answer[row] = values[row]
        else:
            answer[row] = min(max(answer[row - 1], values[row] - half), values[row] + half)
    return answer
