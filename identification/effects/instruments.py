"""Constant faults of instruments: a wrong zero, a wrong gain, a wrong radius."""

from __future__ import annotations

import numpy as np

from .effect import LOAD, PULL, SINKAGE, TORQUE, Drive, Effect, Parameter, Situation


class TorqueOffset(Effect):
    """The torque sensor's zero is wrong."""

    slug = "torque_offset"
    kind = "instrument"
    equation = "T reported = T + T_0"
    source = "definition"

    def __init__(self, usual_Nm: float) -> None:
        self.parameters = (Parameter("T_0", "N m", -2.0 * usual_Nm, 2.0 * usual_Nm, 0.0, 0.1 * usual_Nm),)

    def report(self, channels: np.ndarray, drive: Drive, values: np.ndarray) -> None:
        channels[:, TORQUE] += values[0]


class TorqueGain(Effect):
    """The torque sensor's or the motor's constant is wrong."""

    slug = "torque_gain"
    kind = "instrument"
    equation = "T reported = (1 + g) T"
    source = "definition"
    parameters = (Parameter("g", "", -0.8, 2.0, 0.0, 0.15),)

    def report(self, channels: np.ndarray, drive: Drive, values: np.ndarray) -> None:
        channels[:, TORQUE] *= 1.0 + values[0]


class LoadGain(Effect):
    """The load cell's constant, or the share of the weight that the wheel carries, is wrong."""

    slug = "load_gain"
    kind = "instrument"
    equation = "W reported = (1 + g) W"
    source = "definition"
    parameters = (Parameter("g", "", -0.6, 1.5, 0.0, 0.15),)

    def impose(self, imposed: np.ndarray, drive: Drive, values: np.ndarray) -> None:
        imposed[:, LOAD] /= 1.0 + values[0]


class SinkageOffset(Effect):
    """The sinkage sensor's zero is wrong."""

    slug = "sinkage_offset"
    kind = "instrument"
    equation = "z reported = z + z_0"
    source = "definition"

    def __init__(self, usual_m: float) -> None:
        self.parameters = (Parameter("z_0", "m", -2.0 * usual_m, 2.0 * usual_m, 0.0, 0.1 * usual_m),)

    def report(self, channels: np.ndarray, drive: Drive, values: np.ndarray) -> None:
        channels[:, SINKAGE] += values[0]


class RollingRadius(Effect):
    """Slip was computed with a wrong effective radius."""

    slug = "rolling_radius"
    kind = "instrument"
    equation = "1 - i = (1 - i reported) / (1 + e), e the relative error of the radius"
    source = "definition of slip"
    parameters = (Parameter("e", "", -0.3, 0.4, 0.0, 0.03),)

    def impose(self, imposed: np.ndarray, drive: Drive, values: np.ndarray) -> None:
        slip = imposed[:, 1]
        ratio = np.where(slip >= 0.0, 1.0 - slip, 1.0 / np.maximum(1.0 + slip, 1e-9)) / (1.0 + values[0])
        true = np.where(ratio <= 1.0, 1.0 - ratio, 1.0 / ratio - 1.0)
        imposed[:, 1] = np.clip(true, -1.0, 0.9999)


def forms(situation: Situation) -> tuple[Effect, ...]:
    """Give the faults that these data can show."""
    faults: list[Effect] = []
    if situation.seen(TORQUE):
        faults += [TorqueOffset(float(situation.typical[TORQUE])), TorqueGain()]
    if situation.seen(LOAD):
        faults.append(LoadGain())
    if situation.seen(SINKAGE):
        faults.append(SinkageOffset(float(situation.typical[SINKAGE])))
    if situation.drive.has("slip") and situation.seen(TORQUE, PULL):
        faults.append(RollingRadius())
    return tuple(faults)
