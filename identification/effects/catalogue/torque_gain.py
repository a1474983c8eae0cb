"""Torque gain."""

from ..effect import TORQUE, Parameter
from ..registry import register
from ..sensors import SensorGain


@register
class TorqueGain(SensorGain):
    """The gain of the torque sensor, or the motor's torque constant, is wrong."""

    slug = "torque_gain"
    title = "torque gain"
    what_happens = "the gain of the torque sensor, or the motor's torque constant, is wrong"
    check = "hang a known weight on a lever at the wheel and read the torque"
    changes = (TORQUE,)
    channel = TORQUE
    parameters = (
        Parameter(
            "g", "", -0.8, 2.0, 0.0, 0.15,
            "engineering judgement: torque constants of motors are within 10 % and fall as the motor warms",
        ),
    )  # fmt: skip
