"""Closed-form estimation with linear stresses: least squares in a batch and on-line.

Source: Iagnemma & Dubowsky (2002), Eq. 10-22. Fast, but biased: errors in sinkage, torque and slip enter the
regressors, and the stresses are not exactly linear. `identification.estimate` is accurate.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass

import numpy as np

from ...framework.core.vehicle import Wheel
from .fields import LOCKED
from .textbook import entry_angle, shear_displacement


def regressors(
    load_N: np.ndarray, torque_Nm: np.ndarray, sinkage_m: np.ndarray, slip: np.ndarray, k_m: float, wheel: Wheel
) -> tuple[np.ndarray, np.ndarray]:
    """Rows of Eq. 21: K1 (n,) and K2 (n, 2), so that K1 = K2 [c, tan phi].

    Parameters
    ----------
    load_N, torque_Nm, sinkage_m, slip : (n,)
        W [N], T [N m], z [m], i [-].
    k_m
        Assumed Janosi shear modulus [m].
    wheel
        The wheel.

    Notes
    -----
    From Eq. 17-19 with theta_m = theta_1 / 2: sigma_m and tau_m follow from W and T, and
    tau_m / (1 - A1) = c + sigma_m tan phi. Multiplied by the common denominator this is Eq. 20.
    """
    theta_1 = entry_angle(sinkage_m, wheel.radius_m)
    half = theta_1 / 2.0
    r, b = wheel.radius_m, wheel.width_m
    mobilised = -np.expm1(-shear_displacement(half, theta_1, slip, r) / k_m)
    k1 = (4.0 * np.cos(theta_1) - 8.0 * np.cos(half) + 4.0) * torque_Nm / mobilised
    cohesion = 2.0 * r**2 * b * theta_1 * (np.cos(theta_1) - 2.0 * np.cos(half) + 1.0)
    friction = -(4.0 * torque_Nm * np.sin(theta_1) + load_N * theta_1**2 * r - 8.0 * torque_Nm * np.sin(half))
    return k1, np.column_stack([cohesion, friction])


def peak_stresses(
    load_N: np.ndarray, torque_Nm: np.ndarray, sinkage_m: np.ndarray, wheel: Wheel
) -> tuple[np.ndarray, np.ndarray]:
    """Largest normal and shear stress sigma_m, tau_m [Pa], each (n,), from Eq. 17 and 18."""
    theta_1 = entry_angle(sinkage_m, wheel.radius_m)
    half = theta_1 / 2.0
    r, b = wheel.radius_m, wheel.width_m
    tau = 2.0 * torque_Nm / (r**2 * b * theta_1)
    side = load_N * half * (theta_1 - half) / (r * b)
    sigma = (side - tau * (theta_1 * np.sin(half) - half * np.sin(theta_1))) / (
        theta_1 * np.cos(half) - half * np.cos(theta_1) - theta_1 + half
    )
    return sigma, tau


def drawbar_pull(load_N: np.ndarray, torque_Nm: np.ndarray, sinkage_m: np.ndarray, wheel: Wheel) -> np.ndarray:
    """Drawbar pull [N], (n,), from sensed inputs alone: Eq. 15 with the linear stresses of Eq. 10-13."""
    theta_1 = entry_angle(sinkage_m, wheel.radius_m)
    half = theta_1 / 2.0
    sigma, tau = peak_stresses(load_N, torque_Nm, sinkage_m, wheel)
    # Integrals of the unit triangle (0 at theta_1 and 0, 1 at theta_1 / 2) times cosine and sine.
    cosine = (2.0 * np.cos(half) - np.cos(theta_1) - 1.0) / half
    sine = (2.0 * np.sin(half) - np.sin(theta_1)) / half
    return wheel.radius_m * wheel.width_m * (tau * cosine - sigma * sine)


@dataclass(frozen=True)
class LinearEstimate:
    """c [Pa] and tan phi [-] of Eq. 22, their least-squares covariance (2, 2) and the rows used."""

    c_Pa: float
    tan_phi: float
    covariance: np.ndarray
    n: int

    @property
    def phi_rad(self) -> float:
        """Friction angle [rad]."""
        return math.atan(self.tan_phi)


def estimate(
    load_N: np.ndarray, torque_Nm: np.ndarray, sinkage_m: np.ndarray, slip: np.ndarray, k_m: float, wheel: Wheel
) -> LinearEstimate:
    """Estimate c and phi by Eq. 22 in one batch; parameters as `regressors`.

    Rows that are not finite, or whose shear is not mobilised, are left out. The result is NaN with fewer than two rows.
    The covariance is that of ordinary least squares: it does not include the bias.
    """
    k1, k2 = regressors(load_N, torque_Nm, sinkage_m, slip, k_m, wheel)
    usable = np.isfinite(k1) & np.isfinite(k2).all(axis=1)
    k1, k2 = k1[usable], k2[usable]
    if len(k1) < 2:
        return LinearEstimate(math.nan, math.nan, np.full((2, 2), math.nan), len(k1))
    scale = np.sqrt(np.mean(k2**2, axis=0))
    solution, _, rank, _ = np.linalg.lstsq(k2 / scale, k1, rcond=None)
    if rank < 2:
        return LinearEstimate(math.nan, math.nan, np.full((2, 2), math.nan), len(k1))
    residual = k1 - k2 / scale @ solution
    variance = float(residual @ residual) / max(len(k1) - 2, 1)
    covariance = variance * np.linalg.inv((k2 / scale).T @ (k2 / scale)) / np.outer(scale, scale)
    return LinearEstimate(float(solution[0] / scale[0]), float(solution[1] / scale[1]), covariance, len(k1))


class OnlineEstimator:
    """Eq. 22 sample by sample, with exponential forgetting or over a sliding window.

    Only the normal equations of two unknowns are stored, so that the cost of an update is constant.

    Parameters
    ----------
    wheel
        The wheel.
    k_m
        Assumed Janosi shear modulus [m].
    memory
        Number of samples after which the weight of an old one has fallen to 1/e [-]; infinite for equal weights.
    window
        Number of samples kept [-]; None keeps all.
    """

    def __init__(self, wheel: Wheel, k_m: float, *, memory: float = math.inf, window: int | None = None):
        self._radius, self._width, self._k = wheel.radius_m, wheel.width_m, k_m
        self._forget = math.exp(-1.0 / memory)
        self._sums = (0.0,) * 5
        self._kept: deque[tuple[float, ...]] = deque()
        self._window = window
        self.n = 0

    def update(self, load_N: float, torque_Nm: float, sinkage_m: float, slip: float) -> tuple[float, float]:
        """Add one sample and return (c [Pa], tan phi [-]), NaN before two different samples."""
        row = self._normal_equations(load_N, torque_Nm, sinkage_m, slip)
        if row is not None:
            f = self._forget
            self._sums = tuple([f * total + part for total, part in zip(self._sums, row, strict=True)])
            self.n += 1
            if self._window is not None:
                self._kept.append(row)
                if len(self._kept) > self._window:
                    left = f**self._window
                    oldest = self._kept.popleft()
                    self._sums = tuple([total - left * part for total, part in zip(self._sums, oldest, strict=True)])
                    self.n -= 1
        return self.solution()

    def _normal_equations(
        self, load_N: float, torque_Nm: float, sinkage_m: float, slip: float
    ) -> tuple[float, ...] | None:
        """Products of one row of Eq. 21: x1 x1, x1 x2, x2 x2, x1 y, x2 y; None if it is not usable."""
        r = self._radius
        if not (0.0 < sinkage_m < r and math.isfinite(load_N + torque_Nm + slip)):
            return None
        cosine = 1.0 - sinkage_m / r
        theta = math.acos(cosine)
        sine, half_sine, half_cosine = math.sin(theta), math.sin(theta / 2.0), math.cos(theta / 2.0)
        ratio = 1.0 - slip if slip >= 0.0 else 1.0 / max(1.0 + slip, LOCKED)
        mobilised = -math.expm1(-r / self._k * (theta / 2.0 - ratio * (sine - half_sine)))
        if mobilised == 0.0:
            return None
        y = (4.0 * cosine - 8.0 * half_cosine + 4.0) * torque_Nm / mobilised
        x1 = 2.0 * r * r * self._width * theta * (cosine - 2.0 * half_cosine + 1.0)
        x2 = -(4.0 * torque_Nm * sine + load_N * theta * theta * r - 8.0 * torque_Nm * half_sine)
        return x1 * x1, x1 * x2, x2 * x2, x1 * y, x2 * y

    def solution(self) -> tuple[float, float]:
        """Return the present (c [Pa], tan phi [-])."""
        m11, m12, m22, v1, v2 = self._sums
        determinant = m11 * m22 - m12 * m12
        if determinant <= 1e-12 * m11 * m22:
            return math.nan, math.nan
        return (m22 * v1 - m12 * v2) / determinant, (m11 * v2 - m12 * v1) / determinant
