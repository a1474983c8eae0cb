"""Sinkage offset."""

from ..effect import SINKAGE
from ..registry import register
from ..sensors import SensorOffset


@register
class SinkageOffset(SensorOffset):
    """The zero of the sinkage sensor is wrong."""

    slug = "sinkage_offset"
    title = "sinkage offset"
    what_happens = "the zero of the sinkage sensor is wrong"
    check = "read the sinkage with the wheel on a hard, flat floor"
    changes = (SINKAGE,)
    channel, share = SINKAGE, 0.1
