"""Cross-talk between torque and drawbar pull."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..effect import PULL, TORQUE, Drive, Effect, Parameter, Situation
from ..registry import register

_PRIOR = "engineering judgement: cross-talk of force cells is a few per cent of the other component"


@register
class PullInTorque(Effect):
    """The torque sensor responds to the drawbar pull."""

    slug = "torque_pull_crosstalk"
    title = "cross-talk of torque and drawbar pull"
    what_happens = "the torque sensor responds to the drawbar pull, or the pull cell to the torque"
    check = (
        "pull at the axle of the locked wheel with a known force and read the torque; then turn it with a known torque"
    )
    kind = "instrument"
    form = "pull in torque"
    equation = "T reported = T + l DP"
    source = "definition"
    changes = (TORQUE,)

    def __init__(self, radius_m: float) -> None:
        self.parameters = (Parameter("l", "m", -radius_m, radius_m, 0.0, 0.05 * radius_m, _PRIOR),)

    @classmethod
    def forms(cls, situation: Situation) -> Sequence[Effect]:
        radius_m = situation.wheel.radius_m
        every = (PullInTorque(radius_m), TorqueInPull(radius_m))
        return tuple(form for form in every if situation.measures(*form.changes))

    def report(self, channels: np.ndarray, drive: Drive, values: np.ndarray) -> None:
        channels[:, TORQUE] += values[0] * channels[:, PULL]


class TorqueInPull(PullInTorque):
    """The pull cell responds to the torque."""

    form = "torque in pull"
    equation = "DP reported = DP + s T / r"
    changes = (PULL,)

    def __init__(self, radius_m: float) -> None:
        self._radius_m = radius_m
        self.parameters = (Parameter("s", "", -1.0, 1.0, 0.0, 0.05, _PRIOR),)

    def report(self, channels: np.ndarray, drive: Drive, values: np.ndarray) -> None:
        channels[:, PULL] += values[0] * channels[:, TORQUE] / self._radius_m
