"""How fast a path may be driven: what the ground bears must hold the vehicle on it, and stop it within what is seen."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numba import njit
from numpy.typing import ArrayLike

from ..framework.core.arguments import number, numbers, refused
from ..framework.core.errors import InputError
from ..framework.core.vehicle import Vehicle
from .traction import traction

if TYPE_CHECKING:
    from .answer import GroundAnswer

VEHICLE, CURVE, SIGHT, AHEAD, STUCK = (
    "the vehicle's own limit", "side force in the curve", "stopping within the distance seen",
    "slowing for what comes", "the ground may not carry the vehicle on",
)  # fmt: skip
"""What binds a speed limit; on unknown ground it is why the ground is unknown."""

_ROUNDING = 1e-6
"""Relative difference in speed that is rounding [-]."""


@dataclass(frozen=True)
class SpeedLimit:
    """Greatest speeds along a path of n places.

    Parameters
    ----------
    limit_m_s : (n,)
        With the answer's confidence at each place [m/s].
    reason : (n,) str
        What binds it.
    """

    limit_m_s: np.ndarray
    reason: np.ndarray


def speed_limit(
    answer: GroundAnswer, vehicle: Vehicle | str | Path, *, sight_m: float, most_m_s: float, unknown_m_s: float = 0.0,
    reaction_s: float = 0.0, curvature: ArrayLike | None = None, pitch: ArrayLike = 0.0, roll: ArrayLike = 0.0,
    load_N: float | Sequence[float] | None = None,
) -> SpeedLimit:  # fmt: skip
    """Find the greatest speed at each place of a path.

    Side force and braking share what the ground bears (friction ellipse; J. Y. Wong, "Theory of Ground Vehicles", 4th
    ed. (2008), Sec. 1.4), by the lower bounds of both. From each place the vehicle can stop within the distance seen,
    after its reaction time, and slow down to the limits that follow. Ground on which it may not move on has the limit
    0.

    Parameters
    ----------
    answer
        The places, in the order in which they are driven over, and the confidence wanted.
    vehicle, pitch, roll, load_N
        As `traction.traction`.
    sight_m
        Distance seen ahead [m].
    most_m_s
        The vehicle's own greatest speed [m/s].
    unknown_m_s
        Greatest speed on ground whose soil is not known [m/s]; none where absent.
    reaction_s
        Time from seeing to braking [s].
    curvature : (n,)
        Of the path [1/m], either sign; that of the circle through neighbouring places where absent.

    Raises
    ------
    InputError
        A number that is none, or out of range; else as `traction.traction`.
    """
    sight, most, unknown, reaction = (
        _not_negative(*each) for each in (
            ("sight_m", sight_m), ("most_m_s", most_m_s), ("unknown_m_s", unknown_m_s), ("reaction_s", reaction_s)
        )
    )  # fmt: skip
    ground = traction(answer, vehicle, pitch=pitch, roll=roll, load_N=load_N)
    bend = _curvature(answer) if curvature is None else _given(curvature, len(answer))
    step_m = np.hypot(np.diff(answer.x), np.diff(answer.y))
    limit = np.full(len(answer), most)
    reason = np.full(len(answer), VEHICLE, dtype=object)

    def bind(speeds: np.ndarray | float, why: np.ndarray | str, where: np.ndarray | bool = True) -> None:
        lower = where & (speeds < (1.0 - _ROUNDING) * limit)
        np.copyto(limit, speeds, where=lower)
        np.copyto(reason, why, where=lower)

    braking, side = (np.where(ground.known, np.maximum(each, 0.0), 0.0) for each in (
        ground.braking_lower, ground.side_lower))  # fmt: skip
    with np.errstate(divide="ignore", invalid="ignore"):
        bind(np.nan_to_num(np.sqrt(side / bend), nan=math.inf), CURVE, ground.known)
    bind(_stopping(braking, ground.known, step_m, sight, reaction), SIGHT, ground.known)
    bind(0.0, STUCK, ground.known & ~(ground.acceleration_lower > 0.0))
    bind(unknown, ground.reason, ~ground.known)
    bind(_slowing(limit, braking, side, bend, step_m), AHEAD)
    return SpeedLimit(limit, reason)


def _not_negative(name: str, given: float) -> float:
    value = number(name, given, "a number, not negative")
    if not value >= 0.0:  # nor is NaN
        raise refused(name, given, "a number, not negative")
    return value


def _given(curvature: ArrayLike, count: int) -> np.ndarray:
    bend = numbers("curvature", curvature, "numbers [1/m]")
    if bend.shape != (count,) or not np.isfinite(bend).all():
        raise InputError("curvature", f"{bend.size} numbers", expected=f"a finite one for each of {count} places [1/m]")
    return np.abs(bend)


def _curvature(answer: GroundAnswer) -> np.ndarray:
    """Curvature of the circle through each place and its neighbours (n,) [1/m]; at the ends that of the next place."""
    x, y = answer.x, answer.y
    bend = np.zeros(len(x))
    if len(x) > 2:
        first, second = (np.array([np.diff(each)[at] for each in (x, y)]) for at in (slice(None, -1), slice(1, None)))
        sides = np.hypot(*first) * np.hypot(*second) * np.hypot(x[2:] - x[:-2], y[2:] - y[:-2])
        area = np.abs(first[0] * second[1] - first[1] * second[0])
        bend[1:-1] = np.divide(2.0 * area, sides, out=np.zeros(len(x) - 2), where=sides > 0.0)
        bend[0], bend[-1] = bend[1], bend[-2]
    return bend


def _stopping(
    braking: np.ndarray, known: np.ndarray, step_m: np.ndarray, sight_m: float, reaction_s: float
) -> np.ndarray:
    """Speed (n,) from which the vehicle stops within the distance seen, on the weakest known ground of it."""
    weakest = _least_ahead(np.where(known, braking, math.inf), step_m, sight_m)
    weakest = np.minimum(weakest, np.where(known, braking, math.inf))
    with np.errstate(invalid="ignore"):
        found = np.sqrt((weakest * reaction_s) ** 2 + 2.0 * weakest * sight_m) - weakest * reaction_s
    return np.where(np.isfinite(weakest), found, math.inf)


@njit(cache=True)
def _least_ahead(values, step_m, reach_m):
    answer = values.copy()
    for at in range(len(values)):
        way, ahead = 0.0, at
        while ahead < len(step_m) and way + step_m[ahead] <= reach_m:
            way += step_m[ahead]
            ahead += 1
            answer[at] = min(answer[at], values[ahead])
    return answer


@njit(cache=True)
def _slowing(limit, braking, side, bend, step_m):
    """Speeds (n,) from which braking still reaches the limit of every place that follows."""
    answer = limit.copy()
    for at in range(len(limit) - 2, -1, -1):
        # v^2 - then^2 = 2 a step with a by the friction ellipse at v: a quadratic equation for v^2.
        then, gained = answer[at + 1] ** 2, 2.0 * min(braking[at], braking[at + 1]) * step_m[at]
        held, most_bent = min(side[at], side[at + 1]), max(bend[at], bend[at + 1])
        if most_bent == 0.0:
            square = then + gained
        elif most_bent * then >= held:
            square = then
        else:
            used = most_bent / held
            root = math.sqrt(1.0 + used**2 * (gained**2 - then**2))
            square = (then + gained * root) / (1.0 + (gained * used) ** 2)
        slower = math.sqrt(square)
        answer[at] = min(answer[at], slower)
    return answer
