"""Normal equations of whitened residuals: steps towards the best fit, its covariance, and the prior on the way."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from scipy.sparse import csr_array
from scipy.stats import norm as normal
from scipy.stats import t as student

from .soil_variation import huber_weight

LONGEST = np.array([np.inf, 0.5, 1.0, 1.0, 0.5])
"""Steps of c, tan phi, ln k, ln stiffness and ln n beyond which the model is no straight line."""

_LEAST_LEFT = 0.05
"""A group that leaves less than this share of its pull in the residuals is one without which nothing is known [-]."""


@dataclass(frozen=True)
class Prior:
    """Mean and precision of a normal prior, and bounds, each (p,)."""

    mean: np.ndarray
    precision: np.ndarray
    lower: np.ndarray
    upper: np.ndarray

    def loss(self, vector: np.ndarray) -> float:
        """Minus the log-density [nats], up to a constant."""
        return 0.5 * float(np.sum(self.precision * (vector - self.mean) ** 2))

    def beside(self, count: int, sd: float) -> Prior:
        """Give the prior with so many further parameters, about zero with a standard deviation, without bounds."""
        return Prior(
            np.concatenate([self.mean, np.zeros(count)]),
            np.concatenate([self.precision, np.full(count, sd**-2.0)]),
            np.concatenate([self.lower, np.full(count, -np.inf)]),
            np.concatenate([self.upper, np.full(count, np.inf)]),
        )

    def holding(self, vector: np.ndarray, held: np.ndarray) -> Prior:
        """Give the prior with those parameters of a vector (p,) that are `held` (p,) bound to where they are."""
        lower, upper = np.where(held, vector, self.lower), np.where(held, vector, self.upper)
        return replace(self, lower=lower, upper=upper)


def normal_equations(innovations: np.ndarray, jacobian: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Gradient (p,) and information (p, p) of the log-likelihood of some rows."""
    weight = huber_weight(innovations)
    flat = jacobian.reshape(-1, jacobian.shape[-1])
    return flat.T @ (weight * innovations).ravel(), (flat * weight.ravel()[:, None]).T @ flat


def step_of(
    innovations: np.ndarray, jacobian: np.ndarray, prior: Prior, vector: np.ndarray, damping: float
) -> tuple[np.ndarray, float]:
    """Damped step (p,) that stays off the bounds it leans on, and the gain that it promises [nats]."""
    return step_from(*normal_equations(innovations, jacobian), prior, vector, damping)


def step_from(
    gradient: np.ndarray, information: np.ndarray, prior: Prior, vector: np.ndarray, damping: float,
    longest: np.ndarray = LONGEST,
) -> tuple[np.ndarray, float]:  # fmt: skip
    """As `step_of`, by the gradient (p,) and the information (p, p) of the log-likelihood.

    The leading entries take no longer steps than the `longest`.
    """
    gradient = gradient - prior.precision * (vector - prior.mean)
    information = information + np.diag(prior.precision)
    free = ~((vector <= prior.lower) & (gradient < 0.0)) & ~((vector >= prior.upper) & (gradient > 0.0))
    scale = 1.0 / np.sqrt(np.maximum(information.diagonal(), 1e-12))
    scaled, pull = information * scale * scale[:, None], scale * gradient
    scaled[np.diag_indices_from(scaled)] += damping + 1e-10
    if free.all():
        step = scale * np.linalg.solve(scaled, pull)
    else:
        step = np.zeros(len(vector))
        step[free] = scale[free] * np.linalg.solve(scaled[np.ix_(free, free)], pull[free])
    step *= min(1.0, 1.0 / max(float(np.max(np.abs(step[: len(longest)]) / longest)), 1e-12))
    return step, float(step @ gradient - 0.5 * step @ information @ step)


def is_longest(step: np.ndarray) -> bool:
    """Say whether a step (p,) was cut short for being longer than the `LONGEST`."""
    return bool(np.max(np.abs(step[: len(LONGEST)]) / LONGEST) > 1.0 - 1e-9)


def covariance_of(innovations: np.ndarray, jacobian: np.ndarray, prior: Prior, group: np.ndarray) -> np.ndarray:
    """Covariance (p, p) of the parameters at a fit, made so that 1.96 of its standard deviations hold 95 %.

    Rows of one group (n,) may err together, as where the ground varies otherwise than the fit takes it to: a parameter
    whose estimate the groups pull about more than independent rows would is as uncertain as they show (K.-Y. Liang and
    S. L. Zeger, Biometrika 73 (1986), 13-22), never less than independent rows make it. A group that weighs much in a
    fit leaves little of its own pull in the residuals: what is missing is put back (R. M. Bell and D. F. McCaffrey,
    Survey Methodology 28 (2002), 169-181).
    """
    _, information = normal_equations(innovations, jacobian)
    covariance = scaled_inverse(information + np.diag(prior.precision))
    # In units of what independent rows would tell.
    sd = np.sqrt(np.maximum(np.diag(covariance), 1e-300))
    weight, jacobian = huber_weight(innovations), jacobian * sd
    rows, count = len(group), int(group.max()) + 1
    in_groups = csr_array((np.ones(rows), group, np.arange(rows + 1)), shape=(rows, count)).T
    pulls = in_groups @ np.einsum("nm,nmp->np", weight * innovations, jacobian)
    own = np.einsum("nm,nmp,nmq->npq", weight, jacobian, jacobian, optimize=True)
    own = (in_groups @ own.reshape(rows, -1)).reshape(count, len(sd), len(sd))
    values, axes = np.linalg.eigh(covariance / np.outer(sd, sd))
    root = (axes * np.sqrt(np.maximum(values, 0.0))) @ axes.T
    share, axes = np.linalg.eigh(root @ own @ root)
    along = np.einsum("gpi,gp->gi", axes, (pulls - pulls.mean(axis=0)) @ root)
    along /= np.sqrt(np.maximum(1.0 - share, _LEAST_LEFT))
    pulls = np.einsum("gpi,gi->gp", axes, along) @ root
    shown = count / max(count - 1, 1) * np.sum(pulls**2, axis=0) * _of_few(count - 1) ** 2
    shown += np.sum((covariance / sd[:, None]) ** 2 * prior.precision, axis=1)
    wider = np.sqrt(np.maximum(shown, 1.0))
    return covariance * np.outer(wider, wider)


@cache
def _of_few(degrees: int) -> float:
    """How much wider than a normal's is the 95 % interval of Student's distribution, by its degrees of freedom."""
    return float(student.ppf(0.975, max(degrees, 1)) / normal.ppf(0.975))


def scaled_inverse(matrix: np.ndarray) -> np.ndarray:
    """Inverse of a symmetric matrix (p, p) without negative eigenvalues, its units put aside; pseudo where singular."""
    scale = 1.0 / np.sqrt(np.maximum(np.diag(matrix), 1e-300))
    return np.linalg.pinv(matrix * np.outer(scale, scale), rcond=1e-12, hermitian=True) * np.outer(scale, scale)


def scaled_solve(matrix: np.ndarray, vector: np.ndarray, ridge: float) -> np.ndarray:
    """Solve for a vector (p,) by a symmetric matrix (p, p) without negative eigenvalues, its units put aside; the ridge
    is added to its diagonal of ones, which keeps columns that undo each other from making it singular.
    """
    scale = 1.0 / np.sqrt(np.maximum(np.diag(matrix), 1e-300))
    scaled = matrix * np.outer(scale, scale)
    scaled[np.diag_indices_from(scaled)] += ridge
    return scale * np.linalg.solve(scaled, scale * vector)
