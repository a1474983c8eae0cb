"""Torque offset."""

from ..effect import TORQUE
from ..registry import register
from ..sensors import SensorOffset


@register
class TorqueOffset(SensorOffset):
    """The zero of the torque sensor is wrong."""

    slug = "torque_offset"
    title = "torque offset"
    what_happens = "the zero of the torque sensor is wrong"
    check = "read the torque with the wheel lifted and at rest"
    changes = (TORQUE,)
    channel, share = TORQUE, 0.1
