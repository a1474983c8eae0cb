"""Evidence of a hypothesis (marginal likelihood of the recording) by Laplace's method.

D. J. C. MacKay, Neural Computation 4 (1992), 415-447; R. E. Kass, A. E. Raftery, J. Am. Stat. Assoc. 90 (1995),
773-795. A misfit that no effect of the catalogue explains is modelled by a discrepancy: a smooth function of the
drive's covariates, linear in its coefficients, which are integrated out exactly (M. C. Kennedy, A. O'Hagan, J. R. Stat.
Soc. B 63 (2001), 425-464).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.polynomial.legendre import legvander
from scipy.special import erfcx, ndtr

from ..effects.effect import Drive
from ..mechanics.augmented import SOIL_COUNT
from .fit import Fitted
from .likelihood import Problem
from .steps import Prior, log_determinant, normal_equations, scaled_inverse

AMPLITUDES = (0.3, 1.0, 3.0, 10.0, 30.0)
"""Prior standard deviations of the discrepancy's coefficients, relative to the channel's noise, over which its evidence
is averaged [-]."""

_LEAST_VARIATION = 0.02
"""Least standard deviation of load, relative to its mean, for a discrepancy to depend on it [-]."""


def log_evidence(problem: Problem, fitted: Fitted) -> float:
    """Log evidence of a fit's model [nats], up to a constant that all models of the same samples share."""
    prior = problem.prior(fitted.model)
    information = fitted.information(problem)
    gradient, _ = normal_equations(fitted.white.innovations, fitted.white.jacobian)
    gradient = gradient - prior.precision * (fitted.vector - prior.mean)
    answer = fitted.score + log_integral(gradient, information, fitted.vector, prior)
    answer -= sum(math.log(effect.choices) for effect in fitted.model.effects)
    return answer + _log_prior_scale(prior)


def log_integral(gradient: np.ndarray, information: np.ndarray, vector: np.ndarray, prior: Prior) -> float:
    """Ln of the integral of exp(gradient d - d information d / 2) over all steps d (p,) within the bounds; less
    p / 2 ln(2 pi).

    The gradient is to vanish except for parameters at a bound. The others are integrated out first. Their mass beyond
    the bounds, and the integrals over those at a bound, are computed one by one: exact for one parameter with bounds.
    """
    bound = ((vector <= prior.lower) & (gradient < 0.0)) | ((vector >= prior.upper) & (gradient > 0.0))
    inside = ~bound
    free = information[np.ix_(inside, inside)]
    covariance = scaled_inverse(free)
    answer = -0.5 * log_determinant(free)
    if bound.any():
        across = information[np.ix_(bound, inside)]
        curvature = np.diag(information)[bound] - np.einsum("bi,ij,bj->b", across, covariance, across)
        curvature = np.maximum(curvature, 1e-12 * np.diag(information)[bound])
        # Integral of exp(-|gradient| d - curvature d^2 / 2) over d > 0.
        tail = 0.5 * erfcx(np.abs(gradient[bound]) / np.sqrt(2.0 * curvature))
        answer += float(np.sum(np.log(tail) - 0.5 * np.log(curvature)))
    return answer + _log_mass(vector[inside], np.sqrt(np.diag(covariance)), prior.lower[inside], prior.upper[inside])


def _log_mass(mean: np.ndarray, sd: np.ndarray, lower: np.ndarray, upper: np.ndarray) -> float:
    """Sum of ln of the probabilities that normal variables lie within bounds."""
    return float(np.sum(np.log(ndtr((upper - mean) / sd) - ndtr((lower - mean) / sd))))


def _log_prior_scale(prior: Prior) -> float:
    """Ln of the normalisation of the effects' priors within bounds, less that of unit normal ones."""
    mean, sd = prior.mean[SOIL_COUNT:], 1.0 / np.sqrt(prior.precision[SOIL_COUNT:])
    return -float(np.sum(np.log(sd))) - _log_mass(mean, sd, prior.lower[SOIL_COUNT:], prior.upper[SOIL_COUNT:])


@dataclass(frozen=True)
class Discrepancy:
    """A smooth function of the drive's covariates, added to the channels.

    log_evidence: ln of the Bayes factor of a model with it over the same model without it [nats]; mean (n, m): its
    posterior mean, SI; amplitude: root mean square of that, relative to the channels' noise [-].
    """

    log_evidence: float
    mean: np.ndarray
    amplitude: float


def discrepancy(problem: Problem, fitted: Fitted) -> Discrepancy:
    """Compute the evidence for a discrepancy added to a fitted model, whose parameters are refitted to first order."""
    basis = discrepancy_basis(problem.samples.drive)
    rows, count = basis.shape
    channels, size = len(problem.answers), len(fitted.vector)
    extra = np.zeros((rows, channels, count * channels))
    for channel in range(channels):
        extra[:, channel, channel * count : (channel + 1) * count] = basis * fitted.noise.sd[channel]
    columns = np.concatenate([problem.columns(fitted.response), np.where(problem.seen[..., None], extra, 0.0)], axis=-1)
    white, _ = problem.whitener(fitted.noise, fitted.response).whiten(columns)
    gradient, information = normal_equations(white[..., 0], white[..., 1:])
    prior = problem.prior(fitted.model)
    gradient[:size] += prior.precision * (prior.mean - fitted.vector)
    information[np.arange(size), np.arange(size)] += prior.precision
    base_gain, base_log_det = _gain(information[:size, :size], gradient[:size])
    terms, coefficients = [], []
    for amplitude in AMPLITUDES:
        with_prior = information.copy()
        added = np.arange(size, len(gradient))
        with_prior[added, added] += amplitude**-2.0
        gain, log_det = _gain(with_prior, gradient)
        terms.append(gain - base_gain - 0.5 * (log_det - base_log_det) - len(added) * math.log(amplitude))
        coefficients.append((scaled_inverse(with_prior) @ gradient)[size:])
    best = coefficients[int(np.argmax(terms))]
    mean = extra @ best
    return Discrepancy(
        float(np.logaddexp.reduce(terms)) - math.log(len(AMPLITUDES)), mean,
        float(np.sqrt(np.mean((mean / fitted.noise.sd)[problem.seen] ** 2))),
    )  # fmt: skip


def _gain(information: np.ndarray, gradient: np.ndarray) -> tuple[float, float]:
    """Gain of a Newton step [nats], and ln of the information's determinant."""
    scale = 1.0 / np.sqrt(np.maximum(np.diag(information), 1e-300))
    scaled = information * np.outer(scale, scale)
    scaled[np.diag_indices_from(scaled)] += 1e-10
    scaled_gradient = scale * gradient
    return 0.5 * float(scaled_gradient @ np.linalg.solve(scaled, scaled_gradient)), log_determinant(information)


def discrepancy_basis(drive: Drive) -> np.ndarray:
    """Basis functions (n, k) of a discrepancy: Legendre polynomials of slip, load, time, speed and pass number."""
    columns = [np.ones((len(drive), 1)), legvander(_scaled(drive.slip), 4)[:, 1:]]
    if drive.load_N.std() > _LEAST_VARIATION * drive.load_N.mean():
        load = legvander(_scaled(drive.load_N), 3)[:, 1:]
        columns += [load, (_scaled(drive.slip) * _scaled(drive.load_N))[:, None]]
    if drive.timed and drive.has("time_s"):
        columns.append(legvander(_scaled(drive.time_s), 4)[:, 1:])
    if drive.has("rim_speed_m_s"):
        columns.append(legvander(_scaled(np.log(np.abs(drive.rim_speed_m_s) + 1e-6)), 2)[:, 1:])
    if drive.has("pass_number"):
        columns.append(legvander(_scaled(drive.pass_number), 2)[:, 1:])
    if drive.has("pitch_rad"):
        columns.append(_scaled(drive.pitch_rad)[:, None])
    for name in ("acceleration_m_s2", "angular_acceleration_rad_s2"):
        if drive.has(name):
            columns.append(_scaled(getattr(drive, name))[:, None])
    return np.column_stack(columns)


def _scaled(values: np.ndarray) -> np.ndarray:
    """Values (n,) scaled to -1 to 1, 0 where unknown."""
    low, high = np.nanmin(values), np.nanmax(values)
    return np.nan_to_num(2.0 * (values - low) / max(high - low, 1e-12) - 1.0)


def dependence(problem: Problem, found: Discrepancy) -> list[tuple[int, str, float]]:
    """Channel, variable that explains most of the discrepancy in it, and its size relative to noise, largest first."""
    drive, answer = problem.samples.drive, []
    variables = {"slip": drive.slip, "load_N": drive.load_N}
    for name in ("time_s", "rim_speed_m_s", "pass_number", "pitch_rad"):
        if drive.has(name) and (name != "time_s" or drive.timed):
            variables[name] = getattr(drive, name)
    for position, channel in enumerate(problem.answers):
        course = found.mean[:, position]
        size = float(np.sqrt(np.mean(course[problem.seen[:, position]] ** 2)))
        left = {}
        for name, values in variables.items():
            polynomials = legvander(_scaled(values), 4)
            fitted = polynomials @ np.linalg.lstsq(polynomials, course, rcond=None)[0]
            left[name] = float(np.var(course - fitted))
        answer.append((channel, min(left, key=left.__getitem__), size / float(problem.first_noise.sd[position])))
    return sorted((each for each in answer if each[2] > 0.2), key=lambda each: -each[2])[:2]
