"""Draws of what a vehicle's wheels do on a class of ground: from what is known of its soil, through the full mechanics.

Each class's soil is drawn many times (`posterior`: a new place of the class, Student t), and every draw goes through
the wheel (`identification.effects.ensemble`); where the class has physics of its own through these, with their soil and
what their fit may err by. Draws are quasi-random and fixed, so that the same question has the same answer.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import ndtri
from scipy.stats import chi2, qmc

from ..framework.core.explanation import Estimate
from ..framework.core.soil import PARAMETERS, PLAUSIBLE, Quantity
from ..framework.core.vehicle import Vehicle, Wheel
from ..identification.effects.effect import PULL, SINKAGE
from ..identification.effects.ensemble import channels, error_count, errors_of_fit, soils_off
from ..identification.effects.stored import AugmentedSimulator
from .posterior import LEAST_SCATTER, PRIOR_VARIATION, ClassSoil, RandomEffects, other_parameters

if TYPE_CHECKING:
    from .snapshot import Snapshot

DRAWS = 256
"""Draws from each class's soil; the quasi-random error of a 5 % bound is then about 1 % of the spread."""

_SOIL_NUMBERS = 9
"""Columns of uniform numbers that a draw of a soil takes."""


def shape(wheel: Wheel) -> tuple[float, float, float]:
    """Return what of a wheel the mechanics depend on: radius, width and grouser height [m]."""
    return wheel.radius_m, wheel.width_m, wheel.grouser_height_m


def pulls(snapshot: Snapshot, name: str, vehicle: Vehicle, loads: tuple[float, ...], slips: np.ndarray) -> np.ndarray:
    """Drawbar pull of all wheels together on a class, (DRAWS, slips) [N]; -inf where it is not carried."""
    return _sum_over_wheels(snapshot, name, vehicle, loads, slips, lambda wheel, load, soils, done: done[..., PULL])


def braking_forces(
    snapshot: Snapshot, name: str, vehicle: Vehicle, loads: tuple[float, ...], slips: np.ndarray
) -> np.ndarray:
    """Force that slows the vehicle where its wheels turn slower than they roll by such slips, as `pulls`.

    No more than the contact patches bear (`side_forces`): the textbook's stresses were measured on driven wheels, and
    on braked ones they give more than the ground's shear strength.
    """

    def force(wheel: Wheel, load: float, soils: np.ndarray, done: np.ndarray) -> np.ndarray:
        return np.minimum(-done[..., PULL], _greatest_thrust(wheel, load, soils, done))

    return _sum_over_wheels(snapshot, name, vehicle, loads, -slips, force)


def side_forces(
    snapshot: Snapshot, name: str, vehicle: Vehicle, loads: tuple[float, ...], slips: np.ndarray
) -> np.ndarray:
    """Side force that the contact patches of all wheels together bear on a class, (DRAWS, slips) [N].

    What the wheel's side pushes away, which adds to it, is left out. -inf where the wheel is not carried.
    """
    return _sum_over_wheels(snapshot, name, vehicle, loads, slips, _greatest_thrust)


def _greatest_thrust(wheel: Wheel, load: float, soils: np.ndarray, done: np.ndarray) -> np.ndarray:
    """Bekker's greatest thrust c A + W tan phi (J. Y. Wong, "Theory of Ground Vehicles", 4th ed. (2008), Sec. 2.4), in
    any direction (DRAWS, slips) [N]; the patch A reaches from below the axle to where the wheel enters the ground.
    """
    cosine = np.clip(1.0 - done[..., SINKAGE] / wheel.radius_m, -1.0, 1.0)
    area = wheel.width_m * wheel.radius_m * np.sqrt(1.0 - cosine**2)
    return soils[:, [0]] * area + load * np.tan(soils[:, [1]])


def _sum_over_wheels(
    snapshot: Snapshot, name: str, vehicle: Vehicle, loads: tuple[float, ...], slips: np.ndarray,
    force: Callable[[Wheel, float, np.ndarray, np.ndarray], np.ndarray],
) -> np.ndarray:  # fmt: skip
    """Draw one class's soil (DRAWS, 5), and add up a `force` (DRAWS, slips) of wheel, load, soils and channels."""
    physics, soil, errors = snapshot.physics.get(name), snapshot.soils[name], None
    if physics is None:
        soils = soil_draws(soil)
    else:
        errors = _errors_of(physics, ndtri(_uniform(_SOIL_NUMBERS + error_count(physics))[:, _SOIL_NUMBERS:]))
        soils = soils_off(soil_draws(_about_physics(soil, physics)), errors)
    total = np.zeros((DRAWS, len(slips)))
    by_wheel: dict[tuple[tuple[float, float, float], float], np.ndarray] = {}
    for wheel, load in zip(vehicle.wheels, loads, strict=True):
        key = (shape(wheel), load)
        if key not in by_wheel:
            by_wheel[key] = force(wheel, load, soils, channels(wheel, soils, load, slips, physics, errors))
        total += by_wheel[key]
    return np.where(np.isfinite(total), total, -np.inf)


def soil_draws(soil: ClassSoil) -> np.ndarray:
    """Draw `DRAWS` soils of new places of a class, (DRAWS, 5): columns as `PARAMETERS`, within `PLAUSIBLE`."""
    uniform = _uniform(_SOIL_NUMBERS)
    middle = 0.5 * np.nansum(soil.normal_stress_Pa)
    strength = _student(soil.strength, uniform[:, 0:2], uniform[:, 2], np.array([1.0, middle]))
    log_k, log_stiffness, exponent = (
        _student(soil.others[name], uniform[:, [column]], uniform[:, column + 1], np.ones(1))[:, 0]
        for name, column in (("log_k", 3), ("log_stiffness", 5), ("n", 7))
    )
    draws = np.stack(
        [strength[:, 0], np.arctan(strength[:, 1]), *np.exp(np.clip([log_k, log_stiffness], -50.0, 50.0)), exponent],
        axis=1,
    )
    low, high = np.array([PLAUSIBLE[name] for name in PARAMETERS]).T
    return np.clip(draws, low, high)


def _uniform(columns: int) -> np.ndarray:
    """Quasi-random numbers in (0, 1), (DRAWS, columns); more columns leave the first ones as they were."""
    # Unscrambled, so that no seed is needed; half a step away from the sequence's zeros.
    return (qmc.Sobol(d=columns, scramble=False).random(DRAWS) + 0.5 / DRAWS) % 1.0


def _student(effects: RandomEffects, normal: np.ndarray, tail: np.ndarray, gradient: np.ndarray) -> np.ndarray:
    """Map uniform numbers (s, d) and (s,) to Student t draws of a new place, (s, d)."""
    freedom = effects.predict(gradient)[2]
    factor = np.linalg.cholesky(effects.predictive_covariance)
    stretch = np.sqrt(freedom / chi2.ppf(np.clip(tail, 1e-9, 1.0 - 1e-9), freedom))
    return effects.mean + stretch[:, None] * (ndtri(np.clip(normal, 1e-9, 1.0 - 1e-9)) @ factor.T)


def _about_physics(soil: ClassSoil, physics: AugmentedSimulator) -> ClassSoil:
    """Give the class's soil about the one that was fitted together with the effects.

    The textbook wheel's soil absorbs the effects: with them in the model they would count twice. How places
    of the class scatter, and how well its mean is known, stays as the stretches show; a parameter that no stretch
    determines is the fitted one, with the scatter that soils of one kind usually show. The error of the fit is added
    (`_errors_of`).
    """
    values = physics.soil_values
    centre = {"log_k": np.log(values.k_m), "log_stiffness": np.log(values.stiffness_Pa), "n": values.n}
    fitted = {name: Quantity(entry.value, 0.0, entry.value, entry.value) for name, entry in physics.soil.items()}
    others = {**other_parameters([fitted], np.ones(1)), **soil.others}
    others = {name: replace(others[name], mean=np.array([centre[name]])) for name in centre if name in others}
    strength = replace(soil.strength, mean=np.array([values.c_Pa, np.tan(values.phi_rad)]))
    return replace(soil, strength=strength, others=others)


def _errors_of(physics: AugmentedSimulator, normal: np.ndarray) -> np.ndarray:
    """Draw the errors of a fit (`errors_of_fit`); a soil's parameter of unknown error by as much as places of one class
    commonly differ.
    """
    values = physics.soil_values
    slope = math.cos(values.phi_rad) ** 2
    usual = {
        "c_Pa": max(PRIOR_VARIATION["c_Pa"] * values.c_Pa, LEAST_SCATTER["c_Pa"]),
        "phi_rad": max(PRIOR_VARIATION["tan_phi"] * math.tan(values.phi_rad), LEAST_SCATTER["tan_phi"]) * slope,
        **{name: PRIOR_VARIATION[name] * getattr(values, name) for name in ("k_m", "stiffness_Pa", "n")},
    }
    soil = {
        name: entry if math.isfinite(entry.sd) else Estimate(entry.value, usual[name])
        for name, entry in physics.soil.items()
    }
    return errors_of_fit(replace(physics, soil=soil), normal)
