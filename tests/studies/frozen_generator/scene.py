"""A scene: wheel, soil and drive, and the model that joins them with hidden effects."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from .contact import Array, Reaction, Soil, Wheel, solve, stiffness_for, textbook_contact
from .drives import Drive, draw_drive

if TYPE_CHECKING:
    from .effect import Effect

Hidden = Sequence[tuple["Effect", float]]
TORQUE, SINKAGE, PULL = "torque_Nm", "sinkage_m", "drawbar_pull_N"


class Unsuitable(Exception):
    """The drawn wheel, soil and drive do not go together."""


@dataclass(frozen=True)
class Ground:
    """How the ground varies along the track: factors of stiffness and of strength, their spread and length."""

    stiffness: Array
    strength: Array
    stiffness_sd: float = 0.0
    strength_sd: float = 0.0
    length: float = 0.0


@dataclass(frozen=True)
class Scene:
    """What is driven on what and how, and what the textbook would answer."""

    wheel: Wheel
    soil: Soil
    drive: Drive
    reference: Reaction
    mean_pressure: float
    has_pull: bool

    @property
    def answered(self) -> tuple[str, ...]:
        """Channels that the wheel answers and that are recorded."""
        return (TORQUE, SINKAGE, PULL) if self.has_pull else (TORQUE, SINKAGE)


def predict(
    wheel: Wheel,
    soil: Soil,
    drive: Drive,
    hidden: Hidden = (),
    ground: Ground | None = None,
    guess: Array | None = None,
) -> Reaction:
    """Noise-free readings of the wheel on the soil with the effects at their strengths.

    The drive holds what load cell and slip meter show; faults of theirs change what the contact feels.
    """
    hidden = sorted(hidden, key=lambda pair: not pair[0].first)
    contact = textbook_contact(wheel, soil, drive.load, drive.slip)
    if ground is not None:
        contact.stiffness = contact.stiffness * ground.stiffness
        contact.cohesion = contact.cohesion * ground.strength
        contact.tan_friction = contact.tan_friction * ground.strength
    for effect, strength in hidden:
        effect.contact(contact, drive, strength)
    reaction = solve(contact, guess, intervals=20)
    for effect, strength in hidden:
        effect.reaction(reaction, contact, drive, strength)
    for effect, strength in hidden:
        effect.reading(reaction, drive, strength)
    return reaction


def draw_wheel(rng: np.random.Generator, lugs: bool) -> Wheel:
    """A wheel of 0.06 to 0.5 m radius."""
    radius = float(np.exp(rng.uniform(np.log(0.06), np.log(0.5))))
    width = radius * float(rng.uniform(0.4, 1.1))
    if not lugs:
        return Wheel(round(radius, 4), round(width, 4))
    return Wheel(
        round(radius, 4), round(width, 4), round(radius * rng.uniform(0.04, 0.12), 4), int(rng.integers(8, 25))
    )


def draw_scene(rng: np.random.Generator, protocol: str, *, lugs: bool, laps: bool, has_pull: bool) -> Scene:
    """A scene within the bounds of pressure (3 to 80 kPa) and of sinkage (2 to 35 % of the radius)."""
    wheel = draw_wheel(rng, lugs)
    pressure = float(np.exp(rng.uniform(np.log(5e3), np.log(50e3))))
    depth = wheel.radius * float(np.exp(rng.uniform(np.log(0.05), np.log(0.2))))
    load = pressure * wheel.width * wheel.radius * float(np.sin(np.arccos(1.0 - depth / wheel.radius)))
    soil = Soil(
        cohesion=pressure * float(rng.uniform(0.01, 0.25)),
        friction_angle=float(np.deg2rad(rng.uniform(20.0, 38.0))),
        shear_modulus=wheel.radius * float(np.exp(rng.uniform(np.log(0.03), np.log(0.15)))),
        stiffness=1.0,
        exponent=float(rng.uniform(0.55, 1.3)),
    )
    soil = replace(soil, stiffness=stiffness_for(wheel, soil, load, 0.25, depth))
    if soil.stiffness <= 0.0:
        raise Unsuitable
    drive = draw_drive(rng, protocol, wheel, load, laps=laps)
    reference = predict(wheel, soil, drive)
    scene = Scene(wheel, soil, drive, reference, pressure, has_pull)
    if not plausible(scene, reference):
        raise Unsuitable
    return scene


def plausible(scene: Scene, reaction: Reaction) -> bool:
    """Do pressures and sinkages stay within bounds?"""
    share = np.quantile(reaction.sinkage / scene.wheel.radius, [0.02, 0.98])
    area = scene.wheel.width * scene.wheel.radius * np.sin(reaction.entry_angle)
    pressure = np.quantile(scene.drive.load / area, [0.02, 0.98])
    inside = share[0] > 0.018 and share[1] < 0.36 and pressure[0] > 2.5e3 and pressure[1] < 90e3
    return bool(inside and np.quantile(reaction.torque, 0.02) > 0.0 and np.max(reaction.entry_angle) < 1.4)
