"""The textbook wheel refitted to a recording: what every effect is judged against."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from ....framework.core.errors import InputError
from ....framework.core.soil import SoilKnowledge
from ...effects.effect import LOAD, SLIP
from ...mechanics.augmented import AugmentedWheel
from .fitting import Fitted, Problem, as_smooth_as_it_is, fit
from .gross_errors import without_gross_errors
from .samples import Samples, levels
from .together import together

_COARSE = 0.1
"""Share of a channel's scatter that the first search for a soil takes for noise [-]."""

FLAT = 1e-9
"""Share of its size by which a channel scatters that another simulator gives the same value throughout [-]."""

_LEAST_CARRIED = 0.5
"""Share of the rows whose load some soil has to carry [-]."""

_SAME = 0.02
"""Soils that differ by less in tan phi, ln k, ln stiffness and ln n are one to start from [-]."""

_ALIKE = 0.025
"""Conditions of trials this share of their range apart are levels of their own [-]."""

_ENOUGH_REPEATS = 8
"""Degrees of freedom among repeats from which on they say what noise is."""

QUIET = 0.01
"""How much quiet ground varies [-]."""

_LEAST_SPREAD = 0.01
"""Ground varies by at least so much [-]."""


def fit_textbook(
    samples: Samples, known: SoilKnowledge | None = None, roughest: float = 1.0
) -> tuple[Problem, Fitted]:  # fmt: skip
    """Fit the textbook wheel from the best of several starts; ground varies by `roughest` at most.

    Raises
    ------
    InputError
        No soil carries the load of most rows.
    """
    problem = Problem(samples, known, roughest)
    # Soil first, by what it explains coarsely: variation along the track would explain any soil's residuals.
    found = together(lambda soil: coarse_fit(problem, soil, None), first_soil(problem))
    cleared = without_gross_errors(samples, max(found, key=lambda fitted: fitted.score))
    if cleared is not samples:
        samples, problem = cleared, Problem(cleared, known, roughest)
        found = together(lambda each: coarse_fit(problem, each.vector, each.theta_1), found)
    starts: list[Fitted] = []
    for start in sorted(found, key=lambda fitted: -fitted.score):
        if not any(np.allclose(start.vector[1:], other.vector[1:], atol=_SAME) for other in starts):
            starts.append(start)
    best = best_fit(problem, [(start.vector, start.theta_1) for start in starts])
    carried = np.isfinite(best.theta_1)
    if carried.mean() < _LEAST_CARRIED:
        load_N = float(np.median(samples.drive.load_N[~carried]))
        raise InputError(
            "column load_N", f"no soil carries {load_N:.3g} N, the median of {int((~carried).sum())} of {len(carried)} "
            "rows", expected=f"newtons on a wheel of {samples.wheel.radius_m:g} m radius",
        )  # fmt: skip
    return problem, best


def coarse_fit(problem: Problem, soil: np.ndarray, theta_1: np.ndarray | None) -> Fitted:
    """Fit the textbook wheel to ground that is the same everywhere, by what it leaves as a share of the scatter."""
    scatter, size = np.nanstd(problem.measured, axis=0), np.nanmax(np.abs(problem.measured), axis=0)
    shares = np.where(scatter > FLAT * size, _COARSE * scatter, problem.first_noise.answers)
    coarse = replace(problem.first_noise, answers=shares, spread=np.full(2, 1e-3))
    return fit(problem, AugmentedWheel(problem.samples.wheel), soil, coarse, theta_1, iterations=15, settle=False)


def best_fit(problem: Problem, starts: list[tuple[np.ndarray, np.ndarray]]) -> Fitted:
    """Fit the textbook wheel from several soils (5,) and entry angles (n,) [rad].

    Effects have to live with what it makes of the ground and of errors in load and slip: one that needs the ground to
    vary more, or that hides the errors, explains nothing. Whether ground along a track varies smoothly the fits tell.
    """
    model = AugmentedWheel(problem.samples.wheel)
    problem.most, problem.weights = problem.unbounded, None
    problem.first_noise = replace(problem.first_noise, smooth=0)

    def from_start(start: tuple[np.ndarray, np.ndarray]) -> Fitted:
        return fit(problem, model, start[0], None, start[1])

    found = together(from_start, starts)
    # In quiet ground first, too: a soil that is wrong makes up for it by ground that varies, and so goes on to a worse.
    problem.most = replace(problem.unbounded, spread=np.full(2, QUIET))
    quiet = together(from_start, starts)
    problem.most = problem.unbounded
    found += together(lambda each: fit(problem, model, each.vector, each.noise, each.theta_1), quiet)
    best = max([*found, *quiet], key=lambda fitted: fitted.score)
    # Smoother ground that varied by more would stand in for something else.
    most = np.full(2, max(_LEAST_SPREAD, float(best.noise.spread.max())))
    problem.most = replace(problem.unbounded, spread=most)
    best = as_smooth_as_it_is(problem, best)
    problem.most = problem.unbounded
    problem.first_noise = replace(problem.first_noise, smooth=best.noise.smooth)
    repeat = repeats(problem.samples)
    freedom = int(np.sum(np.maximum(np.bincount(repeat[repeat >= 0]) - 1, 0)))
    if freedom >= _ENOUGH_REPEATS:
        # What repeats do not show is misfit, however well more noise would hide it.
        shown = problem.repeated_noise(best.response, repeat)
        wider = math.exp(2.0 / math.sqrt(2.0 * freedom))
        problem.most = replace(
            shown, answers=shown.answers * wider, spread=np.maximum(shown.spread * wider, _LEAST_SPREAD)
        )
        best = fit(problem, model, best.vector, None, best.theta_1)
    spread = np.full(2, max(_LEAST_SPREAD, float(best.noise.spread.max())))
    problem.most = replace(problem.most, spread=np.minimum(problem.most.spread, spread))
    problem.weights = best.response
    return best


def repeats(samples: Samples) -> np.ndarray:
    """Number of the trial that each row repeats, (n,), -1 for rows that repeat none, and in recordings with time.

    Repeats have all conditions in common: those known, to within a fortieth of their range or a few noises.
    """
    drive = samples.drive
    if drive.timed:
        return np.full(len(samples), -1)
    near = {"load_N": 4.0 * samples.noise[LOAD], "slip": 4.0 * samples.noise[SLIP]}
    label = np.zeros(len(samples), dtype=int)
    for name in ("load_N", "slip", "rim_speed_m_s", "pitch_rad", "pass_number"):
        values = np.nan_to_num(getattr(drive, name))
        apart = max(_ALIKE * float(np.ptp(values)), near.get(name, 0.0))
        label = np.unique(label * len(values) + levels(values, apart), return_inverse=True)[1]
    size = np.bincount(label)
    number = np.cumsum(size > 1) - 1
    return np.where(size[label] > 1, number[label], -1)


def first_soil(problem: Problem) -> list[np.ndarray]:
    """Vectors of five to start from: middling soils, stiff enough to carry the load at the sinkage measured."""
    samples = problem.samples
    radius, width = samples.wheel.radius_m, samples.wheel.width_m
    sinkage = samples.measured[:, 2]
    depth = float(np.nanmedian(sinkage)) if np.isfinite(sinkage).any() else 0.1 * radius
    depth = float(np.clip(depth, 2e-3 * radius, radius))
    load = float(np.median(samples.measured[:, 0]))
    answer = []
    for n, k, friction in ((0.8, 0.02, 0.55), (1.1, 0.006, 0.6), (0.6, 0.03, 0.3)):
        # W is about the mean stress over the chord of the contact.
        chord = math.sqrt(2.0 * radius * depth)
        stress = load / (0.75 * width * chord)
        stiffness = stress * (n + 1.0) / (depth / width) ** n
        answer.append(np.array([500.0, friction, math.log(k), math.log(stiffness), math.log(n)]))
    return answer
