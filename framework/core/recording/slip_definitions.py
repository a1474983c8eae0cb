"""Definitions of slip in use, and how each becomes the one of a wheel file (J. Y. Wong 2010, Eq. 4.44 and 4.47)."""

from __future__ import annotations

from typing import Literal

import numpy as np

Definition = Literal["slip", "relative_to_rim", "relative_to_travel", "speed_ratio", "rim_to_travel"]

SLIP_TOLERANCE = 0.02
"""How far beyond [-1, 1] a recorded slip may lie, by the noise of the two speeds it was made of [-]."""

FORMULAS: dict[Definition, str] = {
    "slip": "1 - V/(r omega) when driving and r omega/V - 1 when braked",
    "relative_to_rim": "1 - V/(r omega), when braked too",
    "relative_to_travel": "(r omega - V)/V",
    "speed_ratio": "V/(r omega)",
    "rim_to_travel": "r omega/V",
}
"""By the name that a column map gives it; the first is that of a wheel file."""


def to_slip(values: np.ndarray, definition: Definition) -> np.ndarray:
    """Give slip (n,) of values (n,) by another definition [-]; NaN where rim and travel go opposite ways."""
    if definition == "slip":
        return values
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = {
            "relative_to_rim": 1.0 - values,
            "relative_to_travel": 1.0 / (1.0 + values),
            "speed_ratio": values,
            "rim_to_travel": 1.0 / values,
        }[definition]
        slip = np.where(ratio <= 1.0, 1.0 - ratio, 1.0 / ratio - 1.0)
    return np.where(ratio >= 0.0, slip, np.nan)


def definitions_of(values: np.ndarray, slip: np.ndarray, near: float) -> list[Definition]:
    """Give the definitions, but that of a wheel file, by which recorded values are the slip.

    Parameters
    ----------
    values, slip : (n,)
        As recorded, and as the speeds of rim and travel give it, with no NaN [-].
    near
        Largest difference in nine rows of ten [-].
    """
    found = []
    for name in FORMULAS:
        # A wheel that turns against its travel has no slip: what is out of range by noise differs by little.
        difference = np.abs(np.nan_to_num(to_slip(values, name), nan=np.inf) - slip)
        if name != "slip" and float(np.quantile(difference, 0.9)) < near:
            found.append(name)
    return found
