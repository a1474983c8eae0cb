"""Faults of a vehicle's instruments beyond those of the bench, and the catalogue of what drives can hide."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from .. import effects, effects_contact, effects_gear, effects_ground, effects_instrument
from ..drives import needs_of
from ..effects import Effect, Setting
from ..effects_instrument import Fault, WrongGain, WrongZero
from ..mechanics import Channels, Drive


class LoadOffset(WrongZero):
    """The zero of the load cell is wrong."""

    slug = "load_offset"
    channel, unit = "load_N", "N"
    channels = ("load_N", "torque_Nm", "sinkage_m", "drawbar_pull_N")
    variables = ("load_N", "slip", "sinkage_m")


class PullOffset(WrongZero):
    """The zero of the sensor of drawbar pull is wrong."""

    slug = "pull_offset"
    channel, unit = "drawbar_pull_N", "N"
    channels = ("drawbar_pull_N",)


class SinkageGain(WrongGain):
    """The constant of the sinkage sensor is wrong."""

    slug = "sinkage_gain"
    channel = "sinkage_m"
    channels = ("sinkage_m",)


@dataclass(frozen=True)
class TorqueSaturation(Fault):
    """The torque sensor, its amplifier or the drive's current reaches a limit.

    ``clipped``: the torque up to the limit, before the sensor's noise. ``rounded``: limit tanh(T/limit). The magnitude
    is how far the limit lies below the greatest torque, or the greatest torque over the limit.
    """

    slug = "torque_saturation"
    forms = ("clipped", "rounded")
    channels = ("torque_Nm",)
    variables = ("load_N", "slip", "sinkage_m")
    greatest_Nm: float = 1.0

    @classmethod
    def draw(cls, rng: np.random.Generator, setting: Setting, form: str) -> Self:
        """Take the greatest torque for the unit."""
        return cls(form, 0.0, greatest_Nm=float(np.abs(setting.textbook.torque_Nm).max()))

    @property
    def bounds(self) -> tuple[float, float]:
        """A limit down to 0.3 of the greatest torque."""
        return (0.0, 0.7) if self.form == "clipped" else (0.0, 1.5)

    def parameters(self) -> dict[str, float]:
        """Give the limit [N m]."""
        share = 1.0 - self.magnitude if self.form == "clipped" else 1.0 / max(self.magnitude, 1e-9)
        return {"limit_Nm": share * self.greatest_Nm}

    def reported(self, channels: Channels, drive: Drive) -> Channels:
        """Limit the torque."""
        limit = self.parameters()["limit_Nm"]
        torque = channels.torque_Nm
        limited = np.clip(torque, -limit, limit) if self.form == "clipped" else limit * np.tanh(torque / limit)
        return replace(channels, torque_Nm=limited)


GROUND: tuple[type[Effect], ...] = (
    *effects_ground.EFFECTS, *(kind for kind in effects_contact.EFFECTS if kind.slug != "rim_adhesion"),
)  # fmt: skip
"""Physics of the ground. A slippery rim is left out: refitting the soil of each ground absorbs it."""

VEHICLE: tuple[type[Effect], ...] = effects_gear.EFFECTS
"""Physics of the vehicle, of all its wheels."""

INSTRUMENTS: tuple[type[Effect], ...] = (
    *effects_instrument.EFFECTS, LoadOffset, PullOffset, SinkageGain, TorqueSaturation,
)  # fmt: skip
"""Faults of the instruments of all wheels or of one."""

NEEDS = {"load_offset": frozenset({"pull"}), "pull_offset": frozenset({"pull"})}

COMPARABLE = {
    ("load_offset", "constant"): {"W_0": ("offset_N", 0.0)},
    ("pull_offset", "constant"): {"DP_0": ("offset_N", 0.0)},
    ("sinkage_gain", "constant"): {"g": ("gain", -1.0)},
}
"""As `truth.COMPARABLE`."""


def catalogue() -> Mapping[str, type[Effect]]:
    """Give every effect that a drive can hide, by slug."""
    return {kind.slug: kind for kind in (*GROUND, *VEHICLE, *INSTRUMENTS)}


def draw_effect(slug: str, rng: np.random.Generator, setting: Setting, form: str | None = None) -> Effect:
    """Draw an effect of a slug, of any of its forms or of the one named."""
    return effects.draw_form(catalogue()[slug], rng, setting, form)


def belongs_to(slug: str) -> str:
    """Say whether an effect is one of the ground or one of the vehicle, its instruments included."""
    return "ground" if slug in {kind.slug for kind in GROUND} else "vehicle"


def needs(slugs: tuple[str, ...]) -> frozenset[str]:
    """Join what the effects need to be seen in a drive."""
    return needs_of(slugs).union(*(NEEDS.get(slug, frozenset()) for slug in slugs))
