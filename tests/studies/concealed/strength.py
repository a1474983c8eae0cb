"""Strength of a hidden effect at which the truth gains a given number of nats over the refitted textbook."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from .effects import Effect
from .mechanics import simulate
from .weighing import Case, Refit, refit_textbook, still, weights

LEVELS = {"plain": 1500.0, "hidden": 250.0, "buried": 60.0}
"""Nats that the true model gains over the refitted textbook one."""

TOLERANCE = 0.12
"""How far the nats may be off, relative."""

LEAST_R2 = 0.95
"""What the refitted textbook explains at least of every answer."""


@dataclass(frozen=True)
class Found:
    """An effect of the required strength, or the nearest plausible one; `reached` says which."""

    effect: Effect
    nats: float
    r2: np.ndarray
    reached: bool
    reason: str


Weigh = Callable[[Effect, np.ndarray], Refit | None]
"""Refits the textbook, from some parameters, to a recording with this effect; None where there is no equilibrium."""


def find_strength(effect: Effect, target: float, weigh: Weigh, start: np.ndarray) -> Found:
    """Look for the magnitude at which the truth gains `target` nats: secant on the logarithms within brackets.

    The nats grow about as the square of the magnitude, from which the search starts.
    """
    least, most = effect.bounds
    magnitude = float(np.clip(0.25 * most, max(least, 1e-3 * most), most))
    low, high = max(least, 1e-4 * most), most
    trials = []
    best: Found | None = None
    for _ in range(12):
        trial = effect.scaled(magnitude)
        fit = weigh(trial, start)
        if fit is None:  # no equilibrium: too strong
            high = magnitude
            magnitude = 0.5 * (low + magnitude)
            continue
        start = fit.parameters
        trials.append((np.log(magnitude), np.log(max(fit.nats, 1e-6))))
        good = abs(fit.nats / target - 1.0) <= TOLERANCE
        clear = bool(np.all(fit.r2 >= LEAST_R2))
        found = Found(trial, fit.nats, fit.r2, good and clear, "" if clear else "textbook explains too little")
        if best is None or (clear and abs(np.log(fit.nats / target)) < abs(np.log(best.nats / target))):
            best = found
        if good:
            return found
        if fit.nats > target:
            high = magnitude
        else:
            low = magnitude
        if high / low < 1.02 or (magnitude >= most and fit.nats < target) or (magnitude <= least and fit.nats > target):
            break
        magnitude = _next(trials, np.log(target), low, high)
    if best is None:
        return Found(effect, 0.0, np.zeros(3), False, "no equilibrium")
    if best.reason:
        return best
    hidden = all(nats < np.log(target) for _, nats in trials)
    reason = "too weak at its strongest" if hidden else "textbook explains too little, or effect too strong"
    return Found(best.effect, best.nats, best.r2, False, reason)


def _next(trials: Sequence[tuple[float, float]], goal: float, low: float, high: float) -> float:
    """Give the next magnitude: a line through the two latest trials, slope 2 from the first, kept in the bracket."""
    x, y = trials[-1]
    slope = 2.0
    if len(trials) > 1 and abs(x - trials[-2][0]) > 1e-6:
        slope = float(np.clip((y - trials[-2][1]) / (x - trials[-2][0]), 0.7, 6.0))
    guess = float(np.exp(x + np.clip((goal - y) / slope, -3.0, 3.0)))
    if low * 1.001 < guess < high * 0.999:
        return guess
    return high if guess >= high else float(np.sqrt(low * high))


def nats_of(case: Case, effect: Effect, start: np.ndarray) -> Refit | None:
    """Refit the textbook to a recording with this effect; None where the wheel finds no equilibrium."""
    observed, theta_1 = simulate(case.ground, case.body, case.drive, [effect])
    if not still(observed, theta_1):
        return None
    return refit_textbook(case, observed, weights(case, [effect], observed, theta_1), start)
