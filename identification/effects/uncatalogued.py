"""Faults of sensors and of what holds the wheel that the catalogue lacks, so that nothing in it stands in for them.

Where one of them explains a recording better than the catalogue does, what was left out is ``unknown``, and what it is
like is said.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations
from typing import NamedTuple

import numpy as np

from ..mechanics.textbook import CHANNELS
from .effect import LOAD, PULL, SINKAGE, TORQUE, Drive, Effect, Parameter, Situation

SLUG = "unknown"

_SATURATING = {"torque_Nm saturates softly": 2.5, "torque_Nm saturates": 8.0}
"""Powers of the law of a sensor that comes to its end [-]: the first is a hyperbolic tangent, to 3 % of the end."""


class _Zero(NamedTuple):
    """A sensor's zero: its name, unit, and the sensor in words."""

    name: str
    unit: str
    words: str


_ZEROS = {
    TORQUE: _Zero("T_0", "N m", "torque"),
    SINKAGE: _Zero("z_0", "m", "sinkage"),
    PULL: _Zero("DP_0", "N", "drawbar pull"),
}
"""Those that may differ from run to run, by channel."""

_MOST_RUNS = 12
"""Runs up to which that is asked: each has a zero of its own in every channel, and fits take as much longer."""

_HELD, _OWN = {"load_N": "load", "rim_speed_m_s": "speed of the rim", "pitch_rad": "slope along the track"}, 0.2
"""What may be held through each run and be another in the next, in words, and share of its variance that is then left
within runs [-]."""


class Uncatalogued(Effect):
    """A fault, and in words what it is like."""

    like: str
    slug = SLUG
    kind = "unknown"
    source = "definition"


class PullOffset(Uncatalogued):
    """The pull cell's zero is wrong."""

    form = "zero of drawbar_pull_N"
    equation = "DP reported = DP + DP_0"
    like = "a wrong zero of the drawbar pull's sensor"
    check = "read the pull cell with nothing on it"

    def __init__(self, usual_N: float) -> None:
        self.parameters = (Parameter("DP_0", "N", -2.0 * usual_N, 2.0 * usual_N, 0.0, 0.1 * usual_N),)

    def report(self, channels: np.ndarray, drive: Drive, values: np.ndarray) -> None:
        channels[:, PULL] += values[0]


class PullGain(Uncatalogued):
    """The pull cell's constant is wrong."""

    form = "gain of drawbar_pull_N"
    equation = "DP reported = (1 + g) DP"
    like = "a wrong gain of the drawbar pull's sensor"
    check = "hang a known weight on the pull cell"
    parameters = (Parameter("g", "", -0.8, 2.0, 0.0, 0.15),)

    def report(self, channels: np.ndarray, drive: Drive, values: np.ndarray) -> None:
        channels[:, PULL] *= 1.0 + values[0]


class SinkageGain(Uncatalogued):
    """The sinkage sensor's constant is wrong."""

    form = "gain of sinkage_m"
    equation = "z reported = (1 + g) z"
    like = "a wrong gain of the sinkage's sensor"
    check = "put gauge blocks under the sinkage's sensor"
    parameters = (Parameter("g", "", -0.8, 2.0, 0.0, 0.15),)

    def report(self, channels: np.ndarray, drive: Drive, values: np.ndarray) -> None:
        channels[:, SINKAGE] *= 1.0 + values[0]


class LoadOffset(Uncatalogued):
    """The load cell's zero is wrong."""

    form = "zero of load_N"
    equation = "W reported = W + W_0"
    like = "a wrong zero of the load cell"
    check = "read the load cell with the wheel in the air"

    def __init__(self, usual_N: float) -> None:
        self.parameters = (Parameter("W_0", "N", -0.5 * usual_N, 0.5 * usual_N, 0.0, 0.1 * usual_N),)

    def impose(self, imposed: np.ndarray, drive: Drive, values: np.ndarray) -> None:
        imposed[:, LOAD] = np.maximum(imposed[:, LOAD] - values[0], 1e-3 * imposed[:, LOAD])


class PullOfLoad(Uncatalogued):
    """A share of the load is in the pull: rails rub, or the cell is not level."""

    form = "load in drawbar_pull_N"
    equation = "DP reported = DP + s W"
    like = "a carriage that rubs on its rails, a pull cell that is not level, or ground that slopes"
    check = "level pull cell and ground, or give the pitch; drive the same once the other way"
    parameters = (Parameter("s", "", -0.5, 0.5, 0.0, 0.03),)

    def report(self, channels: np.ndarray, drive: Drive, values: np.ndarray) -> None:
        channels[:, PULL] += values[0] * drive.load_N


class PullInTorque(Uncatalogued):
    """The torque's sensor feels the pull."""

    form = "drawbar_pull_N in torque_Nm"
    equation = "T reported = T + l DP"
    like = "cross-talk of the drawbar pull into the torque"
    check = "pull at the locked wheel's axle with a known force, and read the torque"

    def __init__(self, radius_m: float) -> None:
        self.parameters = (Parameter("l", "m", -radius_m, radius_m, 0.0, 0.05 * radius_m),)

    def report(self, channels: np.ndarray, drive: Drive, values: np.ndarray) -> None:
        channels[:, TORQUE] += values[0] * channels[:, PULL]


class TorqueInPull(Uncatalogued):
    """The pull's sensor feels the torque."""

    form = "torque_Nm in drawbar_pull_N"
    equation = "DP reported = DP + s T / r"
    like = "cross-talk of the torque into the drawbar pull"
    check = "turn the locked wheel with a known torque, and read the pull"
    parameters = (Parameter("s", "", -1.0, 1.0, 0.0, 0.05),)

    def __init__(self, radius_m: float) -> None:
        self._radius_m = radius_m

    def report(self, channels: np.ndarray, drive: Drive, values: np.ndarray) -> None:
        channels[:, PULL] += values[0] * channels[:, TORQUE] / self._radius_m


class PullInSinkage(Uncatalogued):
    """What carries the sinkage's sensor bends as the wheel pulls."""

    form = "drawbar_pull_N in sinkage_m"
    equation = "z reported = z + c DP"
    like = "a frame that bends under the pull"
    check = "pull at the wheel with a known force on hard ground, and read the sinkage"

    def __init__(self, usual_m: float, usual_N: float) -> None:
        usual = usual_m / usual_N
        self.parameters = (Parameter("c", "m/N", -2.0 * usual, 2.0 * usual, 0.0, 0.1 * usual),)

    def report(self, channels: np.ndarray, drive: Drive, values: np.ndarray) -> None:
        channels[:, SINKAGE] += values[0] * channels[:, PULL]


class TorqueSaturates(Uncatalogued):
    """The torque's sensor, its amplifier or the drive's current comes to its end."""

    like = "a torque's sensor, or a drive's current, that saturates"
    check = "turn the locked wheel with known torques up to the largest"
    parameters = (Parameter("s", "", 0.0, 4.0, 0.0, 0.1),)

    def __init__(self, usual_Nm: float, form: str, power: float) -> None:
        self.form, self._power = form, power
        self.equation = f"T reported = T / (1 + s |T / T_usual|^{power:g})^(1/{power:g})"
        self.constants = {"T_usual": usual_Nm}

    def report(self, channels: np.ndarray, drive: Drive, values: np.ndarray) -> None:
        torque = channels[:, TORQUE]
        share = np.abs(torque / self.constants["T_usual"]) ** self._power
        channels[:, TORQUE] = torque * (1.0 + values[0] * share) ** (-1.0 / self._power)


def _zeros_by_run(channels: Sequence[int]) -> tuple[str, str]:
    """Name the form of zeros that differ from run to run in these channels, and say what it is like."""
    words = [_ZEROS[each].words for each in channels]
    told = " and ".join([", ".join(words[:-1]), words[-1]] if len(words) > 1 else words)
    form = f"zeros of {', '.join(CHANNELS[each] for each in channels)} by run"
    return form, f"zeros of the sensors of {told} that differ from run to run"


class ZerosByRun(Uncatalogued):
    """Zeros differ from run to run, as where sensors are read anew before each, or the surface is levelled anew."""

    by_run = True
    equation = "q reported = q + q_0, another one in each run"
    check = "read the sensors before and after each run, with the wheel just touching the ground"

    def __init__(self, channels: Sequence[int], typical: np.ndarray, drive: Drive) -> None:
        self.form, self.like = _zeros_by_run(channels)
        held = [words for name, words in _HELD.items() if drive.has(name) and _within_runs(drive, name) < _OWN]
        if held:
            self.like += f", or something that depends on the {' or the '.join(held)}, of which each run has its own"
        self._channels, self._runs = channels, np.unique(drive.stretch)
        answer = []
        for each in channels:
            zero, usual = _ZEROS[each], float(typical[each])
            names = [f"{zero.name} of run {number + 1}" for number in range(len(self._runs))]
            answer += [Parameter(name, zero.unit, -2.0 * usual, 2.0 * usual, 0.0, 0.1 * usual) for name in names]
        self.parameters = tuple(answer)

    def report(self, channels: np.ndarray, drive: Drive, values: np.ndarray) -> None:
        run = np.minimum(np.searchsorted(self._runs, drive.stretch), len(self._runs) - 1)
        # Of the zeros of a run that another drive would be nothing is known.
        known = self._runs[run] == drive.stretch
        for channel, zeros in zip(self._channels, values.reshape(len(self._channels), -1), strict=True):
            channels[:, channel] += np.where(known, zeros[run], 0.0)


def forms(situation: Situation) -> tuple[Uncatalogued, ...]:
    """Give the faults that these data can show."""
    faults: list[Uncatalogued] = []
    if situation.seen(PULL):
        faults += [PullOffset(float(situation.typical[PULL])), PullGain()]
    if situation.seen(SINKAGE):
        faults.append(SinkageGain())
    if situation.seen(LOAD) and situation.drive.has("load_N"):
        faults.append(LoadOffset(float(situation.typical[LOAD])))
        if situation.seen(PULL):
            faults.append(PullOfLoad())
    radius_m = situation.wheel.radius_m
    if situation.seen(TORQUE):
        usual_Nm = float(situation.typical[TORQUE])
        faults += [TorqueSaturates(usual_Nm, form, power) for form, power in _SATURATING.items()]
    if situation.seen(TORQUE, PULL):
        faults += [PullInTorque(radius_m), TorqueInPull(radius_m)]
    if situation.seen(SINKAGE, PULL):
        faults.append(PullInSinkage(float(situation.typical[SINKAGE]), float(situation.typical[PULL])))
    return (*faults, *_by_run(situation))


def _by_run(situation: Situation) -> list[ZerosByRun]:
    """Give zeros that differ from run to run in each channel, and in all of them; none where each run has its slip, for
    they would make up for any law of slip.
    """
    drive = situation.drive
    if not drive.timed or not 2 <= len(np.unique(drive.stretch)) <= _MOST_RUNS:
        return []
    if not drive.has("slip") or _within_runs(drive, "slip") < 1.0 - _OWN:
        return []
    seen = [channel for channel in _ZEROS if situation.seen(channel)]
    together = [seen] if len(seen) > 1 else []
    return [ZerosByRun(each, situation.typical, drive) for each in [*([one] for one in seen), *together]]


def _within_runs(drive: Drive, name: str) -> float:
    """Share of a covariate's variance that is within runs [-]."""
    values = getattr(drive, name)
    good = np.isfinite(values)
    values, run = values[good], np.unique(drive.stretch[good], return_inverse=True)[1]
    mean = np.bincount(run, values) / np.bincount(run)
    return float(np.var(values - mean[run]) / np.var(values))


LIKE = {
    each.form: each.like
    for each in (PullOffset, PullGain, SinkageGain, LoadOffset, PullOfLoad, PullInTorque, TorqueInPull, PullInSinkage)
} | dict.fromkeys(_SATURATING, TorqueSaturates.like)
LIKE |= dict(_zeros_by_run(some) for many in (1, 2, 3) for some in combinations(_ZEROS, many))
"""What each is like, by its form."""
