"""A share of the load in the drawbar pull."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..effect import PULL, Drive, Effect, Parameter, Situation
from ..registry import register


@register
class LoadInPull(Effect):
    """A share of the load is measured as drawbar pull: rails rub, the pull cell is not level, or the ground slopes."""

    slug = "load_in_pull"
    title = "load in the drawbar pull"
    what_happens = (
        "a share of the load is measured as drawbar pull: rails rub, or the pull cell or the ground is tilted"
    )
    check = "level the pull cell and the ground, or measure the pitch; drive the same once in the other direction"
    kind = "instrument"
    equation = "DP reported = DP + s W"
    source = "statics"
    changes = (PULL,)
    parameters = (
        Parameter(
            "s", "", -0.5, 0.5, 0.0, 0.03, "engineering judgement: a tilt of 2 degrees, or the friction of rollers"
        ),
    )

    @classmethod
    def forms(cls, situation: Situation) -> Sequence[Effect]:
        """Give the form where the load varies: otherwise it is an offset of the pull."""
        return super().forms(situation) if situation.drive.has("load_N") else ()

    def report(self, channels: np.ndarray, drive: Drive, values: np.ndarray) -> None:
        channels[:, PULL] += values[0] * drive.load_N
