"""Damped Newton steps from the normal equations of white residuals and the prior."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..mechanics.augmented import SOIL_COUNT
from .whitening import robust_weight


@dataclass(frozen=True)
class Prior:
    """Mean (p,) and precision (p, p) of a normal prior, and bounds (p,)."""

    mean: np.ndarray
    precision: np.ndarray
    lower: np.ndarray
    upper: np.ndarray

    def loss(self, vector: np.ndarray) -> float:
        """Minus the log-density [nats], up to a constant."""
        return 0.5 * float((vector - self.mean) @ self.precision @ (vector - self.mean))

    def score(self, vector: np.ndarray) -> np.ndarray:
        """Gradient (p,) of the log-density."""
        return self.precision @ (self.mean - vector)


def normal_equations(
    innovations: np.ndarray, jacobian: np.ndarray, ground: np.ndarray, grounds: int, weight: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray]:  # fmt: skip
    """Gradient (p,) and information (p, p) of the log-likelihood.

    Parameters
    ----------
    innovations : (n, m)
        White residuals.
    jacobian : (n, m, q)
        Their derivatives by the soil of each row's ground and by other parameters.
    ground : (n,)
        Number of each row's ground.
    grounds
        Number of grounds, whose soils come first among the p parameters.
    weight : (n, m), optional
        Weights; less for gross errors where absent.
    """
    weight, count = robust_weight(innovations) if weight is None else weight, jacobian.shape[-1]
    others = SOIL_COUNT * grounds + np.arange(count - SOIL_COUNT)
    size = SOIL_COUNT * (grounds - 1) + count
    gradient, information = np.zeros(size), np.zeros((size, size))
    for each in range(grounds):
        rows = slice(None) if grounds == 1 else np.flatnonzero(ground == each)
        flat, weights = jacobian[rows].reshape(-1, count), weight[rows].ravel()
        own = np.concatenate([SOIL_COUNT * each + np.arange(SOIL_COUNT), others])
        gradient[own] += flat.T @ (weights * innovations[rows].ravel())
        information[np.ix_(own, own)] += (flat * weights[:, None]).T @ flat
    return gradient, information


def solve_step(
    gradient: np.ndarray, information: np.ndarray, prior: Prior, vector: np.ndarray, damping: float,
    free: np.ndarray | None = None,
) -> tuple[np.ndarray, float]:  # fmt: skip
    """Damped Newton step (p,), parameters at active bounds fixed, and its expected gain [nats].

    Parameters
    ----------
    gradient, information
        Of the log-likelihood, (p,) and (p, p); the prior is added.
    prior, vector, damping
        The prior, the present parameters (p,), and Levenberg's damping relative to the scaled information [-].
    free : (p,), optional
        Which parameters may change.
    """
    gradient = gradient + prior.score(vector)
    information = information + prior.precision
    moves = ~((vector <= prior.lower) & (gradient < 0.0)) & ~((vector >= prior.upper) & (gradient > 0.0))
    if free is not None:
        moves &= free
    step = np.zeros(len(vector))
    if not moves.any():
        return step, 0.0
    inside = np.ix_(moves, moves)
    scale = 1.0 / np.sqrt(np.maximum(np.diag(information)[moves], 1e-12))
    scaled = information[inside] * np.outer(scale, scale)
    scaled[np.diag_indices_from(scaled)] += damping + 1e-10
    step[moves] = scale * np.linalg.solve(scaled, scale * gradient[moves])
    return step, float(step @ gradient - 0.5 * step @ information @ step)


def scaled_inverse(matrix: np.ndarray) -> np.ndarray:
    """Inverse of a positive semidefinite matrix (p, p), scaled to a unit diagonal; pseudo-inverse where singular."""
    scale = 1.0 / np.sqrt(np.maximum(np.diag(matrix), 1e-300))
    return np.linalg.pinv(matrix * np.outer(scale, scale), rcond=1e-12, hermitian=True) * np.outer(scale, scale)


def log_determinant(matrix: np.ndarray) -> float:
    """Ln of the determinant of a positive definite matrix (p, p), scaled to a unit diagonal."""
    scale = 1.0 / np.sqrt(np.maximum(np.diag(matrix), 1e-300))
    scaled = matrix * np.outer(scale, scale)
    scaled[np.diag_indices_from(scaled)] += 1e-12
    return float(np.linalg.slogdet(scaled)[1]) - 2.0 * float(np.log(scale).sum())
