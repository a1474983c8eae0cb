"""Forward mechanics of a rigid wheel on deformable soil.

Source, unless another is named: K. Iagnemma, S. Dubowsky, "Terrain estimation for high-speed rough-terrain autonomous
vehicle navigation" (2002), Eq. 1-9. The stresses are those of Reece (normal, Eq. 6), Mohr-Coulomb and Janosi & Hanamoto
(shear, Eq. 5). Braking (negative slip) uses the same law with the shear displacement of a wheel that turns slower than
it travels, and shear stress along the sign of that displacement.

Everything is vectorised over n samples; stresses are integrated in `stress_kernel`. An effect that the textbook leaves
out enters by changing the contact array (geometry, pressure-sinkage, shear law) between `contact_array` and
`rim_forces`, or the forces afterwards.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..framework.core.errors import InputError
from ..framework.core.soil import SoilKnowledge
from ..framework.core.vehicle import Wheel
from . import stress_kernel as kernel

PEAK_SHARE = 0.5
"""theta_m / theta_1: the peak stress lies midway (Sec. 3.1, second assumption)."""

LARGEST_ENTRY_ANGLE = 1.9
"""Entry angles beyond this [rad] mean a wheel buried above its axle: the load is not carried."""


@dataclass(frozen=True)
class Soil:
    """A soil for the forward model: c [Pa], phi [rad], Janosi shear modulus k [m], stiffness k1 + k2 b [Pa], n [-]."""

    c_Pa: float
    phi_rad: float
    k_m: float
    stiffness_Pa: float
    n: float

    def __post_init__(self) -> None:
        for name in ("c_Pa", "phi_rad", "k_m", "stiffness_Pa", "n"):
            value = getattr(self, name)
            least_ok = value >= 0 if name in ("c_Pa", "phi_rad") else value > 0
            if not (math.isfinite(value) and least_ok):
                raise InputError("soil", f"{value!r}", expected="a finite, positive number", place=name)

    @staticmethod
    def from_knowledge(known: SoilKnowledge, source: str = "soil") -> Soil:
        """Build a soil of which every parameter is known; raises `InputError` naming the one that is missing."""
        missing = [name for name in ("c_Pa", "phi_rad", "k_m", "stiffness_Pa", "n") if name not in known.values]
        if missing:
            raise InputError(source, f"{', '.join(missing)} missing", expected="c_Pa, phi_deg, k_m, stiffness_Pa and n")
        return Soil(**{name: float(value) for name, value in known.values.items()})


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
    slip = np.asarray(slip, dtype=float)
    ratio = np.where(slip >= 0.0, 1.0 - slip, 1.0 / np.maximum(1.0 + slip, kernel.LOCKED))
    return radius_m * (theta_1 - theta - ratio * (np.sin(theta_1) - np.sin(theta)))


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


def contact_array(theta_1: np.ndarray, slip: np.ndarray, soil: Soil, *, peak_share: float = PEAK_SHARE) -> np.ndarray:
    """Lay out n textbook contacts as the (n, 9) array that `rim_forces` integrates: theta_2 = 0, theta_m midway.

    Columns: theta_1, theta_2, theta_m [rad], slip [-], c [Pa], tan phi [-], k [m], stiffness [Pa], n [-].
    """
    theta_1, slip = np.broadcast_arrays(np.asarray(theta_1, dtype=float), np.asarray(slip, dtype=float))
    contact = np.empty((theta_1.size, kernel.FIELD_COUNT))
    contact[:, kernel.THETA_1] = theta_1.ravel()
    contact[:, kernel.THETA_2] = 0.0
    contact[:, kernel.THETA_M] = peak_share * theta_1.ravel()
    contact[:, kernel.SLIP] = slip.ravel()
    contact[:, kernel.COHESION :] = (soil.c_Pa, math.tan(soil.phi_rad), soil.k_m, soil.stiffness_Pa, soil.n)
    return contact


def rim_forces(contact: np.ndarray, wheel: Wheel) -> np.ndarray:
    """Load W [N], torque T [N m] and drawbar pull DP [N] of each contact, Eq. 2-4: (n, 3)."""
    forces = np.empty((len(contact), 3))
    kernel.rim_forces(contact, wheel.radius_m, wheel.width_m, kernel.NODES, kernel.WEIGHTS, forces)
    return forces


def rim_forces_and_derivatives(contact: np.ndarray, wheel: Wheel) -> tuple[np.ndarray, np.ndarray]:
    """As `rim_forces`, with the (n, 3, 9) derivatives with respect to the columns of `contact`."""
    forces = np.empty((len(contact), 3))
    jacobian = np.empty((len(contact), 3, kernel.FIELD_COUNT))
    kernel.rim_forces_and_derivatives(
        contact, wheel.radius_m, wheel.width_m, kernel.NODES, kernel.WEIGHTS, forces, jacobian
    )
    return forces, jacobian


def equilibrium(wheel: Wheel, soil: Soil, load_N: np.ndarray, slip: np.ndarray) -> WheelState:
    """Find the entry angle at which the soil carries the load at the given slip, and what follows from it.

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
        NaN in rows whose load is not positive and finite, or is not carried at all (the wheel is swallowed).
    """
    load, slip = np.broadcast_arrays(np.asarray(load_N, dtype=float), np.asarray(slip, dtype=float))
    load, slip = load.ravel(), slip.ravel()
    contact = contact_array(np.zeros(load.size), slip, soil)
    shares = np.zeros(load.size), np.full(load.size, PEAK_SHARE)
    forces = solve_contact(contact, shares, load, wheel)
    theta_1 = contact[:, kernel.THETA_1]
    sinkage = wheel.radius_m * (1.0 - np.cos(theta_1))
    return WheelState(theta_1, sinkage, forces[:, 1], forces[:, 2], forces[:, 0], slip)


def solve_contact(
    contact: np.ndarray, shares: tuple[np.ndarray, np.ndarray], load_N: np.ndarray, wheel: Wheel
) -> np.ndarray:
    """Set the angles of `contact` (n, 9), in place, so that each row carries its load [N]; return the forces (n, 3).

    `shares` are theta_2 / theta_1 and theta_m / theta_1, each (n,). Rows that carry nothing become NaN.
    """
    forces = np.empty((len(contact), 3))
    kernel.solve_entry_angle(
        contact,
        *shares,
        np.ascontiguousarray(load_N, dtype=float),
        wheel.radius_m,
        wheel.width_m,
        kernel.NODES,
        kernel.WEIGHTS,
        LARGEST_ENTRY_ANGLE,
        forces,
    )
    return forces
