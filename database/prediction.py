"""Predictions for a vehicle by class, and their mixture at a place by the belief over classes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.constants import g as GRAVITY

from ..framework.core.arguments import numbers, refused
from ..framework.core.errors import InputError
from ..framework.core.vehicle import Vehicle
from .class_draws import DRAWS, shape
from .mixture import MixtureTable

if TYPE_CHECKING:
    from .answer import GroundAnswer
    from .snapshot import Snapshot

_OTHERS = {"log_k": "shear modulus k", "log_stiffness": "stiffness", "n": "sinkage exponent n"}

_ROUNDING = 1e-12
"""Rounding error of a sum of probabilities [-]."""

Draws = Callable[["Snapshot", str, Vehicle, tuple[float, ...], np.ndarray], np.ndarray]
"""Draws (s, slips) of a quantity on a class for a vehicle with such loads [N] on its wheels; -inf where not carried."""


@dataclass(frozen=True)
class ByClass:
    """A quantity on the u classes for which it can be predicted, at several slips.

    Parameters
    ----------
    usable : (k,) bool
        Which of a snapshot's classes these are.
    reasons : (k,) str
        Why the others are not.
    bounds
        Distribution over the classes, by slip; the mass that is not carried is below all of it.
    mean, carried : (slips, u)
        Mean of the draws that are carried, and their share [-].
    positive : (u,)
        Share of the draws that are positive at some slip [-].
    """

    usable: np.ndarray
    reasons: np.ndarray
    bounds: tuple[MixtureTable, ...]
    mean: np.ndarray
    carried: np.ndarray
    positive: np.ndarray


@dataclass(frozen=True)
class AtPlaces:
    """A quantity at n places.

    Parameters
    ----------
    known, reason : (n,)
        Could it be predicted, and why not.
    weight : (n, u)
        Probabilities of the classes for which it can.
    lower : (n, slips)
        Lower bound at the confidence; NaN where unknown, -inf where the soil may not carry the wheels.
    """

    by_class: ByClass
    known: np.ndarray
    reason: np.ndarray
    weight: np.ndarray
    lower: np.ndarray

    def best(self) -> tuple[np.ndarray, np.ndarray]:
        """Number of the slip with the greatest lower bound (n,), and this bound."""
        row = np.argmax(np.where(self.known[:, None], self.lower, -np.inf), axis=1)
        return row, self.lower[np.arange(len(row)), row]

    def mean(self, row: np.ndarray | int) -> np.ndarray:
        """Expected value (n,) at the slip of that number, one or (n,), where wheels are carried; NaN where unknown."""
        shares = self.weight * self.by_class.carried[row]
        total = shares.sum(axis=1)
        summed = (shares * self.by_class.mean[row]).sum(axis=1)
        return np.divide(summed, total, out=np.full(len(total), np.nan), where=total > 0.0)


def predict(
    answer: GroundAnswer, vehicle: Vehicle, loads: tuple[float, ...], slips: tuple[float, ...], draws: Draws
) -> AtPlaces:
    """Predict a quantity at the places of an answer; by class it is remembered: planners ask the same again.

    Raises
    ------
    InputError
        More confidence than so many draws can bear.
    """
    snapshot = answer.snapshot
    if answer.confidence > 1.0 - 1.0 / DRAWS:
        raise InputError(
            "confidence", f"{answer.confidence!r}", expected=f"at most {1.0 - 1.0 / DRAWS:.4g} for what wheels do"
        )
    key = (draws, tuple(map(shape, vehicle.wheels)), loads, slips)
    found = snapshot.remembered(key, lambda: _by_class(snapshot, vehicle, loads, np.array(slips), draws))
    weight, known, reason = _weights(answer, found)
    level = weight.sum(axis=1) - answer.confidence  # the mass of classes not known counts as not carrying at all
    lower = np.stack([table.lower_bound(weight, level) for table in found.bounds], axis=1)
    if answer.fresh is not None:
        fresh = predict(answer.fresh, vehicle, loads, slips, draws)
        reason = np.where(fresh.known, reason, fresh.reason)
        known, lower = known & fresh.known, np.minimum(lower, fresh.lower)
        weight = np.where(known[:, None], weight, 0.0)
    return AtPlaces(found, known, reason, weight, np.where(known[:, None], lower, np.nan))


def _by_class(
    snapshot: Snapshot, vehicle: Vehicle, loads: tuple[float, ...], slips: np.ndarray, draws: Draws
) -> ByClass:
    reasons = np.array([_why_not(snapshot, name) for name in snapshot.class_names], dtype=object)
    usable = reasons == ""
    names = [name for name, use in zip(snapshot.class_names, usable, strict=True) if use]
    drawn = np.array([draws(snapshot, name, vehicle, loads, slips) for name in names])
    drawn = drawn.reshape(len(names), -1, len(slips)) if names else np.zeros((0, 1, len(slips)))
    carried = np.isfinite(drawn)
    return ByClass(
        usable, reasons, tuple(MixtureTable.of_samples(each) for each in drawn.transpose(2, 1, 0)),
        (np.where(carried, drawn, 0.0).sum(axis=1) / np.maximum(carried.sum(axis=1), 1)).T, carried.mean(axis=1).T,
        np.mean(drawn.max(axis=2) > 0.0, axis=1),
    )  # fmt: skip


def _why_not(snapshot: Snapshot, name: str) -> str:
    """Say why nothing can be predicted on a class; empty where it can."""
    soil = snapshot.soils.get(name)
    if soil is None:
        return f"no soil data for class {name}"
    missing = [text for key, text in _OTHERS.items() if key not in soil.others and name not in snapshot.physics]
    return f"no {missing[0]} known of class {name}" if missing else ""


def _weights(answer: GroundAnswer, found: ByClass) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Probabilities of the usable classes, (n, u); where that is enough to predict; and why not."""
    shares = np.where(answer.known[:, None], answer.class_probability, 0.0)
    lacking = np.where(found.usable, 0.0, shares)
    known = answer.known & (lacking.sum(axis=1) <= 1.0 - answer.confidence + _ROUNDING) & bool(found.usable.any())
    reason, unpredicted = answer.reason, answer.known & ~known
    if unpredicted.any():
        reason = reason.copy()
        reason[unpredicted] = found.reasons[np.argmax(lacking[unpredicted], axis=1)]
    return np.where(known[:, None], shares[:, found.usable], 0.0), known, reason


def loads_of(answer: GroundAnswer, vehicle: Vehicle, load_N: float | Sequence[float] | None) -> tuple[float, ...]:
    """Load on each wheel [N]: as given; else as the vehicle states it or its mass; else the mean one under which the
    soil was measured.

    Raises
    ------
    InputError
        A load is no number or out of range, or none is known.
    """
    if not vehicle.wheels:
        raise InputError(f"vehicle {vehicle.name!r}", "no wheels", expected="[[wheels]]")
    wanted = "positive numbers [N]"
    loads = numbers("load_N", _usual_load(answer, vehicle) if load_N is None else load_N, wanted)
    if loads.ndim == 0:
        loads = np.full(len(vehicle.wheels), loads)
    if loads.shape != (len(vehicle.wheels),):
        raise InputError("load_N", f"{loads.size} numbers", expected=f"one for each of {len(vehicle.wheels)}")
    if load_N is None and not np.all(np.isfinite(loads)):
        raise InputError("load_N", "not given, and the database recorded none", expected="the load on each wheel [N]")
    if not np.all(np.isfinite(loads) & (loads > 0)):
        raise refused("load_N", load_N, wanted)
    return tuple(loads.tolist())


def _usual_load(answer: GroundAnswer, vehicle: Vehicle) -> np.ndarray | float:
    stated = [wheel.load_N for wheel in vehicle.wheels]
    if all(load is not None for load in stated):
        return np.array(stated, dtype=float)
    shares = vehicle.shares_of_weight()
    return answer.snapshot.typical_load_N if shares is None else GRAVITY * (vehicle.mass_kg or 0.0) * shares
