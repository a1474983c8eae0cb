"""Load offset."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..effect import LOAD, Drive, Effect, Situation
from ..registry import register
from ..sensors import SensorOffset

_LEAST = 1e-3
"""Share of the reported load that the true one is at least [-]."""


@register
class LoadOffset(SensorOffset):
    """The zero of the load cell is wrong."""

    slug = "load_offset"
    title = "load offset"
    what_happens = "the zero of the load cell is wrong"
    check = "read the load cell with the wheel in the air"
    channel, share, most = LOAD, 0.05, 0.5

    @classmethod
    def forms(cls, situation: Situation) -> Sequence[Effect]:
        """Give the form where the load varies: otherwise it is a gain."""
        return super().forms(situation) if situation.drive.has("load_N") else ()

    def impose(self, imposed: np.ndarray, drive: Drive, values: np.ndarray) -> None:
        imposed[:, LOAD] = np.maximum(imposed[:, LOAD] - values[0], _LEAST * imposed[:, LOAD])

    def report(self, channels: np.ndarray, drive: Drive, values: np.ndarray) -> None:
        """Leave the load as it is reported: it is the true one that differs (`impose`)."""
