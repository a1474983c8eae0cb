"""Mechanics of the synthetic world's wheels, which shares nothing with `bevameter.identification`.

What is estimated from synthetic drives is then not measured by the estimator's own quadrature and root finder.

K. Iagnemma, S. Dubowsky, *Terrain estimation for high-speed rough-terrain autonomous vehicle navigation* (2002),
Eq. 1-9: composite Simpson rule on either side of the stress peak, Chandrupatla's method for the equilibrium.
Slip-sinkage (Ding et al. 2010) and bulldozing (Rankine 1857, Bekker 1956) come on top where a drive conceals them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.integrate import simpson
from scipy.optimize.elementwise import find_root

INTERVALS = 32
"""Of Simpson's rule, on either side of the peak: forces within 4e-5 of their range for n from 0.5 to 1.5."""

PEAK_SHARE = 0.5
"""theta_m / theta_1: the peak stress lies midway (Sec. 3.1, second assumption)."""

LEAST_ENTRY_ANGLE, MOST_ENTRY_ANGLE = 1e-3, 1.5
"""Between these the equilibrium is looked for [rad]."""

UNIT_WEIGHT_N_M3 = 15.7e3
"""Unit weight of soil ahead of a wheel [N/m^3]: dry sand, 1600 kg/m^3."""


@dataclass(frozen=True)
class Soil:
    """A soil: c [Pa], phi [rad], Janosi shear modulus k [m], stiffness k1 + k2 b [Pa], n [-]."""

    c_Pa: float
    phi_rad: float
    k_m: float
    stiffness_Pa: float
    n: float


@dataclass(frozen=True)
class Equilibrium:
    """A wheel that its soil carries, each (n,): torque T [N m], drawbar pull DP [N], sinkage z [m].

    NaN where the soil does not carry the load.
    """

    torque_Nm: np.ndarray
    drawbar_pull_N: np.ndarray
    sinkage_m: np.ndarray


def equilibrium(
    radius_m: float, width_m: float, soil: Soil, load_N: np.ndarray, slip: np.ndarray, *,
    cohesion: np.ndarray | float = 1.0, stiffness: np.ndarray | float = 1.0, slip_sinkage: float = 0.0,
) -> Equilibrium:  # fmt: skip
    """Find the wheel's equilibrium with its load.

    Parameters
    ----------
    radius_m, width_m
        Radius r and width b of the wheel [m].
    soil
        The soil of the place.
    load_N, slip : (n,)
        Load W [N] and slip i [-], negative when braking (i = r omega / V - 1).
    cohesion, stiffness : (n,)
        By which the soil's are multiplied row by row [-].
    slip_sinkage
        n1 of the sinkage exponent n + n1 |i| of a slipping wheel [-]; L. Ding et al., J. Cent. South Univ. Technol. 17
        (2010), 129-135.
    """

    def miss(theta_1: np.ndarray, load: np.ndarray, *row: np.ndarray) -> np.ndarray:
        return _forces(theta_1, radius_m, width_m, soil, *row)[0] - load

    rows = np.broadcast_arrays(slip, cohesion, stiffness, soil.n + slip_sinkage * np.abs(slip))
    found = find_root(miss, (LEAST_ENTRY_ANGLE, MOST_ENTRY_ANGLE), args=(load_N, *rows), tolerances={"xrtol": 1e-10})
    theta_1 = np.where(found.success, found.x, np.nan)
    _, torque, pull = _forces(theta_1, radius_m, width_m, soil, *rows)
    return Equilibrium(torque, pull, radius_m * (1.0 - np.cos(theta_1)))


def bulldozing_resistance(width_m: float, soil: Soil, sinkage_m: np.ndarray) -> np.ndarray:
    """Passive pressure of the soil ahead of a wheel over its width and sinkage [N], (n,).

    W. J. M. Rankine, Phil. Trans. R. Soc. 147 (1857), 9-27; of wheels M. G. Bekker, *Theory of Land Locomotion* (1956):
    R_b = b (2 c z sqrt(K_p) + K_p gamma z^2 / 2) with K_p = tan^2(45 deg + phi / 2).
    """
    root = np.tan(np.pi / 4.0 + soil.phi_rad / 2.0)
    return width_m * (2.0 * soil.c_Pa * sinkage_m * root + root**2 * UNIT_WEIGHT_N_M3 * sinkage_m**2 / 2.0)


def _forces(
    theta_1: np.ndarray, radius_m: float, width_m: float, soil: Soil, slip: np.ndarray, cohesion: np.ndarray,
    stiffness: np.ndarray, exponent: np.ndarray,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:  # fmt: skip
    """Load [N], torque [N m] and drawbar pull [N] at given entry angles, Eq. 2-4, theta_2 = 0; all (n,)."""
    theta_1, slip, cohesion, stiffness, exponent = (
        each[..., None] for each in (theta_1, slip, cohesion, stiffness, exponent)
    )
    ratio = np.where(slip >= 0.0, 1.0 - slip, 1.0 / (1.0 + slip))  # V / (r omega)
    # The stress is a power of the distance from either end of the contact, which is smooth in the square root of it.
    root = np.linspace(0.0, 1.0, INTERVALS + 1)
    front, rear = (1.0 - PEAK_SHARE) * theta_1, PEAK_SHARE * theta_1
    ahead = theta_1 - front * root**2
    depth = radius_m * np.maximum(np.cos(ahead) - np.cos(theta_1), 0.0)  # Eq. 7; the same behind the peak (Eq. 9)
    sigma = stiffness * soil.stiffness_Pa * (depth / width_m) ** exponent  # Eq. 6
    sums = []
    for theta, length in ((ahead, front), (rear * root**2, rear)):
        run = radius_m * (theta_1 - theta - ratio * (np.sin(theta_1) - np.sin(theta)))
        strength = cohesion * soil.c_Pa + sigma * np.tan(soil.phi_rad)
        tau = strength * np.sign(run) * -np.expm1(-np.abs(run) / soil.k_m)  # Eq. 1 and 5
        sine, cosine = np.sin(theta), np.cos(theta)
        parts = np.stack([sigma * cosine + tau * sine, radius_m * tau, tau * cosine - sigma * sine])
        sums.append(simpson(2.0 * root * length * parts, x=root))
    load, torque, pull = radius_m * width_m * (sums[0] + sums[1])
    return load, torque, pull
