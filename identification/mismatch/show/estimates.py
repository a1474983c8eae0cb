"""What is estimated of soil and effects, with what explanations differ by that the data do not tell apart."""

from __future__ import annotations

import math

import numpy as np

from ....framework.core.soil import PARAMETERS
from ...effects.effect import Effect
from ...mechanics.augmented import SOIL_COUNT
from ...mechanics.soil import from_internal, slope_of_internal
from ..explanation import Estimate
from ..fit.fitting import Fitted, Problem
from ..fit.trial import Trial
from ..name.naming import Naming
from ..name.tries import Search

_COUNTS = 0.01
"""Probability from which on an explanation counts in what soils differ by [-]."""

_SOIL_UNITS = {"c_Pa": "Pa", "phi_rad": "rad", "k_m": "m", "stiffness_Pa": "Pa", "n": ""}


def parameters(fitted: Fitted, effect: Effect) -> dict[str, Estimate]:
    """Parameters of one effect of a fit, with their standard deviations."""
    where = _where(fitted, effect.name)
    return _estimates(effect, fitted.vector[where], np.diag(fitted.covariance)[where])


def parameters_among(found: Search, naming: Naming, trial: Trial, effect: Effect) -> dict[str, Estimate]:
    """Parameters of one effect of a set; their variance has what sets differ by that hold the same form of it, each by
    its share of their probability.
    """
    where = _where(trial.fitted, effect.name)
    values, variance = trial.fitted.vector[where], np.diag(trial.fitted.covariance)[where].copy()
    holding = [
        (weight, other.fitted.vector[_where(other.fitted, effect.name)])
        for other, weight in zip(found.trials, naming.weights.tolist(), strict=True)
        if weight > 0.0 and effect.name in other.names
    ]
    together = sum(weight for weight, _ in holding)
    for weight, there in holding:
        variance += weight / together * (there - values) ** 2
    return _estimates(effect, values, variance)


def soil_of(
    problem: Problem, fitted: Fitted, found: Search | None = None, naming: Naming | None = None
) -> dict[str, Estimate]:  # fmt: skip
    """Soil of a fit; with the spread between explanations that the data do not tell apart, none where it was given."""
    values, variance = fitted.vector[:SOIL_COUNT], np.diag(fitted.covariance)[:SOIL_COUNT].copy()
    if found is not None and naming is not None:
        for trial, weight in zip(found.trials, naming.weights, strict=True):
            if weight > _COUNTS:
                variance += weight * (trial.fitted.vector[:SOIL_COUNT] - values) ** 2
    answer = {}
    for index, name in enumerate(PARAMETERS):
        value = from_internal(name, float(values[index]))
        sd = math.sqrt(max(float(variance[index]), 0.0)) * abs(slope_of_internal(name, value))
        if name in problem.known.values and not problem.known.sd.get(name):
            sd = 0.0
        answer[name] = Estimate(value, sd, _SOIL_UNITS[name])
    return answer


def _where(fitted: Fitted, name: str) -> slice:
    """Where an effect's parameters stand in a fit's vector."""
    return next(where for effect, where in fitted.model.slices() if effect.name == name)


def _estimates(effect: Effect, values: np.ndarray, variance: np.ndarray) -> dict[str, Estimate]:
    sd = np.sqrt(np.maximum(variance, 0.0))
    return {
        parameter.name: Estimate(float(value), float(spread), parameter.unit)
        for parameter, value, spread in zip(effect.parameters, values, sd, strict=True)
    }
