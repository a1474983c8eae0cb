"""Least error that a model can leave of rows held out, and how far beyond it what was found leaves them."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np

from ...noise import in_time, scatter_along_slip
from ..fit.fitting import Fitted, Problem
from ..fit.memory import rho_shown
from ..fit.remembering import REMEMBERED
from ..fit.trial import Trial

_SWALLOWED = 1.6
"""A sensor without a memory is no noisier than so many times what neighbours in time show of it, and trials scatter by
no more than so many times what neighbours in slip show [-]: a fit that takes what it misses for noise would say more.
Of 36 channels of nulls of the study none came out above 1.4, of 261 of trials by other hands none above 1.45."""

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
    floor = math.sqrt(sensor**2 + float(np.mean(uncertain + varying)))
    drive = problem.samples.drive
    if drive.timed:
        return floor
    # Trials are each on ground of their own: whatever varies, neighbours in slip show all of it.
    shown = scatter_along_slip(drive.load_N, drive.slip, fitted.residuals[:, position])
    return min(floor, _SWALLOWED * shown) if math.isfinite(shown) else floor


def swallowed(problem: Problem, fitted: Fitted, position: int) -> bool:
    """Say whether a fit takes for noise of a channel what neighbouring rows do not show and no memory makes
    that is not counted yet.
    """
    drive = problem.samples.drive
    if not drive.timed:
        return False
    shown = float(problem.first_noise.answers[position])
    series = in_time(problem.memory.new_in(fitted.residuals)[:, position], drive.stretch)
    return float(fitted.noise.answers[position]) > _SWALLOWED * shown and rho_shown(series) < REMEMBERED


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
