"""What the error of the model's form does to the parameters: found by a score test, carried into the intervals.

1. Is the textbook's form rejected? Of trials, C. R. Rao's score test (Proc. Camb. Phil. Soc. 44 (1948), Sec. 4) of all
   the freedoms of `mechanics.flexible` at once needs no further fit, and a misfit counts by itself. Along a drive the
   soil varies from place to place, which is no error of form: there the freedoms are weighed against it
   (`ground_variation`), and a misfit counts as far as it is one from sample to sample.
2. If so, the freedoms are estimated with the soil, under their priors.
3. What is still left out shows as residuals that go together under like conditions. The variance of the parameters is
   then that of the scores summed by cluster (K.-Y. Liang, S. L. Zeger, Biometrika 73 (1986), Eq. 6; G. Kauermann,
   R. J. Carroll, J. Am. Stat. Assoc. 96 (2001), on few clusters), clusters being quantiles of slip, of load and of the
   order of the samples, whichever gives most. The profile likelihood of each parameter is scaled to it (L. Pace,
   A. Salvan, N. Sartori, Statistica Sinica 21 (2011), Eq. 8).
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from scipy.stats import chi2
from scipy.stats import t as t_distribution

from ...framework.core.soil import PARAMETERS
from ..mechanics.flexible import FREEDOMS, FlexibleWheel
from ..mechanics.textbook import TextbookWheel
from ..rows.noise import noise_of_series
from .computed_channels import ComputedChannels
from .ground_variation import likelihood_ratio
from .likelihood import POPULATION, Point, Problem, State, evaluate, linearised, mean_score, prior_score, recentre
from .optimise import best_start, fit, inverse_information
from .solution import Solution

FALSE_ALARMS = 0.01
"""How often the score test rejects the textbook's form where it holds [-]."""

CLUSTERS = 6
"""Clusters of samples, by quantiles of slip, load or order: their number less one is the degrees of freedom left."""

LEAST_IN_CLUSTER = 3

MOST_ROWS = 200
"""Samples are thinned evenly to this number where the form is free: its error, not noise, then sets the intervals."""

_FITS = 80
"""Iterations allowed: the freedoms make long valleys."""


def rejected(solution: Solution, wrong_form: float) -> bool:
    """Say whether the samples contradict the textbook's form: by its misfit, or by a test of the freedoms."""
    if not solution.timed:
        limit = chi2.ppf(1.0 - FALSE_ALARMS, len(FREEDOMS))
        return solution.misfit > wrong_form or bool(score_statistic(solution) > limit)
    white = _white_sd(solution)
    noise = solution.problem.noise[solution.problem.answers]
    if math.sqrt(float(np.mean((white / noise) ** 2))) > wrong_form:
        return True
    # Of rows whose noise is autocorrelated so many say the same.
    gain = _gain_of_freedoms(solution, white) / solution.repeated
    return bool(gain > chi2.ppf(1.0 - FALSE_ALARMS, len(FREEDOMS)))


def _white_sd(solution: Solution) -> np.ndarray:
    """Standard deviation (m,) of the answers from sample to sample, SI: what varies along the track is not in it."""
    answers = solution.problem.answers
    left = solution.fit.residuals[:, answers] * np.sqrt(solution.fit.weights)[:, None]
    share = np.array([np.nan_to_num(noise_of_series([column]), nan=1.0) for column in left.T])
    return np.exp(solution.fit.point.log_sd[answers]) * share


def _gain_of_freedoms(solution: Solution, white: np.ndarray) -> float:
    """Twice the log-likelihood that the freedoms gain over soil that varies along the track.

    Answers have the noise `white` (m,) from sample to sample.
    """
    problem = _freed(solution.problem)
    log_sd = solution.fit.point.log_sd.copy()
    log_sd[problem.answers] = np.log(np.maximum(problem.noise[problem.answers], white))
    vector = _extended(solution.fit.vector)
    point = recentre(problem, recentre(problem, replace(solution.fit.point, vector=vector, log_sd=log_sd)))
    scores, information = linearised(problem, point, solution.fit.weights)
    processes = np.zeros((len(vector), 3))
    varied = [0, 1, PARAMETERS.index("stiffness_Pa")]
    processes[varied, range(3)] = [max(abs(vector[0]), 1.0), vector[1], 1.0]
    free = np.append(solution.problem.free, np.ones(len(FREEDOMS), dtype=bool))
    soil = int(solution.problem.free.sum())
    prior = -problem.precision * (vector - problem.prior_mean)
    return likelihood_ratio(
        scores[:, free], information[:, free][:, :, free], problem.precision[free], prior[free], processes[free], soil
    )


def score_statistic(solution: Solution) -> float:
    """Score statistic of all freedoms at the textbook's optimum, at most chi-squared with as many degrees of freedom.

    The priors of the freedoms are in the information, which damps directions that the samples say nothing of.
    """
    problem = _freed(solution.problem)
    point = replace(solution.fit.point, vector=_extended(solution.fit.vector))
    state = evaluate(problem, point)
    p = len(problem.held)
    score = np.einsum("n,nd->d", state.weights, mean_score(state)) + prior_score(problem, point)
    moving = _moving(problem, point, state)
    tested = np.zeros(len(moving), dtype=bool)
    tested[len(solution.problem.held) : p] = True
    rest = moving & ~tested
    # A freedom at its bound is tested all the same.
    information = state.information
    cross = information[np.ix_(tested, rest)] @ inverse_information(information[np.ix_(rest, rest)])
    left = information[np.ix_(tested, tested)] - cross @ information[np.ix_(rest, tested)]
    shown = score[tested] - cross @ score[rest]
    return float(shown @ inverse_information(left) @ shown)


def with_freedom(solution: Solution, starts: list[tuple[np.ndarray, np.ndarray]]) -> Solution:
    """Fit again with the freedoms of the form estimated with the soil, and what is left out carried by cluster.

    `starts` are textbook vectors (p,) with entry angles (n,) [rad]; the textbook's optimum is tried too.
    """
    starts = [*starts, (solution.fit.vector, solution.fit.theta_1)]
    count = len(solution.problem.measured)
    rows = np.linspace(0, count - 1, min(count, MOST_ROWS)).astype(int)
    problem = _freed(replace(solution.problem, measured=solution.problem.measured[rows]))
    begun = best_start(problem, [(_extended(vector), theta_1[rows]) for vector, theta_1 in starts])
    best = fit(problem, begun, iterations=_FITS)
    clusters = _memberships(problem)
    quantile = float(t_distribution.ppf(0.975, max(len(np.unique(clusters[0])) - 1, 1)))
    freed = replace(solution, problem=problem, fit=best, inflation=1.0, quantile=quantile)
    return replace(freed, widening=widening(problem, best.point, clusters))


def widening(problem: Problem, point: Point, clusters: list[np.ndarray]) -> np.ndarray:
    """Factor (p,) on the variance of each parameter, at least 1: variance by cluster over that of the likelihood.

    `clusters` are alternatives, each (n,) labels; the one that gives the parameter most counts.
    """
    state = evaluate(problem, point)
    moving = _moving(problem, point, state)
    inverse = inverse_information(state.information[np.ix_(moving, moving)])
    scores = (mean_score(state) * state.weights[:, None])[:, moving]
    most = np.ones(int(moving.sum()))
    for labels in clusters:
        names = np.unique(labels)
        if len(names) < 2:
            continue
        sums = np.array([scores[labels == name].sum(axis=0) for name in names])
        sums -= sums.mean(axis=0)
        spread = inverse @ sums.T * math.sqrt(len(names) / (len(names) - 1.0))
        most = np.maximum(most, np.sum(spread**2, axis=1) / np.maximum(np.diag(inverse), 1e-300))
    answer = np.ones(len(moving))
    answer[moving] = most
    return answer[: len(problem.held)]


def _freed(problem: Problem) -> Problem:
    """Give a textbook problem the freedoms of the form."""
    if isinstance(problem.model, ComputedChannels):
        model = problem.model.freed(problem.load_scale)
    else:
        assert isinstance(problem.model, TextbookWheel)
        model = FlexibleWheel(problem.model.wheel, problem.load_scale)
    textbook = np.array([freedom.textbook for freedom in FREEDOMS])
    return replace(
        problem,
        model=model,
        prior_mean=np.concatenate([problem.prior_mean, textbook]),
        prior_sd=np.concatenate([problem.prior_sd, [freedom.sd for freedom in FREEDOMS]]),
        held=np.concatenate([problem.held, np.full(len(FREEDOMS), np.nan)]),
        lower=np.concatenate([problem.lower, [freedom.low for freedom in FREEDOMS]]),
        upper=np.concatenate([problem.upper, [freedom.high for freedom in FREEDOMS]]),
    )


def _extended(vector: np.ndarray) -> np.ndarray:
    return np.concatenate([vector, [freedom.textbook for freedom in FREEDOMS]])


def _moving(problem: Problem, point: Point, state: State) -> np.ndarray:
    """(d,) True for what is estimated and not stopped by a bound."""
    answers = np.flatnonzero(problem.answers)
    inside = (point.vector > problem.lower) & (point.vector < problem.upper)
    above = point.log_sd[answers] > np.log(problem.noise[answers]) + 1e-9
    # The population counts as the normal one of its moments, which is nearly at its best too.
    moving = np.concatenate(
        [problem.free & inside, np.ones(POPULATION + len(point.population.curve), dtype=bool), above]
    )
    return moving & (np.diag(state.information) > 0.0)


def _memberships(problem: Problem) -> list[np.ndarray]:
    """Labels (n,) of the clusters: by slip, by load, and by order."""
    measured = problem.measured
    load = np.where(np.isfinite(measured[:, 0]), measured[:, 0], np.nanmedian(measured[:, 0]))
    count = min(CLUSTERS, max(len(measured) // LEAST_IN_CLUSTER, 2))
    return [_by_quantile(values, count) for values in (measured[:, 3], load, np.arange(len(measured)))]


def _by_quantile(values: np.ndarray, count: int) -> np.ndarray:
    edges = np.quantile(values, np.linspace(0.0, 1.0, count + 1)[1:-1])
    return np.searchsorted(edges, values, side="right")
