"""The drives by number: the causes of drive number s are drawn from seed s alone."""

from __future__ import annotations

import numpy as np

from ..strength import LEVELS
from ..study import NULLS, PAIRS
from .conceal import ConcealedDrive, conceal_drive, places_of
from .faults import GROUND, INSTRUMENTS, VEHICLE, catalogue

OWNERS = tuple(tuple(kind.slug for kind in kinds) for kinds in (GROUND, VEHICLE, INSTRUMENTS))
"""Effects of ground, vehicle and instruments."""

ELSEWHERE = 0.5
"""Share of effects of pairs that act on one class or one wheel only, of those that can."""

BLOCK = 1000
"""Seeds within which single effects are dealt out."""


def lot(seed: np.ndarray | int) -> np.ndarray:
    """Give a number in [0, 1) by the golden ratio, so that any stretch of seeds holds its share of all numbers."""
    return np.asarray(seed) * 0.6180339887 % 1.0


def draw(seed: int) -> tuple[tuple[str, ...], tuple[str, ...], str]:
    """Give what drive number `seed` hides, where each effect acts, and the level.

    Single effects are those of ground, vehicle and instruments in turn, in shuffled rounds of each, everywhere and
    elsewhere in turn where they can be, and at each level in turn.
    """
    rng = np.random.default_rng([9277, seed])
    levels = list(LEVELS)
    if lot(seed) < NULLS:
        return (), (), levels[int(rng.integers(3))]
    if lot(seed) < NULLS + PAIRS:
        effects = draw_pair(rng)
        return effects, draw_places(rng, effects), levels[int(rng.integers(3))]
    block = seed // BLOCK
    turn, owner = divmod(int(np.sum(lot(np.arange(block * BLOCK, seed)) >= NULLS + PAIRS)), len(OWNERS))
    slugs = OWNERS[owner]
    order = np.random.default_rng([9276, block, owner, turn // len(slugs)]).permutation(len(slugs))
    slug = slugs[int(order[turn % len(slugs)])]
    return (slug,), (places_of(slug)[-1 if turn % 2 else 0],), levels[(owner + turn) % 3]


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
