"""What an effect is: something real that the textbook wheel leaves out, its strength from 0 (absent) to 1 (bound)."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

import numpy as np

from .contact import Contact, Reaction
from .drives import PROTOCOLS, Drive

if TYPE_CHECKING:
    from .scene import Scene

TORQUE, SINKAGE, PULL = "torque_Nm", "sinkage_m", "drawbar_pull_N"
ANSWERED = (TORQUE, SINKAGE, PULL)
FIELD_OF = {TORQUE: "torque", SINKAGE: "sinkage", PULL: "pull"}


class Effect:
    """Base of all effects: drawn once for a scene, then applied at any strength.

    Subclasses choose a form and its shape on construction and override the stages they act in. Stages are applied in
    turn:
    `drive` (the covariates themselves), `contact` (before the balance), `reaction` (forces beside the contact),
    `reading`
    (what the instruments make of it, after all physics).
    """

    slug: ClassVar[str] = ""
    kind: ClassVar[str] = "physics"
    protocols: ClassVar[tuple[str, ...]] = PROTOCOLS
    needs: ClassVar[frozenset[str]] = frozenset()  # columns without which it cannot be seen
    history: ClassVar[bool] = False  # a row depends on earlier rows
    laps: ClassVar[bool] = False  # the drive must come by the same place again
    first: ClassVar[bool] = False  # changes load or slip, which the others then build on

    def __init__(self, rng: np.random.Generator, scene: Scene) -> None:
        self.form = ""
        self.channels: tuple[str, ...] = ANSWERED
        self.variables: tuple[str, ...] = ()

    def parameters(self, strength: float) -> dict[str, float]:
        """The physical parameters at a strength."""
        raise NotImplementedError

    def drive(self, drive: Drive, strength: float) -> Drive:
        """The drive as it has to be for the effect."""
        return drive

    def contact(self, contact: Contact, drive: Drive, strength: float) -> None:
        """Change the contact before it is solved."""

    def reaction(self, reaction: Reaction, contact: Contact, drive: Drive, strength: float) -> None:
        """Add what acts beside the contact."""

    def reading(self, reaction: Reaction, drive: Drive, strength: float) -> None:
        """Change what is read off."""


def span(values: np.ndarray) -> float:
    """Range of a channel without its outermost values."""
    return float(np.subtract(*np.quantile(values, [0.975, 0.025])))
