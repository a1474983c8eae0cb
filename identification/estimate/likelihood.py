"""Likelihood of wheel samples whose true load and slip are unknown: value, score and information at a point.

The latents of a sample, load and slip, come from a `population` and are integrated out by adaptive quadrature (Q. Liu,
D. A. Pierce, Biometrika 81 (1994), Sec. 2). The score is the mean of the complete-data score over the latents
(Fisher's identity; T. A. Louis, J. R. Stat. Soc. B 44 (1982), Eq. 3.1), the information that of the linearised marginal
model, its population taken to be normal. A share of the samples may be gross errors.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ..mechanics.textbook import ForwardModel
from .population import LEAST_SPREAD, Grid, Population

POPULATION = 5
"""Numbers of a normal population of (load, slip): two means, and the Cholesky factor of the covariance."""

NO_OUTLIERS = 1e-300

_SLIP_NODES, _SLIP_WEIGHTS = np.polynomial.hermite_e.hermegauss(5)
_MIDDLE_FIRST = np.argsort(np.abs(_SLIP_NODES), kind="stable")
_SLIP_NODES, _SLIP_WEIGHTS = _SLIP_NODES[_MIDDLE_FIRST], _SLIP_WEIGHTS[_MIDDLE_FIRST] / _SLIP_WEIGHTS.sum()
_LOAD_NODE = np.sqrt(3.0)
_NODES = np.array([*([0.0, at] for at in _SLIP_NODES), [_LOAD_NODE, 0.0], [-_LOAD_NODE, 0.0]])
_WEIGHTS = np.concatenate([_SLIP_WEIGHTS - np.array([1.0, 0.0, 0.0, 0.0, 0.0]) / 3.0, np.full(2, 1.0 / 6.0)])
"""A cross, its middle first: Gauss-Hermite with five nodes in slip, where shear saturates, with three in load."""

NODE_COUNT = len(_WEIGHTS)

_LOG_2PI = float(np.log(2.0 * np.pi))


@dataclass(frozen=True)
class Problem:
    """What is fitted.

    Parameters
    ----------
    model
        Predicts the channels.
    measured : (n, 5)
        Channels in the order of `textbook.CHANNELS`; NaN where not observed.
    noise : (5,)
        Standard deviations of the sensors.
    answers : (5,)
        True for the channels whose standard deviation is estimated, from the sensor's upwards.
    prior_mean, prior_sd : (p,)
        Gaussian prior on the parameter vector; sd infinite where there is none.
    held : (p,)
        Values that are not estimated; NaN where a parameter is free.
    lower, upper : (p,)
        Bounds of the parameter vector.
    """

    model: ForwardModel
    measured: np.ndarray
    noise: np.ndarray
    answers: np.ndarray
    prior_mean: np.ndarray
    prior_sd: np.ndarray
    held: np.ndarray
    lower: np.ndarray
    upper: np.ndarray

    def fixing(self, index: int, value: float) -> Problem:
        """Give the same problem with one parameter held at a value."""
        held = self.held.copy()
        held[index] = value
        return replace(self, held=held)

    @property
    def free(self) -> np.ndarray:
        """(p,) True where a parameter is estimated."""
        return np.isnan(self.held)

    @cached_property
    def seen(self) -> np.ndarray:
        """(n, 5) True where a channel was observed."""
        return np.isfinite(self.measured)

    @cached_property
    def filled(self) -> np.ndarray:
        """(n, 5) channels with zero where not observed."""
        return np.where(self.seen, self.measured, 0.0)

    @cached_property
    def load_scale(self) -> float:
        """Typical load [N], the unit of the population's spread."""
        return float(np.nanmean(np.abs(self.measured[:, 0])))

    @cached_property
    def grid(self) -> Grid:
        """Where slips may lie, from the measured ones."""
        return Grid.over(self.measured[:, 3], float(self.noise[3]))

    @cached_property
    def least_deviation(self) -> float:
        """Least standard deviation of the population of loads [N]."""
        return max(LEAST_SPREAD * float(self.noise[0]), 1e-4 * self.load_scale)

    @cached_property
    def log_gross(self) -> np.ndarray:
        """Log-density of a gross error, (n,): uniform over twice the range that each observed channel shows."""
        ranges = np.ones(5)
        for channel in np.flatnonzero(self.seen.any(axis=0)):
            column = self.measured[self.seen[:, channel], channel]
            ranges[channel] = 2.0 * max(float(np.ptp(column)), 6.0 * float(self.noise[channel]))
        return -np.sum(np.where(self.seen, np.log(ranges), 0.0), axis=1)

    @cached_property
    def precision(self) -> np.ndarray:
        """(p,) precision of the prior; zero where there is none."""
        return np.where(np.isfinite(self.prior_sd), 1.0 / self.prior_sd**2, 0.0)


@dataclass(frozen=True)
class Point:
    """A state of the iteration.

    vector (p,); population of load and slip; log_sd (5,) of the channels; imposed (n, 2) and spread (n, 2, 2), the
    centre and Cholesky factor of each sample's quadrature; theta_1 (n, q) warm start [rad].
    """

    vector: np.ndarray
    population: Population
    log_sd: np.ndarray
    imposed: np.ndarray
    spread: np.ndarray
    theta_1: np.ndarray
    outliers: float = NO_OUTLIERS


@dataclass(frozen=True)
class State:
    """Everything that a step needs to know at a point; residuals are in units of sd, zero where not observed.

    value [nats]; nodes (n, q, 2) of load and slip; residuals (n, q, 5); responsibility (n, q), the posterior weights of
    the nodes; weights (n,), the probability that a sample is no gross error; score (n, q, d) of the complete data;
    information (d, d); theta_1 (n, q) [rad].
    """

    value: float
    nodes: np.ndarray
    residuals: np.ndarray
    responsibility: np.ndarray
    weights: np.ndarray
    score: np.ndarray
    information: np.ndarray
    theta_1: np.ndarray


def evaluate(problem: Problem, point: Point) -> State:
    """Marginal log-likelihood, score and information at a point, its quadrature nodes held."""
    seen = problem.seen
    rows, count = len(seen), len(_WEIGHTS)
    nodes = point.imposed[:, None, :] + np.einsum("nab,qb->nqa", point.spread, _NODES)
    nodes[..., 0] = np.maximum(nodes[..., 0], 1e-3 * problem.load_scale)
    nodes[..., 1] = np.clip(nodes[..., 1], -0.999, 0.9999)
    prediction = problem.model.predict(nodes.reshape(-1, 2), point.vector, point.theta_1.reshape(-1))
    channels = prediction.channels.reshape(rows, count, 5)
    carried = np.asarray(np.isfinite(channels).all(axis=2))
    inverse_sd = np.where(seen, np.exp(-point.log_sd), 0.0)[:, None, :]
    measured = problem.filled[:, None, :]
    residuals = np.where(carried[..., None], (measured - channels) * inverse_sd, 0.0)
    log_noise = np.sum(seen * (point.log_sd + 0.5 * _LOG_2PI), axis=1)
    log_density = (
        -0.5 * np.einsum("nqm,nqm->nq", residuals, residuals) - log_noise[:, None] + point.population.log_density(nodes)
    )
    determinant = np.abs(point.spread[:, 0, 0] * point.spread[:, 1, 1])
    log_rule = np.log(_WEIGHTS) + 0.5 * np.sum(_NODES**2, axis=1) + _LOG_2PI
    log_terms = np.where(carried, log_density + log_rule + np.log(determinant)[:, None], -np.inf)
    peak = np.max(log_terms, axis=1)
    peak = np.where(np.isfinite(peak), peak, -1e6)
    terms = np.exp(log_terms - peak[:, None])
    total = np.maximum(terms.sum(axis=1), 1e-300)
    log_sample = peak + np.log(total)
    mixed = np.logaddexp(np.log1p(-point.outliers) + log_sample, np.log(point.outliers) + problem.log_gross)
    weights = np.exp(np.log1p(-point.outliers) + log_sample - mixed)
    value = float(mixed.sum()) + _log_prior(problem, point)

    by_parameter = np.nan_to_num(prediction.by_parameter.reshape(rows, count, 5, -1)) * inverse_sd[..., None]
    v, chol = _standardised(problem, point.population, nodes)
    score = _score(problem, residuals, by_parameter, v, chol)
    centre = np.nan_to_num(prediction.by_latent.reshape(rows, count, 5, 2)[:, 0]) * inverse_sd[:, 0, :, None]
    information = _information(problem, centre, by_parameter[:, 0], chol, weights)
    theta_1 = prediction.theta_1.reshape(rows, count)
    return State(value, nodes, residuals, terms / total[:, None], weights, score, information, theta_1)


def _standardised(problem: Problem, population: Population, nodes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Latents in units of the population, (n, q, 2), and the Cholesky factor (2, 2) with the load in scaled units."""
    mean, covariance = population.moments
    unit = np.array([problem.load_scale, 1.0])
    chol = np.linalg.cholesky(covariance / np.outer(unit, unit))
    away = (nodes - mean) / unit
    first = away[..., 0] / chol[0, 0]
    second = (away[..., 1] - chol[1, 0] * first) / chol[1, 1]
    return np.stack([first, second], axis=-1), chol


def _log_prior(problem: Problem, point: Point) -> float:
    vector = -0.5 * float(np.sum(problem.precision * (point.vector - problem.prior_mean) ** 2))
    return vector + point.population.log_prior()


def _score(
    problem: Problem, residuals: np.ndarray, by_parameter: np.ndarray, v: np.ndarray, chol: np.ndarray
) -> np.ndarray:
    """Complete-data score at each node, (n, q, d), that of the population taken to be normal."""
    p = by_parameter.shape[-1]
    answers = np.flatnonzero(problem.answers)
    score = np.empty((*v.shape[:2], p + POPULATION + len(answers)))
    score[..., :p] = np.einsum("nqmp,nqm->nqp", by_parameter, residuals)
    a, d, b = chol[0, 0], chol[1, 1], chol[1, 0]
    beta = b / d
    score[..., p] = (v[..., 0] - beta * v[..., 1]) / (a * problem.load_scale)
    score[..., p + 1] = v[..., 1] / d
    score[..., p + 2] = -1.0 + v[..., 0] ** 2 - beta * v[..., 0] * v[..., 1]
    score[..., p + 3] = -1.0 + v[..., 1] ** 2
    score[..., p + 4] = v[..., 0] * v[..., 1] / d
    score[..., p + POPULATION :] = residuals[..., answers] ** 2 - problem.seen[:, None, answers]
    return score


def _information(
    problem: Problem, by_latent: np.ndarray, by_parameter: np.ndarray, chol: np.ndarray, weights: np.ndarray
) -> np.ndarray:
    """Expected information (d, d) of the marginal model, linearised at the centre of each sample's latents.

    There the channels, in units of sd, are normal with covariance S = 1 + A V A^T, and their mean moves with the
    parameters by B and with the population's mean by A; by construction it has no negative eigenvalue (K. V. Mardia,
    R. J. Marshall, Biometrika 71 (1984), Eq. 3).
    """
    p = by_parameter.shape[-1]
    answers = np.flatnonzero(problem.answers)
    unit = np.array([problem.load_scale, 1.0])
    root = unit[:, None] * chol
    reach = by_latent @ root
    inner = _inverse_2x2(np.eye(2) + reach.transpose(0, 2, 1) @ reach)
    inverse = np.eye(5) - reach @ inner @ reach.transpose(0, 2, 1)
    mean = np.concatenate([by_parameter, by_latent], axis=2)
    weighted = mean * weights[:, None, None]
    information = np.zeros((p + POPULATION + len(answers),) * 2)
    information[: p + 2, : p + 2] = np.tensordot(weighted, inverse @ mean, axes=([0, 1], [0, 1]))

    moves = np.array([[[chol[0, 0], 0.0], [0.0, 0.0]], [[0.0, 0.0], [0.0, chol[1, 1]]], [[0.0, 0.0], [1.0, 0.0]]])
    moves = unit[:, None] * moves @ root.T
    moves += moves.transpose(0, 2, 1)
    spread = inverse @ (by_latent @ moves[:, None] @ by_latent.transpose(0, 2, 1))
    block = slice(p + 2, p + POPULATION)
    information[block, block] = 0.5 * np.einsum("n,anij,bnji->ab", weights, spread, spread)
    rest = slice(p + POPULATION, None)
    seen = problem.seen[:, answers] * np.sqrt(weights)[:, None]
    both = inverse[:, answers][:, :, answers] * seen[:, :, None] * seen[:, None, :]
    information[rest, rest] = 2.0 * np.sum(both**2, axis=0) + 1e-6 * np.eye(len(answers))
    cross = np.einsum("anij,nji->anj", spread, inverse)[:, :, answers]
    information[block, rest] = np.einsum("anj,nj->aj", cross, seen**2)
    information[rest, block] = information[block, rest].T
    information[np.arange(p), np.arange(p)] += problem.precision
    return information


def linearised(problem: Problem, point: Point, weights: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Score (n, p) and information (n, p, p) of each sample on the parameter vector, `weights` as in `State`.

    The model is linearised at each sample's load and slip, and their population is the normal one of its moments.
    """
    prediction = problem.model.predict(point.imposed, point.vector, point.theta_1[:, 0])
    inverse_sd = np.where(problem.seen, np.exp(-point.log_sd), 0.0)
    by_parameter = np.nan_to_num(prediction.by_parameter) * inverse_sd[..., None]
    by_latent = np.nan_to_num(prediction.by_latent) * inverse_sd[..., None]
    mean, covariance = point.population.moments
    left = np.nan_to_num((problem.filled - prediction.channels) * inverse_sd)
    left += np.einsum("nma,na->nm", by_latent, point.imposed - mean)
    reach = by_latent @ np.linalg.cholesky(covariance)
    inner = _inverse_2x2(np.eye(2) + reach.transpose(0, 2, 1) @ reach)
    weighted = by_parameter - reach @ (inner @ (reach.transpose(0, 2, 1) @ by_parameter))
    weighted *= weights[:, None, None]
    return np.einsum("nmp,nm->np", weighted, left), weighted.transpose(0, 2, 1) @ by_parameter


def _inverse_2x2(matrices: np.ndarray) -> np.ndarray:
    """Inverses of positive definite matrices, (n, 2, 2)."""
    a, b, d = matrices[:, 0, 0], matrices[:, 0, 1], matrices[:, 1, 1]
    determinant = a * d - b * b
    return np.stack([np.stack([d, -b], axis=1), np.stack([-b, a], axis=1)], axis=1) / determinant[:, None, None]


def mean_score(state: State) -> np.ndarray:
    """Score of each sample, (n, d), its latents averaged out."""
    return np.einsum("nq,nqd->nd", state.responsibility, state.score)


def with_population(problem: Problem, point: Point, state: State, *, striding: bool) -> Point:
    """Move the population to where the samples' latents now say, its deviation of load by a damped step of scoring."""
    stride = 1.0 / (_load_known(point, state) ** 2 + 1e-3) if striding else 1.0
    population = point.population.improved(
        state.nodes, state.responsibility, state.weights, problem.least_deviation, stride
    )
    return replace(point, population=population)


def _load_known(point: Point, state: State) -> float:
    """Share of the variance of load that the samples' channels determine, on average, from 0 to 1.

    Its square is the information of the deviation that is left of what known loads would give.
    """
    p = len(point.vector)
    return float(point.population.deviation**2 * state.information[p, p] / max(float(state.weights.sum()), 1e-9))


def recentre(problem: Problem, point: Point) -> Point:
    """Move each sample's quadrature to where its latents now are: one Gauss-Newton step and the curvature there."""
    seen = problem.seen
    middle = point.theta_1[:, 0]
    prediction = problem.model.predict(point.imposed, point.vector, middle)
    inverse_sd = np.where(seen, np.exp(-point.log_sd), 0.0)
    residuals = np.nan_to_num((problem.filled - prediction.channels) * inverse_sd)
    jacobian = np.nan_to_num(prediction.by_latent * inverse_sd[..., None])
    v, chol = _standardised(problem, point.population, point.imposed[:, None, :])
    root = np.linalg.inv(chol) / np.array([problem.load_scale, 1.0])
    precision = np.einsum("nma,nmb->nab", jacobian, jacobian) + root.T @ root
    gradient = np.einsum("nma,nm->na", jacobian, residuals) - v[:, 0] @ root
    covariance = np.linalg.inv(precision)
    step = np.einsum("nab,nb->na", covariance, gradient)
    scale = np.array([problem.load_scale, 1.0])
    imposed = point.imposed + np.clip(step, -0.3 * scale, 0.3 * scale)
    imposed[:, 0] = np.maximum(imposed[:, 0], 0.02 * scale[0])
    imposed[:, 1] = np.clip(imposed[:, 1], -0.99, 0.999)
    theta_1 = np.where(np.isfinite(point.theta_1), point.theta_1, middle[:, None])
    theta_1 = np.where(np.isfinite(theta_1), theta_1, 0.5)
    return replace(point, imposed=imposed, spread=np.linalg.cholesky(covariance), theta_1=theta_1)
