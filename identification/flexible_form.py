"""The driven wheel with the freedom of form that is reported in the literature: nuisance physics for an honest fit.

Where the textbook's form is rejected, its five parameters have to bend to what it leaves out, and their intervals,
which take the form for granted, miss the truth. Here the form itself is uncertain: a few numbers that describe how
wheels on real soil depart from the textbook, each with a prior as wide as what has been published, are estimated beside
the soil and carried into its intervals. A discrepancy without knowledge of the physics does not give the parameters
back (J. Brynjarsdottir, A. O'Hagan, Inverse Problems 30 (2014) 114007, Sec. 4). The textbook is the point where every
freedom has its textbook value.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numba import njit

from ..framework.core.soil import PARAMETERS
from ..framework.core.vehicle import Wheel
from . import stress_kernel as kernel
from .forward import SMALLEST_ENTRY_ANGLE, Prediction, from_internal, to_internal
from .wheel_soil import LARGEST_ENTRY_ANGLE, PEAK_SHARE


@dataclass(frozen=True)
class Freedom:
    """One way in which the form may depart: its textbook value, the published spread [same unit], and bounds."""

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

NUISANCES = tuple(freedom.name for freedom in FREEDOMS)
_LOAD_TOLERANCE = 1e-3
_SMALLEST_SHARE, _LARGEST_SHARE = 0.05, 0.95
"""The stress peak stays inside the contact."""

PUSH = 1e5
"""Unit of the bulldozing resistance [Pa/m]: of the order of 1, as the optimiser's steps want it."""

SMALLEST_EXPONENT, SMALLEST_LOAD = 0.05, 1e-3
"""The sinkage exponent at any slip [-], and the load in typical loads [-], are at least these."""


@dataclass(frozen=True)
class FlexibleWheel:
    """Five soil parameters as in `forward.TextbookWheel`, then the numbers of `FREEDOMS`, all at their own scale.

    The shear modulus k is that at `load_N` [N], a typical load.
    """

    wheel: Wheel
    load_N: float
    names: tuple[str, ...] = PARAMETERS

    def to_vector(self, values: dict[str, float]) -> np.ndarray:
        """Lay out the soil in internal coordinates, and the freedoms at the textbook's values."""
        soil = [to_internal(name, values[name]) for name in self.names]
        return np.array([*soil, *(freedom.textbook for freedom in FREEDOMS)])

    def from_vector(self, vector: np.ndarray) -> dict[str, float]:
        """Give the SI values of the soil in a vector."""
        return {name: from_internal(name, float(value)) for name, value in zip(self.names, vector, strict=False)}

    def exponents(self, vector: np.ndarray, slip: np.ndarray) -> np.ndarray:
        """Sinkage exponent n at each slip (n,)."""
        return np.maximum(math.exp(vector[4]) + vector[len(PARAMETERS)] * np.abs(slip), SMALLEST_EXPONENT)

    def predict(self, imposed: np.ndarray, vector: np.ndarray, theta_1: np.ndarray) -> Prediction:
        """Predict W [N], T [N m], z [m], i [-], DP [N]: see `forward.Prediction`."""
        r, b = self.wheel.radius_m, self.wheel.width_m
        rows, size = len(imposed), len(vector)
        n1, a0, a1, exit_share, bulldozing, stiffening = vector[len(PARAMETERS) :]
        slip, sign = np.abs(imposed[:, 1]), np.sign(imposed[:, 1])
        share = a0 + a1 * slip
        moving = ((share > _SMALLEST_SHARE) & (share < _LARGEST_SHARE)).astype(float)
        share = np.clip(share, _SMALLEST_SHARE, _LARGEST_SHARE)
        contact = np.empty((rows, kernel.FIELD_COUNT))
        contact[:, kernel.SLIP] = imposed[:, 1]
        contact[:, kernel.COHESION : kernel.EXPONENT] = vector[0], vector[1], math.exp(vector[2]), math.exp(vector[3])
        heavier = np.log(np.maximum(imposed[:, 0], SMALLEST_LOAD * self.load_N) / self.load_N)
        contact[:, kernel.SHEAR_MODULUS] *= np.exp(stiffening * heavier)
        n0 = math.exp(vector[4])
        contact[:, kernel.EXPONENT] = self.exponents(vector, slip)
        rising = contact[:, kernel.EXPONENT] > SMALLEST_EXPONENT
        angle = np.ascontiguousarray(theta_1, dtype=float).copy()
        forces, full = np.empty((rows, 3)), np.empty((rows, 3, kernel.FIELD_COUNT))
        load = np.ascontiguousarray(imposed[:, 0])
        _carry_each(load, contact, exit_share, share, r, b, kernel.FEW_NODES, kernel.FEW_WEIGHTS, angle, forces, full)

        def along_angle(what: np.ndarray) -> np.ndarray:
            return what[..., kernel.THETA_1] + share[:, None] * what[..., kernel.THETA_M] - exit_share * what[..., 1]

        by_angle = along_angle(full)
        # Columns: load, slip, then the vector; at a given entry angle.
        direct = np.zeros((rows, 3, 2 + size))
        by_peak = full[:, :, kernel.THETA_M] * (angle * moving)[:, None]
        by_exponent = full[:, :, kernel.EXPONENT] * rising[:, None]
        by_modulus = full[:, :, kernel.SHEAR_MODULUS] * contact[:, None, kernel.SHEAR_MODULUS]
        direct[:, :, 0] = by_modulus * (stiffening / load)[:, None]
        direct[:, :, 1] = full[:, :, kernel.SLIP] + sign[:, None] * (n1 * by_exponent + a1 * by_peak)
        direct[:, :, 2:4] = full[:, :, kernel.COHESION : kernel.SHEAR_MODULUS]
        direct[:, :, 4] = by_modulus
        direct[:, :, 5] = full[:, :, kernel.STIFFNESS] * math.exp(vector[3])
        direct[:, :, 6] = by_exponent * n0
        direct[:, :, 7] = by_exponent * slip[:, None]
        direct[:, :, 8] = by_peak
        direct[:, :, 9] = by_peak * slip[:, None]
        direct[:, :, 10] = -full[:, :, kernel.THETA_2] * angle[:, None]
        direct[:, :, 12] = by_modulus * heavier[:, None]

        push = PUSH * b
        sinkage_slope = r * np.sin(angle)
        sinkage = r * (1.0 - np.cos(angle))
        forces[:, 2] -= bulldozing * push * sinkage**2
        by_angle[:, 2] -= 2.0 * bulldozing * push * sinkage * sinkage_slope
        direct[:, 2, 11] = -push * sinkage**2

        # The entry angle answers so that W stays what is imposed.
        stiffness = by_angle[:, 0]
        answering = -direct[:, 0] / stiffness[:, None]
        answering[:, 0] += 1.0 / stiffness
        missing = (load - forces[:, 0]) / stiffness
        channels, by_latent = np.empty((rows, 5)), np.zeros((rows, 5, 2))
        by_parameter = np.zeros((rows, 5, size))
        channels[:, 0], by_latent[:, 0, 0] = load, 1.0
        channels[:, 3], by_latent[:, 3, 1] = imposed[:, 1], 1.0
        for force, channel in ((1, 1), (2, 4)):
            slope = by_angle[:, force]
            channels[:, channel] = forces[:, force] + slope * missing
            total = direct[:, force] + slope[:, None] * answering
            by_latent[:, channel] = total[:, :2]
            by_parameter[:, channel] = total[:, 2:]
        angle = angle + missing
        slope = r * np.sin(angle)
        channels[:, 2] = r * (1.0 - np.cos(angle))
        by_latent[:, 2] = slope[:, None] * answering[:, :2]
        by_parameter[:, 2] = slope[:, None] * answering[:, 2:]
        return Prediction(channels, by_latent, by_parameter, angle)


@njit(cache=True, nogil=True, error_model="numpy")
def _carry_each(load, contact, exit_share, share, radius, width, nodes, weights, angle, forces, full):
    """Entry angle at which each row carries its load, as `stress_kernel.carry`, each row with its own fields.

    `angle` (n,) holds the start and then the answer; `full` (n, 3, 9) the derivatives by the columns of `contact`.
    A row whose load is never carried becomes NaN.
    """
    for row in range(load.size):
        target = load[row]
        low, high = SMALLEST_ENTRY_ANGLE, LARGEST_ENTRY_ANGLE
        theta = angle[row]
        if not (low < theta < high):
            theta = 0.5
        met = False
        one = slice(row, row + 1)
        for _ in range(60):
            contact[row, 0], contact[row, 1], contact[row, 2] = theta, -exit_share * theta, share[row] * theta
            kernel.rim_forces_and_derivatives(contact[one], radius, width, nodes, weights, forces[one], full[one])
            missing = target - forces[row, 0]
            if abs(missing) <= _LOAD_TOLERANCE * target:
                met = True
                break
            if missing > 0.0:
                low = theta
            else:
                high = theta
            if high - low < 1e-12 or not target > 0.0:
                break
            slope = full[row, 0, 0] + share[row] * full[row, 0, 2] - exit_share * full[row, 0, 1]
            growth = slope * theta / forces[row, 0] if forces[row, 0] > 0.0 else 0.0
            trial = theta * (target / forces[row, 0]) ** (1.0 / growth) if growth > 0.2 else -1.0
            theta = trial if low < trial < high else 0.5 * (low + high)
        if met:
            angle[row] = theta
        else:
            angle[row] = math.nan
            forces[row, :] = math.nan
            full[row, :, :] = math.nan
