"""Whether the soil that is known from elsewhere is the one that the textbook wheel finds by itself."""

from __future__ import annotations

import numpy as np
from scipy.stats import chi2

from ....framework.core.soil import PARAMETERS, SoilKnowledge
from ...mechanics.soil import from_internal, slope_of_internal, to_internal
from ..fit.samples import Samples
from ..fit.steps import scaled_inverse
from ..fit.textbook import fit_textbook
from . import readable

_BY_CHANCE = 1e-6
"""Probability with which an agreeing soil would be told to disagree [-]."""


def disagreement(samples: Samples, known: SoilKnowledge) -> str | None:
    """Say, in words, that the soil known from elsewhere is not the one that the wheel finds; None where it may be.

    An instrument's fault may look wholly like another soil, and so does a soil that is stated wrongly: what is named,
    or that nothing is, rests on the statement then.
    """
    names = list(known.values)
    if not names:
        return None
    _, fitted = fit_textbook(samples)
    index = [PARAMETERS.index(name) for name in names]
    told = np.array([to_internal(name, known.values[name]) for name in names])
    slope = np.array([slope_of_internal(name, known.values[name]) for name in names])
    told_sd = np.array([known.sd.get(name, 0.0) for name in names]) / slope
    found, covariance = fitted.vector[index], fitted.covariance[np.ix_(index, index)]
    away = told - found
    if float(away @ scaled_inverse(covariance + np.diag(told_sd**2)) @ away) < chi2.isf(_BY_CHANCE, len(names)):
        return None
    told_and_found = "; ".join(
        f"{readable.shown(name).name} {_value(name, told[i], told_sd[i])} stated, "
        f"{_value(name, found[i], covariance[i, i] ** 0.5)} found"
        for i, name in enumerate(names)
    )
    meant = " (its stiffness is that of pressure over (sinkage / width)^n)" if "stiffness_Pa" in names else ""
    return (
        f"the soil stated is not the one that the textbook wheel finds by itself ({told_and_found}): either the "
        f"statement is wrong{meant}, or what was left out makes the ground look like another soil"
    )


def _value(name: str, at: float, sd: float) -> str:
    """Put an internal value and its standard deviation in the unit that is shown."""
    how, value = readable.shown(name), from_internal(name, float(at))
    if sd > 0.0:
        shown = readable.spread(value, float(sd) * slope_of_internal(name, value), how.scale)
    else:
        shown = readable.number(value, how.scale)
    return f"{shown} {how.unit}".strip()
