"""The drives by number: the causes of drive number s are drawn from seed s alone."""

from __future__ import annotations

import numpy as np

from ..strength import LEVELS
from ..study import NULLS, PAIRS
from .conceal import ConcealedDrive, conceal_drive, places_of
from .faults import GROUND, INSTRUMENTS, VEHICLE, catalogue

DEALT = tuple(kind.slug for kind in (*GROUND, *VEHICLE, *VEHICLE, *INSTRUMENTS))
"""Effects as they are dealt out: those of ground, vehicle and instruments about as often."""

ELSEWHERE = 0.5
"""Share of effects that act on one class or one wheel only, of those that can."""


def draw(seed: int) -> tuple[tuple[str, ...], tuple[str, ...], str]:
    """Give what drive number `seed` hides, where each effect acts, and the level.

    Nulls, single effects and pairs follow the golden ratio, and slugs and levels are dealt out in shuffled rounds, so that
    any stretch of seeds holds its share of all of them.
    """
    rng = np.random.default_rng([9277, seed])
    order = np.random.default_rng([9276, seed // len(DEALT)]).permutation(len(DEALT))
    lot = (seed * 0.6180339887) % 1.0
    level = list(LEVELS)[int(np.random.default_rng([9279, seed // 3]).permutation(3)[seed % 3])]
    if lot < NULLS:
        effects: tuple[str, ...] = ()
    elif lot < NULLS + PAIRS:
        effects = draw_pair(rng)
    else:
        effects = (DEALT[int(order[seed % len(DEALT)])],)
    return effects, draw_places(rng, effects), level


def draw_pair(rng: np.random.Generator) -> tuple[str, ...]:
    """Draw two different effects."""
    return tuple(str(slug) for slug in rng.choice(list(catalogue()), 2, replace=False))


def draw_places(rng: np.random.Generator, effects: tuple[str, ...]) -> tuple[str, ...]:
    """Draw where each effect acts."""
    return tuple(places_of(slug)[-1] if rng.random() < ELSEWHERE else "everywhere" for slug in effects)


def make(seed: int) -> ConcealedDrive:
    """Make drive number `seed`; an effect that cannot reach its level is hidden at the next one below.

    Two effects that stand for each other are replaced by the next pair.
    """
    effects, places, level = draw(seed)
    names = list(LEVELS)
    rng = np.random.default_rng([9278, seed])
    drive = None
    for _ in range(3):
        for lower in names[names.index(level) :]:
            drive = conceal_drive(seed, effects, places, lower)
            if drive.truth["reached"]:
                return drive
        if len(effects) == 2:
            effects = draw_pair(rng)
            places = draw_places(rng, effects)
    assert drive is not None
    return drive
