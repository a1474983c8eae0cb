"""Base classes of sensor faults: a wrong zero or a wrong gain."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import ClassVar

import numpy as np

from .effect import LOAD, PULL, SINKAGE, TORQUE, Drive, Effect, Parameter, Situation

SYMBOLS = {LOAD: ("W", "N"), TORQUE: ("T", "N m"), SINKAGE: ("z", "m"), PULL: ("DP", "N")}
"""Symbol and unit of each channel."""

_READINGS = 100
"""Number of readings averaged in a check of a zero."""

_CHECKED_TO = 0.01
"""Relative accuracy of a check of a gain [-]."""


class SensorOffset(Effect):
    """The zero of a sensor is wrong."""

    kind = "instrument"
    source = "definition"
    channel: ClassVar[int]
    share: ClassVar[float]
    """Standard deviation of the prior, as a share of the channel's root mean square [-]."""
    most: ClassVar[float] = 2.0
    """Bound, in the same unit [-]."""

    def __init__(self, usual: float) -> None:
        symbol, unit = SYMBOLS[self.channel]
        most = self.most * usual
        source = f"engineering judgement: zeros are off by {100.0 * self.share:g} % of the usual reading"
        self.parameters = (Parameter(f"{symbol}_0", unit, -most, most, 0.0, self.share * usual, source),)
        self.equation = f"{symbol} reported = {symbol} + {symbol}_0"

    @classmethod
    def forms(cls, situation: Situation) -> Sequence[Effect]:
        return (cls(float(situation.typical[cls.channel])),) if situation.measures(cls.channel) else ()

    def check_sd(self, noise: np.ndarray) -> float:
        return float(noise[self.channel]) / math.sqrt(_READINGS)

    def report(self, channels: np.ndarray, drive: Drive, values: np.ndarray) -> None:
        channels[:, self.channel] += values[0]


class SensorGain(Effect):
    """The gain of a sensor is wrong."""

    kind = "instrument"
    source = "definition"
    channel: ClassVar[int]

    def __init_subclass__(cls) -> None:
        symbol, _ = SYMBOLS[cls.channel]
        cls.equation = f"{symbol} reported = (1 + g) {symbol}"

    def check_sd(self, noise: np.ndarray) -> float:
        return _CHECKED_TO

    def report(self, channels: np.ndarray, drive: Drive, values: np.ndarray) -> None:
        channels[:, self.channel] *= 1.0 + values[0]
