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
from .traction import Traction, traction

if TYPE_CHECKING:
    from .answer import GroundAnswer

VEHICLE, CURVE, SIGHT, AHEAD, STUCK = (
    "the vehicle's own limit", "side force in the curve", "stopping within the sight distance",
    "braking for a lower limit ahead", "the vehicle may be immobilised",
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
    ed. (2008), Sec. 1.4), by the lower bounds of both. From each place the vehicle can stop on its path within the
    distance seen, after its reaction time, and slow down to the limits that follow. Ground on which it may not move on
    has the limit 0.

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
    if not math.isfinite(reaction):
        raise refused("reaction_s", reaction_s, "a finite time [s]")
    ground = traction(answer, vehicle, pitch=pitch, roll=roll, load_N=load_N)
    bend = curvature_of(np.column_stack([answer.x, answer.y])) if curvature is None else _given(curvature, len(answer))
    # Nothing is promised of braking on the way to and from a place that is no number.
    step_m = np.nan_to_num(np.hypot(np.diff(answer.x), np.diff(answer.y)))
    return limits(ground, bend, step_m, sight_m=sight, most_m_s=most, unknown_m_s=unknown, reaction_s=reaction)


def speed_limit_of_each(
    answer: GroundAnswer, vehicle: Vehicle | str | Path, *, sight_m: float, most_m_s: float, reaction_s: float = 0.0,
    load_N: float | Sequence[float] | None = None,
) -> SpeedLimit:  # fmt: skip
    """Find the greatest speed at each place by itself, as on level, straight ground that is everywhere like it.

    For maps: places that are no path. The parameters are those of `speed_limit`; NaN where the ground is not known.
    """
    sight, most, reaction = (
        _not_negative(*each) for each in (("sight_m", sight_m), ("most_m_s", most_m_s), ("reaction_s", reaction_s))
    )
    for name, given in (("sight_m", sight), ("reaction_s", reaction)):
        if not math.isfinite(given):
            raise refused(name, given, "a finite number")
    ground = traction(answer, vehicle, load_N=load_N)
    braking = np.where(ground.known, np.maximum(ground.braking_lower, 0.0), 0.0)
    apart = np.full(max(len(answer) - 1, 0), math.inf)  # no place is within sight of another
    stopping = _stopping(braking, braking, ground.known, np.zeros(len(answer)), apart, sight, reaction)
    stuck = ground.known & ~(ground.acceleration_lower > 0.0)
    limit = np.where(stuck, 0.0, np.minimum(stopping, most))
    reason = np.where(stuck, STUCK, np.where(stopping < most, SIGHT, VEHICLE)).astype(object)
    return SpeedLimit(np.where(ground.known, limit, np.nan), np.where(ground.known, reason, ground.reason))


def limits(
    ground: Traction, bend: np.ndarray, step_m: np.ndarray, *, sight_m: float, most_m_s: float, unknown_m_s: float,
    reaction_s: float,
) -> SpeedLimit:  # fmt: skip
    """Find the greatest speeds of `speed_limit` on n places of such traction, wherever that is known from.

    Parameters
    ----------
    ground
        Of the n places.
    bend : (n,)
        Curvature, not negative [1/m].
    step_m : (n - 1,)
        Way between neighbours [m].
    sight_m, most_m_s, unknown_m_s, reaction_s
        As `speed_limit`.
    """
    limit = np.full(len(bend), most_m_s)
    reason = np.full(len(bend), VEHICLE, dtype=object)

    def bind(speeds: np.ndarray | float, why: np.ndarray | str, where: np.ndarray | bool = True) -> None:
        lower = where & (speeds < (1.0 - _ROUNDING) * limit)
        np.copyto(limit, speeds, where=lower)
        np.copyto(reason, why, where=lower)

    braking, side = (np.where(ground.known, np.maximum(each, 0.0), 0.0) for each in (
        ground.braking_lower, ground.side_lower))  # fmt: skip
    with np.errstate(divide="ignore", invalid="ignore"):
        bind(np.nan_to_num(np.sqrt(side / bend), nan=math.inf, posinf=math.inf), CURVE, ground.known)
    bind(_stopping(braking, side, ground.known, bend, step_m, sight_m, reaction_s), SIGHT, ground.known)
    bind(0.0, STUCK, ground.known & ~(ground.acceleration_lower > 0.0))
    bind(unknown_m_s, ground.reason, ~ground.known)
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


def curvature_of(path: np.ndarray) -> np.ndarray:
    """Curvature of the circle through each place of a path (n, 2) [m] and its neighbours, (n,) [1/m].

    At the ends it is that of the next place. A place that is repeated counts once. Infinite where the path turns back.
    """
    moved = (np.diff(path, axis=0, prepend=math.nan) != 0.0).any(axis=1)
    step = np.diff(path[moved], axis=0)
    bend = np.zeros(moved.sum())
    if len(step) > 1:
        first, second = step[:-1], step[1:]
        cross = np.abs(first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0])
        along = (first * second).sum(axis=1)
        with np.errstate(divide="ignore", invalid="ignore"):
            bend[1:-1] = 2.0 * cross / (np.hypot(*first.T) * np.hypot(*second.T) * np.hypot(*(first + second).T))
        bend[1:-1][(along < 0.0) & (cross <= -_ROUNDING * along)] = math.inf
        bend[0], bend[-1] = bend[1], bend[-2]
    return np.where(np.isnan(bend), 0.0, bend)[np.cumsum(moved) - 1]


@njit(cache=True)
def _stopping(braking, side, known, bend, step_m, sight_m, reaction_s):
    """Speeds (n,) from which the vehicle stops on its path within the distance seen, by what each place of it bears.

    Infinite where it sees unknown ground, where nothing is promised of braking: it slows down before that in any case.
    """
    answer = np.full(len(braking), math.inf)
    for at in range(len(braking)):
        last, way, sure = at, 0.0, known[at]
        while sure and last < len(step_m) and way + step_m[last] <= sight_m:
            way += step_m[last]
            last += 1
            sure = known[last]
        if not sure:
            continue
        # v^2 at which braking has to begin, from the end of sight back to where the reaction ends.
        rest = sight_m - way
        square = _before(0.0, 2.0 * braking[last] * rest, side[last], bend[last])
        slope = -square / rest if rest > 0.0 else 0.0
        while last > at and math.sqrt(square) * reaction_s < way:
            last -= 1
            way -= step_m[last]
            then, square = square, _slower(square, last, braking, side, bend, step_m)
            slope = (then - square) / step_m[last] if step_m[last] > 0.0 else 0.0
        # v^2 = square + slope (v t - way) within this step.
        late, way = slope * reaction_s, max(way, 0.0)
        answer[at] = 0.5 * (late + math.sqrt(late**2 + 4.0 * (square - slope * way)))
    return answer


@njit(cache=True)
def _slowing(limit, braking, side, bend, step_m):
    """Speeds (n,) from which braking still reaches the limit of every place that follows."""
    answer = limit.copy()
    for at in range(len(limit) - 2, -1, -1):
        answer[at] = min(answer[at], math.sqrt(_slower(answer[at + 1] ** 2, at, braking, side, bend, step_m)))
    return answer


@njit(cache=True)
def _slower(then, at, braking, side, bend, step_m):
    """v^2 at a place from which braking leads to v^2 `then` at the next; the weaker of both places counts."""
    gained = 2.0 * min(braking[at], braking[at + 1]) * step_m[at]
    return _before(then, gained, min(side[at], side[at + 1]), max(bend[at], bend[at + 1]))


@njit(cache=True)
def _before(then, gained, held, bend):
    """v^2 from which braking leads to v^2 `then`, where it takes `gained` off on the straight.

    By the friction ellipse v^2 falls by gained sqrt(1 - u^2 v^4), u = bend / held: u v^2 is a sine of the way.
    """
    if bend == 0.0:
        return then + gained
    if bend == math.inf or bend * then >= held:
        return then
    used = bend / held
    return math.sin(min(math.asin(used * then) + used * gained, 0.5 * math.pi)) / used
