"""Lugs passing: blows at a whole number a turn, whose spectrum is a comb of lines at every multiple.

Each tooth of the comb may be too weak to be seen; all of them together are tested at once, for every number of lugs.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import stats

from .alignment import Aligned, HeldOutGain, Null, held_out_gain

MOST_LUGS = 64
"""More lugs than this on one wheel are a tread or a gear."""
LEAST_LUGS = 4
_SCALES = 1.0 + np.linspace(-0.005, 0.005, 21)
"""Errors of the wheel speed's scale that are allowed for [-]."""
_LEAST_TEETH = 6
_MOST_TEETH = 48
_MOST_EACH = 4.0
"""A tooth counts no more than this: two lines of a gear are no comb, however strong [-]."""
_RUN = 24
"""So many neighbouring teeth are looked at together."""
_STANDS = 1.0
_SEARCH_SHARE = 0.5
_LEAST_SHARE = 0.6
_LEAST_Z = 7.0


@dataclass(frozen=True)
class Comb:
    """Lines at every multiple of a number of lugs.

    Parameters
    ----------
    lugs
        A turn.
    place, sd
        The same as measured: off by the error of the wheel speed's scale.
    teeth
        Multiples that stand out and are tracked.
    gains
        Held-out gain of each.
    p_value
        Against surrogates.
    """

    lugs: int
    place: float
    sd: float
    teeth: tuple[int, ...]
    gains: tuple[HeldOutGain, ...]
    p_value: float


def find_comb(family: Aligned, null: Null, lug_count: int | None = None) -> Comb | None:
    """Find the comb that stands out most, or None."""
    score, drawn = np.minimum(null.p_values(*family.means())[0], _MOST_EACH), np.minimum(null.scores, _MOST_EACH)
    best = (0.0, 0, 1.0, 1.0)
    for lugs in range(LEAST_LUGS, MOST_LUGS + 1) if lug_count is None else (lug_count,):
        for scale in _SCALES:
            at = _teeth(family, lugs * scale)
            if at.size < _LEAST_TEETH:
                continue
            z = float(score[at].sum() / np.sqrt(at.size))
            if z <= best[0] or _densest(score[at]) < _SEARCH_SHARE:
                continue
            spread = float(np.std(drawn[:, at].sum(axis=1) / np.sqrt(at.size)))
            best = (z, lugs, float(scale), max(spread, 1.0))
    z, lugs, scale, spread = best
    lugs = _fewest(family, score, drawn, null.tail, lugs, scale) if lug_count is None else lugs
    if lugs == 0 or z / spread / null.tail < _LEAST_Z:
        return None
    place = lugs * scale
    at = _teeth(family, place)[:_MOST_TEETH]
    number = np.round(family.multiples[at] / place).astype(int)
    teeth = [int(k) for k, index in zip(number, at, strict=True) if score[index] > _STANDS]
    gains = tuple(held_out_gain(family, k * place) for k in teeth)
    measured = np.array([gain.line.multiple / k for gain, k in zip(gains, teeth, strict=True)])
    weight = np.square(teeth, dtype=float)
    mean = float(np.average(measured, weights=weight))
    sd = float(np.sqrt(np.average((measured - mean) ** 2, weights=weight) / len(teeth)))
    return Comb(lugs, mean, max(sd, 1e-3 * mean), tuple(teeth), gains, float(stats.norm.sf(z / spread / null.tail)))


def _fewest(
    family: Aligned, score: np.ndarray, drawn: np.ndarray, tail: float, lugs: int, scale: float
) -> int:  # fmt: skip
    """The least number of lugs whose own teeth, not only those shared with `lugs`, stand out, the first ones or all
    together: every other tooth of a comb of 16 is a comb of 32, and seldom a worse one.
    """
    for part in range(lugs // LEAST_LUGS, 1, -1):
        if lugs % part:
            continue
        at = _teeth(family, lugs / part * scale)
        number = np.round(family.multiples[at] * part / (lugs * scale)).astype(int)
        own = at[number % part != 0]
        if own.size < _LEAST_TEETH:
            continue
        root = np.sqrt(own.size)
        spread = max(float(np.std(drawn[:, own].sum(axis=1) / root)), 1.0)
        together = float(score[own].sum() / root) / spread / tail
        few = float(np.mean(score[own[:_RUN]] > _STANDS))
        if few >= _LEAST_SHARE or (together >= _LEAST_Z and _densest(score[own]) >= _LEAST_SHARE):
            return lugs // part
    return lugs


def _densest(score: np.ndarray) -> float:
    """Largest share of neighbouring teeth (n,), `_RUN` of them where there are as many, that stand out: a mount or a
    body rings with them somewhere, and buried ones are heard there first.
    """
    run = min(_RUN, len(score))
    return float(np.convolve(score > _STANDS, np.ones(run) / run, "valid").max())


def _teeth(family: Aligned, place: float) -> np.ndarray:
    """Indices into the family's multiples of the teeth of a comb, from the first that lies among them."""
    first, last = family.multiples[0], family.multiples[-1]
    k = np.arange(1, int(last / place) + 1)
    k = k[k * place >= first]
    return np.round((k * place - first) / family.step).astype(int)
