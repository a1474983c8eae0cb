"""How well load and slip are known: neighbours show how noisy they are at most, answers that follow them how little.

A slip that really changes from row to row looks like one that is measured badly. What the wheel answers tells them
apart: it follows the former, and not the latter.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...framework.core.soil import WRONG_FORM, SoilKnowledge
from ...framework.core.vehicle import Wheel
from ..rows.noise import least_noise
from .estimate import ANSWERS, Measured, Solution, solve
from .optimise import Fit, fit

TOLD = 25.0
"""Nats that less noise of load or slip has to gain before it is taken: a form that is wrong gains some, too."""

FEWEST = 100
"""Rows from which on they tell the noise of all channels beside five parameters of a soil."""

_IMPOSED = [0, 3]
"""Load and slip among `textbook.CHANNELS`."""

_STEPS, _ENOUGH = 20, 0.5
"""Steps to where the noise is likeliest, and how little the last of them gains [nats]: many fewer than are asked."""


def as_answers_tell(measured: Measured, wheel: Wheel, known: SoilKnowledge) -> tuple[Measured, Solution, list[str]]:
    """Fit one soil, with less noise than neighbours show where that is much likelier and the soil's form then holds.

    Parameters
    ----------
    measured
        Usable samples in order of time; noise that is `Measured.stated` stands.
    wheel, known
        As in `estimation.estimate_soil`.

    Returns
    -------
    The samples with the noise that was taken, their fit, and what is to be said of it.

    Raises
    ------
    InputError
        As in `estimation.solve`.
    """
    solution = solve(measured, wheel, known)
    noise = likeliest_noise(measured, solution)
    if np.array_equal(noise, measured.noise, equal_nan=True):
        return measured, solution, []
    quiet = replace(measured, noise=noise)
    found = solve(quiet, wheel, known)
    if found.misfit > WRONG_FORM:
        return measured, solution, []
    return quiet, found, said(measured.noise[_IMPOSED], noise[_IMPOSED])


def likeliest_noise(measured: Measured, solution: Solution) -> np.ndarray:
    """Noise (5,) of all channels that is likeliest beside a fit, at most what neighbours show.

    It is less only where load or slip gains much by less of it, by itself, and rows are enough to tell.
    """
    free = ~measured.stated & solution.problem.seen.any(axis=0)
    while len(measured.channels) >= FEWEST and free[_IMPOSED].any():
        fitted = beside_any_noise(solution, measured, free)
        noise = np.exp(fitted.point.log_sd)
        needless = [
            channel
            for channel in np.flatnonzero(free & ~ANSWERS).tolist()
            if noise[channel] > measured.noise[channel]
            or fitted.log_likelihood < _held(solution, measured, free, channel).log_likelihood + TOLD
        ]
        if not needless:
            return np.where(free, np.fmin(measured.noise, noise), measured.noise)
        free[needless[-1]] = False
    return measured.noise


def _held(solution: Solution, measured: Measured, free: np.ndarray, channel: int) -> Fit:
    """Fit beside the likeliest noise of channels that are `free` (5,), one of them held at what neighbours show."""
    others = free & (np.arange(len(free)) != channel)
    return beside_any_noise(solution, measured, others) if others.any() else solution.fit


def said(shown: np.ndarray, taken: np.ndarray) -> list[str]:
    """Say in words which of load [N] and slip change by more than their noise: (2,) that neighbours show, and taken."""
    return [
        f"{name} seems to change from row to row, for the other channels follow it: its noise is taken for "
        f"{less:.2g}{unit}, where neighbours show {noise:.2g}{unit}"
        for name, unit, noise, less in zip(("the load", "slip"), (" N", ""), shown, taken, strict=True)
        if less < noise
    ]


def beside_any_noise(solution: Solution, measured: Measured, free: np.ndarray) -> Fit:
    """Fit again, the noise of the channels that are `free` (5,) whatever is likeliest."""
    problem = solution.problem
    least = np.array([least_noise(channel) for channel in problem.filled.T])
    noise = np.where(free, np.fmin(measured.noise, least), measured.noise)
    problem = replace(problem, noise=noise, answers=problem.answers | free)
    return fit(problem, solution.fit.point, iterations=_STEPS, enough=_ENOUGH)
