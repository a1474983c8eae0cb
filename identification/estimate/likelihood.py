"""Likelihood of wheel samples whose true load and slip are unknown: value, score and information at a point.

The latents of a sample, load and slip, come from a `population` and are integrated out by adaptive quadrature (Q. Liu,
D. A. Pierce, Biometrika 81 (1994), Sec. 2). The score is the mean of the complete-data score over the latents
(Fisher's identity; T. A. Louis, J. R. Stat. Soc. B 44 (1982), Eq. 3.1), the information that of the linearised marginal
model, its population taken to be normal near each sample. A share of the samples may be gross errors.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ..mechanics.textbook import ForwardModel, Prediction
from .population import LEAST_SPREAD, Grid, Population

POPULATION = 4
"""Numbers of the population that scores and information have after the parameters', before the coefficients of the
curve of load by slip: means of load and slip, logarithms of the deviations of the load at a slip and of the slip."""

NO_OUTLIERS = 1e-300

_SLIPS, _SLIP_WEIGHTS = np.polynomial.hermite_e.hermegauss(5)
_MIDDLE_FIRST = np.argsort(np.abs(_SLIPS), kind="stable")
_SLIPS, _SLIP_WEIGHTS = _SLIPS[_MIDDLE_FIRST], _SLIP_WEIGHTS[_MIDDLE_FIRST] / _SLIP_WEIGHTS.sum()
_LOADS, _LOAD_WEIGHTS = np.sqrt(3.0) * np.array([0.0, 1.0, -1.0]), np.array([4.0, 1.0, 1.0]) / 6.0
_NODES = np.array([[load, slip] for load in _LOADS for slip in _SLIPS])
_LOG_RULE = np.log(np.outer(_LOAD_WEIGHTS, _SLIP_WEIGHTS)).ravel() + 0.5 * np.sum(_NODES**2, axis=1)
"""Gauss-Hermite with five nodes in slip, where shear saturates, and three in load; the middle first."""

_CROSS = np.array([*([0.0, slip] for slip in _SLIPS), *([load, 0.0] for load in _LOADS[1:])])
"""Nodes where the model is evaluated: those in the middle of load or slip; the others follow from them (`_filled`)."""

NODE_COUNT = len(_CROSS)

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
    centre and a root of the covariance of each sample's quadrature; theta_1 (n,
    `NODE_COUNT`) warm start [rad].
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
    information (d, d); theta_1 (n, `NODE_COUNT`) [rad].
    """

    value: float
    nodes: np.ndarray
    residuals: np.ndarray
    responsibility: np.ndarray
    weights: np.ndarray
    score: np.ndarray
    information: np.ndarray
    theta_1: np.ndarray

    @property
    def slips(self) -> tuple[np.ndarray, np.ndarray]:
        """Slips (n, s) at which there are nodes of all loads, and the posterior weights of these together, (n, s)."""
        weights = self.responsibility.reshape(len(self.nodes), -1, len(_SLIPS)).sum(axis=1)
        return self.nodes[:, : len(_SLIPS), 1], weights


def evaluate(problem: Problem, point: Point) -> State:
    """Marginal log-likelihood, score and information at a point, its quadrature nodes held."""
    seen = problem.seen
    rows = len(seen)
    cross = point.imposed[:, None, :] + np.einsum("nab,qb->nqa", point.spread, _CROSS)
    cross[..., 0] = np.maximum(cross[..., 0], 1e-3 * problem.load_scale)
    cross[..., 1] = np.clip(cross[..., 1], -0.999, 0.9999)
    prediction = problem.model.predict(cross.reshape(-1, 2), point.vector, point.theta_1.reshape(-1))
    nodes, channels, by_parameter = _filled(cross, prediction)
    carried = np.asarray(np.isfinite(channels).all(axis=2))
    inverse_sd = np.where(seen, np.exp(-point.log_sd), 0.0)[:, None, :]
    measured = problem.filled[:, None, :]
    residuals = np.where(carried[..., None], (measured - channels) * inverse_sd, 0.0)
    log_noise = np.sum(seen * (point.log_sd + 0.5 * _LOG_2PI), axis=1)
    log_density = (
        -0.5 * np.einsum("nqm,nqm->nq", residuals, residuals) - log_noise[:, None] + point.population.log_density(nodes)
    )
    determinant = np.abs(point.spread[:, 0, 0] * point.spread[:, 1, 1])
    log_terms = np.where(carried, log_density + _LOG_RULE + (np.log(determinant) + _LOG_2PI)[:, None], -np.inf)
    peak = np.max(log_terms, axis=1)
    peak = np.where(np.isfinite(peak), peak, -1e6)
    terms = np.exp(log_terms - peak[:, None])
    total = np.maximum(terms.sum(axis=1), 1e-300)
    log_sample = peak + np.log(total)
    mixed = np.logaddexp(np.log1p(-point.outliers) + log_sample, np.log(point.outliers) + problem.log_gross)
    weights = np.exp(np.log1p(-point.outliers) + log_sample - mixed)
    value = float(mixed.sum()) + _log_prior(problem, point)

    by_parameter = by_parameter * inverse_sd[..., None]
    score = _score(problem, point.population, nodes, residuals, by_parameter)
    centre = np.nan_to_num(prediction.by_latent.reshape(rows, NODE_COUNT, 5, 2)[:, 0]) * inverse_sd[:, 0, :, None]
    information = _information(problem, point.population, nodes[:, 0], centre, by_parameter[:, 0], weights)
    theta_1 = prediction.theta_1.reshape(rows, NODE_COUNT)
    return State(value, nodes, residuals, terms / total[:, None], weights, score, information, theta_1)


def _filled(cross: np.ndarray, prediction: Prediction) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Nodes of all loads at all slips (n, q, 2), channels there (n, q, 5), and derivatives by parameters (n, q, 5, p).

    Off the cross channels go on from each slip's node along the derivative by load there, with the curvature that they
    have in the middle; derivatives are sums of what the two axes add.
    """
    rows, slips = len(cross), len(_SLIPS)

    def on_cross(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Values at the slips' nodes (n, 1, s, ...), and what loads add to the middle (n, l, 1, ...)."""
        values = values.reshape(rows, NODE_COUNT, *values.shape[1:])
        added = np.concatenate([np.zeros_like(values[:, :1]), values[:, slips:] - values[:, :1]], axis=1)
        return values[:, None, :slips], added[:, :, None]

    by_latent = prediction.by_latent.reshape(rows, NODE_COUNT, 5, 2)
    steeper = (by_latent[:, :slips, :, 0] - by_latent[:, :1, :, 0])[:, None]
    along, heavier = on_cross(cross.reshape(-1, 2))
    channels, of_load = on_cross(prediction.channels)
    by_parameter, more = on_cross(np.nan_to_num(prediction.by_parameter))
    answers = (along + heavier, channels + of_load + steeper * heavier[..., :1], by_parameter + more)
    nodes, channels, by_parameter = (each.reshape(rows, -1, *each.shape[3:]) for each in answers)
    return nodes, channels, by_parameter


def _log_prior(problem: Problem, point: Point) -> float:
    vector = -0.5 * float(np.sum(problem.precision * (point.vector - problem.prior_mean) ** 2))
    return vector + point.population.log_prior()


def _score(
    problem: Problem, population: Population, nodes: np.ndarray, residuals: np.ndarray, by_parameter: np.ndarray
) -> np.ndarray:
    """Complete-data score at each node, (n, q, d)."""
    p = by_parameter.shape[-1]
    answers = np.flatnonzero(problem.answers)
    away, root = (each.reshape(*nodes.shape[:2], *each.shape[1:]) for each in population.nearby(nodes.reshape(-1, 2)))
    load, slip = away[..., 0], away[..., 1]
    of_load, by_slip, of_slip = root[..., 0, 0], root[..., 0, 1], root[..., 1, 1]
    basis = population.basis(nodes[:, : len(_SLIPS), 1])[0]  # at the same slips for all loads
    curve = (load / of_load)[..., None] * np.tile(basis, (1, len(_LOADS), 1))
    normal = [load / of_load, (slip - load * by_slip / of_load) / of_slip, load**2 - 1.0, slip**2 - 1.0]
    of_noise = residuals[..., answers] ** 2 - problem.seen[:, None, answers]
    of_vector = np.einsum("nqmp,nqm->nqp", by_parameter, residuals)
    assert p == of_vector.shape[-1]
    return np.concatenate([of_vector, np.stack(normal, axis=-1), curve, of_noise], axis=-1)


def prior_score(problem: Problem, point: Point) -> np.ndarray:
    """Derivative of the log-priors by all that scores are by, (d,)."""
    of_vector = -problem.precision * (point.vector - problem.prior_mean)
    population, answers = point.population, int(problem.answers.sum())
    of_curve = -population.grid.spline.straight @ population.curve / population.deviation**2
    of_population = [0.0, 0.0, -float(of_curve @ population.curve), 0.0]
    return np.concatenate([of_vector, of_population, of_curve, np.zeros(answers)])


def _information(
    problem: Problem,
    population: Population,
    imposed: np.ndarray,
    by_latent: np.ndarray,
    by_parameter: np.ndarray,
    weights: np.ndarray,
) -> np.ndarray:
    """Expected information (d, d) of the marginal model, linearised at the centre of each sample's latents (n, 2).

    There the channels, in units of sd, are normal with covariance S = 1 + A V A^T, V = R R^T by the root R (n, 2, 2) of
    the population there, and their mean moves with the parameters by B, with the population's mean by A, and with the
    curve as the load does there; by construction it has no negative eigenvalue (K. V. Mardia, R. J. Marshall,
    Biometrika 71 (1984), Eq. 3).
    """
    answers, root = np.flatnonzero(problem.answers), population.nearby(imposed)[1]
    reach = by_latent @ root
    inner = _inverse_2x2(np.eye(2) + reach.transpose(0, 2, 1) @ reach)
    inverse = np.eye(5) - reach @ inner @ reach.transpose(0, 2, 1)
    curve = by_latent[:, :, :1] * population.basis(imposed[:, 1])[0][:, None, :]
    mean = np.concatenate([by_parameter, by_latent, curve], axis=2)
    p, k = by_parameter.shape[-1], curve.shape[-1]
    rest = slice(p + POPULATION + k, None)
    block = slice(p + 2, p + POPULATION)
    of_mean = np.concatenate([np.arange(p + 2), p + POPULATION + np.arange(k)])
    information = np.zeros((p + POPULATION + k + len(answers),) * 2)
    information[np.ix_(of_mean, of_mean)] = np.tensordot(
        mean * weights[:, None, None], inverse @ mean, axes=([0, 1], [0, 1])
    )

    moves = np.zeros((2, *root.shape))
    moves[0, :, 0, 0], moves[1, :, :, 1] = root[:, 0, 0], root[:, :, 1]
    moves = moves @ root.transpose(0, 2, 1)
    moves += moves.swapaxes(2, 3)
    spread = inverse @ (by_latent @ moves @ by_latent.transpose(0, 2, 1))
    information[block, block] = 0.5 * np.einsum("n,anij,bnji->ab", weights, spread, spread)
    seen = problem.seen[:, answers] * np.sqrt(weights)[:, None]
    both = inverse[:, answers][:, :, answers] * seen[:, :, None] * seen[:, None, :]
    information[rest, rest] = 2.0 * np.sum(both**2, axis=0) + 1e-6 * np.eye(len(answers))
    cross = np.einsum("anij,nji->anj", spread, inverse)[:, :, answers]
    information[block, rest] = np.einsum("anj,nj->aj", cross, seen**2)
    information[rest, block] = information[block, rest].T
    information[np.arange(p), np.arange(p)] += problem.precision
    information[p + POPULATION : p + POPULATION + k, p + POPULATION : p + POPULATION + k] += (
        population.grid.spline.straight / population.deviation**2
    )
    return information


def linearised(problem: Problem, point: Point, weights: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Score (n, p) and information (n, p, p) of each sample on the parameter vector, `weights` as in `State`.

    The model is linearised at each sample's load and slip, and their population taken to be normal near them.
    """
    prediction = problem.model.predict(point.imposed, point.vector, point.theta_1[:, 0])
    inverse_sd = np.where(problem.seen, np.exp(-point.log_sd), 0.0)
    by_parameter = np.nan_to_num(prediction.by_parameter) * inverse_sd[..., None]
    by_latent = np.nan_to_num(prediction.by_latent) * inverse_sd[..., None]
    away, root = point.population.nearby(point.imposed)
    reach = by_latent @ root
    left = np.nan_to_num((problem.filled - prediction.channels) * inverse_sd)
    left += np.einsum("nma,na->nm", reach, away)
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


def recentre(problem: Problem, point: Point) -> Point:
    """Move each sample's quadrature to where its latents now are: one Gauss-Newton step and the curvature there."""
    seen = problem.seen
    middle = point.theta_1[:, 0]
    prediction = problem.model.predict(point.imposed, point.vector, middle)
    inverse_sd = np.where(seen, np.exp(-point.log_sd), 0.0)
    residuals = np.nan_to_num((problem.filled - prediction.channels) * inverse_sd)
    jacobian = np.nan_to_num(prediction.by_latent * inverse_sd[..., None])
    away, root = point.population.nearby(point.imposed)
    whitens = np.linalg.inv(root)
    precision = np.einsum("nma,nmb->nab", jacobian, jacobian) + whitens.transpose(0, 2, 1) @ whitens
    gradient = np.einsum("nma,nm->na", jacobian, residuals) - np.einsum("nab,na->nb", whitens, away)
    covariance = np.linalg.inv(precision)
    step = np.einsum("nab,nb->na", covariance, gradient)
    scale = np.array([problem.load_scale, 1.0])
    imposed = point.imposed + np.clip(step, -0.3 * scale, 0.3 * scale)
    imposed[:, 0] = np.maximum(imposed[:, 0], 0.02 * scale[0])
    imposed[:, 1] = np.clip(imposed[:, 1], -0.99, 0.999)
    theta_1 = np.where(np.isfinite(point.theta_1), point.theta_1, middle[:, None])
    theta_1 = np.where(np.isfinite(theta_1), theta_1, 0.5)
    # Slip first, the load follows it: what is far from normal is the slip, and the load only where it goes with it.
    spread = np.linalg.cholesky(covariance[:, ::-1, ::-1])[:, ::-1, ::-1]
    return replace(point, imposed=imposed, spread=spread, theta_1=theta_1)
