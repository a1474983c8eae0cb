"""Prior of the soils of grounds: wide for each class, narrower for places of one class."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from ...framework.core.soil import PARAMETERS, PLAUSIBLE, SoilKnowledge
from ..mechanics.augmented import SOIL_COUNT
from ..mechanics.soil import slope_of_internal, to_internal
from .steps import Prior

SOIL_PRIOR = {
    "c_Pa": (0.0, 2e4), "phi_rad": (0.6, 0.4), "k_m": (math.log(0.012), 1.2), "stiffness_Pa": (0.0, math.inf),
    "n": (math.log(0.95), 0.5),
}  # fmt: skip
"""Mean and standard deviation in internal coordinates: wider than the range of Wong (2010), Table 2.3."""

BETWEEN_PLACES = {"c_Pa": 700.0, "phi_rad": 0.06, "k_m": 0.4, "stiffness_Pa": 0.5, "n": 0.15}
"""Standard deviation of the soils of places of one class in internal coordinates: as the database expects
(`database.posterior.PRIOR_VARIATION`), for a cohesion of 2 kPa and a friction of 0.6."""


def prior_of_soils(known: SoilKnowledge, classes: Sequence[Sequence[int]]) -> Prior:
    """Prior and bounds of the soils of g grounds, 5 g parameters.

    The soils of grounds of one class vary about its mean, which is integrated out.

    Parameters
    ----------
    known
        Prior knowledge of the soil.
    classes
        Numbers of the grounds of each class.
    """
    mean, sd, lower, upper = [], [], [], []
    for name in PARAMETERS:
        if name in known.values:
            at, slope = to_internal(name, known.values[name]), slope_of_internal(name, known.values[name])
            mean.append(at)
            sd.append(max(known.sd.get(name, 0.0) / slope, 1e-6 * max(abs(at), 1.0)))
        else:
            mean.append(SOIL_PRIOR[name][0])
            sd.append(SOIL_PRIOR[name][1])
        lower.append(to_internal(name, PLAUSIBLE[name][0]))
        upper.append(to_internal(name, PLAUSIBLE[name][1]))
    lower[0] = 0.0
    grounds = sum(map(len, classes))
    precision = np.zeros((grounds, SOIL_COUNT, grounds, SOIL_COUNT))
    for index, name in enumerate(PARAMETERS):
        for members in classes:
            about = precision_about_mean(len(members), sd[index], BETWEEN_PLACES[name])
            precision[:, index, :, index][np.ix_(members, members)] = about
    return Prior(
        np.tile(mean, grounds), precision.reshape(2 * (SOIL_COUNT * grounds,)), np.tile(lower, grounds),
        np.tile(upper, grounds),
    )  # fmt: skip


def precision_about_mean(count: int, of_mean: float, spread: float) -> np.ndarray:
    """Precision of `count` variables of standard deviation `spread` about a mean that has one of its own."""
    if count == 1:
        return np.full((1, 1), of_mean**-2.0)
    # The inverse of spread^2 I + of_mean^2 1 1' (Sherman and Morrison).
    shared = 1.0 / ((spread / of_mean) ** 2 + count)
    return (np.eye(count) - shared) / spread**2
