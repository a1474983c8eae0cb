"""Faults of the instruments: what they report differs from what there is."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar, Self

import numpy as np
from scipy.signal import lfilter

from .effects import Effect, Setting
from .mechanics import ANSWERS, Channels, Drive, travel_ratio


@dataclass(frozen=True)
class Fault(Effect):
    """A fault, of either sign."""

    kind = "instrument"
    forms = ("constant",)

    @classmethod
    def draw(cls, rng: np.random.Generator, setting: Setting, form: str) -> Self:
        return cls(form, 0.0, float(rng.choice([-1.0, 1.0])))


@dataclass(frozen=True)
class WrongZero(Fault):
    """The zero of a sensor is wrong."""

    channel: ClassVar[str]
    unit: ClassVar[str]
    most: ClassVar[float] = 0.4
    """Largest offset, relative to the channel's usual size [-]."""
    variables = ("load_N", "slip", "constant", "sinkage_m")
    usual: float = 1.0

    @classmethod
    def draw(cls, rng: np.random.Generator, setting: Setting, form: str) -> Self:
        """Draw the sign."""
        return cls(form, 0.0, float(rng.choice([-1.0, 1.0])), cls.size(setting))

    @classmethod
    def size(cls, setting: Setting) -> float:
        """Usual size of the channel: its mean."""
        return float(np.abs(getattr(setting.textbook, cls.channel)).mean())

    @property
    def bounds(self) -> tuple[float, float]:
        """Relative to the channel's usual size."""
        return 0.0, self.most

    def parameters(self) -> dict[str, float]:
        """Give the offset."""
        return {f"offset_{self.unit}": self.sign * self.magnitude * self.usual}

    def reported(self, channels: Channels, drive: Drive) -> Channels:
        """Add the offset."""
        off = self.sign * self.magnitude * self.usual
        return replace(channels, **{self.channel: getattr(channels, self.channel) + off})


@dataclass(frozen=True)
class WrongGain(Fault):
    """The constant of a sensor is wrong."""

    channel: ClassVar[str]
    variables = ("load_N", "slip", "sinkage_m")

    @property
    def bounds(self) -> tuple[float, float]:
        """Logarithm of the gain: from half to twice."""
        return 0.0, 0.7

    def parameters(self) -> dict[str, float]:
        """Give the gain [-]."""
        return {"gain": float(np.exp(self.sign * self.magnitude))}

    def reported(self, channels: Channels, drive: Drive) -> Channels:
        """Multiply by the gain."""
        return replace(channels, **{self.channel: getattr(channels, self.channel) * self.parameters()["gain"]})


class TorqueOffset(WrongZero):
    """The torque sensor's zero is wrong."""

    slug = "torque_offset"
    channel, unit, most = "torque_Nm", "Nm", 0.6
    channels = ("torque_Nm",)

    @classmethod
    def size(cls, setting: Setting) -> float:
        """Range of the torque."""
        return setting.span("torque_Nm")


class SinkageOffset(WrongZero):
    """The sinkage sensor's zero is wrong."""

    slug = "sinkage_offset"
    channel, unit, most = "sinkage_m", "m", 0.6
    channels = ("sinkage_m",)


class TorqueGain(WrongGain):
    """The torque sensor's, or the motor's, constant is wrong."""

    slug = "torque_gain"
    channel = "torque_Nm"
    channels = ("torque_Nm",)


class LoadGain(WrongGain):
    """The load cell's constant, or the share of the weight that the wheel carries, is wrong."""

    slug = "load_gain"
    channel = "load_N"
    channels = ("load_N", "torque_Nm", "sinkage_m", "drawbar_pull_N")

    def inputs(self, load_N: np.ndarray, slip: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Undo the gain."""
        return load_N / self.parameters()["gain"], slip


@dataclass(frozen=True)
class RollingRadius(Fault):
    """Slip is computed with a wrong effective radius: the wheel rolls as one of radius r (1 + e)."""

    slug = "rolling_radius"
    channels = ("slip", "torque_Nm", "drawbar_pull_N", "sinkage_m")
    variables = ("slip",)

    @property
    def bounds(self) -> tuple[float, float]:
        """Up to 15 %."""
        return 0.0, 0.15

    def parameters(self) -> dict[str, float]:
        """Give the ratio of the true rolling radius to the stated one [-]."""
        return {"radius_ratio": 1.0 + self.sign * self.magnitude}

    def reported(self, channels: Channels, drive: Drive) -> Channels:
        """Report the slip that the stated radius gives."""
        return replace(channels, slip=_slip(travel_ratio(channels.slip) * self.parameters()["radius_ratio"]))

    def inputs(self, load_N: np.ndarray, slip: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Give the slip that the true rolling radius gives."""
        return load_N, _slip(travel_ratio(slip) / self.parameters()["radius_ratio"])


def _slip(ratio: np.ndarray) -> np.ndarray:
    """Give slip by the ratio V/(r omega)."""
    return np.where(ratio <= 1.0, 1.0 - ratio, 1.0 / ratio - 1.0)


@dataclass(frozen=True)
class TimeLag(Fault):
    """One channel arrives late: ``delay``, as it was; ``filter``, through a first-order low pass."""

    slug = "time_lag"
    forms = ("delay", "filter")
    channels = ANSWERS
    variables = ("time_s", "lag_s")
    channel: str = "torque_Nm"

    @classmethod
    def draw(cls, rng: np.random.Generator, setting: Setting, form: str) -> Self:
        return cls(form, 0.0, 1.0, str(rng.choice(ANSWERS if setting.pulls else ANSWERS[:2])))

    @property
    def bounds(self) -> tuple[float, float]:
        """Up to 4 s."""
        return 0.0, 4.0

    def parameters(self) -> dict[str, float]:
        """Give the lag [s]."""
        return {"lag_s": self.magnitude}

    def reported(self, channels: Channels, drive: Drive) -> Channels:
        values, time = getattr(channels, self.channel), drive.time_s
        if self.form == "delay":
            late = np.interp(time - self.magnitude, time, values)
        else:
            step = float(np.median(np.diff(time)))
            share = -np.expm1(-step / max(self.magnitude, 1e-9))
            # In a pause between passes it settles.
            runs = np.split(values, np.flatnonzero(np.diff(time) > 5.0 * step) + 1)
            late = np.concatenate([
                lfilter([share], [1.0, share - 1.0], run, zi=[(1.0 - share) * run[0]])[0] for run in runs
            ])  # fmt: skip
        return replace(channels, **{self.channel: late})


@dataclass(frozen=True)
class Drift(Fault):
    """A channel wanders: ``linear`` in time, ``warm_up`` (1 - exp(-t/tau)), or a smooth ``wander``."""

    slug = "drift"
    forms = ("linear", "warm_up", "wander")
    channels = ANSWERS
    variables = ("time_s",)
    channel: str = "torque_Nm"
    span: float = 1.0
    shape: tuple[float, ...] = (0.3,)

    @classmethod
    def draw(cls, rng: np.random.Generator, setting: Setting, form: str) -> Self:
        """Draw channel, sign, and the constant of the warm-up or the waves of the wandering."""
        channel = str(rng.choice(ANSWERS if setting.pulls else ANSWERS[:2]))
        waves = rng.normal(size=3) / np.array([1.0, 2.0, 3.0])
        shape = (float(rng.uniform(0.1, 0.4)),) if form == "warm_up" else tuple(waves.tolist())
        return cls(form, 0.0, float(rng.choice([-1.0, 1.0])), channel, setting.span(channel), shape)

    @property
    def bounds(self) -> tuple[float, float]:
        """Up to 0.6 of the channel's range."""
        return 0.0, 0.6

    def parameters(self) -> dict[str, float]:
        """Give how far the channel is off in the end, or at most [its unit]."""
        name = "end" if self.form != "wander" else "size"
        return {name: self.sign * self.magnitude * self.span}

    def reported(self, channels: Channels, drive: Drive) -> Channels:
        part = (drive.time_s - drive.time_s[0]) / np.ptp(drive.time_s)
        if self.form == "linear":
            course = part
        elif self.form == "warm_up":
            course = -np.expm1(-part / self.shape[0])
        else:
            waves = np.arange(len(self.shape))[:, None]
            course = np.array(self.shape) @ np.sin((0.5 + waves) * np.pi * part + waves)
            course = (course - course[0]) / max(float(np.abs(course - course[0]).max()), 1e-9)
        off = self.sign * self.magnitude * self.span * course
        return replace(channels, **{self.channel: getattr(channels, self.channel) + off})


EFFECTS: tuple[type[Effect], ...] = (
    TorqueOffset, TorqueGain, LoadGain, SinkageOffset, RollingRadius, TimeLag, Drift,
)  # fmt: skip
