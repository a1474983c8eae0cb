"""The textbook wheel with nuisance parameters for published departures from its form.

If the textbook form is incorrect, its five parameters are biased, and their intervals, conditional on the form, do not
cover the true values. Here the form is uncertain: nuisance parameters describe departures of wheels on real soil from
the textbook, with priors as wide as published values. They are estimated with the soil and marginalised in its
intervals. A discrepancy without physics does not recover the parameters (J. Brynjarsdottir, A. O'Hagan, Inverse
Problems 30 (2014) 114007, Sec. 4).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ...framework.core.soil import PARAMETERS
from ...framework.core.vehicle import Wheel
from . import fields
from .textbook import PEAK_SHARE, Prediction, contact_array, in_equilibrium, initial_angles, predicted


@dataclass(frozen=True)
class Freedom:
    """A nuisance parameter: its textbook value, prior standard deviation [same unit] and bounds."""

    name: str
    textbook: float
    sd: float
    low: float
    high: float
    source: str


FREEDOMS = (
    Freedom("n1", 0.0, 0.4, -1.0, 2.0, "n = n0 + n1 i: Ding et al. 2010"),
    Freedom("a0", PEAK_SHARE, 0.15, 0.15, 0.85, "theta_m = (a0 + a1 i) theta_1: Wong & Reece 1967, a0 0.18 to 0.43"),
    Freedom("a1", 0.0, 0.3, -1.0, 1.0, "theta_m = (a0 + a1 i) theta_1: Wong & Reece 1967, a1 0.32 to 0.41"),
    Freedom("exit_share", 0.0, 0.3, 0.0, 0.8, "theta_2 = -exit_share theta_1: Onafeko & Reece 1967; Ishigami 2007"),
    Freedom("bulldozing", 0.0, 0.5, 0.0, 10.0, "DP less bulldozing b z^2 [1e5 Pa/m], about gamma K_p / 2: McKyes 1985"),
    Freedom("stiffening", 0.0, 0.5, -0.5, 1.5, "k = k_0 (W / W_0)^m; m = 1 - 0.5 for sand: Duncan & Chang 1970, Eq. 6"),
)

_SMALLEST_SHARE, _LARGEST_SHARE = 0.05, 0.95
"""Bounds of theta_m / theta_1 [-]: the stress peak stays inside the contact."""

PUSH = 1e5
"""Unit of the bulldozing resistance [Pa/m], which makes the parameter of order 1 for the optimiser."""

SMALLEST_EXPONENT, SMALLEST_LOAD = 0.05, 1e-3
"""Lower bounds of the sinkage exponent at any slip [-], and of the load relative to a typical load [-]."""


@dataclass(frozen=True)
class FlexibleWheel:
    """Five soil parameters as in `textbook.TextbookWheel`, then the nuisance parameters of `FREEDOMS`.

    The shear modulus k is that at `load_N` [N], a typical load.
    """

    wheel: Wheel
    load_N: float

    def exponents(self, vector: np.ndarray, slip: np.ndarray) -> np.ndarray:
        """Sinkage exponent n at each slip (n,)."""
        return np.maximum(math.exp(vector[4]) + vector[len(PARAMETERS)] * np.abs(slip), SMALLEST_EXPONENT)

    def predict(self, imposed: np.ndarray, vector: np.ndarray, theta_1: np.ndarray) -> Prediction:
        """Predict W [N], T [N m], z [m], i [-], DP [N]: see `textbook.Prediction`."""
        n1, a0, a1, exit_share, bulldozing, stiffening = vector[len(PARAMETERS) :]
        slip, sign = np.abs(imposed[:, 1]), np.sign(imposed[:, 1])
        heavier = np.log(np.maximum(imposed[:, 0], SMALLEST_LOAD * self.load_N) / self.load_N)
        modulus, stiffness, n0 = np.exp(vector[2:5])
        soil = vector[0], vector[1], modulus * np.exp(stiffening * heavier), stiffness, self.exponents(vector, slip)
        start = contact_array(initial_angles(theta_1), imposed[:, 1], soil, self.wheel)
        share = a0 + a1 * slip
        moving = (share > _SMALLEST_SHARE) & (share < _LARGEST_SHARE)
        start[:, fields.THETA_2] = -exit_share * start[:, fields.THETA_1]
        start[:, fields.THETA_M] = np.clip(share, _SMALLEST_SHARE, _LARGEST_SHARE) * start[:, fields.THETA_1]
        found, by_angle = in_equilibrium(start, imposed, self.wheel)
        contact, slopes, forces = found.contact, found.slopes, found.forces
        angle = contact[:, fields.THETA_1]

        # Columns: load, slip, then the vector; at a given entry angle.
        direct = np.zeros((len(imposed), 3, 2 + len(vector)))
        by_peak = slopes[:, :, fields.THETA_M] * (angle * moving)[:, None]
        by_exponent = slopes[:, :, fields.EXPONENT] * (contact[:, fields.EXPONENT] > SMALLEST_EXPONENT)[:, None]
        by_modulus = slopes[:, :, fields.MODULUS] * contact[:, fields.MODULUS, None]
        by_advance = self.wheel.radius_m * fields.speed_ratio(imposed[:, 1])[1]
        direct[:, :, 0] = by_modulus * (stiffening / imposed[:, 0])[:, None]
        direct[:, :, 1] = slopes[:, :, fields.ADVANCE] * by_advance[:, None]
        direct[:, :, 1] += sign[:, None] * (n1 * by_exponent + a1 * by_peak)
        direct[:, :, 2:4] = slopes[:, :, fields.COHESION : fields.TAN_PHI + 1]
        direct[:, :, 4] = by_modulus
        direct[:, :, 5] = slopes[:, :, fields.STIFFNESS] * stiffness
        direct[:, :, 6] = by_exponent * n0
        direct[:, :, 7] = by_exponent * slip[:, None]
        direct[:, :, 8] = by_peak
        direct[:, :, 9] = by_peak * slip[:, None]
        direct[:, :, 10] = -slopes[:, :, fields.THETA_2] * angle[:, None]
        direct[:, :, 12] = by_modulus * heavier[:, None]

        push, sinkage = PUSH * self.wheel.width_m, self.wheel.radius_m * (1.0 - np.cos(angle))
        forces[:, 2] -= bulldozing * push * sinkage**2
        by_angle[:, 2] -= 2.0 * bulldozing * push * sinkage * self.wheel.radius_m * np.sin(angle)
        direct[:, 2, 11] = -push * sinkage**2
        return predicted(found, by_angle, direct, imposed, self.wheel)
