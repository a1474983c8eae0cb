"""What an effect is, and the catalogue of those that can be hidden (PHYSICS.md), by their public slugs."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import ClassVar, Self

import numpy as np

from .mechanics import Body, Change, Channels, Drive, Ground

GRAVITY = 9.81
"""[m/s2]."""


@dataclass(frozen=True)
class Setting:
    """What an effect is drawn for: the wheel, its soil and drive, and what the textbook's wheel would answer."""

    body: Body
    ground: Ground
    drive: Drive
    textbook: Channels
    pulls: bool
    """Whether drawbar pull is recorded."""

    def span(self, channel: str) -> float:
        """Give the range of a channel of the textbook's wheel, or a tenth of its size where that is more."""
        values = getattr(self.textbook, channel)
        return float(max(np.ptp(values), 0.1 * np.abs(values).max()))


@dataclass(frozen=True)
class Effect(Change, ABC):
    """A change with a name and a magnitude.

    Parameters
    ----------
    form
        Which published form; one of `forms`.
    magnitude
        Its strength, in the unit of the form's first parameter, 0 or more.
    sign
        +1 or -1, where the effect can go either way.
    """

    slug: ClassVar[str]
    kind: ClassVar[str] = "physics"
    forms: ClassVar[tuple[str, ...]]
    channels: ClassVar[tuple[str, ...]]
    """The channels where it shows: right answers to where the mismatch lives."""
    variables: ClassVar[tuple[str, ...]]
    """What its mismatch depends on: right answers likewise."""

    form: str
    magnitude: float
    sign: float = 1.0

    @property
    @abstractmethod
    def bounds(self) -> tuple[float, float]:
        """Least and greatest magnitude that is physically plausible."""

    @classmethod
    def draw(cls, rng: np.random.Generator, setting: Setting, form: str) -> Self:
        """Draw everything but the magnitude, which is 1 % of what is plausible."""
        return cls(form, 0.0)

    @abstractmethod
    def parameters(self) -> dict[str, float]:
        """Give the true parameters by name, SI."""

    def inputs(self, load_N: np.ndarray, slip: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Give the true load and slip of reported ones, as they are if this effect is all that is wrong with them."""
        return load_N, slip

    def scaled(self, magnitude: float) -> Self:
        """Give the same effect with another magnitude."""
        return replace(self, magnitude=float(magnitude))


def catalogue() -> Mapping[str, type[Effect]]:
    """Give every effect that can be hidden, by slug, in the order of PHYSICS.md."""
    from . import effects_contact, effects_gear, effects_ground, effects_instrument

    modules = (effects_ground, effects_contact, effects_gear, effects_instrument)
    found = [kind for module in modules for kind in module.EFFECTS]
    return {kind.slug: kind for kind in found}


def draw_effect(slug: str, rng: np.random.Generator, setting: Setting, form: str | None = None) -> Effect:
    """Draw an effect of a slug, of any of its forms or of the one named."""
    return draw_form(catalogue()[slug], rng, setting, form)


def draw_form(kind: type[Effect], rng: np.random.Generator, setting: Setting, form: str | None = None) -> Effect:
    """Draw an effect of a kind, of any of its forms or of the one named."""
    chosen = form if form is not None else str(rng.choice(kind.forms))
    if chosen not in kind.forms:
        raise ValueError(f"{kind.slug} has no form {chosen!r}, only {', '.join(kind.forms)}")
    return kind.draw(rng, setting, chosen)
