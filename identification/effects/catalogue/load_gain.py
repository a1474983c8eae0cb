"""Load gain."""

from __future__ import annotations

import numpy as np

from ..effect import LOAD, Drive, Parameter
from ..registry import register
from ..sensors import SensorGain


@register
class LoadGain(SensorGain):
    """The gain of the load cell, or the share of the weight that the wheel carries, is wrong."""

    slug = "load_gain"
    title = "load gain"
    what_happens = "the gain of the load cell, or the wheel's share of the weight, is wrong"
    check = "stand the wheel on a scale and read the load"
    channel = LOAD
    parameters = (
        Parameter(
            "g", "", -0.6, 1.5, 0.0, 0.15,
            "engineering judgement: a wheel's share of the weight is computed to 10 to 20 % where it is not weighed",
        ),
    )  # fmt: skip

    def impose(self, imposed: np.ndarray, drive: Drive, values: np.ndarray) -> None:
        imposed[:, LOAD] /= 1.0 + values[0]

    def report(self, channels: np.ndarray, drive: Drive, values: np.ndarray) -> None:
        """Leave the load as it is reported: it is the true one that differs (`impose`)."""
