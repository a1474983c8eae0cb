"""What each seed holds: null, one effect, two, or a cause beyond the list; and which."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .beyond import BEYOND
from .drives import PROTOCOLS
from .effect import Effect
from .instrument_effects import INSTRUMENT_EFFECTS
from .soil_effects import SOIL_EFFECTS, RimAdhesion
from .vehicle_effects import VEHICLE_EFFECTS

CYCLE = 20
NULLS, SINGLES, PAIRS = 6, 9, 3  # of CYCLE; the rest lies beyond
LISTED: tuple[type[Effect], ...] = SOIL_EFFECTS + VEHICLE_EFFECTS + INSTRUMENT_EFFECTS
NATS = {"plain": 1500.0, "hidden": 250.0, "buried": 60.0}


@dataclass(frozen=True)
class Plan:
    """Kinds of effects to conceal (none for a null) and how strongly they are to show."""

    effects: tuple[type[Effect], ...]
    level: str

    def protocols(self) -> list[str]:
        """Protocols under which all of them can be seen."""
        return [p for p in PROTOCOLS if all(p in effect.protocols for effect in self.effects)]


def _pair(rng: np.random.Generator) -> tuple[type[Effect], ...]:
    """Two effects that share a protocol; rim adhesion is too weak to stand beside another."""
    able = [effect for effect in LISTED if effect is not RimAdhesion]
    while True:
        first, second = rng.choice(len(able), 2, replace=False)
        pair = (able[first], able[second])
        if Plan(pair, "").protocols():
            return pair


def make_plan(seed: int, attempt: int) -> Plan:
    """The plan of a seed: kinds and levels in turn, so that all come up evenly; later attempts change only a pair."""
    turn, place = divmod(seed, CYCLE)
    levels = list(NATS)
    if place < NULLS:
        return Plan((), "null")
    if place < NULLS + SINGLES:
        number = turn * SINGLES + place - NULLS
        which = (7 * number) % len(LISTED)
        return Plan((LISTED[which],), levels[(number // len(LISTED) + which) % 3])
    if place < NULLS + SINGLES + PAIRS:
        level = levels[(turn + place) % 2]  # each of two at least hidden
        return Plan(_pair(np.random.default_rng([seed, 2, attempt])), level)
    number = turn * (CYCLE - NULLS - SINGLES - PAIRS) + place - NULLS - SINGLES - PAIRS
    which = (2 * number) % len(BEYOND)
    return Plan((BEYOND[which],), levels[(number // len(BEYOND) + which) % 3])
