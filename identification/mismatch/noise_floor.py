"""Least error that a model can leave of rows held out, and how far beyond it what was found leaves them."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np

from .fitting import Fitted, Problem
from .trial import Trial

SHOWN = 3.0
"""An autocorrelation counts from so many of its standard deviations on, as white noise has them [-]."""

FEWEST = 25
"""Rows below which a channel does not tell."""

_SCATTER = 1.45
"""Standard deviation of the rho that differences show of white noise, times the root of the number of rows [-]."""

_MOST_ALIKE = 0.95
"""Neighbours are taken to be no more alike than so [-]."""

_GROSS = 5.0
"""Differences are cut off at so many of their medians [-]."""

_REMEMBERED = 1.5
"""Rows that say the same from which on noise has a memory: neighbours then show less of it than there is."""

_SWALLOWED = 1.6
"""A sensor without a memory is no noisier than so many times what neighbours in time show of it [-]: a fit that takes
what it misses for noise would say more. Of 36 channels of nulls of the study none came out above 1.4."""

FAR = 0.7
"""Distance of the errors on held-out rows from the noise, a mean over the channels of ln(ratio), from which on a form
is wrong [-]: of 439 sets that were asserted on recordings of the study, all looked at since, those that were right left
errors 0.54 above the noise at most, but for one."""


def noise_floor(problem: Problem, fitted: Fitted, position: int) -> float:
    """Least error to be had: the sensor's noise, what uncertain load and slip do, and ground that varies unforeseen."""
    weights = problem.weights or fitted.response
    channel = problem.answers[position]
    by_latent, by_ground = np.nan_to_num(weights.by_latent[:, channel]), np.nan_to_num(weights.by_ground[:, channel])
    uncertain = np.einsum("na,ab,nb->n", by_latent, problem.latent_covariance, by_latent)
    varying = by_ground**2 @ fitted.noise.spread**2
    sensor = float(fitted.noise.answers[position])
    if swallowed(problem, fitted, position):
        sensor = _SWALLOWED * float(problem.first_noise.answers[position])
    return math.sqrt(sensor**2 + float(np.mean(uncertain + varying)))


def swallowed(problem: Problem, fitted: Fitted, position: int) -> bool:
    """Say whether a fit takes for noise of a channel what neighbouring rows do not show and no memory makes."""
    drive = problem.samples.drive
    if not drive.timed:
        return False
    shown = float(problem.first_noise.answers[position])
    series = in_time(fitted.residuals[:, position], drive.stretch)
    return float(fitted.noise.answers[position]) > _SWALLOWED * shown and rows_alike(series) < _REMEMBERED


def dispersion(problem: Problem, tried: Iterable[Trial]) -> float:
    """Variance of held-out residuals over the noise's, by the set that leaves least, 1 where one leaves little more.

    Where every form is wrong, rows err by more than the noise and not independently: scores differ by chance by as much
    more, and are to be divided by it (P. McCullagh and J. A. Nelder, "Generalized Linear Models" (1989), Sec. 4.5; of
    model selection K. P. Burnham and D. R. Anderson (2002), Sec. 2.5).
    """
    answers = range(len(problem.answers))
    distances = []
    for trial in tried:
        floor = np.array([noise_floor(problem, trial.fitted, each) for each in answers])
        # What was not predicted is off by all of it.
        left = np.where(np.isfinite(trial.held_out.residuals), trial.held_out.residuals, problem.measured)
        error = np.sqrt(np.nanmean(np.where(problem.seen, left, np.nan) ** 2, axis=0))
        seen = error > 0.0
        distances.append(float(np.log(error[seen] / floor[seen]).mean()) if seen.any() else 0.0)
    least = min(distances, default=0.0)
    return math.exp(2.0 * least) if least > FAR else 1.0


def rows_alike(series: list[np.ndarray]) -> float:
    """(1 + rho) / (1 - rho) of a first-order autoregression, from how much more two steps differ than one: 1 + rho
    times. Three differ 1 + rho + rho^2 times; ground that varies and misfit are smooth, and theirs differ more.
    """
    squares = []
    for step in (1, 2, 3):
        apart = np.concatenate([np.abs(values[step:] - values[:-step]) for values in series] or [np.empty(0)])
        apart = apart[np.isfinite(apart)]
        if len(apart) < FEWEST or not np.median(apart) > 0.0:
            return 1.0
        # A gross error is cut off, or it would be most of it.
        squares.append(float(np.mean(np.minimum(apart, _GROSS * np.median(apart)) ** 2)))
    two, three = squares[1] / squares[0] - 1.0, squares[2] / squares[0] - 1.0
    scatter = _SCATTER / np.sqrt(len(apart))
    if not SHOWN * scatter < two < 1.0 + SHOWN * scatter or three > two * (1.0 + two) + 2.0 * SHOWN * scatter:
        return 1.0
    # Rather too little than too much: near one a small error of it is a large one of what it makes.
    rho = min(two - scatter, _MOST_ALIKE)
    return (1.0 + rho) / (1.0 - rho)


def in_time(values: np.ndarray, stretch: np.ndarray) -> list[np.ndarray]:
    """Series of neighbours in time."""
    ends = np.flatnonzero(np.diff(stretch)) + 1
    return [each for each in np.split(values, ends) if len(each) > 2]
