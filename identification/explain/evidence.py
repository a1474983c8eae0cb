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
from .fit import Fitted
from .likelihood import Problem
from .steps import Prior, log_determinant, scaled_inverse

AMPLITUDES = (0.3, 1.0, 3.0, 10.0, 30.0)
"""Prior standard deviations of the discrepancy's coefficients, relative to the channel's noise, over which its evidence
is averaged [-]."""

_LEAST_VARIATION = 0.02
"""Least standard deviation of load, relative to its mean, for a discrepancy to depend on it [-]."""


def log_evidence(problem: Problem, fitted: Fitted) -> float:
    """Log evidence of a fit's model [nats], up to a constant that all models of the same samples share."""
    prior = problem.prior(fitted.model)
    information = fitted.information(problem)
    gradient, _ = problem.normal_equations(fitted.white.innovations, fitted.white.jacobian)
    gradient = gradient + prior.score(fitted.vector)
    answer = fitted.score + log_integral(gradient, information, fitted.vector, prior)
    answer -= sum(math.log(effect.choices) for effect in fitted.model.effects)
    return answer + _log_prior_scale(prior, fitted.model.soils.stop)


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


def _log_prior_scale(prior: Prior, start: int) -> float:
    """Ln of the normalisation of the effects' priors, from parameter `start` on, within bounds, less that of unit
    normal ones.
    """
    mean, sd = prior.mean[start:], 1.0 / np.sqrt(np.diag(prior.precision)[start:])
    return -float(np.sum(np.log(sd))) - _log_mass(mean, sd, prior.lower[start:], prior.upper[start:])


@dataclass(frozen=True)
class Discrepancy:
    """A smooth function of the drive's covariates, added to the answers.

    log_evidence: log Bayes factor of a model with it over the same model without it [nats]; mean (n, m): what its most
    probable structure adds to the answers, SI; change (n, m): the same with the response of the model, whose
    parameters are refitted with it.
    """

    log_evidence: float
    mean: np.ndarray
    change: np.ndarray


def discrepancy(problem: Problem, fitted: Fitted) -> Discrepancy:
    """Compute the evidence for a discrepancy added to a fitted model, whose parameters are refitted to first order.

    Which channels it is in, which covariates it depends on and how large it is are unknown: the evidence is the mean
    over `structures` and `AMPLITUDES`.
    """
    basis, covariates = discrepancy_basis(problem.samples.drive)
    rows, channels, size = len(basis), len(problem.answers), len(fitted.vector)
    extra = np.einsum("nk,cd->ncdk", basis, np.diag(fitted.noise.sd)).reshape(rows, channels, -1)
    columns = np.concatenate([problem.columns(fitted.response), np.where(problem.seen[..., None], extra, 0.0)], axis=-1)
    white, _ = problem.whitener(fitted.noise, fitted.response).whiten(columns)
    gradient, information = problem.normal_equations(white[..., 0], white[..., 1:])
    prior = problem.prior(fitted.model)
    gradient[:size] += prior.score(fitted.vector)
    information[:size, :size] += prior.precision
    # The model's parameters integrated out.
    covariance, cross = scaled_inverse(information[:size, :size]), information[:size, size:]
    slope = gradient[size:] - cross.T @ covariance @ gradient[:size]
    curvature = information[size:, size:] - cross.T @ covariance @ cross
    precision, logs = np.array(AMPLITUDES)[:, None] ** -2.0, []
    modes: list[tuple[np.ndarray, np.ndarray]] = []
    for chosen in structures(covariates, channels):
        values, vectors = np.linalg.eigh(curvature[np.ix_(chosen, chosen)])
        values, along = np.maximum(values, 0.0), vectors.T @ slope[chosen]
        logs.append(0.5 * (along**2 / (values + precision) - np.log1p(values / precision)).sum(axis=1))
        at = int(np.argmax(logs[-1]))
        modes.append((chosen, vectors @ (along / (values + precision[at]))))
    chosen, coefficients = modes[int(np.argmax(np.max(logs, axis=1)))]
    evidence = float(np.logaddexp.reduce(logs, axis=None)) - math.log(np.size(logs))
    mean = extra[..., chosen] @ coefficients
    step = covariance @ (gradient[:size] - cross[:, chosen] @ coefficients)
    response = fitted.response.changed_by(step)[:, problem.answers]
    return Discrepancy(evidence, mean, mean + response)


_CONSTANT, _PRODUCT = "constant", "slip load_N"


def discrepancy_basis(drive: Drive) -> tuple[np.ndarray, np.ndarray]:
    """Basis functions (n, k) of a discrepancy, Legendre polynomials of covariates, and the covariate of each (k,)."""
    degrees = {"slip": 4}
    if drive.load_N.std() > _LEAST_VARIATION * drive.load_N.mean():
        degrees["load_N"] = 3
    if drive.timed:
        degrees["time_s"] = 4
    degrees |= {"rim_speed_m_s": 2, "pass_number": 2, "pitch_rad": 1}
    degrees |= {"acceleration_m_s2": 1, "angular_acceleration_rad_s2": 1}
    columns: list[np.ndarray] = [np.ones((len(drive), 1))]
    covariates = [_CONSTANT]
    for name, degree in degrees.items():
        values = getattr(drive, name)
        if drive.has(name):
            values = np.log(np.abs(values) + 1e-6) if name == "rim_speed_m_s" else values
            columns.append(legvander(_scaled(values), degree)[:, 1:])
            covariates += degree * [name]
    if {"slip", "load_N"} <= set(covariates):
        columns.append((_scaled(drive.slip) * _scaled(drive.load_N))[:, None])
        covariates.append(_PRODUCT)
    return np.column_stack(columns), np.array(covariates)


def structures(covariates: np.ndarray, channels: int) -> list[np.ndarray]:
    """Coefficients of each structure of a discrepancy, once: it is in one channel or in all of them, and depends on
    one covariate, on slip and load, or on all covariates.

    Parameters
    ----------
    covariates : (k,)
        Covariate of each basis function.
    channels
        Number m of channels; coefficients are ordered by channel, then basis function.
    """
    names = [name for name in dict.fromkeys(covariates) if name != _PRODUCT]
    dependences = [np.isin(covariates, [_CONSTANT, name]) for name in names]
    if _PRODUCT in covariates:
        dependences.append(np.isin(covariates, [_CONSTANT, "slip", "load_N", _PRODUCT]))
    dependences.append(np.ones(len(covariates), dtype=bool))
    places = [*np.eye(channels, dtype=bool), np.ones(channels, dtype=bool)][: channels + (channels > 1)]
    masks = (np.outer(place, dependence).ravel() for place in places for dependence in dependences)
    return [np.flatnonzero(mask) for mask in {mask.tobytes(): mask for mask in masks}.values()]


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
