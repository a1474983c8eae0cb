"""Running gear and vehicle: the five effects of lugs, tyre, slope, inertia and drive train."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from .contact import Contact, Reaction
from .drives import TIMED, Drive
from .effect import PULL, TORQUE, Effect
from .scene import Scene


class Grousers(Effect):
    """Lugs move the shear surface outwards, bite, and make the forces ripple."""

    slug = "grousers"
    needs = frozenset({"wheel_angle_rad"})
    protocols = TIMED

    def __init__(self, rng: np.random.Generator, scene: Scene) -> None:
        super().__init__(rng, scene)
        self.variables = ("wheel_angle_rad",)
        self.sinusoid = rng.random() < 0.5
        self.count, self.height = scene.wheel.grouser_count, scene.wheel.grouser_height
        self.reach = rng.uniform(0.2, 0.8)
        self.phase = rng.uniform(0.0, 2.0 * np.pi)
        self.lead = rng.uniform(-0.6, 0.6)
        self.torque = rng.uniform(0.15, 0.4) * float(np.median(scene.reference.torque))
        self.pull = rng.uniform(0.5, 1.0) * self.torque / scene.wheel.radius
        self.weight, self.soil = rng.uniform(12e3, 19e3), scene.soil
        self.form = "shear radius r + lambda h, " + (
            "sinusoidal ripple at the lug count" if self.sinusoid else "passive bite of each lug in the soil"
        )

    def parameters(self, strength: float) -> dict[str, float]:
        common = {"lambda": self.reach * strength, "h": self.height, "count": float(self.count), "phase": self.phase}
        if self.sinusoid:
            return {**common, "torque_amplitude": self.torque * strength, "pull_amplitude": self.pull * strength}
        return {**common, "bite": 2.0 * strength, "gamma": self.weight}

    def contact(self, contact: Contact, drive: Drive, strength: float) -> None:
        contact.lug_reach = contact.lug_reach + self.reach * strength * self.height  # Ding et al. 2011

    def reaction(self, reaction: Reaction, contact: Contact, drive: Drive, strength: float) -> None:
        if self.sinusoid:  # Irani et al. 2011
            phase = self.count * drive.angle + self.phase
            reaction.torque = reaction.torque + strength * self.torque * np.sin(phase)
            reaction.pull = reaction.pull + strength * self.pull * np.sin(phase + self.lead)
            return
        # Each lug between entry and bottom-dead-centre is a small passive wall (Bekker 1960; McKyes 1985)
        spacing = 2.0 * np.pi / self.count
        nearest = np.mod(-(drive.angle + self.phase / self.count), spacing)
        earth = np.tan(np.pi / 4 + self.soil.friction_angle / 2) ** 2
        for number in range(int(np.ceil(np.max(reaction.entry_angle) / spacing))):
            at = nearest + number * spacing
            depth = np.maximum(contact.radius * (np.cos(at) - np.cos(reaction.entry_angle)), 0.0)
            buried = depth > 0.0
            edge = np.minimum(depth / (0.2 * self.height), 1.0)  # a lug bites as it enters, not at once
            wall = 0.5 * self.weight * self.height**2 * earth + self.weight * depth * self.height * earth
            wall = wall + 2.0 * self.soil.cohesion * self.height * np.sqrt(earth)
            bite = 2.0 * strength * contact.width * np.where(buried, wall * edge, 0.0)
            reaction.torque = reaction.torque + contact.radius * bite
            reaction.pull = reaction.pull + bite * np.cos(at)


class TyreDeflection(Effect):
    """The wheel flattens (substitute circle of Bolling 1987, Schmid 1995, Harnisch et al. 2005)."""

    slug = "tyre_deflection"

    def __init__(self, rng: np.random.Generator, scene: Scene) -> None:
        super().__init__(rng, scene)
        self.variables = ("load_N",)
        self.power = 1.0 if rng.random() < 0.5 else 2.0 / 3.0
        self.load = float(np.median(scene.drive.load))
        self.deepest = 0.15 * scene.wheel.radius
        self.form = "f = W / k_t" if self.power == 1.0 else "f = f0 (W / W0)^(2/3)"

    def parameters(self, strength: float) -> dict[str, float]:
        if self.power == 1.0:
            return {"k_t": self.load / max(self.deepest * strength, 1e-12)}
        return {"f0": self.deepest * strength, "W0": self.load}

    def contact(self, contact: Contact, drive: Drive, strength: float) -> None:
        contact.deflection = self.deepest * strength * (contact.load / self.load) ** self.power


class SlopeGravity(Effect):
    """On a slope, weight has a component along the track (statics)."""

    slug = "slope_gravity"
    needs = frozenset({"pitch_rad", PULL})

    def __init__(self, rng: np.random.Generator, scene: Scene) -> None:
        super().__init__(rng, scene)
        self.variables = ("pitch_rad",)
        self.channels = (PULL,)
        self.steepest = rng.uniform(0.15, 0.28)
        self.share = rng.uniform(0.8, 1.2)
        self.form = "DP - share W sin(pitch)"

    def parameters(self, strength: float) -> dict[str, float]:
        return {"share": self.share, "steepest_rad": self.steepest * strength}

    def drive(self, drive: Drive, strength: float) -> Drive:
        return replace(drive, pitch=drive.slopes * self.steepest * strength)

    def reaction(self, reaction: Reaction, contact: Contact, drive: Drive, strength: float) -> None:
        reaction.pull = reaction.pull - self.share * contact.load * np.sin(drive.pitch)


class Inertia(Effect):
    """Wheel and vehicle are accelerating (Newton)."""

    slug = "inertia"
    needs = frozenset({"wheel_speed_rad_s", "travel_speed_m_s"})
    protocols = ("speed",)

    def __init__(self, rng: np.random.Generator, scene: Scene) -> None:
        super().__init__(rng, scene)
        self.both = rng.random() < 0.5 and scene.has_pull
        self.variables = ("wheel_speed_rad_s", "travel_speed_m_s") if self.both else ("wheel_speed_rad_s",)
        self.channels = (TORQUE, PULL) if self.both else (TORQUE,)
        largest = max(float(np.quantile(np.abs(scene.drive.wheel_acceleration), 0.95)), 1e-9)
        self.wheel = rng.uniform(0.3, 0.6) * float(np.median(scene.reference.torque)) / largest
        self.mass = rng.uniform(0.5, 1.5) * self.wheel / scene.wheel.radius**2
        self.form = "T + J domega/dt" + (", DP - m dV/dt" if self.both else "")

    def parameters(self, strength: float) -> dict[str, float]:
        return {"J": self.wheel * strength, **({"m": self.mass * strength} if self.both else {})}

    def reaction(self, reaction: Reaction, contact: Contact, drive: Drive, strength: float) -> None:
        reaction.torque = reaction.torque + strength * self.wheel * drive.wheel_acceleration
        if self.both:
            reaction.pull = reaction.pull - strength * self.mass * drive.travel_acceleration


class DrivetrainFriction(Effect):
    """Torque measured at the motor includes gear and bearing losses (Armstrong-Helouvry 1994)."""

    slug = "drivetrain_friction"
    needs = frozenset({"wheel_speed_rad_s", PULL})
    protocols = ("speed", "table")

    def __init__(self, rng: np.random.Generator, scene: Scene) -> None:
        super().__init__(rng, scene)
        self.channels = (TORQUE,)
        torque = float(np.median(scene.reference.torque))
        self.coulomb = rng.uniform(0.05, 0.15) * torque
        self.by_speed = rng.random() < 0.6
        self.variables = ("wheel_speed_rad_s",) if self.by_speed else ("load_N",)
        self.viscous = rng.uniform(0.2, 0.4) * torque / float(np.max(scene.drive.wheel_speed))
        self.lever = rng.uniform(0.15, 0.35) * torque / float(np.median(scene.drive.load))
        self.form = "T_c + b omega" if self.by_speed else "T_c + mu r_b W"

    def parameters(self, strength: float) -> dict[str, float]:
        second = {"b": self.viscous * strength} if self.by_speed else {"mu_r_b": self.lever * strength}
        return {"T_c": self.coulomb * strength, **second}

    def reaction(self, reaction: Reaction, contact: Contact, drive: Drive, strength: float) -> None:
        second = self.viscous * drive.wheel_speed if self.by_speed else self.lever * contact.load
        reaction.torque = reaction.torque + strength * (self.coulomb + second)


VEHICLE_EFFECTS: tuple[type[Effect], ...] = (Grousers, TyreDeflection, SlopeGravity, Inertia, DrivetrainFriction)
