"""A smooth correction in words and, where a short one does as well, in algebra."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import numpy as np
from scipy.stats import rankdata
from sklearn.linear_model import LinearRegression

from ..locate.play import BEHIND_PLAY
from .readable import Shown, number, shown

_MONOTONIC = 0.9
"""Rank correlation from which on a curve rises or falls as a whole [-]."""

_PACE = 1.6
"""A half of the range in which it is this many times as steep as in the other is worth a word [-]."""

_AS_WELL = 0.97
"""Share of the correction's variance that an algebraic form has to hold to stand for it [-]."""

_MOST_TERMS = 2

_NOTHING = 1e-9
"""A constant that is a smaller share of the correction's range is rounding [-]."""


@dataclass(frozen=True)
class Shape:
    """How a correction moves with its variable, and a formula (SI) where one is as good, else empty."""

    words: str
    formula: str


def shape_of(channel: str, variable: str, at: np.ndarray, values: np.ndarray) -> Shape:
    """Describe a correction.

    Parameters
    ----------
    channel
        What is corrected.
    variable
        Its name; for a ripple with its number of cycles or its period in brackets, and with `BEHIND_PLAY` of what hangs
        back.
    at, values : (n,)
        The variable and the correction, SI; NaN where the variable was not observed.
    """
    good = np.isfinite(at) & np.isfinite(values)
    at, values = at[good], values[good]
    moved = shown(channel)
    by = f"by {_with_unit(float(np.ptp(values)), moved)}"
    if variable.endswith(" a turn)"):
        name, _, cycles = variable.partition(" (")
        return Shape(f"{moved.name} ripples with {shown(name).name}, {cycles.rstrip(')')}, {by}", "")
    if variable.endswith(" m)"):
        every = variable.partition(" (")[2].rstrip(")")
        return Shape(f"{moved.name} goes up and down along the track, {every}, {by}", "")
    if variable.endswith(BEHIND_PLAY):
        half = 0.5 * float(np.ptp(values))
        words = f"{moved.name} hangs back by {_with_unit(half, moved)} where it turns round, as by play or hysteresis"
        return Shape(words, f"play of {half:.3g} in {channel}")
    how = shown(variable)
    return Shape(f"{moved.name} {_movement(at, values, how)} with {how.name} {by}", _formula(variable, at, values))


def _with_unit(value: float, how: Shown) -> str:
    return f"{number(value, how.scale)} {how.unit}".rstrip()


def _movement(at: np.ndarray, values: np.ndarray, how: Shown) -> str:
    """Whether it rises, falls, peaks or dips, and where it does so most."""
    if len(np.unique(at)) < 3:
        return "steps"
    trend = float(np.corrcoef(rankdata(at), rankdata(values))[0, 1])
    if abs(trend) >= _MONOTONIC:
        early, late = _pace(at, values, False), _pace(at, values, True)
        pace = ", ever faster," if late > _PACE * early else ", ever slower," if early > _PACE * late else ""
        return ("rises" if trend > 0.0 else "falls") + pace
    line = np.polynomial.Polynomial.fit(at, values, 2)
    bend = line.convert().coef[2] if line.convert().coef.size > 2 else 0.0
    explained = 1.0 - float(np.var(values - line(at))) / max(float(np.var(values)), 1e-300)
    if explained < 0.5:
        return "wanders"
    turn = at[np.argmin(values)] if bend > 0.0 else at[np.argmax(values)]
    return f"{'dips' if bend > 0.0 else 'peaks'} near {_with_unit(float(f'{turn:.2g}'), how)}"


def _pace(at: np.ndarray, values: np.ndarray, late: bool) -> float:
    """Slope of the straight line through the lower or the upper half of the range, without its sign."""
    middle = 0.5 * (float(at.min()) + float(at.max()))
    half = at >= middle if late else at <= middle
    if len(np.unique(at[half])) < 2:
        return 0.0
    return abs(float(np.polynomial.Polynomial.fit(at[half], values[half], 1).convert().coef[-1]))


def _formula(variable: str, at: np.ndarray, values: np.ndarray) -> str:
    """The shortest sum of elementary terms that holds almost all of the correction, or nothing."""
    scale = float(np.max(np.abs(at)))
    if scale <= 0.0 or len(np.unique(at)) < 5:
        return ""
    name = variable if " " not in variable else f"({variable})"
    terms = {name: at, f"{name}^2": at**2, f"{name}^3": at**3, f"sqrt|{name}|": np.sqrt(np.abs(at))}
    if at.min() > 0.0:
        terms |= {f"ln {name}": np.log(at), f"1/{name}": 1.0 / at}
    for count in range(1, _MOST_TERMS + 1):
        best, formula = _AS_WELL, ""
        for chosen in combinations(terms, count):
            columns = np.column_stack([terms[each] for each in chosen])
            fitted = LinearRegression().fit(columns, values)
            score = float(fitted.score(columns, values))
            if score > best:
                slopes = zip(fitted.coef_, chosen, strict=True)
                best = score
                level = float(fitted.intercept_) if abs(fitted.intercept_) > _NOTHING * float(np.ptp(values)) else 0.0
                told = [f"{slope:+.3g} {each}" for slope, each in slopes]
                formula = " ".join([f"{level:.3g}", *told] if level else told).lstrip("+")
        if formula:
            return formula
    return ""
