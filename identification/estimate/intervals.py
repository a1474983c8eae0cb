"""95 % intervals of the parameters from the profile likelihood."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from ...framework.core.concurrency import together
from ...framework.core.soil import PARAMETERS, Quantity
from ..mechanics.soil import from_internal, slope_of_internal
from .optimise import fit
from .solution import Solution

_TOLERANCE = 0.15
"""An end is taken where the profile has fallen to within this share of the critical value."""

_UNFORESEEN = 0.1
"""Gain of the population of load and slip where the predicted gain of a step of the parameters is small [nats]."""

_CLIFF = 10.0
"""A fall beyond this many times the critical value is no slope of a parabola."""


@dataclass(frozen=True)
class _Walk:
    """How to walk out: trials, iterations of a fit, gain [nats] that ends it, first step [half intervals], growth.

    A fit also ends before a step whose predicted gain is less than a share `foreseen` of the critical value [-], less
    `_UNFORESEEN`, and less than `foreseen_at_most` [nats]: what is missed moves an end by that share.
    """

    trials: int
    iterations: int
    enough: float
    first: float
    growth: float
    foreseen: float = 0.0
    foreseen_at_most: float = 0.0


_STRAIGHT = _Walk(12, 20, 0.05, 1.0, 4.0, 0.02, 0.5)
_WINDING = _Walk(10, 40, 0.01, 0.25, 2.0)
"""Where the form is free, valleys are long and bend: short steps, each from where the last one ended."""

_WINDING_FAR = _Walk(14, 120, 0.01, 0.2, 1.8)
"""With few samples they reach far, and each step is cheap."""

_FEW = 60
"""Samples that are few in this sense."""


@dataclass
class ProfilePath:
    """How the other parameters go with one: along `ridge` (p,) from the `best` (p,), then off it as a parabola does.

    A parabola bends to the same side on either side of the best: where it leads is known from any fit on it.
    """

    best: np.ndarray
    index: int
    ridge: np.ndarray
    bend: np.ndarray | float = 0.0

    def at(self, value: float) -> np.ndarray:
        """Vector (p,) where the parameter has a value."""
        away = value - self.best[self.index]
        return self.best + self.ridge * away + self.bend * away**2

    def lead_through(self, vector: np.ndarray) -> None:
        """Take the bend from a fit (p,)."""
        away = vector[self.index] - self.best[self.index]
        self.bend = (vector - self.best - self.ridge * away) / away**2


@dataclass(frozen=True)
class Intervals:
    """Quantities by name, and the parameter vectors (p,) at both ends of each profile, by index."""

    quantities: dict[str, Quantity]
    ends: dict[int, tuple[np.ndarray, np.ndarray]]


def parameter_intervals(solution: Solution, covariance: np.ndarray, other: Intervals | None = None) -> Intervals:
    """Give value, standard deviation and 95 % interval of each parameter in SI.

    Parameters
    ----------
    solution
        The bounded fit.
    covariance : (p, p)
        Of the parameter vector, inflation included.
    other
        Intervals of a freer form of the model, known already: an end within them is not looked for.
    """

    def profiled(index: int) -> tuple[np.ndarray, np.ndarray]:
        sd = math.sqrt(max(covariance[index, index], 0.0))
        ridge = covariance[:, index] / max(covariance[index, index], 1e-300)
        path = ProfilePath(solution.fit.vector, index, ridge)
        known = (None, None) if other is None else (float(end[index]) for end in other.ends[index])
        low, high = (
            profile_end(solution, index, sd, path, direction, end)
            for direction, end in zip((-1.0, 1.0), known, strict=True)
        )
        return low, high

    free = np.flatnonzero(solution.free[: len(PARAMETERS)]).tolist()
    ends = dict(zip(free, together(profiled, free), strict=True))
    quantities = {}
    for index, name in enumerate(PARAMETERS):
        if index in ends:
            quantities[name] = _quantity(solution, index, name, *ends[index])
        else:
            value = from_internal(name, float(solution.fit.vector[index]))
            quantities[name] = Quantity(value, 0.0, value, value)
    return Intervals(quantities, ends)


def _quantity(solution: Solution, index: int, name: str, low: np.ndarray, high: np.ndarray) -> Quantity:
    """Give a parameter in SI with the interval between the ends (p,) of its profile."""
    value = from_internal(name, float(solution.fit.vector[index]))
    sd = spread(solution, index, low, high) * slope_of_internal(name, value)
    return Quantity(value, sd, from_internal(name, float(low[index])), from_internal(name, float(high[index])))


def hull(solution: Solution, first: Intervals, other: Intervals) -> Intervals:
    """Widen intervals to those that a freer form of the model gives: the truth may be nearer to either.

    Parameters
    ----------
    solution
        The textbook's fit, whose values stand.
    first, other
        Its intervals, and those of the freer form, whose vectors begin with the same parameters.
    """
    quantities, ends = dict(first.quantities), {}
    size = len(solution.fit.vector)
    for index, name in enumerate(first.quantities):
        if index not in first.ends:
            continue
        low = min(first.ends[index][0], other.ends[index][0][:size], key=lambda vector, at=index: float(vector[at]))
        high = max(first.ends[index][1], other.ends[index][1][:size], key=lambda vector, at=index: float(vector[at]))
        ends[index] = low, high
        quantities[name] = _quantity(solution, index, name, low, high)
    return Intervals(quantities, ends)


def spread(solution: Solution, index: int, low: np.ndarray, high: np.ndarray) -> float:
    """Standard deviation of a parameter from the wider side of its profile interval."""
    centre = solution.fit.vector[index]
    return float(max(high[index] - centre, centre - low[index])) / solution.quantile


def consistent(covariance: np.ndarray, solution: Solution, intervals: Intervals) -> np.ndarray:
    """Scale a covariance (p, p) so that its standard deviations are those of the profiles, the correlations kept.

    Along a ridge that bounds cut off, the curvature at the optimum understates the range of the parameters.
    """
    factor = np.ones(len(covariance))
    for index, (low, high) in intervals.ends.items():
        sd = math.sqrt(max(covariance[index, index], 1e-300))
        factor[index] = spread(solution, index, low, high) / sd
    return covariance * np.outer(factor, factor)


def profile_end(
    solution: Solution, index: int, sd: float, path: ProfilePath, direction: float, known: float | None = None
) -> np.ndarray:
    """Walk out along the profile to where it has fallen by the critical value, or to the bound: the vector there.

    Each fit starts on the `path`, which learns from it. An end within a `known` one is not looked for: the best stands
    for it.
    """
    best, problem = solution.fit, solution.problem
    centre = float(best.vector[index])
    bound = float((problem.upper if direction > 0.0 else problem.lower)[index])
    reach = (bound - centre) * direction
    if reach <= 0.0:
        return best.vector
    critical = solution.quantile**2 * solution.widened(index)
    point = best.point
    inner, outer, fall, found, carried = 0.0, math.inf, 0.0, best.vector, best.vector
    walk, again = _STRAIGHT, False
    if solution.widening is not None:
        walk = _WINDING_FAR if len(problem.measured) <= _FEW else _WINDING
    at = min(max(walk.first * sd * solution.quantile, 1e-9 * reach), reach)
    least = 0.0 if known is None else min((known - centre) * direction, reach)
    at = least if least > 0.0 else at
    for trial in range(walk.trials):
        value = centre + direction * at
        # From the last foothold: where a bound has stopped another parameter the path from the best leads astray.
        vector = point.vector + path.ridge * (value - point.vector[index])
        if walk is _STRAIGHT:
            vector = point.vector + path.at(value) - path.at(float(point.vector[index]))
        vector = np.clip(vector, problem.lower, problem.upper)
        profiled = fit(
            problem.fixing(index, value), replace(point, vector=vector),
            iterations=walk.iterations, enough=walk.enough,
            foreseen=min(walk.foreseen * critical - _UNFORESEEN, walk.foreseen_at_most),
        )  # fmt: skip
        fall = max(2.0 * (best.log_likelihood - profiled.log_likelihood), 1e-6)
        if trial == 0 and least > 0.0 and fall >= critical:
            return best.vector
        found = profiled.vector
        if fall <= _CLIFF * critical and np.all(((found > problem.lower) & (found < problem.upper)) | ~solution.free):
            path.lead_through(found)
        if abs(fall / critical - 1.0) <= _TOLERANCE or (fall < critical and at >= reach):
            break
        # The profile is nearly a parabola about the optimum; brackets catch it where it is not.
        aim = at * math.sqrt(critical / fall)
        if fall < critical:
            inner, point, carried = at, profiled.point, found
            outer = outer if outer > at else math.inf
            at = min(aim, walk.growth * at, reach) if math.isinf(outer) else min(aim, 0.5 * (inner + outer))
        else:
            outer = at
            # Over a cliff a parabola says nothing: where a bound stops another parameter, the profile breaks off.
            share = 0.5 if inner > 0.0 and fall > _CLIFF * critical else 0.15
            at = max(aim, inner + share * (outer - inner))
        if outer - inner < 0.03 * outer:
            if again or walk is not _STRAIGHT or inner == 0.0:
                break
            # A climb from afar may have missed the way that one from the last foothold finds.
            again, at = True, outer
    else:
        if fall <= _CLIFF * critical:
            fall = critical
    reached = (found[index] - centre) * direction
    if fall > critical * (1.0 - _TOLERANCE):
        reached = min(reached * math.sqrt(critical / fall), reach)
    if reached < inner and math.isfinite(outer):
        # The profile breaks off in between; what goes with its edge is what went with the last foothold.
        found, reached = carried, 0.5 * (inner + outer)
    answer = found.copy()
    answer[index] = centre + direction * reached
    return answer
