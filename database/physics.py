"""Physics of classes of ground: what the textbook wheel lacked there, found by somebody at some time."""

from __future__ import annotations

import json
import uuid
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from functools import cached_property
from typing import Any

import numpy as np

from ..framework.core.errors import InputError
from ..framework.core.soil import Quantity
from ..identification.effects.stored import AugmentedSimulator
from .posterior import ClassSoil, RandomEffects, other_parameters

_NAMESPACE = uuid.UUID("0d9a6d0c-6f4e-5d63-8a51-2c1b7f0f3a42")
_LONGEST_NAME = 200


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
        A name that is empty or too long.
    """

    class_name: str
    physics: AugmentedSimulator
    source: str
    observed_at: datetime
    site: str = ""

    def __post_init__(self) -> None:
        for name, least in (("class_name", 1), ("source", 0), ("site", 0)):
            value = getattr(self, name)
            if not isinstance(value, str) or not least <= len(value) <= _LONGEST_NAME:
                raise InputError(name, f"{value!r}"[:80], expected=f"text of {least} to {_LONGEST_NAME} letters")
        if self.observed_at.tzinfo is None:
            object.__setattr__(self, "observed_at", self.observed_at.replace(tzinfo=UTC))

    @cached_property
    def id(self) -> uuid.UUID:
        """Identity: UUID 5 of everything that it holds."""
        key = [self.class_name, self.site, self.source, self.observed_at.astimezone(UTC).isoformat(),
               self.physics.to_json()]  # fmt: skip
        return uuid.uuid5(_NAMESPACE, json.dumps(key, ensure_ascii=True, sort_keys=True, separators=(",", ":")))


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
    tell is the fitted one, with the scatter that soils of one kind usually show.
    """
    values = physics.soil_values
    centre = {"log_k": np.log(values.k_m), "log_stiffness": np.log(values.stiffness_Pa), "n": values.n}
    fitted = {
        name: Quantity(entry.value, entry.sd, entry.value - 1.96 * entry.sd, entry.value + 1.96 * entry.sd)
        for name, entry in physics.soil.items()
    }
    others = {**other_parameters([fitted], np.ones(1)), **soil.others}
    others = {name: _about(others[name], np.array([centre[name]])) for name in centre if name in others}
    strength = _about(soil.strength, np.array([values.c_Pa, np.tan(values.phi_rad)]))
    return replace(soil, strength=strength, others=others)


def _about(effects: RandomEffects, mean: np.ndarray) -> RandomEffects:
    return replace(effects, mean=mean)
