"""Driving a planned route on the true ground: does the vehicle arrive, hold the path, and stop in time?"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from .planners import REACTION_S, Planner, Route, cells_along
from .site import Site

ARRIVED, IMMOBILISED, OFF, NO_ROUTE = "arrived", "immobilised", "left the path", "no route"

STOPS = 4
"""Emergency stops that are tried on each route."""

ROUNDING = 1e-5
"""Relative difference that is rounding [-]."""

_MOST_STEPS = 1000
"""A stop that takes more is none."""

_LEAST_M_S = 0.5
"""A slower vehicle has nothing to stop."""


@dataclass(frozen=True)
class Stop:
    """One emergency stop: speed [m/s], distances predicted and achieved [m], infinite where it leaves the path."""

    speed: float
    predicted: float
    achieved: float


@dataclass(frozen=True)
class Held:
    """Does what was taken for granted hold on p patches, each on one cell: neighbouring cells are much the same.

    Parameters
    ----------
    patch : (p,) int
        Their numbers.
    bounds : (p, 3) bool
        Of acceleration, braking and side force.
    """

    patch: np.ndarray
    bounds: np.ndarray


@dataclass(frozen=True)
class Ride:
    """How a route went.

    Parameters
    ----------
    outcome
        One of `ARRIVED`, `IMMOBILISED`, `OFF`, `NO_ROUTE`.
    time_s
        Until it arrived; NaN where it did not.
    length_m
        Of the route; NaN where there is none.
    stops
        Emergency stops, each as if it were the only one.
    held
        On the patches crossed, what was taken for granted.
    """

    outcome: str
    time_s: float = math.nan
    length_m: float = math.nan
    stops: tuple[Stop, ...] = ()
    held: Held = field(default_factory=lambda: Held(np.zeros(0, dtype=int), np.zeros((0, 3), dtype=bool)))


def ride(site: Site, planner: Planner, route: Route | None, rng: np.random.Generator) -> Ride:
    """Drive a route."""
    if route is None:
        return Ride(NO_ROUTE)
    rows = cells_along(route.path)
    pull, braking, side = (each.ravel()[rows] for each in (site.acceleration, site.braking, site.side))
    step = np.hypot(*np.diff(route.path, axis=0).T)
    speed = _driven(route.speed, pull, braking, step)
    stuck = np.append(np.flatnonzero(pull < 0.0), len(rows))[0]
    off = np.append(np.flatnonzero(speed**2 * route.bend > (1.0 + ROUNDING) * side), len(rows))[0]
    ended = int(min(stuck, off))
    outcome = ARRIVED if ended == len(rows) else IMMOBILISED if stuck <= off else OFF
    time = float(np.sum(step / (0.5 * (speed[1:] + speed[:-1])))) if outcome == ARRIVED else math.nan
    bound = np.where(planner.ground.known, [planner.ground.braking_lower, planner.ground.side_lower], 0.0)[:, rows]
    last = min(ended, len(step))
    stops = _stops(speed, bound, np.array([braking, side]), route.bend, step, last, rng)
    return Ride(outcome, time, float(step.sum()), stops, held_by_patch(site, planner, rows))


def _stops(
    speed: np.ndarray, bound: np.ndarray, true: np.ndarray, bend: np.ndarray, step: np.ndarray, last: int,
    rng: np.random.Generator,
) -> tuple[Stop, ...]:  # fmt: skip
    """Sound alarms at random places before the last; `bound` and `true` (2, n) are braking and side force."""
    at = 3 + np.flatnonzero(speed[3:last] >= _LEAST_M_S)
    drawn = rng.choice(at, min(STOPS, len(at)), replace=False).tolist()

    def distance(ground: np.ndarray, k: int) -> float:
        return stopping_m(speed[k:], ground[0, k:], ground[1, k:], bend[k:], step[k:])

    return tuple(Stop(float(speed[k]), distance(bound, k), distance(true, k)) for k in drawn)


def _driven(limit: np.ndarray, pull: np.ndarray, braking: np.ndarray, step: np.ndarray) -> np.ndarray:
    """Speeds (n,) from rest [m/s]: the planned ones, so far as the true ground allows to reach them."""
    square = np.zeros(len(limit))
    for k, way in enumerate(step):
        fastest = square[k] + 2.0 * max(pull[k], 0.0) * way
        square[k + 1] = max(min(limit[k + 1] ** 2, fastest), square[k] - 2.0 * braking[k] * way)
    return np.sqrt(square)


def stopping_m(speed: np.ndarray, braking: np.ndarray, side: np.ndarray, bend: np.ndarray, step: np.ndarray) -> float:
    """Distance [m] in which a vehicle stops on its path; braking is what side force leaves (friction ellipse).

    In the reaction time it keeps its speed, or slows down as it does anyway. The ground goes on as at the last place.
    Infinite where it cannot hold the path, or never stops.

    Parameters
    ----------
    speed, braking, side, bend : (n,)
        At places ahead, the first of which is that of the alarm: speeds without an alarm [m/s], decelerations [m/s^2]
        and curvature [1/m].
    step : (n - 1,)
        Way between the places [m].
    """
    square, way, late = speed[0] ** 2, 0.0, speed[0] * REACTION_S
    for k in range(_MOST_STEPS):
        at, length = min(k, len(step)), step[min(k, len(step) - 1)]
        coasting = min(max(late - way, 0.0), length)
        if coasting > 0.0:
            square = min(square, speed[at] ** 2)
        # v^2 falls by 2 a sqrt(1 - (u v^2)^2) a metre: u v^2 is a sine of the way.
        used, gained = bend[at] / max(side[at], 1e-9) if k < len(step) else 0.0, 2.0 * braking[at]
        if used * square > 1.0 + ROUNDING:
            return math.inf
        phase = math.asin(min(used * square, 1.0))
        needed = math.inf if gained == 0.0 else phase / (used * gained) if phase > 0.0 else square / gained
        if needed <= length - coasting:
            return way + coasting + needed
        lost = gained * (length - coasting)
        square, way = math.sin(phase - used * lost) / used if phase > 0.0 else square - lost, way + length
    return math.inf


def held_by_patch(site: Site, planner: Planner, rows: np.ndarray) -> Held:
    """See what holds on each patch of cells (n,): on the middle one of those that are known."""
    rows = rows[planner.ground.known[rows]]
    patch = site.patch.ravel()[rows]
    numbers = np.unique(patch)
    cells = [np.flatnonzero(patch == each) for each in numbers]
    picked = rows[np.array([each[len(each) // 2] for each in cells], dtype=int)]
    bounds = (planner.ground.acceleration_lower, planner.ground.braking_lower, planner.ground.side_lower)
    truth = (site.acceleration, site.braking, site.side)
    held = [true.ravel()[picked] >= bound[picked] for true, bound in zip(truth, bounds, strict=True)]
    return Held(numbers, np.stack(held, axis=1))
