"""The textbook wheel refitted to a recording: what every effect is judged against."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from ...framework.core.soil import SoilKnowledge
from ..augmented import AugmentedWheel
from .fitting import Fitted, Problem, fit
from .samples import Samples

_COARSE = 0.1
"""Share of a channel's scatter that the first search for a soil takes for noise [-]."""

_LEAST_SPREAD = 0.01
"""Ground varies by at least so much [-]."""


def fit_textbook(samples: Samples, known: SoilKnowledge | None = None) -> tuple[Problem, Fitted]:
    """Fit the textbook wheel from the best of several starts."""
    problem = Problem(samples, known)
    # Soil first, by what it explains coarsely: variation along the track would explain any soil's residuals.
    scatter = np.nanstd(problem.measured, axis=0)
    coarse = replace(problem.first_noise, answers=_COARSE * scatter, spread=np.full(2, 1e-3))
    model = AugmentedWheel(samples.wheel)
    starts = [fit(problem, model, start, coarse, iterations=15, settle=False) for start in first_soil(problem)]
    return problem, best_fit(problem, [(start.vector, start.theta_1) for start in starts])


def best_fit(problem: Problem, starts: list[tuple[np.ndarray, np.ndarray]]) -> Fitted:
    """Fit the textbook wheel from several soils (5,) and entry angles (n,) [rad].

    Effects have to live with what it makes of the ground and of errors in load and slip: one that needs the ground to
    vary more, or that hides the errors, explains nothing.
    """
    model = AugmentedWheel(problem.samples.wheel)
    problem.most_spread, problem.weights = 1.0, None
    found = [fit(problem, model, soil, None, theta_1) for soil, theta_1 in starts]
    best = max(found, key=lambda fitted: fitted.score)
    problem.most_spread = float(max(_LEAST_SPREAD, best.noise.spread.max()))
    problem.weights = best.response
    return best


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
