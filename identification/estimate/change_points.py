"""Where the soil itself changes within a drive, found from the wheels alone.

One soil cannot explain two: the residuals of the soil's answers then step at the border. A border is placed where the
step is largest and kept if two soils are worth their additional parameters (G. Schwarz, Ann. Statist. 6 (1978)), with
rows that repeat their neighbours' noise counting as one; each side is searched again (binary segmentation; A. J. Scott,
M. Knott, Biometrics 30 (1974)).
"""

from __future__ import annotations

import numpy as np
from scipy.ndimage import median_filter

from ...framework.core.soil import WRONG_FORM, SoilKnowledge
from ...framework.core.vehicle import Wheel
from ..rows.gate import LIMITS
from .autocorrelation import are_correlated, correlation_time
from .estimate import solve
from .noise_likelihood import with_autocorrelated_noise
from .solution import ANSWERS, Measured, Solution


def split_soils(
    measured: Measured, wheel: Wheel, known: SoilKnowledge, whole: Solution, offset: int = 0
) -> list[tuple[slice, Solution]]:
    """Cut samples in order of time into stretches of one soil each, with the fit of each.

    No stretch is shorter than what the gate uses.

    Parameters
    ----------
    measured
        Samples in order, every one with load and slip.
    wheel
        The wheel.
    known
        What is known of the soil; taken to hold on all of them.
    whole
        Their fit as one soil.
    offset
        Number of the first of these samples among all.
    """
    count, whole = len(measured.channels), with_autocorrelated_noise(measured, whole, wheel, known)
    undivided = [(slice(offset, offset + count), whole)]
    allowed = _long_enough(measured.order)
    if whole.misfit <= WRONG_FORM or not allowed.any():
        return undivided
    at = _largest_step(whole.fit.residuals[:, ANSWERS], allowed)
    parts = [measured.select(slice(0, at)), measured.select(slice(at, count))]
    fits = [solve(part, wheel, known) for part in parts]
    gain = sum(each.fit.log_likelihood for each in fits) - whole.fit.log_likelihood
    if gain / _repeated(fits, _window(measured.order)) <= 0.5 * len(whole.fit.information) * np.log(count):
        return undivided
    first, second = (
        split_soils(part, wheel, known, each, start)
        for part, start, each in zip(parts, (offset, offset + at), fits, strict=True)
    )
    return first + second


def _long_enough(order: np.ndarray) -> np.ndarray:
    """(n - 1,) True for borders before rows 1, 2 ... that leave enough rows, and time [s], on either side."""
    before = np.arange(1, len(order))
    rows = np.minimum(before, len(order) - before)
    time_s = np.minimum(order[1:] - order[0], order[-1] - order[1:])
    return (rows >= LIMITS.least_rows) & (time_s >= LIMITS.least_s)


def _window(order: np.ndarray) -> int:
    """Rows of the shortest stretch."""
    return max(LIMITS.least_rows, int(len(order) * LIMITS.least_s / (order[-1] - order[0])))


def _repeated(fits: list[Solution], window: int) -> float:
    """Number of neighbouring rows that say the same of what changes within a window: what changes later may be soil."""
    times = []
    for each in fits:
        left = np.nan_to_num(each.fit.residuals[:, ANSWERS])
        quick = left - median_filter(left, size=(window, 1), mode="nearest")
        times.append(correlation_time(quick[:, are_correlated(quick)]))
    return max(times)


def _largest_step(residuals: np.ndarray, allowed: np.ndarray) -> int:
    """Row at which the mean residual, (n, channels), steps most, of those before which a border is `allowed`."""
    count = len(residuals)
    before = np.arange(1, count)
    sums = np.cumsum(np.nan_to_num(residuals), axis=0)
    left, total = sums[:-1], sums[-1]
    step = left / before[:, None] - (total - left) / (count - before)[:, None]
    strength = np.sum(step**2, axis=1) * before * (count - before)
    return int(np.argmax(np.where(allowed, strength, -1.0))) + 1
