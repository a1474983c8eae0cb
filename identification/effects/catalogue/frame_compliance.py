"""A frame that bends under the drawbar pull."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..effect import PULL, SINKAGE, Drive, Effect, Parameter, Situation
from ..registry import register


@register
class FrameCompliance(Effect):
    """The frame that carries the sinkage sensor bends under the drawbar pull."""

    slug = "frame_compliance"
    title = "frame compliance"
    what_happens = "the frame that carries the sinkage sensor bends under the drawbar pull"
    check = "pull at the wheel with a known force on a hard floor and read the sinkage"
    kind = "instrument"
    equation = "z reported = z + c DP"
    source = "Hooke's law"
    changes = (SINKAGE,)

    def __init__(self, usual_m: float, usual_N: float) -> None:
        usual = usual_m / usual_N
        source = "engineering judgement: the frame bends by 5 % of the sinkage under the usual pull"
        self.parameters = (Parameter("c", "m/N", -2.0 * usual, 2.0 * usual, 0.0, 0.05 * usual, source),)

    @classmethod
    def forms(cls, situation: Situation) -> Sequence[Effect]:
        if not situation.measures(SINKAGE):
            return ()
        # The model has the pull whether or not it was measured.
        load = float(np.nanmean(np.abs(situation.drive.load_N)))
        usual_N = float(situation.typical[PULL]) if situation.measures(PULL) else 0.2 * load
        return (cls(float(situation.typical[SINKAGE]), usual_N),)

    def report(self, channels: np.ndarray, drive: Drive, values: np.ndarray) -> None:
        channels[:, SINKAGE] += values[0] * channels[:, PULL]
