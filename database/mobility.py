"""What a vehicle can do on ground that a snapshot knows: drawbar pull at a slip, and whether it moves at all."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..framework.core.arguments import number, refused
from ..framework.core.vehicle import Vehicle, as_vehicle
from .class_draws import pulls
from .narrowing import narrowed_by
from .prediction import AtPlaces, loads_of, predict

if TYPE_CHECKING:
    from .answer import GroundAnswer

SLIPS = tuple(np.linspace(0.05, 0.8, 16).tolist())
"""Slips among which `mobility` seeks the best [-]."""


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
    note : (n,) str
        What holds a lower bound below zero down where the mean is not, and which drive would raise it; else empty.
    """

    known: np.ndarray
    reason: np.ndarray
    mean: np.ndarray
    lower: np.ndarray
    load_N: tuple[float, ...]
    slip: float
    note: np.ndarray


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
    note : (n,) str
        As `DrawbarPull`.
    """

    known: np.ndarray
    reason: np.ndarray
    go_probability: np.ndarray
    drawbar_pull_lower: np.ndarray
    best_slip: np.ndarray
    slope_lower: np.ndarray
    load_N: tuple[float, ...]
    note: np.ndarray


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
        Load on each wheel [N], one number for all or one a wheel; where absent, what the vehicle states (`load_N` of
        its wheels, or its mass), else the mean load under which the soil was measured (`Snapshot.typical_load_N`).

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
    loads = loads_of(answer, vehicle, load_N)
    found = predict(answer, vehicle, loads, (slip,), pulls)
    mean, lower = found.mean(0), found.lower[:, 0]
    return DrawbarPull(found.known, found.reason, mean, lower, loads, slip, _why_negative(answer, found, mean, lower))


def mobility(
    answer: GroundAnswer, vehicle: Vehicle | str | Path, load_N: float | Sequence[float] | None = None
) -> Mobility:
    """Predict whether the vehicle moves, and how much pull it has to spare at its best slip; as `drawbar_pull`."""
    vehicle = as_vehicle(vehicle)
    loads = loads_of(answer, vehicle, load_N)
    found = predict(answer, vehicle, loads, SLIPS, pulls)
    row, best = found.best()
    slip = np.where(found.known, np.array(SLIPS)[row], np.nan)
    go = np.where(found.known, found.weight @ found.by_class.positive, np.nan)
    slope = np.arcsin(np.clip(best / sum(loads), -1.0, 1.0))
    note = _why_negative(answer, found, found.mean(row), best)
    return Mobility(found.known, found.reason, go, best, slip, slope, loads, note)


def _why_negative(answer: GroundAnswer, found: AtPlaces, mean: np.ndarray, lower: np.ndarray) -> np.ndarray:
    """Say (n,) what holds a negative lower bound down where the expected value is not; empty elsewhere."""
    note = np.full(len(lower), "", dtype=object)
    rows = np.flatnonzero(found.known & (lower < 0.0) & (mean > 0.0))
    names = [name for name, use in zip(answer.class_names, found.by_class.usable, strict=True) if use]
    gradient = np.array([1.0, answer.normal_stress])
    # The class that has most of what is not positive.
    number = np.argmax(found.weight[rows] * (1.0 - found.by_class.positive), axis=1) if len(rows) else rows
    for each in np.unique(number).tolist():
        why = narrowed_by(answer.snapshot.soils[names[each]], gradient, answer.confidence)
        note[rows[number == each]] = f"the lower bound is negative: {names[each]} bounds it: {why}"
    return note
