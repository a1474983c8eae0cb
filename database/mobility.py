"""What a vehicle can do on ground that a snapshot knows: drawbar pull at a slip, and whether it moves at all.

Each class's soil is drawn many times from what is known of it (`posterior`: a new place of the class, Student t), every
draw goes through the wheel's full mechanics (`identification.effects.ensemble`; where the class has
physics of its own through these, with their soil and what their fit may err by), and the classes'
distributions are mixed by the belief over classes. Draws are quasi-random and fixed, so that the same question has the
same answer.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import ndtri
from scipy.stats import chi2, qmc

from ..framework.core.arguments import number, numbers, refused
from ..framework.core.errors import InputError
from ..framework.core.soil import PARAMETERS, PLAUSIBLE, Quantity
from ..framework.core.vehicle import Vehicle, Wheel, as_vehicle
from ..identification.effects.ensemble import drawbar_pull as wheel_pull
from ..identification.effects.ensemble import error_count, errors_of_fit, soils_off
from ..identification.effects.stored import AugmentedSimulator, Estimated
from .mixture import MixtureTable
from .posterior import LEAST_SCATTER, PRIOR_VARIATION, ClassSoil, RandomEffects, other_parameters

if TYPE_CHECKING:
    from .answer import GroundAnswer
    from .snapshot import Snapshot

DRAWS = 256
"""Draws from each class's soil; the quasi-random error of a 5 % bound is then about 1 % of the spread."""

SLIPS = tuple(np.linspace(0.05, 0.8, 16).tolist())
"""Slips among which `mobility` seeks the best [-]."""

_SOIL_NUMBERS = 9
"""Columns of uniform numbers that a draw of a soil takes."""

_OTHERS = {"log_k": "shear modulus k", "log_stiffness": "stiffness", "n": "sinkage exponent n"}


@dataclass(frozen=True)
class DrawbarPull:
    """Drawbar pull of a whole vehicle at n places.

    Parameters
    ----------
    known : (n,) bool
        Could it be predicted?
    reason : (n,) str
        Why not; empty where known.
    mean : (n,)
        Expected drawbar pull, all wheels together [N], where the soil carries them.
    lower : (n,)
        What it exceeds with the answer's confidence [N]; -inf where the soil may not carry the wheels at all.
    load_N
        Load on each wheel that was assumed [N].
    slip
        [-].
    """

    known: np.ndarray
    reason: np.ndarray
    mean: np.ndarray
    lower: np.ndarray
    load_N: tuple[float, ...]
    slip: float


@dataclass(frozen=True)
class Mobility:
    """Whether and how well a vehicle moves at n places, at the slip that serves it best.

    Parameters
    ----------
    known, reason
        As `DrawbarPull`.
    go_probability : (n,)
        Probability that at some slip of `SLIPS` the drawbar pull is positive: the vehicle moves on the level [-].
        Classes whose soil was not measured count as not moving.
    drawbar_pull_lower : (n,)
        The greatest lower bound of the drawbar pull over the slips [N].
    best_slip : (n,)
        Slip at which that is [-].
    slope_lower : (n,)
        Steepest climb that this bound allows, asin(DP / W), no more than the pull on level ground gives [rad]; negative
        where the vehicle may be stuck on the level.
    load_N
        Load on each wheel that was assumed [N].
    """

    known: np.ndarray
    reason: np.ndarray
    go_probability: np.ndarray
    drawbar_pull_lower: np.ndarray
    best_slip: np.ndarray
    slope_lower: np.ndarray
    load_N: tuple[float, ...]


def drawbar_pull(
    answer: GroundAnswer, vehicle: Vehicle | str | Path, slip: float, load_N: float | Sequence[float] | None = None
) -> DrawbarPull:
    """Predict the drawbar pull of all wheels together at one slip.

    Parameters
    ----------
    answer
        The places, and the confidence wanted.
    vehicle
        Its wheels: the vehicle, or its TOML file, which is read at each call.
    slip
        In (-1, 1) [-].
    load_N
        Load on each wheel [N], one number for all or one a wheel; where absent, the mean load under which the soil
        was measured (`Snapshot.typical_load_N`).

    Raises
    ------
    InputError
        A slip or load that is no number or out of range, no vehicle, or no load given and none recorded.
    """
    given, wanted = slip, "a number between -1 and 1"
    slip = number("slip", given, wanted)
    if not -1.0 < slip < 1.0:  # nor is NaN
        raise refused("slip", given, wanted)
    vehicle = as_vehicle(vehicle)
    loads = _loads(answer, vehicle, load_N)
    pulls = _pulls(answer, vehicle, loads, (slip,))
    weight, known, reason = _weights(answer, pulls)
    lower = np.where(known, pulls.bounds[0].lower_bound(weight, weight.sum(axis=1) - answer.confidence), np.nan)
    shares = weight * pulls.carried
    total = shares.sum(axis=1)
    mean = np.divide(shares @ pulls.mean, total, out=np.full(len(answer), np.nan), where=total > 0)
    return DrawbarPull(known, reason, mean, lower, loads, slip)


def mobility(
    answer: GroundAnswer, vehicle: Vehicle | str | Path, load_N: float | Sequence[float] | None = None
) -> Mobility:
    """Predict whether the vehicle moves, and how much pull it has to spare at its best slip; as `drawbar_pull`."""
    vehicle = as_vehicle(vehicle)
    loads = _loads(answer, vehicle, load_N)
    pulls = _pulls(answer, vehicle, loads, SLIPS)
    weight, known, reason = _weights(answer, pulls)
    level = weight.sum(axis=1) - answer.confidence
    bounds = np.stack([table.lower_bound(weight, level) for table in pulls.bounds], axis=1)
    row = np.argmax(bounds, axis=1)
    best = np.where(known, bounds[np.arange(len(answer)), row], np.nan)
    slip = np.where(known, np.array(SLIPS)[row], np.nan)
    go = np.where(known, weight @ pulls.moving, np.nan)
    slope = np.arcsin(np.clip(best / sum(loads), -1.0, 1.0))
    return Mobility(known, reason, go, best, slip, slope, loads)


def _loads(answer: GroundAnswer, vehicle: Vehicle, load_N: float | Sequence[float] | None) -> tuple[float, ...]:
    wanted = "positive numbers [N]"
    given = answer.snapshot.typical_load_N if load_N is None else load_N
    loads = numbers("load_N", given, wanted)
    if loads.ndim == 0:
        loads = np.full(len(vehicle.wheels), loads)
    if loads.shape != (len(vehicle.wheels),):
        raise InputError("load_N", f"{loads.size} numbers", expected=f"one for each of {len(vehicle.wheels)}")
    if load_N is None and not np.all(np.isfinite(loads)):
        raise InputError("load_N", "not given, and the database recorded none", expected="the load on each wheel [N]")
    if not np.all(np.isfinite(loads) & (loads > 0)):
        raise refused("load_N", load_N, wanted)
    return tuple(loads.tolist())


@dataclass(frozen=True)
class _Pulls:
    """Drawbar pull of a vehicle on the u classes for which it can be predicted, at several slips.

    Parameters
    ----------
    usable : (k,) bool
        Which of a snapshot's classes these are.
    reasons : (k,) str
        Why the others are not.
    bounds
        Distribution of the pull over the classes [N], by slip; the mass that is not carried is below all of it.
    mean, carried : (u,)
        Mean [N] and share of the draws that are carried [-], at the first slip.
    moving : (u,)
        Share of the draws whose pull is positive at some slip [-].
    """

    usable: np.ndarray
    reasons: np.ndarray
    bounds: tuple[MixtureTable, ...]
    mean: np.ndarray
    carried: np.ndarray
    moving: np.ndarray


def _pulls(answer: GroundAnswer, vehicle: Vehicle, loads: tuple[float, ...], slips: tuple[float, ...]) -> _Pulls:
    """Predict by class; remembered by the snapshot, as planners ask the same again."""
    snapshot = answer.snapshot
    key = (tuple(map(_shape, vehicle.wheels)), loads, slips)
    return snapshot.remembered(key, lambda: _predict(snapshot, vehicle, loads, np.array(slips)))


def _predict(snapshot: Snapshot, vehicle: Vehicle, loads: tuple[float, ...], slips: np.ndarray) -> _Pulls:
    reasons = np.array([_why_not(snapshot, name) for name in snapshot.class_names], dtype=object)
    usable = reasons == ""
    names = [name for name, use in zip(snapshot.class_names, usable, strict=True) if use]
    draws = np.array([_pull(snapshot, name, vehicle, loads, slips) for name in names]).reshape(-1, DRAWS, len(slips))
    first, carried = draws[:, :, 0], np.isfinite(draws[:, :, 0])
    return _Pulls(
        usable, reasons, tuple(MixtureTable.of_samples(each) for each in draws.transpose(2, 1, 0)),
        np.where(carried, first, 0.0).sum(axis=1) / np.maximum(carried.sum(axis=1), 1), carried.mean(axis=1),
        np.mean(draws.max(axis=2) > 0.0, axis=1),
    )  # fmt: skip


def _why_not(snapshot: Snapshot, name: str) -> str:
    """Say why nothing can be predicted on a class; empty where it can."""
    soil = snapshot.soils.get(name)
    if soil is None:
        return f"no soil data for class {name}"
    missing = [text for key, text in _OTHERS.items() if key not in soil.others and name not in snapshot.physics]
    return f"no {missing[0]} known of class {name}" if missing else ""


def _shape(wheel: Wheel) -> tuple[float, float, float]:
    return wheel.radius_m, wheel.width_m, wheel.grouser_height_m


def _pull(snapshot: Snapshot, name: str, vehicle: Vehicle, loads: tuple[float, ...], slips: np.ndarray) -> np.ndarray:
    """Draw one class's soil and add up the wheels' drawbar pull: (DRAWS, slips) [N]."""
    physics, soil, errors = snapshot.physics.get(name), snapshot.soils[name], None
    if physics is None:
        draws = soil_draws(soil)
    else:
        errors = _errors_of(physics, ndtri(_uniform(_SOIL_NUMBERS + error_count(physics))[:, _SOIL_NUMBERS:]))
        draws = soils_off(soil_draws(_about_physics(soil, physics)), errors)
    total = np.zeros((DRAWS, len(slips)))
    by_wheel: dict[tuple[tuple[float, float, float], float], np.ndarray] = {}
    for wheel, load in zip(vehicle.wheels, loads, strict=True):
        key = (_shape(wheel), load)
        if key not in by_wheel:
            by_wheel[key] = wheel_pull(wheel, draws, load, slips, physics, errors)
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


def _weights(answer: GroundAnswer, pulls: _Pulls) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Probabilities of the usable classes, (n, u); where that is enough to predict; and why not."""
    shares = np.where(answer.known[:, None], answer.class_probability, 0.0)
    lacking = np.where(pulls.usable, 0.0, shares)
    known = answer.known & (lacking.sum(axis=1) <= 1.0 - answer.confidence + 1e-12) & bool(pulls.usable.any())
    reason, unpredicted = answer.reason, answer.known & ~known
    if unpredicted.any():
        reason = reason.copy()
        reason[unpredicted] = pulls.reasons[np.argmax(lacking[unpredicted], axis=1)]
    return np.where(known[:, None], shares[:, pulls.usable], 0.0), known, reason


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
        name: entry if math.isfinite(entry.sd) else Estimated(entry.value, usual[name])
        for name, entry in physics.soil.items()
    }
    return errors_of_fit(replace(physics, soil=soil), normal)
