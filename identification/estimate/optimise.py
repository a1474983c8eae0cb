"""Maximum likelihood with errors in every channel: the true load and slip of each sample are unknown too.

Least squares on noisy regressors is biased (attenuation). Here the true load and slip of a sample are latent, drawn
from a `population` that is estimated with the soil (the structural model of W. A. Fuller, "Measurement Error Models"
(1987), Sec. 1.2 and 4.2). Where the model cannot explain a channel, its standard deviation is estimated too, never
below the sensor's. The likelihood itself is in `likelihood`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from .likelihood import (
    NO_OUTLIERS,
    NODE_COUNT,
    POPULATION,
    Point,
    Problem,
    State,
    evaluate,
    mean_score,
    prior_score,
    recentre,
)
from .population import Population

ENOUGH = 0.003
"""The iteration ends when a step gains less than this [nats]."""

_FEW = 100
"""Samples that tell which hill to climb: of twice as many or more, so many are climbed with first."""

_SAME_HILL = 9.0
"""Squared distance up to which two climbs with few samples have ended on one hill [variances]: steps that gain little
leave about a standard deviation."""


_SHARES = (1.0, 0.5, 0.25)
"""Shares of a step that the population may go: near its least deviation a whole one leads too far."""


@dataclass(frozen=True)
class Fit:
    """Where the iteration ended: the point, the log-likelihood with priors [nats], and what follows at that point.

    information (d, d) of (vector, population, log_sd of answers); weights (n,) probability of being no gross error;
    residuals (n, 5) of the channels at the expected latents, in units of sd.
    """

    point: Point
    log_likelihood: float
    information: np.ndarray
    weights: np.ndarray
    residuals: np.ndarray
    theta_1: np.ndarray
    converged: bool

    @property
    def vector(self) -> np.ndarray:
        """(p,) the parameter vector."""
        return self.point.vector

    def covariance(self, free: np.ndarray) -> np.ndarray:
        """Covariance (p, p) of the vector; zero for parameters that are held (`free` (p,) bool is False)."""
        everything = np.concatenate([free, np.ones(len(self.information) - len(free), dtype=bool)])
        inverse = inverse_information(self.information[np.ix_(everything, everything)])
        kept = int(free.sum())
        answer = np.zeros((len(free), len(free)))
        answer[np.ix_(free, free)] = inverse[:kept, :kept]
        return answer


def inverse_information(matrix: np.ndarray) -> np.ndarray:
    """Inverse of an information matrix; a direction without information has a huge variance, not a negative one."""
    scale = 1.0 / np.sqrt(np.maximum(np.diag(matrix), 1e-12))
    values, vectors = np.linalg.eigh(matrix * np.outer(scale, scale))
    return (vectors / np.maximum(values, 1e-10)) @ vectors.T * np.outer(scale, scale)


def best_start(problem: Problem, starts: list[tuple[np.ndarray, np.ndarray]]) -> Point:
    """Climb a little from each start (vector, theta_1), looking for no gross errors yet, and keep the best point.

    Of many samples a few, evenly spread, are climbed with first; all of them only decide between the hills found.
    """
    count = len(problem.measured)
    if count < 2 * _FEW:
        return _highest(problem, [start(problem, *each) for each in starts])
    rows = np.linspace(0, count - 1, _FEW).astype(int)
    few = replace(problem, measured=problem.measured[rows])
    if np.any(few.seen.mean(axis=0) < 0.5 * problem.seen.mean(axis=0)):
        # A channel that was observed now and then only.
        return _highest(problem, [start(problem, *each) for each in starts])
    climbed = [_climb(few, start(few, vector, theta_1[rows]), 30, enough=0.5)[:2] for vector, theta_1 in starts]
    begun = [start(problem, climbed[at][0].vector, starts[at][1], climbed[at][0]) for at in _hills(problem, climbed)]
    return _highest(problem, begun) if len(begun) > 1 else replace(begun[0], outliers=0.01)


def _highest(problem: Problem, begun: list[Point]) -> Point:
    """Climb a little from each point and give the highest, from where on gross errors are looked for."""
    climbed = [_climb(problem, point, 30, enough=0.5) for point in begun]
    point, _, _ = max(climbed, key=lambda each: each[1].value)
    return replace(point, outliers=0.01)


def _hills(problem: Problem, climbed: list[tuple[Point, State]]) -> list[int]:
    """Indices of the climbs that ended highest on hills of their own, the highest first."""
    p, hills = len(problem.held), []
    for at in sorted(range(len(climbed)), key=lambda at: -climbed[at][1].value):
        apart = [climbed[at][0].vector - climbed[hill][0].vector for hill in hills]
        information = [_marginal(climbed[hill][1].information, p) for hill in hills]
        if not any(away @ each @ away <= _SAME_HILL for away, each in zip(apart, information, strict=True)):
            hills.append(at)
    return hills


def _marginal(information: np.ndarray, p: int) -> np.ndarray:
    """Information (p, p) of the first p parameters, the others estimated."""
    cross = information[:p, p:]
    return information[:p, :p] - cross @ inverse_information(information[p:, p:]) @ cross.T


def start(problem: Problem, vector: np.ndarray, theta_1: np.ndarray, like: Point | None = None) -> Point:
    """Begin at a parameter vector, with the measured load and slip as latents and theta_1 (n,) as warm start.

    Population and noise are those of a point `like` it of the same samples or some of them; else the population is
    normal and the noise large.
    """
    measured = problem.measured
    slip = np.clip(measured[:, 3], -0.98, 0.999)
    load = np.where(np.isfinite(measured[:, 0]), measured[:, 0], np.nanmedian(measured[:, 0]))
    load = np.maximum(load, 0.02 * problem.load_scale)
    if like is not None:
        population, log_sd = like.population.carried(problem.grid), like.log_sd
    else:
        population = Population.beginning(problem.grid, load, float(problem.noise[0]), problem.least_deviation)
        log_sd = _wide(problem)
    imposed, angles = np.column_stack([load, slip]), np.tile(theta_1[:, None], (1, NODE_COUNT))
    point = Point(vector, population, log_sd, imposed, np.zeros((len(load), 2, 2)), angles)
    return recentre(problem, recentre(problem, point))


def _wide(problem: Problem) -> np.ndarray:
    """Log-noise (5,) that is wide, so that a start far from the truth sees a slope, not a field of gross errors."""
    seen = [column[np.isfinite(column)] for column in problem.measured.T]
    spread = [np.std(column) if len(column) else 0.0 for column in seen]
    sd = np.where(np.isfinite(problem.noise), problem.noise, 1.0)
    return np.log(np.where(problem.answers, np.maximum(sd, 0.5 * np.array(spread)), sd))


def fit(
    problem: Problem, point: Point, *, iterations: int = 60, enough: float = ENOUGH, foreseen: float = 0.0
) -> Fit:  # fmt: skip
    """Maximise the marginal likelihood from a starting point by damped scoring.

    A step whose predicted gain, with what the last step gained beyond its own prediction, is less than `foreseen` nats
    is the last and is not evaluated: the log-likelihood includes its predicted gain, all else is that of the point
    before.
    """
    vector = np.where(problem.free, np.clip(point.vector, problem.lower, problem.upper), problem.held)
    point = recentre(problem, replace(point, vector=vector))
    point, state, converged = _climb(problem, point, iterations, enough=enough, foreseen=foreseen)
    residual = np.einsum("nq,nqm->nm", state.responsibility, state.residuals)
    residual[~problem.seen] = np.nan
    theta_1 = np.nan_to_num(state.theta_1[:, 0])
    return Fit(point, state.value, state.information, state.weights, residual, theta_1, converged)


def _climb(
    problem: Problem, point: Point, iterations: int, *, enough: float, foreseen: float = 0.0
) -> tuple[Point, State, bool]:  # fmt: skip
    """Step uphill until a step gains less than `enough` nats, or its predicted gain is less than `foreseen`."""
    damping, converged, fresh = 1e-3, False, False
    beyond = math.inf  # Gain of the last step beyond its prediction: that of the population's shares.
    state = evaluate(problem, point)
    if point.outliers != NO_OUTLIERS and np.mean(state.weights) < 0.5:
        # So far off that samples seem gross errors, and none of them says where to go.
        nearer = _climb(problem, replace(point, outliers=NO_OUTLIERS), iterations, enough=0.5)[0]
        point = replace(nearer, outliers=point.outliers)
        state = evaluate(problem, point)
    for _ in range(iterations):
        trial, predicted = _move(problem, point, state, damping)
        if trial is not None and predicted >= 0.0 and predicted + max(beyond, 0.0) < foreseen:
            point, state, converged = trial, replace(state, value=state.value + predicted), True
            break
        # The quadrature follows every step: one that stayed behind would call a wider population a worse one.
        trial = None if trial is None else recentre(problem, recentre(problem, trial))
        moved = None if trial is None else evaluate(problem, trial)
        if trial is not None and moved is not None and moved.value >= state.value - 1e-9 * abs(state.value):
            gain = moved.value - state.value
            beyond = gain - predicted
            point, state, fresh = replace(trial, theta_1=moved.theta_1), moved, False
            damping = max(damping / 8.0, 1e-9)
            if gain < enough:
                converged = True
                break
        elif not fresh:
            # Nor may the point be judged by a better quadrature, or a worse one, than the steps from it.
            point, fresh = recentre(problem, recentre(problem, replace(point, theta_1=state.theta_1))), True
            state = evaluate(problem, point)
            damping *= 10.0
        else:
            damping *= 10.0
            if damping > 1e8:
                break
    return point, state, converged


def _move(problem: Problem, point: Point, state: State, damping: float) -> tuple[Point | None, float]:
    """One damped step of everything that is estimated, None where it cannot be taken, and its predicted gain [nats].

    The prediction leaves out what the shares of the population gain.
    """
    p, population = len(problem.held), point.population
    noise = slice(p + POPULATION + len(population.curve), None)
    uphill = np.einsum("n,nd->d", state.weights, mean_score(state)) + prior_score(problem, point)
    information = state.information
    answers = np.flatnonzero(problem.answers)
    floor = np.log(problem.noise[answers])
    # Where slips spread wider than their noise, the shares of the population say best where they are.
    narrow = population.moments[1][1, 1] <= problem.noise[3] ** 2
    spread = population.deviation > problem.least_deviation or uphill[p + 2] > 0.0
    others = np.ones(len(population.curve) + len(answers), dtype=bool)
    moving = np.concatenate([problem.free, [True, narrow, spread, False], others])
    moving[:p] &= ~((point.vector <= problem.lower) & (uphill[:p] < 0.0))
    moving[:p] &= ~((point.vector >= problem.upper) & (uphill[:p] > 0.0))
    moving[noise] &= ~((point.log_sd[answers] <= floor) & (uphill[noise] < 0.0))

    block = information[np.ix_(moving, moving)]
    scale = 1.0 / np.sqrt(np.maximum(np.diag(block), 1e-12))
    scaled = block * np.outer(scale, scale)
    values, vectors = np.linalg.eigh(scaled)
    values = np.maximum(values, 0.0) + damping
    step = np.zeros(len(moving))
    step[moving] = scale * (vectors @ ((vectors.T @ (scale * uphill[moving])) / values))
    if not np.isfinite(step).all():
        return None, 0.0
    log_part = slice(2, None)
    change = step[:p].copy()
    change[log_part] = np.clip(change[log_part], -1.0, 1.0)
    vector = np.where(problem.free, np.clip(point.vector + change, problem.lower, problem.upper), point.vector)
    log_sd = point.log_sd.copy()
    # Down from where it was put at first in strides, up with care: there every other residual seems small.
    log_sd[answers] = np.maximum(log_sd[answers] + np.clip(step[noise], -1.0, 0.2), floor)
    outliers = point.outliers
    if outliers != NO_OUTLIERS:
        # Far from the optimum every sample would seem a gross error: none is looked for there.
        outliers = float(np.clip(np.mean(1.0 - state.weights), 1e-3, 0.2))
    taken = step.copy()
    taken[:p], taken[noise] = vector - point.vector, log_sd[answers] - point.log_sd[answers]
    point = replace(
        point, vector=vector, log_sd=log_sd, outliers=outliers,
        population=_moved(problem, population, state, taken[p : p + 3], taken[p + POPULATION : noise.start]),
    )  # fmt: skip

    # Where the likelihood is a parabola the step leads to its top.
    return replace(point, theta_1=state.theta_1), 0.5 * float(uphill @ taken)


def _moved(
    problem: Problem, population: Population, state: State, step: np.ndarray, curve: np.ndarray
) -> Population:  # fmt: skip
    """Move level, shift and deviation by a step (3,), and the curve (k,): all of it, or the part that gains most where
    each sample's nodes are, which costs no mechanics.
    """
    shared = population.improved(*state.slips, state.weights)
    before = population.log_density(state.nodes)

    def gain(moved: Population) -> float:
        ratio = np.sum(state.responsibility * np.exp(np.minimum(moved.log_density(state.nodes) - before, 50.0)), axis=1)
        return float(state.weights @ np.log(np.maximum(ratio, 1e-300))) + moved.log_prior()

    level, shift, wider = step.tolist()
    parts = [
        shared.moved(share * level, share * shift, share * wider, share * curve, problem.least_deviation)
        for share in _SHARES
    ]
    return max(parts, key=gain)
