"""Drawbar-pull gain."""

from ..effect import PULL, Parameter
from ..registry import register
from ..sensors import SensorGain


@register
class PullGain(SensorGain):
    """The gain of the pull cell is wrong."""

    slug = "pull_gain"
    title = "drawbar-pull gain"
    what_happens = "the gain of the drawbar-pull sensor is wrong"
    check = "pull at the pull cell with a known weight"
    changes = (PULL,)
    channel = PULL
    parameters = (
        Parameter(
            "g", "", -0.8, 2.0, 0.0, 0.1,
            "engineering judgement: force cells that were not calibrated in place are off by 5 to 10 %",
        ),
    )  # fmt: skip
