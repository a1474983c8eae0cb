"""Saturation of the torque."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..effect import TORQUE, Drive, Effect, Parameter, Situation
from ..registry import register

_POWERS = {"soft": 2.5, "hard": 8.0}
"""Powers of the law by form [-]: the soft one is a hyperbolic tangent to 3 % of its limit."""


@register
class TorqueSaturation(Effect):
    """The torque sensor, its amplifier or the drive's current reaches its limit."""

    slug = "torque_saturation"
    title = "torque saturation"
    what_happens = "the torque sensor, its amplifier or the drive's current reaches its limit"
    check = "turn the locked wheel with known torques up to the largest and read the torque"
    kind = "instrument"
    source = "a smooth limiter: the generalised mean of a straight line and its limit"
    changes = (TORQUE,)

    def __init__(self, usual_Nm: float, form: str) -> None:
        self.form, self._power = form, _POWERS[form]
        self.equation = f"T reported = T / (1 + s |T / T_usual|^{self._power:g})^(1/{self._power:g})"
        self.constants = {"T_usual": usual_Nm}
        source = "engineering judgement: the usual torque is reported too small by a few per cent"
        self.parameters = (Parameter("s", "", 0.0, 4.0, 0.0, 0.1, source),)

    @classmethod
    def forms(cls, situation: Situation) -> Sequence[Effect]:
        if not situation.measures(TORQUE):
            return ()
        return tuple(cls(float(situation.typical[TORQUE]), form) for form in _POWERS)

    def report(self, channels: np.ndarray, drive: Drive, values: np.ndarray) -> None:
        torque = channels[:, TORQUE]
        share = np.abs(torque / self.constants["T_usual"]) ** self._power
        channels[:, TORQUE] = torque * (1.0 + values[0] * share) ** (-1.0 / self._power)
