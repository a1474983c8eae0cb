"""Forward mechanics of a rigid wheel on deformable soil: the textbook wheel.

Source, unless another is named: K. Iagnemma, S. Dubowsky, "Terrain estimation for high-speed rough-terrain autonomous
vehicle navigation" (2002), Eq. 1-9. The stresses are those of Reece (normal, Eq. 6), Mohr-Coulomb and Janosi & Hanamoto
(shear, Eq. 5). Braking (negative slip) uses the same law with the shear displacement of a wheel that turns slower than
it travels, and shear stress along the sign of that displacement.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from ...framework.core.vehicle import Wheel
from . import fields
from .equilibrium import LARGEST_ENTRY_ANGLE, SMALLEST_ENTRY_ANGLE, Equilibrium, carry
from .soil import Soil

CHANNELS = ("load_N", "torque_Nm", "sinkage_m", "slip", "drawbar_pull_N")
"""Channels of a wheel, in the order of arrays of predictions."""

ANSWERS = ("torque_Nm", "sinkage_m", "drawbar_pull_N")
"""Channels that follow from load and slip, which are imposed."""

PEAK_SHARE = 0.5
"""theta_m / theta_1: the peak stress lies midway (Sec. 3.1, second assumption)."""

USUAL_ENTRY_ANGLE = 0.5
"""Default initial entry angle [rad]."""


@dataclass(frozen=True)
class WheelState:
    """The wheel in equilibrium with the soil, each (n,): NaN where the soil does not carry the load.

    theta_1 [rad] entry angle, sinkage z [m], torque T [N m], drawbar pull DP [N], load W [N], slip [-].
    """

    theta_1_rad: np.ndarray
    sinkage_m: np.ndarray
    torque_Nm: np.ndarray
    drawbar_pull_N: np.ndarray
    load_N: np.ndarray
    slip: np.ndarray


def entry_angle(sinkage_m: np.ndarray, radius_m: float) -> np.ndarray:
    """Entry angle theta_1 [rad] of a wheel of radius [m] at sinkage [m], from Eq. 7 at theta = 0; NaN above 2 r."""
    return np.arccos(1.0 - np.asarray(sinkage_m, dtype=float) / radius_m)


def shear_displacement(theta: np.ndarray, theta_1: np.ndarray, slip: np.ndarray, radius_m: float) -> np.ndarray:
    """Shear displacement j [m] at rim angle theta [rad] (the bracket of Eq. 5 times r), also for braking."""
    return radius_m * (theta_1 - theta - fields.speed_ratio(slip)[0] * (np.sin(theta_1) - np.sin(theta)))


def normal_stress(
    theta: np.ndarray, theta_1: float, soil: Soil, wheel: Wheel, *, theta_m: float | None = None, theta_2: float = 0.0
) -> np.ndarray:
    """Normal stress sigma(theta) [Pa] along the rim, Eq. 8 ahead of theta_m and Eq. 9 behind it; zero off the contact.

    Parameters
    ----------
    theta : (m,)
        Rim angles from the vertical [rad].
    theta_1, theta_m, theta_2
        Entry, peak and exit angle [rad]; theta_m is theta_1 / 2 where absent.
    soil, wheel
        The soil and the wheel.
    """
    theta = np.asarray(theta, dtype=float)
    peak = PEAK_SHARE * theta_1 if theta_m is None else theta_m
    mirrored = theta_1 - (theta - theta_2) / (peak - theta_2) * (theta_1 - peak)
    ahead = np.where(theta >= peak, theta, mirrored)
    depth = np.where((theta <= theta_1) & (theta >= theta_2), np.cos(ahead) - math.cos(theta_1), 0.0)
    return soil.stiffness_Pa * (wheel.radius_m / wheel.width_m * np.maximum(depth, 0.0)) ** soil.n


def shear_stress(
    theta: np.ndarray,
    theta_1: float,
    slip: float,
    soil: Soil,
    wheel: Wheel,
    *,
    theta_m: float | None = None,
    theta_2: float = 0.0,
) -> np.ndarray:
    """Shear stress tau(theta) [Pa] along the rim, Eq. 5; zero off the contact. Parameters as `normal_stress`."""
    theta = np.asarray(theta, dtype=float)
    sigma = normal_stress(theta, theta_1, soil, wheel, theta_m=theta_m, theta_2=theta_2)
    displacement = shear_displacement(theta, np.asarray(theta_1), np.asarray(slip), wheel.radius_m)
    mobilised = np.sign(displacement) * -np.expm1(-np.abs(displacement) / soil.k_m)
    inside = (theta <= theta_1) & (theta >= theta_2)
    return np.where(inside, (soil.c_Pa + sigma * math.tan(soil.phi_rad)) * mobilised, 0.0)


def contact_array(
    theta_1: float | np.ndarray, slip: np.ndarray, soil: Soil | Sequence[float | np.ndarray], wheel: Wheel
) -> np.ndarray:
    """Return n textbook contacts as the (n, f) array that `stresses` integrates: theta_2 = 0, theta_m midway.

    Parameters
    ----------
    theta_1, slip : (n,)
        Entry angles [rad] and slips [-].
    soil
        One soil, or c [Pa], tan phi [-], k [m], stiffness [Pa] and n [-], each a scalar or (n,).
    wheel
        The wheel.
    """
    contact = np.empty((np.size(slip), len(fields.FIELDS)), order="F")
    contact[:] = fields.TEXTBOOK
    contact[:, fields.THETA_1] = theta_1
    contact[:, fields.THETA_M] = PEAK_SHARE * contact[:, fields.THETA_1]
    contact[:, fields.ADVANCE] = wheel.radius_m * fields.speed_ratio(slip)[0]
    for field, number in enumerate(soil.numbers if isinstance(soil, Soil) else soil, fields.COHESION):
        contact[:, field] = number
    contact[:, fields.RADIUS : fields.LEVER + 1] = wheel.radius_m
    return contact


def equilibrium(wheel: Wheel, soil: Soil, load_N: np.ndarray, slip: np.ndarray) -> WheelState:
    """Compute the state of the wheel at the entry angle at which the soil carries the load at the given slip.

    Parameters
    ----------
    wheel, soil
        The wheel and the soil.
    load_N : (n,)
        Vertical load W, positive [N].
    slip : (n,)
        Slip in [-1, 1] [-]; negative when braking.

    Returns
    -------
    WheelState
        NaN in rows whose load is not positive and finite, or is not carried at any entry angle.
    """
    load, slip = np.broadcast_arrays(np.asarray(load_N, dtype=float), np.asarray(slip, dtype=float))
    load, slip = load.ravel(), slip.ravel()
    found = carry(contact_array(USUAL_ENTRY_ANGLE, slip, soil, wheel), load, wheel.width_m)
    theta_1, forces = found.contact[:, fields.THETA_1].copy(), found.forces
    return WheelState(
        theta_1, wheel.radius_m * (1.0 - np.cos(theta_1)), forces[:, 1], forces[:, 2], forces[:, 0], slip
    )  # fmt: skip


@dataclass(frozen=True)
class Prediction:
    """Channels (n, 5), derivatives by (load, slip) (n, 5, 2) and by the parameters (n, 5, p), entry angle (n,) [rad].

    Rows whose load the soil does not carry are NaN.
    """

    channels: np.ndarray
    by_latent: np.ndarray
    by_parameter: np.ndarray
    theta_1: np.ndarray


class ForwardModel(Protocol):
    """A model of the channels by imposed load [N] and slip (n, 2) and a parameter vector (p,): the soil comes first."""

    def predict(self, imposed: np.ndarray, vector: np.ndarray, theta_1: np.ndarray) -> Prediction:
        """Predict all channels from initial entry angles `theta_1` (n,) [rad]."""
        ...


def initial_angles(theta_1: np.ndarray) -> np.ndarray:
    """Initial entry angles (n,) [rad]: the given ones where they are in range, else the default."""
    usable = (theta_1 > SMALLEST_ENTRY_ANGLE) & (theta_1 < LARGEST_ENTRY_ANGLE)
    return np.where(usable, theta_1, USUAL_ENTRY_ANGLE)


def in_equilibrium(contact: np.ndarray, imposed: np.ndarray, wheel: Wheel) -> tuple[Equilibrium, np.ndarray]:
    """Equilibrium of contacts, and derivatives (n, 3) of its forces by the entry angle, all angles in proportion."""
    found = carry(contact, imposed[:, 0], wheel.width_m, near=True, sloped=True)
    by_angle = found.slopes[:, :, fields.THETA_1].copy()
    for field in (fields.THETA_2, fields.THETA_M):
        share = found.contact[:, field] / found.contact[:, fields.THETA_1]
        by_angle += found.slopes[:, :, field] * share[:, None]
    return found, by_angle


def predicted(
    found: Equilibrium, by_angle: np.ndarray, direct: np.ndarray, imposed: np.ndarray, wheel: Wheel
) -> Prediction:
    """Predict the channels of a wheel in equilibrium.

    Derivatives of the entry angle follow from a constant W (implicit function theorem); the error of the load that the
    root finder leaves is corrected by the same derivatives.

    Parameters
    ----------
    found
        Contacts and forces.
    by_angle : (n, 3)
        Derivatives of the forces by the entry angle [1/rad].
    direct : (n, 3, 2 + p)
        Derivatives of the forces by load, slip and the parameters at a given entry angle.
    imposed : (n, 2)
        Load [N] and slip.
    wheel
        The wheel.
    """
    load, theta_1 = imposed[:, 0], found.contact[:, fields.THETA_1]
    stiffness = by_angle[:, 0]
    turned = -direct[:, 0] / stiffness[:, None]
    turned[:, 0] += 1.0 / stiffness
    correction = (load - found.forces[:, 0]) / stiffness
    angle = theta_1 + correction
    channels, derivatives = np.empty((len(load), 5)), np.zeros((len(load), 5, direct.shape[2]))
    for force, channel in ((1, 1), (2, 4)):
        channels[:, channel] = found.forces[:, force] + by_angle[:, force] * correction
        derivatives[:, channel] = direct[:, force] + by_angle[:, force, None] * turned
    channels[:, 2] = wheel.radius_m * (1.0 - np.cos(angle))
    derivatives[:, 2] = (wheel.radius_m * np.sin(angle))[:, None] * turned
    channels[:, [0, 3]] = imposed
    derivatives[:, 0, 0] = derivatives[:, 3, 1] = 1.0
    return Prediction(channels, derivatives[:, :, :2], derivatives[:, :, 2:], angle)


@dataclass(frozen=True)
class TextbookWheel:
    """The paper's Eq. 1-9 for one wheel: five soil parameters, theta_2 = 0, theta_m = theta_1 / 2."""

    wheel: Wheel

    def predict(self, imposed: np.ndarray, vector: np.ndarray, theta_1: np.ndarray) -> Prediction:
        """Predict W [N], T [N m], z [m], i [-], DP [N]: see `Prediction`."""
        soil = [*vector[:2], *np.exp(vector[2:])]
        found, by_angle = in_equilibrium(
            contact_array(initial_angles(theta_1), imposed[:, 1], soil, self.wheel), imposed, self.wheel
        )
        direct = np.zeros((len(imposed), 3, 2 + len(soil)))
        direct[:, :, 1:] = found.slopes[:, :, fields.ADVANCE : fields.EXPONENT + 1]
        direct[:, :, 1] *= self.wheel.radius_m * fields.speed_ratio(imposed[:, 1])[1][:, None]
        direct[:, :, 4:] *= np.array(soil[2:])
        return predicted(found, by_angle, direct, imposed, self.wheel)
