"""Faults of the instruments: seven effects that are no physics of the ground."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from .contact import Array, Contact, Reaction
from .drives import TIMED, Drive
from .effect import FIELD_OF, PULL, SINKAGE, TORQUE, Effect, span
from .scene import Scene


class Fault(Effect):
    """Base of the instruments' faults."""

    kind: ClassVar[str] = "instrument"

    def __init__(self, rng: np.random.Generator, scene: Scene) -> None:
        super().__init__(rng, scene)
        self.sign = float(rng.choice([-1.0, 1.0]))


class TorqueOffset(Fault):
    """Bias of the torque."""

    slug = "torque_offset"

    def __init__(self, rng: np.random.Generator, scene: Scene) -> None:
        super().__init__(rng, scene)
        self.form, self.channels = "T + T0", (TORQUE,)
        self.size = 0.4 * self.sign * float(np.median(scene.reference.torque))

    def parameters(self, strength: float) -> dict[str, float]:
        return {"T0": self.size * strength}

    def reading(self, reaction: Reaction, drive: Drive, strength: float) -> None:
        reaction.torque = reaction.torque + self.size * strength


class TorqueGain(Fault):
    """Wrong constant of the torque."""

    slug = "torque_gain"
    needs = frozenset({PULL})

    def __init__(self, rng: np.random.Generator, scene: Scene) -> None:
        super().__init__(rng, scene)
        self.form, self.channels, self.variables = "T (1 + g)", (TORQUE,), (TORQUE,)

    def parameters(self, strength: float) -> dict[str, float]:
        return {"g": 0.4 * self.sign * strength}

    def reading(self, reaction: Reaction, drive: Drive, strength: float) -> None:
        reaction.torque = reaction.torque * (1.0 + 0.4 * self.sign * strength)


class LoadGain(Fault):
    """Load cell or mass distribution wrong."""

    slug = "load_gain"
    needs = frozenset({PULL})
    first = True

    def __init__(self, rng: np.random.Generator, scene: Scene) -> None:
        super().__init__(rng, scene)
        self.form, self.channels, self.variables = "W indicated = W (1 + g)", ("load_N",), ("load_N",)

    def parameters(self, strength: float) -> dict[str, float]:
        return {"g": 0.3 * self.sign * strength}

    def contact(self, contact: Contact, drive: Drive, strength: float) -> None:
        contact.load = contact.load / (1.0 + 0.3 * self.sign * strength)


class SinkageOffset(Fault):
    """Wrong zero of the sinkage."""

    slug = "sinkage_offset"

    def __init__(self, rng: np.random.Generator, scene: Scene) -> None:
        super().__init__(rng, scene)
        self.form, self.channels = "z + z0", (SINKAGE,)
        lowest = float(np.quantile(scene.reference.sinkage, 0.05))
        self.size = 0.4 * float(np.median(scene.reference.sinkage)) if self.sign > 0 else -0.7 * lowest

    def parameters(self, strength: float) -> dict[str, float]:
        return {"z0": self.size * strength}

    def reading(self, reaction: Reaction, drive: Drive, strength: float) -> None:
        reaction.sinkage = reaction.sinkage + self.size * strength


class RollingRadius(Fault):
    """Slip computed with a wrong effective radius."""

    slug = "rolling_radius"
    needs = frozenset({PULL})
    first = True

    def __init__(self, rng: np.random.Generator, scene: Scene) -> None:
        super().__init__(rng, scene)
        self.form = "1 - i = (1 - i indicated) / (1 + e)"
        self.channels, self.variables = ("slip",), ("slip",)
        lowest = float(np.min(scene.drive.slip))
        self.size = 0.12 if self.sign > 0 else -min(0.12, 0.95 * lowest)

    def parameters(self, strength: float) -> dict[str, float]:
        return {"e": self.size * strength}

    def contact(self, contact: Contact, drive: Drive, strength: float) -> None:
        contact.slip = 1.0 - (1.0 - contact.slip) / (1.0 + self.size * strength)


def delayed(values: Array, time: Array, seconds: float) -> Array:
    """The values as they were `seconds` ago."""
    return np.interp(time - seconds, time, values)


def first_order(values: Array, time: Array, seconds: float) -> Array:
    """The values after a first-order low pass, exact for a held input."""
    out = np.array(values, dtype=float)
    keep = np.exp(-np.diff(time, prepend=time[0]) / max(seconds, 1e-9))
    for row in range(1, len(out)):
        out[row] = keep[row] * out[row - 1] + (1.0 - keep[row]) * values[row]
    return out


class TimeLag(Fault):
    """One channel arrives late."""

    slug = "time_lag"
    protocols = ("bench", "field", "speed")
    history = True

    def __init__(self, rng: np.random.Generator, scene: Scene) -> None:
        super().__init__(rng, scene)
        self.channel = str(rng.choice(scene.answered))
        self.channels, self.variables = (self.channel,), ("time_s",)
        self.pure = rng.random() < 0.6
        self.form = "pure delay" if self.pure else "first-order lag"

    def parameters(self, strength: float) -> dict[str, float]:
        return {"delay_s" if self.pure else "lag_s": 2.0 * strength}

    def reading(self, reaction: Reaction, drive: Drive, strength: float) -> None:
        late = delayed if self.pure else first_order
        name = FIELD_OF[self.channel]
        setattr(reaction, name, late(getattr(reaction, name), drive.time, 2.0 * strength))


class Drift(Fault):
    """A channel wanders with time or temperature."""

    slug = "drift"
    protocols = TIMED

    def __init__(self, rng: np.random.Generator, scene: Scene) -> None:
        super().__init__(rng, scene)
        self.channel = str(rng.choice(scene.answered))
        self.channels, self.variables = (self.channel,), ("time_s",)
        self.size = 0.35 * self.sign * span(getattr(scene.reference, FIELD_OF[self.channel]))
        self.start, self.duration = float(scene.drive.time[0]), float(np.ptp(scene.drive.time))
        self.shape = str(rng.choice(["linear", "warm-up", "wander"]))
        self.pace = rng.uniform(0.15, 0.4) if self.shape == "warm-up" else rng.uniform(0.8, 2.0)
        self.form = {
            "linear": "d t / T",
            "warm-up": "d (1 - e^(-t / (q T)))",
            "wander": "d sin(2 pi q t / T) / 2",
        }[self.shape] + ", T the duration"

    def parameters(self, strength: float) -> dict[str, float]:
        return {"d": self.size * strength, "T": self.duration, "q": self.pace}

    def reading(self, reaction: Reaction, drive: Drive, strength: float) -> None:
        share = (drive.time - self.start) / self.duration
        if self.shape == "warm-up":
            share = -np.expm1(-share / self.pace)
        elif self.shape == "wander":
            share = 0.5 * np.sin(2.0 * np.pi * self.pace * share)
        name = FIELD_OF[self.channel]
        setattr(reaction, name, getattr(reaction, name) + self.size * strength * share)


INSTRUMENT_EFFECTS: tuple[type[Effect], ...] = (
    TorqueOffset,
    TorqueGain,
    LoadGain,
    SinkageOffset,
    RollingRadius,
    TimeLag,
    Drift,
)
