"""Least error that a model can leave of rows held out, and how far beyond it what was found leaves them."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np

from ...noise import in_time
from ..fit.fitting import Fitted, Problem
from ..fit.soil_variation import correlation
from ..fit.trial import Trial

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

_BORNE_OUT = 0.5
"""Share of the neighbours in place that are of different passes, from which on these bear out that the ground varies: a
memory of the noise would not return with the place [-]."""

_STEPS_APART = (1, 2, 3)
"""Rows between those whose differences tell a memory."""

_SWALLOWED = 1.6
"""A sensor without a memory is no noisier than so many times what neighbours in time show of it [-]: a fit that takes
what it misses for noise would say more. Of 36 channels of nulls of the study none came out above 1.4."""

FAR = 0.7
"""Distance of the errors on held-out rows from the noise, a mean over the channels of ln(ratio), from which on a form
is wrong [-]: of 439 sets that were asserted on recordings of the study, all looked at since, those that were right left
errors 0.54 above the noise at most, but for one."""


def noise_floor(problem: Problem, fitted: Fitted, position: int) -> float:
    """Error that a fit expects: of the sensor, of load and slip, and of ground that varies unforeseen."""
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


def rows_alike(series: list[np.ndarray], of_ground: np.ndarray | float = 0.0) -> float:
    """(1 + rho) / (1 - rho) of a first-order autoregression, from how much more two steps differ than one: 1 + rho
    times. Three differ 1 + rho + rho^2 times; ground that varies and misfit are smooth, and theirs differ more.

    Parameters
    ----------
    series
        Stretches of neighbours in time.
    of_ground : (3,)
        Mean squares of differences over one, two and three rows that are known to be the ground's (`ground_apart`).
    """
    squares, count = np.empty(len(_STEPS_APART)), 0
    for index, step in enumerate(_STEPS_APART):
        apart = np.concatenate([np.abs(values[step:] - values[:-step]) for values in series] or [np.empty(0)])
        apart = apart[np.isfinite(apart)]
        count = len(apart)
        if count < FEWEST or not np.median(apart) > 0.0:
            return 1.0
        # A gross error is cut off, or it would be most of it.
        squares[index] = np.mean(np.minimum(apart, _GROSS * np.median(apart)) ** 2)
    left = squares - of_ground
    if not left[0] > 0.0:
        return 1.0
    two, three = left[1:] / left[0] - 1.0
    scatter = _SCATTER / np.sqrt(count) * squares[0] / left[0]
    if not SHOWN * scatter < two < 1.0 + SHOWN * scatter or three > two * (1.0 + two) + 2.0 * SHOWN * scatter:
        return 1.0
    # Rather too little than too much: near one a small error of it is a large one of what it makes.
    rho = min(two - scatter, _MOST_ALIKE)
    return (1.0 + rho) / (1.0 - rho)


def ground_apart(problem: Problem, fitted: Fitted, position: int) -> np.ndarray:
    """Mean squares (3,), SI, of what neighbours one, two and three rows apart in time differ by in a channel for the
    ground's varying; nothing where no other passes bear that out, for a memory of the noise passes for it there.
    """
    samples, noise = problem.samples, fitted.noise
    stretch, place = samples.drive.stretch, samples.position
    beside = np.isfinite(problem.gap[1:])
    if not beside.any() or np.mean((np.diff(stretch[problem.order]) != 0)[beside]) < _BORNE_OUT:
        return np.zeros(len(_STEPS_APART))
    by_ground = np.nan_to_num((problem.weights or fitted.response).by_ground[:, problem.answers[position]])
    felt, answer = by_ground * noise.spread, []
    for step in _STEPS_APART:
        first, second = felt[:-step], felt[step:]
        alike = correlation(place[step:] - place[:-step], noise)[:, None]
        squares = np.sum(first**2 + second**2 - 2.0 * alike * first * second, axis=1)
        inside = stretch[step:] == stretch[:-step]
        answer.append(float(squares[inside].sum() / max(inside.sum(), 1)))
    return np.array(answer)
