"""Sinkage gain."""

from ..effect import SINKAGE, Parameter
from ..registry import register
from ..sensors import SensorGain


@register
class SinkageGain(SensorGain):
    """The gain of the sinkage sensor is wrong."""

    slug = "sinkage_gain"
    title = "sinkage gain"
    what_happens = "the gain of the sinkage sensor is wrong"
    check = "put gauge blocks of known height under the wheel and read the sinkage"
    changes = (SINKAGE,)
    channel = SINKAGE
    parameters = (
        Parameter(
            "g", "", -0.8, 2.0, 0.0, 0.1,
            "engineering judgement: distance sensors that were not calibrated in place are off by 5 to 10 %",
        ),
    )  # fmt: skip
