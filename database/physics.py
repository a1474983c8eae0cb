"""Physics of classes of ground: what the textbook wheel lacked there, found by somebody at some time."""

from __future__ import annotations

import json
import math
import uuid
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from functools import cached_property
from typing import Any

import numpy as np

from ..framework.core.arguments import refused
from ..framework.core.errors import InputError
from ..framework.core.soil import Quantity
from ..identification.effects.ensemble import errors_of_fit
from ..identification.effects.stored import AugmentedSimulator, Estimated
from .posterior import LEAST_SCATTER, PRIOR_VARIATION, ClassSoil, RandomEffects, other_parameters

_NAMESPACE = uuid.UUID("0d9a6d0c-6f4e-5d63-8a51-2c1b7f0f3a42")
_LONGEST_NAME, _LONGEST_SOURCE = 200, 4096
"""Letters of a name, and of a source: a path may be as long."""

LEAST_PROBABILITY = 0.5
"""Probability of each effect from which on what was found is kept with a class [-]: less likely than not is a guess."""


@dataclass(frozen=True)
class ClassPhysics:
    """An augmented simulator that was found on ground of one class.

    Parameters
    ----------
    class_name
        The class.
    physics
        Soil and effects.
    source
        Where it came from: a recording's name, a paper.
    observed_at
        When; a time without a zone is taken as UTC.
    site
        The site that it holds at; empty for ground of the class anywhere.

    Raises
    ------
    InputError
        A name that is empty, too long or no text, physics that is none, or a time that is none.
    """

    class_name: str
    physics: AugmentedSimulator
    source: str
    observed_at: datetime
    site: str = ""

    def __post_init__(self) -> None:
        for name, least, most in (("class_name", 1, _LONGEST_NAME), ("source", 0, _LONGEST_SOURCE),
                                  ("site", 0, _LONGEST_NAME)):  # fmt: skip
            value = getattr(self, name)
            if not isinstance(value, str) or not least <= len(value.strip()) <= len(value) <= most or not _text(value):
                raise InputError(name, ascii(value)[:80], expected=f"text of {least} to {most} letters")
        if not isinstance(self.physics, AugmentedSimulator):
            raise refused("physics", self.physics, "an AugmentedSimulator, as `physics` of what explain answers")
        if not isinstance(self.observed_at, datetime):
            raise InputError("observed_at", f"{self.observed_at!r}"[:80], expected="a datetime")
        zone = self.observed_at.tzinfo or UTC
        try:
            object.__setattr__(self, "observed_at", self.observed_at.replace(tzinfo=zone).astimezone(UTC))
        except OverflowError as error:
            raise InputError("observed_at", str(self.observed_at), expected="a time of the years 1 to 9999") from error

    @cached_property
    def id(self) -> uuid.UUID:
        """Identity: UUID 5 of everything that it holds."""
        key = [self.class_name, self.site, self.source, self.observed_at.astimezone(UTC).isoformat(),
               self.physics.to_json()]  # fmt: skip
        return uuid.uuid5(_NAMESPACE, json.dumps(key, ensure_ascii=True, sort_keys=True, separators=(",", ":")))


def check_likely(physics: AugmentedSimulator, source: str) -> None:
    """Refuse what was found without being likely; raises `InputError`."""
    for effect in physics.effects:
        if effect.probability < LEAST_PROBABILITY:
            raise InputError(source, f"{effect.slug} is there with probability {effect.probability:.6g}",
                             expected=f"{LEAST_PROBABILITY:g} or more: what cannot be told is nothing to plan on"
                             )  # fmt: skip


def sound_physics(physics: AugmentedSimulator, source: str) -> AugmentedSimulator:
    """Give physics number by number as it is read back, and likely; raises `InputError` where it is not sound."""
    try:
        document = physics.to_json()
    except (AttributeError, KeyError, TypeError, ValueError) as error:
        raise InputError(
            source, f"{type(error).__name__} {error}"[:120], expected="soil and effects as numbers"
        ) from None
    sound = AugmentedSimulator.from_json(document, source)
    check_likely(sound, source)
    return sound


def _text(value: str) -> bool:
    """Say whether every database takes it: it is of characters, none of which is zero."""
    return "\0" not in value and not any("\ud800" <= letter <= "\udfff" for letter in value)


def physics_row(found: ClassPhysics) -> dict[str, Any]:
    """The `class_physics` row."""
    return {
        "id": found.id,
        "class_name": found.class_name,
        "site": found.site,
        "source": found.source,
        "observed_at": found.observed_at,
        "physics": found.physics.to_json(),
    }


def class_physics(row: Any, database: str) -> ClassPhysics:
    """Read a `class_physics` row; raises `InputError` where somebody wrote what is no physics."""
    physics = AugmentedSimulator.from_json(row.physics, f"{database}, physics of {row.class_name}")
    return ClassPhysics(row.class_name, physics, row.source, row.observed_at, row.site)


def about_physics(soil: ClassSoil, physics: AugmentedSimulator) -> ClassSoil:
    """Give the class's soil about the one that was fitted together with the effects.

    The textbook wheel's soil has the effects bent into it: with them in the model it would count them twice. How places
    of the class scatter, and how well its mean is known, stays as the stretches show; a parameter that no stretch could
    tell is the fitted one, with the scatter that soils of one kind usually show. What the fit itself errs by comes on
    top of that (`errors_of`).
    """
    values = physics.soil_values
    centre = {"log_k": np.log(values.k_m), "log_stiffness": np.log(values.stiffness_Pa), "n": values.n}
    fitted = {name: Quantity(entry.value, 0.0, entry.value, entry.value) for name, entry in physics.soil.items()}
    others = {**other_parameters([fitted], np.ones(1)), **soil.others}
    others = {name: _about(others[name], np.array([centre[name]])) for name in centre if name in others}
    strength = _about(soil.strength, np.array([values.c_Pa, np.tan(values.phi_rad)]))
    return replace(soil, strength=strength, others=others)


def errors_of(physics: AugmentedSimulator, normal: np.ndarray) -> np.ndarray:
    """Draw what a fit errs by (`errors_of_fit`), a soil's parameter of which nobody knows how well it was told by as
    much as places of one class commonly differ.
    """
    values = physics.soil_values
    slope = math.cos(values.phi_rad) ** 2
    usual = {
        "c_Pa": max(PRIOR_VARIATION["c_Pa"] * values.c_Pa, LEAST_SCATTER["c_Pa"]),
        "phi_rad": max(PRIOR_VARIATION["tan_phi"] * math.tan(values.phi_rad), LEAST_SCATTER["tan_phi"]) * slope,
        **{name: PRIOR_VARIATION[name] * getattr(values, name) for name in ("k_m", "stiffness_Pa", "n")},
    }
    soil = {
        name: entry if math.isfinite(entry.sd) else Estimated(entry.value, usual[name])
        for name, entry in physics.soil.items()
    }
    return errors_of_fit(replace(physics, soil=soil), normal)


def _about(effects: RandomEffects, mean: np.ndarray) -> RandomEffects:
    return replace(effects, mean=mean)
