"""Where the soil itself changes within a drive, found from the wheels alone.

One soil cannot explain two: the residuals of the soil's answers then step at the border. A border is placed where the
step is largest and kept if two soils are worth their additional parameters (G. Schwarz, Ann. Statist. 6 (1978)); each
side is searched again (binary segmentation; A. J. Scott, M. Knott, Biometrics 30 (1974)).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..framework.core.soil import SoilKnowledge
from ..framework.core.vehicle import Wheel
from .estimation import ANSWERS, WRONG_FORM, Measured, Solution, solve


def split_soils(
    measured: Measured, wheel: Wheel, known: SoilKnowledge, whole: Solution, *, least_rows: int
) -> list[tuple[slice, Solution]]:
    """Cut samples in order of time into stretches of one soil each, with the fit of each.

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
    least_rows
        No stretch is shorter [-].
    """
    return _split(measured, wheel, known, least_rows, 0, whole)


def _split(
    measured: Measured, wheel: Wheel, known: SoilKnowledge, least_rows: int, offset: int, whole: Solution
) -> list[tuple[slice, Solution]]:
    count = len(measured.channels)
    undivided = [(slice(offset, offset + count), whole)]
    if whole.misfit <= WRONG_FORM or count < 2 * least_rows:
        return undivided
    at = _largest_step(whole.fit.residuals[:, ANSWERS], least_rows)
    parts = [_part(measured, slice(0, at)), _part(measured, slice(at, count))]
    fits = [solve(part, wheel, known) for part in parts]
    gain = sum(each.fit.log_likelihood for each in fits) - whole.fit.log_likelihood
    if gain <= 0.5 * len(whole.fit.information) * np.log(count):
        return undivided
    first, second = (
        _split(part, wheel, known, least_rows, start, each)
        for part, start, each in zip(parts, (offset, offset + at), fits, strict=True)
    )
    return first + second


def _part(measured: Measured, rows: slice) -> Measured:
    return replace(measured, channels=measured.channels[rows], order=measured.order[rows])


def _largest_step(residuals: np.ndarray, least_rows: int) -> int:
    """Row at which the mean residual, (n, channels), steps most, at least `least_rows` from either end."""
    count = len(residuals)
    before = np.arange(1, count)
    sums = np.cumsum(np.nan_to_num(residuals), axis=0)
    left, total = sums[:-1], sums[-1]
    step = left / before[:, None] - (total - left) / (count - before)[:, None]
    strength = np.sum(step**2, axis=1) * before * (count - before)
    strength[: least_rows - 1] = strength[count - least_rows :] = -1.0
    return int(np.argmax(strength)) + 1
