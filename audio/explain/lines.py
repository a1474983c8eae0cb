"""Lines in the sound of a drive: those that follow the wheel, and those of fixed frequency.

Found one by one, the strongest first; each is scored on held-out stretches both as a multiple of the wheel's turns and
as a fixed frequency; at one speed both are the same.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.stats import false_discovery_control

from ...framework.core.explanation import posterior
from .alignment import Aligned, HeldOutGain, Null, held_out_gain, null_of
from .combs import MOST_LUGS, Comb, find_comb
from .drive_spectra import BLOCK_S, ENVELOPE_RATE_HZ, ENVELOPE_S, LOW_HZ, DriveSpectra
from .line_fit import skirt_bins

FALSE_DISCOVERY_RATE = 0.01
MOST_LINES = 40
_MASK_BINS = 3
_TOOTH_BINS = 2
_LEAST_TONE_HZ = 45.0
"""Below, the spectrum of rumble is too steep to distinguish its slope from a tone [Hz]; mains lie above."""
_WIDE_SHARE = 0.2


@dataclass(frozen=True)
class Line:
    """A line that is more than noise.

    Parameters
    ----------
    family
        ``"order"``, ``"envelope"`` or ``"fixed"``: what explains it best.
    place, sd
        Order [-] or frequency [Hz], and its standard deviation.
    excess
        Power over that of contact sound in one bin [-].
    p_value
        Against surrogates.
    probability
        That it is of this family, from held-out stretches.
    rival
        The next best family and its place, or None where nothing rivals.
    rival_probability
        Probability of that.
    gain
        Held-out gain.
    from_hz, to_hz
        Where it was during the drive [Hz].
    """

    family: str
    place: float
    sd: float
    excess: float
    p_value: float
    probability: float
    rival: tuple[str, float] | None
    rival_probability: float
    gain: HeldOutGain
    from_hz: float
    to_hz: float


def families_of(spectra: DriveSpectra) -> dict[str, Aligned]:
    """Set up what is looked for: orders in sound and envelope, where the wheel turns, and fixed frequencies."""
    families = {}
    low = round(LOW_HZ * BLOCK_S)
    fast = float(np.quantile(spectra.shaft_hz, 0.95)) if spectra.shaft_hz.size else 0.0
    if fast > 0.05:
        # Half a bin at the highest speed: a line never falls between two.
        step = 0.5 / (BLOCK_S * fast)
        families["order"] = Aligned(
            "order", spectra.turned.copy(), spectra.shaft_hz, BLOCK_S, low, spectra.stretch,
            np.arange(max(3.0, 2 * step), 0.9 * spectra.top_hz / fast, step),
        )  # fmt: skip
        step = 0.5 / (ENVELOPE_S * fast)
        families["envelope"] = Aligned(
            "envelope", spectra.envelope.copy(), spectra.envelope_shaft_hz, ENVELOPE_S, 3, spectra.envelope_stretch,
            np.arange(max(1.5, 2 * step), min(2.0 * MOST_LUGS, 0.45 * ENVELOPE_RATE_HZ / fast), step),
        )  # fmt: skip
    families["fixed"] = Aligned(
        "fixed", spectra.fixed.copy(), np.ones(len(spectra.fixed)), BLOCK_S, low, spectra.stretch,
        np.arange(_LEAST_TONE_HZ, spectra.top_hz - 50.0, 1.0 / BLOCK_S),
    )  # fmt: skip
    return {name: family for name, family in families.items() if family.multiples.size > 40}


def find_lines(
    spectra: DriveSpectra, rng: np.random.Generator, lug_count: int | None = None
) -> tuple[list[Line], Comb | None]:
    """Find every line, the most significant first, at a false discovery rate of `FALSE_DISCOVERY_RATE`.

    A comb of lugs is looked for before, and what it explains is taken out.
    """
    families = families_of(spectra)
    nulls = {name: null_of(family, rng) for name, family in families.items()}
    comb = find_comb(families["order"], nulls["order"], lug_count) if "order" in families else None
    if comb is not None:
        _explain_comb(families, comb)
    lines: list[Line] = []
    wide = 0
    while len(lines) + wide < MOST_LINES:
        found = _strongest(families, nulls)
        if found is None:
            break
        name, place, p_value = found
        line = _judged(families, name, place, p_value)
        if line.family == "fixed" and _is_wide(spectra, line.place):
            # A hump of many bins is a resonance: those have a test of their own.
            families["fixed"].mask(np.full(len(spectra.fixed), line.place), 3 * _MASK_BINS)
            wide += 1
            continue
        _explain(families, line)
        if line.gain.nats > 0 and line.probability > 0.1:
            lines.append(line)
        else:
            wide += 1
    return lines, comb


def _strongest(families: dict[str, Aligned], nulls: dict[str, Null]) -> tuple[str, float, float] | None:
    """Family, place and p value of the most significant candidate that the false discovery rate admits."""
    names, places, ps, scores = [], [], [], []
    for name, family in families.items():
        score, p = nulls[name].p_values(*family.means())
        names += [name] * p.size
        places.append(family.multiples)
        ps.append(p)
        scores.append(score / nulls[name].tail)
    p = np.concatenate(ps)
    best = int(np.argmax(np.concatenate(scores)))
    if false_discovery_control(p)[best] > FALSE_DISCOVERY_RATE:
        return None
    return names[best], float(np.concatenate(places)[best]), float(p[best])


def _judged(families: dict[str, Aligned], name: str, place: float, p_value: float) -> Line:
    """Score a candidate as what it was found as, and as the best rival of the other kind."""
    own = held_out_gain(families[name], place)
    rival_name = {"order": "fixed", "fixed": "order"}.get(name)
    rival = None
    if rival_name in families:
        rival = _best_rival(families[rival_name], families[name], own.line.multiple)
    # Places were sought among all multiples of the family: that many chances to be wrong.
    weights = {name: own.nats - np.log(families[name].multiples.size), "none": 0.0}
    if rival is not None and rival_name is not None:
        weights[rival_name] = rival.nats - np.log(families[rival_name].multiples.size)
    share = posterior(weights)
    if rival is not None and rival_name is not None and share[rival_name] > share[name]:
        name, own, rival_name, rival = rival_name, rival, name, own
    heard = families[name].speed[~np.isnan(families[name].along(own.line.multiple))]
    reach = np.quantile(own.line.multiple * heard, [0.02, 0.98]) if heard.size else (0.0, 0.0)
    return Line(
        name, own.line.multiple, own.line.sd, own.line.excess, p_value, share[name],
        None if rival is None or rival_name is None else (rival_name, rival.line.multiple),
        share.get(rival_name or "", 0.0), own, float(reach[0]), float(reach[1]),
    )  # fmt: skip


def _best_rival(rival: Aligned, own: Aligned, place: float) -> HeldOutGain | None:
    """The multiple of the other family that goes where this line went, and says most."""
    moving = own if own.name == "order" else rival
    speed = moving.speed[moving.speed > 0.05]
    if speed.size == 0:
        return None
    low, high = np.quantile(speed, [0.1, 0.9])
    ends = (place * low, place * high) if own.name == "order" else (place / high, place / low)
    near = (rival.multiples >= ends[0] - 2 * rival.step) & (rival.multiples <= ends[1] + 2 * rival.step)
    if not near.any():
        return None
    mean, count = rival.means(rival.multiples[near])
    # The sum of what noise does not explain: few loud blocks count no more than many that are a little louder.
    return held_out_gain(rival, float(rival.multiples[near][np.argmax((mean - 0.596) * count)]))


def _is_wide(spectra: DriveSpectra, frequency_hz: float) -> bool:
    """Whether the spectrum still stands high near the line: 5 to 8 bins away, a fifth of its height."""
    at = round(frequency_hz * BLOCK_S)
    logs = np.log(np.maximum(spectra.fixed[:, max(at - 8, 0) : at + 9], 1e-6)).mean(axis=0) + np.euler_gamma
    if logs.size < 17:
        return False
    level = np.expm1(logs)
    side = 0.5 * (level[:4].mean() + level[-4:].mean())
    return bool(side > _WIDE_SHARE * level[7:10].max())


def _explain_comb(families: dict[str, Aligned], comb: Comb) -> None:
    """Take all teeth of a comb out, those that do not stand out too, and its rhythm in the envelope."""
    shaft = families["order"].speed
    fast = float(np.quantile(shaft, 0.95)) * BLOCK_S
    for k in range(1, int(families["order"].multiples[-1] / comb.place) + 2):
        for name in ("order", "fixed"):
            if name in families:
                # The higher the tooth, the further the error of the comb's place has carried it.
                wide = min(_TOOTH_BINS + int(2.0 * k * comb.sd * fast), max(int(0.3 * comb.place * fast), _TOOTH_BINS))
                families[name].mask(k * comb.place * shaft, wide)
    if "envelope" in families:
        own = families["envelope"]
        for k in range(1, int(own.multiples[-1] / comb.place) + 2):
            own.mask(k * comb.place * own.speed, 2)


def _explain(families: dict[str, Aligned], line: Line) -> None:
    """Take a line out of all spectra, and with an order its harmonics' own neighbourhoods stay in."""
    if line.family == "envelope":
        own = families["envelope"]
        own.mask(line.place * own.speed, 2)
        return
    for name in ("order", "fixed"):
        if name in families:
            speed = families["order"].speed if line.family == "order" else families["fixed"].speed
            families[name].mask(line.place * speed, max(_MASK_BINS, skirt_bins(line.excess)))
