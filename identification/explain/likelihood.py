"""Likelihood of a recording under a model: latent load and slip, sensor noise, varying ground, gross errors.

The likelihood is Gaussian except for gross errors. It is linearised about the expected load and slip and the mean
ground: the derivatives of the channels by load, slip, stiffness and strength propagate errors into the channels.
"""

from __future__ import annotations

import math
from copy import copy
from dataclasses import dataclass, replace
from functools import cached_property
from weakref import WeakKeyDictionary

import numpy as np
from scipy.linalg import block_diag

from ...framework.core.soil import SoilKnowledge
from ..mechanics.augmented import AugmentedWheel, Entry, Response
from .latent import STATES
from .samples import MOST_SLIP, Samples
from .soil_prior import prior_of_soils
from .steps import Prior, normal_equations, solve_step
from .whitening import Chain, Filter, Noise, Whitener, matern, robust_loss, robust_weight, whitener

_LN_NOISE_SD, _LN_STATED_SD = 0.5, 0.1
"""Prior standard deviation of ln(noise) about the estimate from neighbouring rows, and about a stated noise."""

_AUTOCORRELATION_SD, _MAX_AUTOCORRELATION = 0.25, 0.97
"""Prior standard deviation of the autocorrelation of sensor noise about 0, and its upper bound [-]."""

_NEIGHBOURS_ERROR = 3.5
"""Three standard errors of ln(noise) estimated from neighbours, times the root of their number [-]: a median absolute
deviation has 37 % of the efficiency of a standard deviation (F. R. Hampel, J. Am. Stat. Assoc. 69 (1974), 383-393)."""

_GROUND_SD_SCALE, _LN_LENGTH_SD = 0.05, 1.5
"""Prior standard deviations of the ground's standard deviation and of ln of its correlation length [-]."""

_LEAST_GROUND_SD, _LEAST_LN_NOISE = 1e-5, -1.5
"""Lower bounds of the ground's standard deviation, and of ln(noise) relative to the estimate from neighbours [-]."""

UNIFORM_SD = 0.01
"""Standard deviation of nearly uniform ground [-]."""

_LARGEST_DERIVATIVE = 1e12
"""Larger derivatives, SI, are those of a wheel at the limit of the load that the soil carries: they are omitted."""

_DIFFERENCE = 1e-4
"""Step of the noise parameters (`_packed`) in difference quotients of the innovations."""

_NOISE_STEPS, _LEAST_NOISE_GAIN = 12, 0.05
"""Most steps of a fit of the noise, and the gain of a step below which it ends [nats]."""


@dataclass(frozen=True)
class White:
    """Innovations (n, m), their derivatives by the parameters (n, m, p), each row's loss (n,) [nats], and the robust
    weights of each filter (`whitening.Whitener`).
    """

    innovations: np.ndarray
    jacobian: np.ndarray
    loss: np.ndarray
    weights: tuple[np.ndarray, np.ndarray]


class Problem:
    """Samples, priors and error model.

    Parameters
    ----------
    samples
        The samples.
    known
        Prior knowledge of the soil.
    noise_share
        Shares of sensor noise in the white parts of load and slip (`latent.Path.latent`) [-].
    max_ground_sd
        Upper bound of the standard deviation of ln stiffness and ln strength along the track [-].

    Attributes
    ----------
    reference
        Response whose derivatives propagate errors under every hypothesis, so that evidences can be compared; None
        before the textbook wheel is fitted: each response then propagates errors itself.
    """

    def __init__(
        self, samples: Samples, known: SoilKnowledge | None = None, noise_share: tuple[float, float] = (1.0, 1.0),
        max_ground_sd: float = 1.0,
    ) -> None:  # fmt: skip
        self.samples, self.known, self.noise_share = samples, known or SoilKnowledge(), noise_share
        self._max_ground_sd = max_ground_sd
        self.answers = list(samples.answers)
        self.load, self.slip = samples.load.latent(noise_share[0]), samples.slip.latent(noise_share[1])
        self.imposed = np.column_stack([self.load.mean, np.clip(self.slip.mean, -1.0, MOST_SLIP)])
        self.seen = np.ascontiguousarray(samples.seen)
        self.measured = samples.measured[:, self.answers]
        self.order, self.gap = _order_along_track(samples.position, samples.lane, samples.drive.ground)
        self.reference: Response | None = None
        self._whiteners: WeakKeyDictionary[Noise, Whitener] = WeakKeyDictionary()
        self.first_noise = self._first_noise()

    @cached_property
    def _transitions(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Unique transitions and process noise (g, d, d) of the errors of load and slip, whether a row that has them
        follows the previous one (g,), and the index of them for each row (n,).
        """
        both = [np.zeros((len(self.samples), 2 * STATES, 2 * STATES)) for _ in range(2)]
        for index, latent in enumerate((self.load, self.slip)):
            own = slice(STATES * index, STATES * (index + 1))
            both[0][:, own, own], both[1][:, own, own] = latent.transition, latent.process_noise
        rows = np.column_stack([*(each.reshape(len(each), -1) for each in both), self.samples.follows])
        _, first, which = np.unique(rows, axis=0, return_index=True, return_inverse=True)
        return both[0][first], both[1][first], self.samples.follows[first].astype(bool), which.ravel()

    def _first_noise(self) -> Noise:
        finite = self.gap[np.isfinite(self.gap)]
        track = float(finite.sum()) if finite.size else 1.0
        shortest = float(np.median(finite[finite > 0.0])) if (finite > 0.0).any() else 1e-3
        self._length_bounds = shortest, max(0.3 * track, 2.0 * shortest)
        length = math.sqrt(shortest * self._length_bounds[1])
        sd = self.samples.noise[self.answers]
        return Noise(sd, np.zeros(len(sd)), np.full(2, min(0.02, self._max_ground_sd)), length)

    def with_uniform_ground(self) -> Problem:
        """Return the same problem with nearly uniform ground and the same reference."""
        answer = Problem(self.samples, self.known, self.noise_share, UNIFORM_SD)
        answer.reference = self.reference
        return answer

    def without(self, rows: np.ndarray) -> Problem:
        """Return the same problem with some rows unobserved."""
        answer = copy(self)
        answer.seen = self.seen.copy()
        answer.seen[rows] = False
        answer._whiteners = WeakKeyDictionary()
        return answer

    @property
    def uniform_ground_noise(self) -> Noise:
        """Initial noise with nearly uniform ground: variation of the ground may have absorbed an effect."""
        return replace(self.first_noise, ground_sd=np.full(2, UNIFORM_SD))

    @property
    def grounds(self) -> int:
        """Number of grounds."""
        return len(self.samples.grounds)

    def normal_equations(
        self, innovations: np.ndarray, jacobian: np.ndarray, rows: np.ndarray | slice = slice(None)
    ) -> tuple[np.ndarray, np.ndarray]:
        """Gradient (p,) and information (p, p) of the log-likelihood of rows (`steps.normal_equations`)."""
        ground = self.samples.drive.ground[rows]
        return normal_equations(innovations[rows], jacobian[rows], ground, self.grounds)

    @cached_property
    def _prior_of_soils(self) -> Prior:
        return prior_of_soils(self.known, list(self.samples.classes.values()))

    def prior(self, model: AugmentedWheel) -> Prior:
        """Priors and bounds of a model's parameter vector."""
        soils = self._prior_of_soils
        parameters = [parameter for effect, _ in model.slices() for parameter in effect.parameters]
        scales = np.array([parameter.scale for parameter in parameters])
        return Prior(
            np.append(soils.mean, [parameter.null for parameter in parameters]),
            np.asarray(block_diag(soils.precision, np.diag(scales**-2.0))),
            np.append(soils.lower, [parameter.low for parameter in parameters]),
            np.append(soils.upper, [parameter.high for parameter in parameters]),
        )

    def linearise(
        self, model: AugmentedWheel, vector: np.ndarray, entry: Entry | None, known: Response | None = None
    ) -> Response:
        """Response of the model with derivatives; those `known` of the model less its last effect are reused."""
        latent = self.reference is None
        return model.linearise(self.samples.drive, self.imposed, vector, entry, latent=latent, known=known)

    def residuals(self, response: Response) -> np.ndarray:
        """Residuals (n, m), SI, NaN where not observed."""
        return np.where(self.seen, self.measured - response.channels[:, self.answers], np.nan)

    def columns(self, response: Response) -> np.ndarray:
        """Residuals and derivatives (n, m, 1 + p); a load that is not carried has zero response."""
        residual = self.measured - response.channels[:, self.answers]
        carried = np.isfinite(residual) | ~self.seen
        residual = np.where(self.seen, np.where(carried, residual, self.measured), 0.0)
        slopes = response.by_parameter[:, self.answers]
        good = (self.seen & np.isfinite(response.channels[:, self.answers]))[..., None] & (
            np.abs(slopes) < _LARGEST_DERIVATIVE
        )
        return np.concatenate([residual[..., None], np.where(good, slopes, 0.0)], axis=-1)

    def whitener(self, noise: Noise, response: Response) -> Whitener:
        """Return the whitener of a noise model, with errors propagated by `reference` if set, else by the response."""
        if self.reference is None:
            return self._whitener(self._errors(noise, response), matern(self.gap, noise), response)
        if noise not in self._whiteners:
            errors = self._errors(noise, self.reference)
            self._whiteners[noise] = self._whitener(errors, matern(self.gap, noise), self.reference)
        return self._whiteners[noise]

    def _whitener(self, errors: Filter, transitions: tuple[np.ndarray, np.ndarray], reference: Response) -> Whitener:
        return whitener(errors, self._by_ground(reference), transitions, self.order)

    def _by_ground(self, reference: Response) -> np.ndarray:
        return np.where(self.seen[..., None], np.nan_to_num(reference.by_ground[:, self.answers]), 0.0)

    def _errors(self, noise: Noise, reference: Response) -> Filter:
        """Filter of the errors of load and slip and of sensor noise, in order of time."""
        path_transition, path_noise, follows, which = self._transitions
        by_latent = np.nan_to_num(reference.by_latent[:, self.answers])
        white = [index for index, latent in enumerate((self.load, self.slip)) if latent.white.any()]
        autocorrelated = np.flatnonzero(noise.autocorrelation > 0.0)
        paths = 2 * STATES
        size = paths + len(white) + len(autocorrelated)
        transition, process_noise = np.zeros((2, len(follows), size, size))
        loading, variance = np.zeros((*self.seen.shape, size)), np.tile(noise.sd**2, (len(which), 1))
        transition[:, :paths, :paths], process_noise[:, :paths, :paths] = path_transition, path_noise
        loading[..., :paths:STATES] = by_latent
        for state, index in enumerate(white, start=paths):
            process_noise[:, state, state] = 1.0
            loading[..., state] = by_latent[..., index] * np.sqrt((self.load, self.slip)[index].white)[:, None]
        for state, channel in enumerate(autocorrelated, start=paths + len(white)):
            rho = np.where(follows, noise.autocorrelation[channel], 0.0)
            transition[:, state, state], process_noise[:, state, state] = rho, noise.sd[channel] ** 2 * (1.0 - rho**2)
            loading[:, channel, state], variance[:, channel] = 1.0, 0.0
        of_ground = self._by_ground(reference) ** 2 @ noise.ground_sd**2
        return Chain(transition, process_noise, which, loading, variance).filter(self.seen, of_ground)

    def white(self, response: Response, noise: Noise) -> White:
        """Innovations of a response, with derivatives, losses and weights."""
        whitened = self.whitener(noise, response)
        columns, weights = whitened.whiten(self.columns(response))
        innovations = columns[..., 0]
        return White(innovations, columns[..., 1:], (robust_loss(innovations) + whitened.log_sd).sum(axis=1), weights)

    def loss(self, residuals: np.ndarray, noise: Noise, response: Response) -> np.ndarray:
        """Loss of each row (n,) [nats] for residuals (n, m), SI."""
        whitened = self.whitener(noise, response)
        white, _ = whitened.whiten(np.where(self.seen, residuals, 0.0)[..., None])
        return (robust_loss(white[..., 0]) + whitened.log_sd).sum(axis=1)

    def noise_prior(self, noise: Noise) -> tuple[Prior, np.ndarray]:
        """Prior of the noise parameters (`_packed`), and which of them can be estimated."""
        count = len(self.answers)
        stated = self.samples.stated[self.answers]
        shortest, longest = self._length_bounds
        mean = np.concatenate([np.log(self.first_noise.sd), np.zeros(count + 2), [math.log(self.first_noise.length)]])
        sd = np.concatenate([
            np.where(stated, _LN_STATED_SD, _LN_NOISE_SD), np.full(count, _AUTOCORRELATION_SD),
            np.full(2, _GROUND_SD_SCALE), [_LN_LENGTH_SD],
        ])  # fmt: skip
        lower = np.concatenate([mean[:count] + _LEAST_LN_NOISE, np.zeros(count), np.full(2, _LEAST_GROUND_SD)])
        free = np.ones(2 * count + 3, dtype=bool)
        free[count : 2 * count] = bool(self.samples.follows.any())
        most = mean[:count] + _NEIGHBOURS_ERROR / np.sqrt(np.maximum(self.seen.sum(axis=0), 1))
        if free[count]:
            most += _log_underestimate(_MAX_AUTOCORRELATION)
        upper = np.concatenate([most, np.full(count, _MAX_AUTOCORRELATION), np.full(2, self._max_ground_sd)])
        free[-1] = bool(np.isfinite(self.gap).any())
        bounds = math.log(shortest), math.log(longest)
        return Prior(mean, np.diag(sd**-2.0), np.append(lower, bounds[0]), np.append(upper, bounds[1])), free

    def noise_loss(self, noise: Noise) -> float:
        """Minus the log-prior of the noise [nats], up to a constant."""
        return self.noise_prior(noise)[0].loss(_packed(noise))

    def best_noise(self, response: Response, vector: np.ndarray, start: Noise, model: AugmentedWheel) -> Noise:
        """Maximum a posteriori noise, the parameters profiled out to first order.

        With fixed parameters, their misfit would count as noise. By scoring (Harvey 1989, Sec. 3.4.5), with difference
        quotients for the derivatives of the innovations.
        """
        prior, free = self.noise_prior(start)
        own, columns = self.prior(model), self.columns(response)
        noise, damping = start, 1e-3
        loss, step = self._profile_loss(columns, response, noise, vector, own)
        for _ in range(_NOISE_STEPS):
            packed = _packed(noise)
            left = columns[..., :1] - np.einsum("nmq,nq->nm", columns[..., 1:], response.of_each_row(step))[..., None]
            gradient, information = self._noise_score(left, response, noise, free)
            change, expected = solve_step(gradient, information, prior, packed, damping, free)
            if expected < _LEAST_NOISE_GAIN:
                break
            longest = np.concatenate([np.ones(len(self.answers)), np.full(len(self.answers), 0.3), [0.1, 0.1, 1.5]])
            change *= min(1.0, 1.0 / max(float(np.max(np.abs(change) / longest)), 1e-12))
            trial = _unpacked(np.clip(packed + change, prior.lower, prior.upper), noise)
            reached, trial_step = self._profile_loss(columns, response, trial, vector, own)
            if reached < loss:
                gained, noise, loss, step = loss - reached, trial, reached, trial_step
                damping = max(damping / 5.0, 1e-6)
                if gained < _LEAST_NOISE_GAIN:
                    break
            else:
                damping *= 10.0
                if damping > 1e4:
                    break
        return noise

    def _profile_loss(
        self, columns: np.ndarray, response: Response, noise: Noise, vector: np.ndarray, prior: Prior
    ) -> tuple[float, np.ndarray]:
        """Loss of a noise model [nats] less the gain of one step (p,) of the parameters, and that step."""
        whitened = self.whitener(noise, response)
        white, _ = whitened.whiten(columns)
        gradient, information = self.normal_equations(white[..., 0], white[..., 1:])
        step, gained = solve_step(gradient, information, prior, vector, 0.0)
        loss = float(robust_loss(white[..., 0]).sum() + whitened.log_sd.sum())
        return loss - gained + self.noise_loss(noise), step

    def _noise_score(
        self, left: np.ndarray, response: Response, noise: Noise, free: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Score (k,) and information (k, k) of the noise parameters from residuals (n, m, 1), by differences."""
        packed, reference = _packed(noise), self.reference or response
        base, ground = self.whitener(noise, response), matern(self.gap, noise)
        here = base.whiten(left)[0].ravel()
        moved, log_sd_moved = np.zeros((2, len(packed), here.size))
        for index in np.flatnonzero(free):
            there = packed.copy()
            there[index] += _DIFFERENCE
            changed = _unpacked(there, noise)
            if index < len(packed) - 3:
                further = self._whitener(self._errors(changed, reference), ground, reference)
            else:
                further = self._whitener(base.in_time, matern(self.gap, changed), reference)
            moved[index] = (further.whiten(left)[0].ravel() - here) / _DIFFERENCE
            log_sd_moved[index] = (further.log_sd - base.log_sd).ravel() / _DIFFERENCE
        weight = robust_weight(here)
        score = -(moved @ (weight * here)) - log_sd_moved.sum(axis=1)
        return score, (moved * weight) @ moved.T + log_sd_moved @ log_sd_moved.T


def _log_underestimate(autocorrelation: float) -> float:
    """Underestimate of ln(noise) from second differences of an autocorrelated noise [-]."""
    return 0.5 * math.log(6.0 / (6.0 - 8.0 * autocorrelation + 2.0 * autocorrelation**2))


def _packed(noise: Noise) -> np.ndarray:
    """Noise parameters (2 m + 3,): ln sd, autocorrelation, standard deviations of the ground, ln length."""
    return np.concatenate([np.log(noise.sd), noise.autocorrelation, noise.ground_sd, [math.log(noise.length)]])


def _unpacked(packed: np.ndarray, like: Noise) -> Noise:
    count = len(like.sd)
    return replace(
        like, sd=np.exp(packed[:count]), autocorrelation=packed[count : 2 * count], ground_sd=packed[-3:-1],
        length=math.exp(packed[-1]),
    )  # fmt: skip


def _order_along_track(
    position: np.ndarray, lane: np.ndarray, ground: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:  # fmt: skip
    """Order (n,) of the rows along the track, and the distance (n,) from the previous row on the same ground."""
    count = len(position)
    if not np.isfinite(position).all():
        return np.arange(count), np.full(count, np.inf)
    order = np.lexsort((position, lane))
    gap = np.diff(position[order])
    gap[(np.diff(lane[order]) != 0) | (np.diff(ground[order]) != 0)] = np.inf
    return order, np.concatenate([[np.inf], gap])
