"""Rolling radius."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...mechanics.fields import speed_ratio
from ..effect import PULL, TORQUE, Drive, Effect, Parameter, Situation
from ..registry import register

_CHECKED_TO = 0.01
"""Relative accuracy of the check [-]."""


@register
class RollingRadius(Effect):
    """Slip was computed with a wrong effective radius."""

    slug = "rolling_radius"
    title = "rolling radius"
    what_happens = "slip was computed with a wrong effective radius"
    check = "count the wheel's turns over a measured distance on a hard floor"
    kind = "instrument"
    equation = "1 - i = (1 - i reported) / (1 + e), e the relative error of the radius"
    source = "definition of slip"
    parameters = (
        Parameter(
            "e", "", -0.3, 0.4, 0.0, 0.03,
            "engineering judgement: lugs and tyres leave the effective radius uncertain by a few per cent",
        ),
    )  # fmt: skip

    @classmethod
    def forms(cls, situation: Situation) -> Sequence[Effect]:
        """Give the form where slip varies and a force was measured that follows slip."""
        return (cls(),) if situation.drive.has("slip") and situation.measures(TORQUE, PULL) else ()

    def check_sd(self, noise: np.ndarray) -> float:
        return _CHECKED_TO

    def impose(self, imposed: np.ndarray, drive: Drive, values: np.ndarray) -> None:
        slip = imposed[:, 1]
        ratio = speed_ratio(slip)[0] / (1.0 + values[0])
        true = np.where(ratio <= 1.0, 1.0 - ratio, 1.0 / ratio - 1.0)
        imposed[:, 1] = np.clip(true, -1.0, 0.9999)
