"""Sensor noise by maximum likelihood, where the vehicle states none and neighbouring rows do not show it.

Second differences of neighbours are the usual measure (`rows.noise`). They take for noise what load and slip really
change by from row to row, which the wheel's answers follow; and they show little of noise that is autocorrelated, as
behind a low-pass filter, whose size shows only in what one soil leaves of all channels together.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...framework.core.findings import Finding, note
from ...framework.core.soil import WRONG_FORM, SoilKnowledge
from ...framework.core.vehicle import Wheel
from ..mechanics.textbook import CHANNELS
from ..rows.noise import least_noise
from .estimate import solve
from .optimise import Fit, fit
from .solution import ANSWERS, Measured, Solution

LEAST_GAIN = 25.0
"""Nats that less noise of load or slip has to gain before it is taken: a form that is wrong gains some, too."""

FEWEST = 100
"""Fewest rows that determine the noise of all channels and five parameters of a soil."""

_IMPOSED = np.flatnonzero(~ANSWERS)
"""Load and slip among `textbook.CHANNELS`."""

_STEPS, _ENOUGH = 20, 0.5
"""Most steps to the maximum of the likelihood, and how little the last of them gains [nats]."""

_NOTED = 2.0
"""Rows that count as one above which it is noted."""


def solve_with_noise(
    measured: Measured, wheel: Wheel, known: SoilKnowledge, alone: Solution | None = None
) -> tuple[Measured, Solution, list[Finding]]:
    """Fit one soil, with less noise of load and slip than neighbours show where that has a much larger likelihood.

    Parameters
    ----------
    measured
        Usable samples in order of time; noise that is `Measured.stated` stands.
    wheel, known
        As in `estimate.estimate_soil`.
    alone
        Their fit with the noise that neighbours show, where it is known already.

    Returns
    -------
    Measured
        The samples with the noise that was taken: less of it only where the soil's form then holds.
    Solution
        Their fit.
    list of Finding
        ``unsteady_input`` for load or slip, where less noise was taken.

    Raises
    ------
    InputError
        As in `estimate.solve`.
    """
    solution = alone or solve(measured, wheel, known)
    noise = likeliest_noise(measured, solution)
    if np.array_equal(noise, measured.noise, equal_nan=True):
        return measured, solution, []
    quiet = replace(measured, noise=noise)
    found = solve(quiet, wheel, known)
    if found.misfit > WRONG_FORM:
        return measured, solution, []
    return (
        quiet,
        found,
        [
            note("unsteady_input", channel=CHANNELS[at], noise=float(noise[at]), shown=float(measured.noise[at]))
            for at in _IMPOSED.tolist()
            if noise[at] < measured.noise[at]
        ],
    )


def likeliest_noise(measured: Measured, solution: Solution) -> np.ndarray:
    """Maximum-likelihood noise (5,) of all channels at a fit, at most what neighbours show.

    It is less only where load or slip alone gains `LEAST_GAIN` by it, of `FEWEST` rows or more.
    """
    free = ~measured.stated & solution.problem.seen.any(axis=0)
    while len(measured.channels) >= FEWEST and free[_IMPOSED].any():
        fitted = _with_free_noise(solution, measured, free)
        noise = np.exp(fitted.point.log_sd)
        needless = [
            channel
            for channel in np.flatnonzero(free & ~ANSWERS).tolist()
            if noise[channel] > measured.noise[channel]
            or fitted.log_likelihood < _held(solution, measured, free, channel).log_likelihood + LEAST_GAIN
        ]
        if not needless:
            return np.where(free, np.fmin(measured.noise, noise), measured.noise)
        free[needless[-1]] = False
    return measured.noise


def _held(solution: Solution, measured: Measured, free: np.ndarray, channel: int) -> Fit:
    """Fit with the noise of channels `free` (5,), one of them held at what neighbours show."""
    others = free & (np.arange(len(free)) != channel)
    return _with_free_noise(solution, measured, others) if others.any() else solution.fit


def _with_free_noise(solution: Solution, measured: Measured, free: np.ndarray) -> Fit:
    """Fit again, the noise of the channels that are `free` (5,) with it."""
    problem = solution.problem
    least = np.array([least_noise(channel) for channel in problem.filled.T])
    noise = np.where(free, np.fmin(measured.noise, least), measured.noise)
    problem = replace(problem, noise=noise, answers=problem.answers | free)
    return fit(problem, solution.fit.point, iterations=_STEPS, enough=_ENOUGH)


def with_autocorrelated_noise(measured: Measured, solution: Solution, wheel: Wheel, known: SoilKnowledge) -> Solution:
    """Fit again with the maximum-likelihood noise where that of a fit is autocorrelated and more than neighbours show.

    Correlated rows estimate the size of such noise without bias; the intervals count how many of them are worth one
    (`estimate.solve`).

    Parameters
    ----------
    measured
        Usable samples in order of time; noise that is `Measured.stated` stands.
    solution
        Their fit as one soil.
    wheel, known
        As in `estimate.estimate_soil`.
    """
    free = ~measured.stated & solution.problem.seen.any(axis=0)
    if solution.misfit <= WRONG_FORM or solution.repeated == 1.0 or not free.any() or len(measured.channels) < FEWEST:
        return solution
    noise = np.exp(_with_free_noise(solution, measured, free).point.log_sd)
    found = solve(replace(measured, noise=np.where(free, noise, measured.noise)), wheel, known)
    return found if found.misfit <= WRONG_FORM and found.repeated > 1.0 else solution


def autocorrelation_finding(measured: Measured, solution: Solution) -> tuple[Finding, ...]:
    """Note that the noise of samples is autocorrelated, where it is, and whether more is taken than neighbours show."""
    if solution.repeated < _NOTED:
        return ()
    larger = not np.array_equal(solution.problem.noise, measured.noise, equal_nan=True)
    return (note("autocorrelated_noise", rows=solution.repeated, larger=larger),)
