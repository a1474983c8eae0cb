"""What a synthetic drive conceals: physics that the textbook wheel lacks, and faults of instruments."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any, Literal

Cause = Literal[
    "bulldozing", "drivetrain_friction", "inertia", "load_gain", "multipass_compaction", "slip_sinkage",
    "torque_offset",
]  # fmt: skip
"""Slugs of the catalogue of effects, `bevameter.identification.effects.catalogue`."""


@dataclass(frozen=True)
class Concealed:
    """A cause of a difference between the textbook wheel and the recording, which `truth.json` alone states.

    Parameters
    ----------
    effect
        What it is, by the catalogue's slug.
    values
        Its parameters by the catalogue's names [SI].
    terrain, wheel
        Class of ground and name of the wheel where it acts; None for all of them.
    """

    effect: Cause
    values: Mapping[str, float]
    terrain: str | None = None
    wheel: str | None = None

    def acts(self, terrain: str | None, wheel: str | None) -> bool:
        """Whether it acts on that class of ground and that wheel; None where the effect does not depend on it."""
        return self.terrain in (None, terrain) and self.wheel in (None, wheel)

    def truth(self) -> dict[str, Any]:
        """Give it as `truth.json` has it; `where` is empty where it acts everywhere."""
        where = {"class": self.terrain, "wheel": self.wheel}
        return {
            "effect": self.effect,
            "where": {key: name for key, name in where.items() if name is not None},
            "values": dict(self.values),
        }


def strength(
    causes: Iterable[Concealed], effect: Cause, parameter: str, *, terrain: str | None = None, wheel: str | None = None
) -> float:
    """Give a parameter of an effect on a class of ground and a wheel [SI]; 0 where the effect does not act."""
    return sum(
        (cause.values[parameter] for cause in causes if cause.effect == effect and cause.acts(terrain, wheel)), 0.0
    )
