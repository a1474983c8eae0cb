"""Sensors whose noise lasts from row to row, as behind a low-pass filter, and of which nothing is stated.

Second differences of neighbours show how little such noise changes within a row, and not how large it is. Its size
shows in what one soil leaves of all channels together: rows that repeat each other tell that as well as others do, only
less surely, and the intervals count how many of them say the same (`estimation.solve`).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...framework.core.soil import WRONG_FORM, SoilKnowledge
from ...framework.core.vehicle import Wheel
from .estimate import Measured, Solution, solve
from .noise_likelihood import FEWEST, beside_any_noise

_WORTH_A_WORD = 2.0
"""Rows that count as one from which on a note says so."""


def as_rows_repeat(measured: Measured, solution: Solution, wheel: Wheel, known: SoilKnowledge) -> Solution:
    """Fit again beside the likeliest noise where a fit misses more than neighbours show, and noise that lasts is it.

    Parameters
    ----------
    measured
        Usable samples in order of time; noise that is `Measured.stated` stands.
    solution
        Their fit as one soil.
    wheel, known
        As in `estimation.estimate_soil`.
    """
    free = ~measured.stated & solution.problem.seen.any(axis=0)
    if solution.misfit <= WRONG_FORM or solution.repeated == 1.0 or not free.any() or len(measured.channels) < FEWEST:
        return solution
    noise = np.exp(beside_any_noise(solution, measured, free).point.log_sd)
    found = solve(replace(measured, noise=np.where(free, noise, measured.noise)), wheel, known)
    return found if found.misfit <= WRONG_FORM and found.repeated > 1.0 else solution


def said(measured: Measured, solution: Solution) -> tuple[str, ...]:
    """Say in words that the noise of samples lasts, where it does, and whether more of it is taken than they show."""
    if solution.repeated < _WORTH_A_WORD:
        return ()
    same = np.array_equal(solution.problem.noise, measured.noise, equal_nan=True)
    larger = "" if same else "; it is taken to be larger than neighbours, which share it, differ by"
    return (
        f"the sensors' noise lasts from row to row, as behind a filter: about {solution.repeated:.0f} neighbouring "
        f"rows count as one{larger}",
    )
