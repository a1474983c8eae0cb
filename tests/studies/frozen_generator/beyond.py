"""Causes outside of the list of effects: real mismatches which nothing listed explains."""

from __future__ import annotations

import numpy as np

from .contact import Array, Contact, Reaction
from .drives import TIMED, Drive
from .effect import PULL, SINKAGE, TORQUE, Effect, span
from .instrument_effects import first_order
from .scene import Scene

CONTIGUOUS = ("bench", "field", "speed")


class Beyond(Effect):
    """Base: its public name is always "beyond", its own name is in the form."""

    slug = "beyond"


class Crust(Beyond):
    """A dry crust on top carries at first, then breaks (ground with a weak interior: after Wong 2010, muskeg)."""

    def __init__(self, rng: np.random.Generator, scene: Scene) -> None:
        super().__init__(rng, scene)
        self.form = "crust: p + p_c (z/h) e^(1 - z/h)"
        self.variables = ("sinkage_m", "load_N")
        self.depth = rng.uniform(0.1, 0.35) * float(np.median(scene.reference.sinkage))
        self.size = rng.uniform(1.0, 2.0) * scene.mean_pressure

    def parameters(self, strength: float) -> dict[str, float]:
        return {"p_c": self.size * strength, "h": self.depth}

    def contact(self, contact: Contact, drive: Drive, strength: float) -> None:
        def crust(depth: Array, pressure: Array) -> Array:
            return pressure + self.size * strength * depth / self.depth * np.exp(1.0 - depth / self.depth)

        contact.pressure_terms.append(crust)


class CurvedEnvelope(Beyond):
    """Strength rises less than in proportion to stress (power-law envelope: de Mello 1977, Lade 2010)."""

    def __init__(self, rng: np.random.Generator, scene: Scene) -> None:
        super().__init__(rng, scene)
        self.form = "curved envelope: tau_max = c + s_0 tan phi (sigma / s_0)^m"
        self.variables = ("load_N",)
        self.stress = scene.mean_pressure
        self.friction = float(np.tan(scene.soil.friction_angle))

    def parameters(self, strength: float) -> dict[str, float]:
        return {"m": 1.0 - 0.6 * strength, "s_0": self.stress}

    def contact(self, contact: Contact, drive: Drive, strength: float) -> None:
        def envelope(stress: Array, limit: Array) -> Array:
            friction = contact.tan_friction[:, None]
            return limit - stress * friction + self.stress * friction * (stress / self.stress) ** (1.0 - 0.6 * strength)

        contact.strength = envelope


class DryingGround(Beyond):
    """The whole ground dries after a rain front has passed: soil changes with time, not with place."""

    protocols = TIMED

    def __init__(self, rng: np.random.Generator, scene: Scene) -> None:
        super().__init__(rng, scene)
        self.form = "drying: stiffness and c grow like exp(a (1 - e^(-t/tau)))"
        self.variables = ("time_s",)
        self.duration = float(np.ptp(scene.drive.time)) * rng.uniform(0.2, 0.6)
        self.growth = rng.uniform(0.4, 1.0, 2)

    def parameters(self, strength: float) -> dict[str, float]:
        return {"a_stiffness": self.growth[0] * strength, "a_c": self.growth[1] * strength, "tau": self.duration}

    def contact(self, contact: Contact, drive: Drive, strength: float) -> None:
        dried = -np.expm1(-drive.time / self.duration) * strength
        contact.stiffness = contact.stiffness * np.exp(self.growth[0] * dried)
        contact.cohesion = contact.cohesion * np.exp(self.growth[1] * dried)


class ShaftCompliance(Beyond):
    """A torsionally soft shaft rings after each change of torque (second-order response)."""

    protocols = CONTIGUOUS
    history = True

    def __init__(self, rng: np.random.Generator, scene: Scene) -> None:
        super().__init__(rng, scene)
        self.form = "soft shaft: overshooting second-order response of the torque"
        self.channels, self.variables = (TORQUE,), ("time_s",)
        self.damping = rng.uniform(0.08, 0.2)

    def parameters(self, strength: float) -> dict[str, float]:
        return {"period_s": 5.0 * strength, "damping": self.damping}

    def reading(self, reaction: Reaction, drive: Drive, strength: float) -> None:
        substeps = 8
        step = float(np.median(np.diff(drive.time))) / substeps
        stiffness = 2.0 * np.pi / max(5.0 * strength, 16.0 * step)
        twist, rate = float(reaction.torque[0]), 0.0
        out = np.empty_like(reaction.torque)
        for row, target in enumerate(reaction.torque.tolist()):
            for _ in range(substeps):
                rate += step * stiffness * (stiffness * (target - twist) - 2.0 * self.damping * rate)
                twist += step * rate
            out[row] = twist
        reaction.torque = out


class WheelEccentricity(Beyond):
    """The axle sits off the centre of the rim: sinkage and torque ripple once a turn."""

    protocols = TIMED
    needs = frozenset({"wheel_angle_rad"})

    def __init__(self, rng: np.random.Generator, scene: Scene) -> None:
        super().__init__(rng, scene)
        self.form = "eccentric wheel: z + e cos(angle), T + W e sin(angle)"
        self.channels, self.variables = (SINKAGE, TORQUE), ("wheel_angle_rad",)
        self.size = 0.3 * float(np.median(scene.reference.sinkage))
        self.phase = rng.uniform(0.0, 6.28)

    def parameters(self, strength: float) -> dict[str, float]:
        return {"e": self.size * strength, "phase": self.phase}

    def reading(self, reaction: Reaction, drive: Drive, strength: float) -> None:
        throw = self.size * strength
        reaction.sinkage = reaction.sinkage + throw * np.cos(drive.angle + self.phase)
        reaction.torque = reaction.torque + throw * drive.load * np.sin(drive.angle + self.phase)


class ThermalGain(Beyond):
    """The torque sensor warms with the work done through it, and its gain follows."""

    kind = "instrument"
    protocols = CONTIGUOUS
    history = True

    def __init__(self, rng: np.random.Generator, scene: Scene) -> None:
        super().__init__(rng, scene)
        self.form = "thermal gain: T (1 - g q), q the low-passed power over its median"
        self.channels, self.variables = (TORQUE,), ("time_s", "wheel_speed_rad_s", TORQUE)
        self.seconds = rng.uniform(0.1, 0.3) * float(np.ptp(scene.drive.time))

    def parameters(self, strength: float) -> dict[str, float]:
        return {"g": 0.35 * strength, "tau": self.seconds}

    def reading(self, reaction: Reaction, drive: Drive, strength: float) -> None:
        power = reaction.torque * drive.wheel_speed
        power[0] = 0.0  # starts cold
        warmth = first_order(power, drive.time, self.seconds) / max(float(np.median(np.abs(power))), 1e-12)
        reaction.torque = reaction.torque * (1.0 - 0.35 * strength * np.clip(warmth, 0.0, 2.0))


class PullHysteresis(Beyond):
    """Friction in the pull sensor's guide: it follows only beyond a play (backlash operator of Krasnosel'skii 1989)."""

    kind = "instrument"
    protocols = CONTIGUOUS
    needs = frozenset({PULL})
    history = True

    def __init__(self, rng: np.random.Generator, scene: Scene) -> None:
        super().__init__(rng, scene)
        self.form = "hysteresis: play operator of half-width h on the drawbar pull"
        self.channels, self.variables = (PULL,), ("time_s", PULL)
        self.width = 0.3 * span(scene.reference.pull)

    def parameters(self, strength: float) -> dict[str, float]:
        return {"h": self.width * strength}

    def reading(self, reaction: Reaction, drive: Drive, strength: float) -> None:
        half = self.width * strength
        out = np.array(reaction.pull)
        for row in range(1, len(out)):
            out[row] = min(max(out[row - 1], out[row] - half), out[row] + half)
        reaction.pull = out


class TorqueSaturation(Beyond):
    """The torque reading bends off towards the end of its range."""

    kind = "instrument"

    def __init__(self, rng: np.random.Generator, scene: Scene) -> None:
        super().__init__(rng, scene)
        self.form = "saturation: T above T_s shown as T_s + (T - T_s)(1 - a)"
        self.channels, self.variables = (TORQUE,), (TORQUE,)
        self.knee = float(np.quantile(scene.reference.torque, rng.uniform(0.4, 0.7)))

    def parameters(self, strength: float) -> dict[str, float]:
        return {"T_s": self.knee, "a": 0.95 * strength}

    def reading(self, reaction: Reaction, drive: Drive, strength: float) -> None:
        reaction.torque = reaction.torque - 0.95 * strength * np.maximum(reaction.torque - self.knee, 0.0)


class CrossTalk(Beyond):
    """Torque leaks into the sinkage sensor's bracket, which twists with it."""

    kind = "instrument"

    def __init__(self, rng: np.random.Generator, scene: Scene) -> None:
        super().__init__(rng, scene)
        self.form = "cross talk: z + s T"
        self.channels, self.variables = (SINKAGE,), (TORQUE,)
        sign = float(rng.choice([-1.0, 1.0]))
        self.size = 0.6 * sign * span(scene.reference.sinkage) / span(scene.reference.torque)

    def parameters(self, strength: float) -> dict[str, float]:
        return {"s": self.size * strength}

    def reading(self, reaction: Reaction, drive: Drive, strength: float) -> None:
        reaction.sinkage = reaction.sinkage + self.size * strength * reaction.torque


BEYOND: tuple[type[Effect], ...] = (
    Crust,
    ShaftCompliance,
    DryingGround,
    ThermalGain,
    WheelEccentricity,
    CurvedEnvelope,
    PullHysteresis,
    TorqueSaturation,
    CrossTalk,
)
