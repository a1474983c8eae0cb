"""What the ground can bear of a vehicle's acceleration, braking and side force, on the level and on slopes."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike
from scipy.constants import g as GRAVITY

from ..framework.core.arguments import numbers
from ..framework.core.errors import InputError
from ..framework.core.vehicle import Vehicle, as_vehicle
from .class_draws import braking_forces, pulls, side_forces
from .mobility import SLIPS
from .prediction import AtPlaces, Draws, loads_of, predict

if TYPE_CHECKING:
    from .answer import GroundAnswer

_SIDE_SLIP = (0.15,)
"""Slip at which the contact patches that bear side force are computed [-]: sinkage hardly depends on it."""

_LOAD_STEP = 0.1
"""Forces are computed at multiples of this share of the load [-], so that they are remembered."""

STEEPEST_RAD = 1.2
"""Slopes up to this are accepted [rad]: no wheel holds on steeper ones."""


@dataclass(frozen=True)
class Traction:
    """Accelerations that the ground can bear at n places, each by itself [m/s^2].

    Each is the mean and what it exceeds with the answer's confidence. Negative where the ground is too weak, or the
    slope too steep, to hold the vehicle; NaN where unknown; -inf where the soil may not carry the wheels.

    Parameters
    ----------
    known, reason : (n,)
        Could it be predicted, and why not.
    acceleration, acceleration_lower : (n,)
        Forwards, at the slip of `SLIPS` that serves best.
    braking, braking_lower : (n,)
        Deceleration, likewise.
    side, side_lower : (n,)
        To either side: the weaker one on a cross slope.
    load_N
        Load on each wheel that was assumed [N].
    """

    known: np.ndarray
    reason: np.ndarray
    acceleration: np.ndarray
    acceleration_lower: np.ndarray
    braking: np.ndarray
    braking_lower: np.ndarray
    side: np.ndarray
    side_lower: np.ndarray
    load_N: tuple[float, ...]


def traction(
    answer: GroundAnswer, vehicle: Vehicle | str | Path, *, pitch: ArrayLike = 0.0, roll: ArrayLike = 0.0,
    load_N: float | Sequence[float] | None = None,
) -> Traction:  # fmt: skip
    """Predict what the ground can bear.

    On a slope the wheels carry less: forces are interpolated over the load between the level and the steepest slope.

    Parameters
    ----------
    answer
        The places, and the confidence wanted.
    vehicle
        Its wheels: the vehicle, or its TOML file, which is read at each call.
    pitch, roll : () or (n,)
        Slope along the direction of travel, nose up positive, and across it [rad].
    load_N
        As `mobility.drawbar_pull`, on level ground.

    Raises
    ------
    InputError
        A slope that is no number, one too steep, or not one for each place; else as `mobility.drawbar_pull`.
    """
    vehicle = as_vehicle(vehicle)
    loads = loads_of(answer, vehicle, load_N)
    up, across = (_slope(name, each, len(answer)) for name, each in (("pitch", pitch), ("roll", roll)))
    left = np.cos(up) * np.cos(across)
    per_mass = GRAVITY / sum(loads)

    def at(share: float, slips: tuple[float, ...], draws: Draws) -> AtPlaces:
        return predict(answer, vehicle, tuple(share * load for load in loads), slips, draws)

    def accelerations(
        level: AtPlaces, lighter: Callable[[float], AtPlaces], against: np.ndarray
    ) -> Iterator[np.ndarray]:
        for force in _at_load(level, lighter, left):
            yield per_mass * force - GRAVITY * against

    forward = at(1.0, SLIPS, pulls)
    braking, side = at(1.0, SLIPS, braking_forces), at(1.0, _SIDE_SLIP, side_forces)
    columns = (
        *accelerations(forward, lambda share: at(share, SLIPS, pulls), np.sin(up)),
        *accelerations(braking, lambda share: at(share, SLIPS, braking_forces), -np.sin(up)),
        *accelerations(side, lambda share: at(share, _SIDE_SLIP, side_forces), np.abs(np.sin(across))),
    )
    return Traction(forward.known, forward.reason, *columns, load_N=loads)


def _at_load(level: AtPlaces, lighter: Callable[[float], AtPlaces], left: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Mean and lower bound (n,) of a force [N] where so much of the load is `left` (n,) [-], at the slip with the
    greatest bound.

    `level` is the prediction at the whole load; `lighter` gives that at a share of it.
    """
    row, lower = level.best()
    if not (left < 1.0).any():
        return level.mean(row), lower
    least = _LOAD_STEP * math.floor(left.min() / _LOAD_STEP)
    light = lighter(least)
    light_row, light_lower = light.best()
    share = (1.0 - left) / (1.0 - least)
    pairs = ((level.mean(row), light.mean(light_row)), (lower, light_lower))
    with np.errstate(invalid="ignore"):  # of -inf at an end
        mean, bound = (
            np.where(share <= 0.0, whole, np.where(share >= 1.0, part, (1.0 - share) * whole + share * part))
            for whole, part in pairs
        )
    return mean, bound


def _slope(name: str, given: ArrayLike, count: int) -> np.ndarray:
    slope = numbers(name, given, "numbers [rad]")
    if slope.ndim > 1 or slope.size not in (1, count):
        raise InputError(name, f"{slope.size} numbers", expected=f"one, or one for each of {count} places [rad]")
    steep = ~(np.abs(slope) <= STEEPEST_RAD)  # nor is NaN a slope
    if steep.any():
        raise InputError(name, f"{slope[steep].flat[0]:g}", expected=f"a slope within +-{STEEPEST_RAD:g} rad")
    return np.broadcast_to(slope.ravel() if slope.ndim else slope, (count,))
