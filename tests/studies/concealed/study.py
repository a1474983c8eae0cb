"""The study's recordings by number: the effects of recording number s are drawn from seed s alone."""

from __future__ import annotations

import numpy as np

from .conceal import ConcealedRecording, conceal
from .drives import LACKED, PROTOCOL_SHARES, PROTOCOLS, needs_of
from .effects import catalogue
from .strength import LEVELS

NULLS, PAIRS = 0.30, 0.15
"""Shares of recordings with nothing and with two effects hidden."""


def draw(seed: int, protocol: str | None = None) -> tuple[tuple[str, ...], str, str]:
    """Give what recording number `seed` hides, its level and its protocol, the one given where that can show it.

    Nulls, single effects and pairs follow the golden ratio, and slugs are dealt out in shuffled rounds, so that any
    stretch of seeds holds its share of all of them.
    """
    slugs, levels = list(catalogue()), list(LEVELS)
    rng = np.random.default_rng([9177, seed])
    turn = int(np.random.default_rng([9176, seed // len(slugs)]).permutation(len(slugs))[seed % len(slugs)])
    lot = (seed * 0.6180339887) % 1.0
    if lot < NULLS:
        effects: tuple[str, ...] = ()
    elif lot < NULLS + PAIRS:
        effects = tuple(str(slug) for slug in rng.choice(slugs, 2, replace=False))
    else:
        effects = (slugs[turn],)
    level = levels[int(rng.integers(3))]
    drawn = str(rng.choice(PROTOCOLS, p=PROTOCOL_SHARES))
    return effects, level, shown_by(protocol or drawn, effects)


def shown_by(protocol: str, effects: tuple[str, ...]) -> str:
    """Give the protocol, or a bench test where it cannot show the effects."""
    return "bench" if needs_of(effects) & LACKED.get(protocol, frozenset()) else protocol


def make(seed: int, protocol: str | None = None) -> ConcealedRecording:
    """Make recording number `seed`; an effect that cannot reach its level is hidden at the next one below.

    Two effects that stand for each other in this drive are replaced by the next pair.
    """
    effects, level, shown = draw(seed, protocol)
    names = list(LEVELS)
    slugs, rng = list(catalogue()), np.random.default_rng([9178, seed])
    recording = None
    for _ in range(3):
        for lower in names[names.index(level) :]:
            recording = conceal(seed, effects, lower, shown)
            if recording.truth["reached"]:
                return recording
        if len(effects) == 2:
            effects = tuple(str(slug) for slug in rng.choice(slugs, 2, replace=False))
            shown = shown_by(protocol or shown, effects)
    assert recording is not None
    return recording
