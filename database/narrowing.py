"""What holds a lower bound down, and which drive would raise it."""

from __future__ import annotations

import math

import numpy as np
from scipy.special import stdtrit

from .posterior import ClassSoil

WEAK = 0.5
"""A lower bound below this share of the expected strength is explained [-]."""

_TYPICAL = 0.75
"""A class whose quantile is at least this share as far from its mean as it is, with scatter and mean known, is well
known [-]."""


def narrowed_by(soil: ClassSoil, gradient: np.ndarray, confidence: float) -> str:
    """Say what would narrow the prediction of ``gradient . (c, tan phi)`` at a new place of a class.

    The distance of the bound from the mean has three parts: how places of the class differ, what is not known of that
    from few places, and the error of the mean. Where the first alone makes most of it, places do differ so.
    """
    _, scale, freedom = soil.strength.predict(gradient)
    places = f"{soil.stretches} stretch{'es' * (soil.stretches != 1)}"
    scatter = math.sqrt(float(gradient @ soil.strength.scatter @ gradient))
    wide = scale * -stdtrit(freedom, 1.0 - confidence)
    if scatter * -stdtrit(math.inf, 1.0 - confidence) > _TYPICAL * wide:
        return f"its places differ by so much, by {places}"
    if scale * -stdtrit(math.inf, 1.0 - confidence) > _TYPICAL * wide:
        return f"its mean is uncertain, by {places}: drive slowly on it for longer, load and slip varied"
    return f"how its places differ is hardly known from {places}: drive slowly on it at other places"
