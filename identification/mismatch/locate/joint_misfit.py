"""What a fit leaves of slip and load in all channels together, each part of it too little to be a finding."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.polynomial.legendre import legvander
from scipy.linalg import orth

from ....framework.core.soil import PARAMETERS
from ...mechanics.textbook import CHANNELS
from ..fit.fitting import Fitted, Problem, fit
from ..fit.held_out import HeldOut, summed
from ..fit.samples import Samples
from ..fit.soil_variation import HUBER, NoiseModel, huber_loss
from ..fit.textbook import QUIET
from .coming_round import coming_round
from .smooth_correction import NO_WORSE, STRENGTH, Group, SmoothCorrection, Solver, Term

_DEGREE = 3
"""Of the polynomials of slip, and of load: on four loads in turn errors have either sign."""

_HELD = 0.02
"""Loads that scatter by less, a share of their mean, are one load [-]."""

_APART = 1e-3
"""Columns whose part of their own is a smaller share tell nothing [-]."""

WORTH, _NEXT_TO_NOTHING = 15.0, 2.0
"""Nats that a correction of all channels together has to gain, and those that a part of it has to be worth: a
column that tells nothing is worth more than one nat by chance 16 times in a hundred, more than two 5 times (half a
chi-square of one degree)."""


def nats_in_all(problem: Problem, fitted: Fitted, repeated: float = 1.0) -> float:
    """Nats by which what a fit leaves follows slip and load more closely than noise does; below zero where less.

    The score test (C. R. Rao, Proc. Camb. Phil. Soc. 44 (1948), 50-57) of polynomials of slip and load that are added
    to all channels at once: what the fit's own parameters would take of them is taken off, and half a nat for each, by
    which noise follows them. A correction by one of them (`smooth_correction`) has to stand for itself.

    Parameters
    ----------
    problem, fitted
        The samples, and the fit that leaves it.
    repeated
        Number of neighbouring rows that say the same.
    """
    courses = _courses(problem.samples)
    count, channels = len(problem.measured), len(problem.answers)
    added = np.einsum("nk,cd->ncdk", courses, np.diag(fitted.noise.answers)).reshape(count, channels, -1)
    innovations, jacobian, columns = problem.whitened_columns(fitted, fitted.noise, added)
    left = np.clip(innovations, -HUBER, HUBER).ravel()
    own = orth(_of_one_size(jacobian.reshape(left.size, -1)))
    columns = _of_one_size(columns.reshape(left.size, -1))
    further = orth(columns - own @ (own.T @ columns), rcond=_APART)
    return 0.5 * (float(np.sum((further.T @ (left - own @ (own.T @ left))) ** 2)) / repeated - further.shape[1])


def joint_correction(
    problem: Problem, fitted: Fitted, alone: HeldOut, *, turning: bool = False
) -> SmoothCorrection | None:  # fmt: skip
    """Find what a fit leaves of slip and load in all channels together, the noise following; None where too little.

    A misfit that no channel shows by itself may pass for ground that varies, and is none beside the ground that is left
    once it is taken off: the corrections are weighed with the likeliest noise beside them against the fit with its own.

    Parameters
    ----------
    problem, fitted
        The samples, and the fit that leaves it.
    alone
        How the fit predicts by itself.
    turning
        Whether to look for what comes round with the wheel or along the track, too (`coming_round`).
    """
    plain = Solver(problem, fitted, [])
    without = _weigh(plain, []) - _cost(problem, fitted, fitted.noise)
    groups = _groups(problem) + (coming_round(problem, fitted) if turning else [])
    solvers = [_beside(problem, each, groups) for each in (fitted, *_told(problem, fitted))]
    solver, cost = max(solvers, key=lambda pair: _weigh(pair[0], list(range(len(groups)))) - pair[1])
    kept = _needed(solver, groups)
    gain = _worth(solver, groups, kept) - cost - without
    left = solver.held_out(kept)
    growth = replace(alone, residuals=left).error(problem) - alone.error(problem)
    if not kept or gain < WORTH or growth > math.log(NO_WORSE):
        return None
    share = gain / len(kept)
    terms = tuple(
        Term(CHANNELS[problem.answers[groups[index].position]], groups[index].variable, groups[index].at, values, share)
        for index, values in zip(kept, solver.added(kept), strict=True)
    )
    _, scatter = summed(solver.predicted(kept) - plain.predicted([]))
    return SmoothCorrection(terms, gain, scatter, alone.residuals - left, solver.left(kept))


def _told(problem: Problem, fitted: Fitted) -> list[Fitted]:
    """Give a model on the soil that is known from elsewhere, where any is: its own may make up for what is left out."""
    if not problem.known.values:
        return []
    vector = fitted.vector.copy()
    known = [PARAMETERS.index(name) for name in problem.known.values]
    vector[known] = problem.prior(fitted.model).mean[known]
    return [fit(problem, fitted.model, vector, fitted.noise, fitted.theta_1, iterations=0, settle=False)]


def _groups(problem: Problem) -> list[Group]:
    """A polynomial of slip, one of load and their product, on each channel."""
    drive = problem.samples.drive
    courses = _courses(problem.samples)
    parts = [("slip", drive.slip, courses[:, : _DEGREE + 1])]
    if courses.shape[1] > _DEGREE + 1:
        parts += [
            ("load_N", drive.load_N, courses[:, _DEGREE + 1 : -1]),
            ("slip x load", courses[:, -1], courses[:, -1:]),
        ]
    channels = range(len(problem.answers))
    return [Group(position, name, at, columns) for name, at, columns in parts for position in channels]


def _beside(problem: Problem, fitted: Fitted, groups: list[Group]) -> tuple[Solver, float]:
    """Weigh a fit with all groups under the likeliest noise beside them, from its own and from quiet ground.

    Gives what weighs groups, and what the noise costs (`_cost`).
    """
    sizes = [group.columns.shape[1] for group in groups]
    added = np.zeros((len(problem.measured), len(CHANNELS), sum(sizes)))
    for group, end, size in zip(groups, np.cumsum(sizes), sizes, strict=True):
        unit = fitted.noise.answers[group.position]
        added[:, problem.answers[group.position], end - size : end] = group.columns * unit
    response = replace(fitted.response, by_parameter=np.concatenate([fitted.response.by_parameter, added], axis=2))
    vector = np.concatenate([fitted.vector, np.zeros(sum(sizes))])
    prior = problem.prior(fitted.model).beside(sum(sizes), STRENGTH)
    answer = []
    for start in (fitted.noise, replace(fitted.noise, spread=np.full(2, QUIET))):
        noise = problem.best_noise(response, vector, start, prior)
        answer.append((Solver(problem, replace(fitted, noise=noise), groups), _cost(problem, fitted, noise)))
    return max(answer, key=lambda pair: _weigh(pair[0], list(range(len(groups)))) - pair[1])


def _weigh(solver: Solver, groups: list[int]) -> float:
    """Log-likelihood of all blocks held out [nats], and of what is known of the soil."""
    return solver.predictive(groups) + solver.soil_nats(groups)


def _cost(problem: Problem, fitted: Fitted, noise: NoiseModel) -> float:
    """Nats that a noise costs, whatever the residuals: it is as wide as it is, and known to be somewhere."""
    innovations, _, loss = problem.whitened(fitted.response, noise)
    return float(loss.sum() - huber_loss(innovations).sum()) + problem.noise_loss(noise)


def _worth(solver: Solver, groups: list[Group], kept: list[int]) -> float:
    """Weigh some of the groups (`_weigh`), less the chance that the search for each had [nats]."""
    return _weigh(solver, kept) - sum(groups[index].sought for index in kept)


def _needed(solver: Solver, groups: list[Group]) -> list[int]:
    """Drop groups one by one while held-out blocks lose next to nothing by it; the numbers of those that are left."""
    kept = list(range(len(groups)))
    best = _worth(solver, groups, kept)
    while kept:
        reached = {each: _worth(solver, groups, [other for other in kept if other != each]) for each in kept}
        least = max(kept, key=lambda each: reached[each])
        if best - reached[least] > _NEXT_TO_NOTHING:
            break
        best = reached[least]
        kept.remove(least)
    return kept


def _courses(samples: Samples) -> np.ndarray:
    """Polynomials (n, k) of slip, of load where it is not held, and their product."""
    drive = samples.drive
    by_slip = legvander(_within(drive.slip), _DEGREE)
    if drive.load_N.std() < _HELD * drive.load_N.mean():
        return by_slip
    load = _within(drive.load_N)
    return np.column_stack([by_slip, legvander(load, _DEGREE)[:, 1:], by_slip[:, 1] * load])


def _within(values: np.ndarray) -> np.ndarray:
    """Lay values (n,) from -1 to 1."""
    low, high = float(values.min()), float(values.max())
    return 2.0 * (values - low) / max(high - low, 1e-12) - 1.0


def _of_one_size(columns: np.ndarray) -> np.ndarray:
    return columns / np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
