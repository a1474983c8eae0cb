"""From what was located to causes: gear mesh, lugs, steady tones, wind, resonances, or what only follows the wheel."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from scipy import stats

from ...framework.core.explanation import ASSERTED, UNKNOWN, Estimate, posterior, probability
from ...framework.core.sound_explanation import SoundCause, SoundRegion
from .alignment import HeldOut
from .combs import MOST_LUGS, Comb
from .drive_spectra import BLOCK_S, ENVELOPE_S, DriveSpectra
from .line_fit import NOISE_BINS, LineFit
from .lines import FALSE_DISCOVERY_RATE, Line
from .resonances import ResonanceFinding
from .wind import WindFinding

PRIOR = 0.05
"""Prior probability of each cause [-]: one in twenty drives is taken to have any one of them."""

CATALOGUE: dict[str, tuple[Literal["instrument", "physics", "unknown"], str, str]] = {
    "gear_mesh": (
        "instrument", "sum_k a_k cos(k o theta(t) + phi_k), theta the wheel's angle, o the mesh order",
        "Randall 2011, Vibration-based Condition Monitoring, ch. 2 (tooth meshing, harmonics and sidebands)",
    ),
    "lug_passing": (
        "physics", "g(N theta(t)), periodic in the wheel's angle with N lugs a turn",
        "Randall 2011, ch. 5 (envelope analysis); Fyfe and Munck 1997, doi:10.1006/mssp.1996.0056",
    ),
    "wind_noise": (
        "instrument", "S_w(f, V) = W (V / 1 m/s)^m (f / 100 Hz)^-s",
        "Strasberg 1988, J. Acoust. Soc. Am. 83, 544 (per third octave p^2 ~ V^6.3 f^-2.3 at fixed screen)",
    ),
    "resonance": (
        "instrument", "|H(f)|^2 = 1 + G / (1 + (2 Q (f - f_0) / f_0)^2)",
        "Single degree of freedom, Randall 2011, ch. 2",
    ),
    "steady_tone": ("instrument", "a cos(2 pi f_0 t + phi)", "A sinusoid of fixed frequency"),
    "unknown": ("unknown", "a cos(o theta(t) + phi)", ""),
}  # fmt: skip
"""By public name: kind, equation and source. Lugs meet the ground; what is known besides disturbs the instrument."""

_LEAST_NATS = 6.0 + float(np.log(5000.0) + np.log(PRIOR / (1.0 - PRIOR)))
"""A line that gains less than six nats, after paying for the places searched, is not worth a statement."""
_NOISE_DB = 10.0 / np.log(10.0) * np.pi / np.sqrt(6.0)
"""Standard deviation of 10 log10 of an exponential variable [dB]: the scatter of one block's spectrum."""
_SCALE_ERROR = 0.003
"""Wheel speeds are seldom calibrated better than this [-]: an integer order may be off by as much."""
_MOST_MULTIPLE = 40
_PER_TURN = "turns^-1"
_VARY_SPEED = "drive at varied speed, a factor of 1.3 or more: a fixed tone stays where it is, an order moves with it"
_ANOTHER_SOURCE = "a tap on the vehicle at rest: the ring of the lugs' blows goes with them, that of the mount stays"
_ANOTHER_GROUND = "drive on a ground that sounds different: what belongs to the vehicle stays"


@dataclass(frozen=True)
class Cause:
    """A cause with where it was located (shares still to be set), what each place gains, and the scatter there [dB]."""

    found: SoundCause
    places: tuple[SoundRegion, ...]
    gains: tuple[HeldOut, ...]
    noise_dB: float = float(_NOISE_DB)

    @property
    def nats(self) -> float:
        """Held-out gain of all places."""
        return sum(gain.nats for gain in self.gains)


def _cause(effect: str, probability: float, parameters: dict[str, Estimate], nats: float, **further: Any) -> SoundCause:
    kind, equation, source = CATALOGUE[effect]
    return SoundCause(
        effect, further.pop("kind", kind), "", probability, parameters, equation, source, nats=nats, **further
    )


def comb_cause(comb: Comb, spectra: DriveSpectra, lug_count: int | None) -> Cause:
    """Name a comb: blows at every multiple of a whole number a turn are lugs, whatever else turns with the wheel."""
    known = lug_count is None or comb.lugs % lug_count == 0
    parameters = {
        "lug_count": Estimate(float(comb.lugs), comb.sd),
        "excess": _excess(comb.gains[0].line),
        "harmonics": Estimate(float(len(comb.teeth)), np.nan),
    }
    low, high = (float(x) for x in np.quantile(spectra.shaft_hz, [0.02, 0.98]))
    top = spectra.top_hz
    places = tuple(
        SoundRegion(
            "wheel_order", k * (comb.place - 2.0 * comb.sd), k * (comb.place + 2.0 * comb.sd),
            min(k * comb.place * low, top), min(k * comb.place * high, top), 0.0, comb.p_value,
        )
        for k in comb.teeth
    )  # fmt: skip
    nats = sum(gain.nats for gain in comb.gains)
    found = _cause("lug_passing", 0.99 if known else 0.5, parameters, nats)
    return Cause(found, places, comb.gains)


def wind_cause(wind: WindFinding, *, subtract: bool) -> Cause | None:
    """Name wind that is more probable than not; subtracted only on request."""
    sure = probability(wind.nats, PRIOR)
    if wind.p_value > FALSE_DISCOVERY_RATE or sure < 0.5:
        return None
    parameters = {
        "level": Estimate(wind.model.log_w, wind.sd[0], "ln of full scale squared per Hz at 100 Hz and 1 m/s"),
        "exponent": Estimate(wind.model.exponent, wind.sd[1]),
        "slope": Estimate(wind.model.slope, wind.sd[2]),
    }
    found = _cause(
        "wind_noise", sure, parameters, wind.nats, subtracted=subtract and wind.closer and sure > ASSERTED,
        would_tell="" if sure > ASSERTED else "accelerate over a wider range of speed on one ground",
    )  # fmt: skip
    place = SoundRegion("travel_speed", *wind.speed_m_s, wind.low_hz, wind.top_hz, 0.0, wind.p_value)
    return Cause(found, (place,), (wind,), wind.noise_dB)


def resonance_cause(hump: ResonanceFinding, *, lugs: bool) -> Cause | None:
    """Name a hump; on a single ground, or where lugs strike, it may be theirs."""
    sure = probability(hump.nats, PRIOR)
    if sure < 0.5:
        return None
    rivals = (("contact sound of this ground",) if hump.grounds == 1 else ()) + (("lug_passing",) if lugs else ())
    checks = ([_ANOTHER_GROUND] if hump.grounds == 1 else []) + ([_ANOTHER_SOURCE] if lugs else [])
    middle, half = hump.frequency_hz[0], 0.5 * hump.frequency_hz[0] / hump.q[0]
    parameters = {
        "frequency": Estimate(*hump.frequency_hz, "Hz"),
        "quality_factor": Estimate(*hump.q),
        "gain": Estimate(*hump.gain),
    }
    found = _cause(
        "resonance", sure / (1 + len(rivals)), parameters, hump.nats,
        subtracted=not rivals and hump.closer, indistinguishable_from=rivals, would_tell="; ".join(checks),
    )  # fmt: skip
    low, high = middle - half, middle + half
    return Cause(found, (SoundRegion("frequency_Hz", low, high, low, high, 0.0, hump.p_value),), (hump,), 0.0)


def line_causes(lines: list[Line], lug_count: int | None) -> list[tuple[Cause, tuple[Line, ...]]]:
    """Name the lines that are worth a statement; each cause comes with the lines of it that are subtracted."""
    answer = []
    for found, own in _named_lines(lines, lug_count):
        cause = Cause(found, tuple(_place(line) for line in own), tuple(line.gain for line in own))
        if cause.nats < _LEAST_NATS:
            continue
        tonal = tuple(line for line in own if line.family != "envelope")
        closer = sum(line.gain.after_dB2 for line in tonal) < sum(line.gain.before_dB2 for line in tonal)
        taken = tonal if found.subtracted and closer else ()
        answer.append((replace(cause, found=replace(found, subtracted=bool(taken))), taken))
    return answer


def _place(line: Line) -> SoundRegion:
    variable = "frequency_Hz" if line.family == "fixed" else "wheel_order"
    low, high = line.place - 2.0 * line.sd, line.place + 2.0 * line.sd
    return SoundRegion(variable, low, high, line.from_hz, line.to_hz, 0.0, line.p_value)


def _nats(lines: Iterable[Line]) -> float:
    """Held-out gain of lines together."""
    return sum(line.gain.nats for line in lines)


def _named_lines(lines: list[Line], lug_count: int | None) -> list[tuple[SoundCause, tuple[Line, ...]]]:
    """Name all lines; each cause comes with the lines it explains."""
    open_, sure_order, fixed = [], [], []
    for line in lines:
        total = line.probability + line.rival_probability
        if line.rival is not None and line.rival_probability / total > 1.0 - ASSERTED:
            open_.append(line)
        elif line.family == "fixed":
            fixed.append(line)
        else:
            sure_order.append(line)
    causes = _order_causes(sure_order, lug_count)
    causes += [(_steady(group), tuple(group)) for group in _harmonic_groups(fixed)]
    for line in open_:
        causes += [(cause, (line,)) for cause in _undecided(line)]
    return causes


def _harmonic_groups(lines: list[Line]) -> list[list[Line]]:
    """Group fixed lines whose frequencies are whole multiples of the lowest of them."""
    rest, groups = sorted(lines, key=lambda line: line.place), []
    while rest:
        first = rest[0]
        own = [line for line in rest if _is_multiple(line, first)]
        groups.append(own)
        rest = [line for line in rest if line not in own]
    return groups


def _is_multiple(line: Line, first: Line) -> bool:
    ratio = line.place / first.place
    k = max(round(ratio), 1)
    tolerance = 3.0 * (line.sd + k * first.sd) / first.place
    # A tolerance as wide as the gaps between multiples would let anything in.
    return k <= _MOST_MULTIPLE and abs(ratio - k) < min(tolerance + 1e-3, 0.12)


def _steady(group: list[Line]) -> SoundCause:
    first = group[0]
    return _cause(
        "steady_tone", max(line.probability for line in group),
        {"frequency": Estimate(first.place, first.sd, "Hz"), "excess": _excess(first.gain.line)},
        _nats(group),
    )  # fmt: skip


def _excess(line: LineFit, *, envelope: bool = False) -> Estimate:
    """Power of a line over that of the noise in 1 Hz [dB]; NaN where the fit does not know."""
    in_1_hz = line.excess * NOISE_BINS / (ENVELOPE_S if envelope else BLOCK_S)
    value = float(10.0 * np.log10(max(in_1_hz, 1e-3))) if line.excess_known else np.nan
    return Estimate(value, np.nan, "dB in 1 Hz" + " of the envelope" * envelope)


def _undecided(line: Line) -> list[SoundCause]:
    """Both readings of a line that stood at one frequency as well as at one order."""
    assert line.rival is not None
    readings = [((line.family, line.place), line.probability, line.sd), (line.rival, line.rival_probability, np.nan)]
    answer = []
    for (family, place), share, sd in readings:
        fixed, first = family == "fixed", not answer
        answer.append(
            _cause(
                "steady_tone" if fixed else UNKNOWN, share,
                {"frequency" if fixed else "order": Estimate(place, sd, "Hz" if fixed else _PER_TURN)},
                line.gain.nats if first else 0.0,
                kind="instrument",  # one of two readings, and no sign of what the catalogue lacks
                indistinguishable_from=("gear_mesh", "lug_passing") if fixed else ("steady_tone",),
                would_tell=_VARY_SPEED, subtracted=first,
            )
        )  # fmt: skip
    return answer


def _order_causes(lines: list[Line], lug_count: int | None) -> list[tuple[SoundCause, tuple[Line, ...]]]:
    envelope = [line for line in lines if line.family == "envelope"]
    tonal = [line for line in lines if line.family == "order"]
    causes = []
    rhythm = _rhythm(envelope, lug_count)
    if rhythm is not None:
        lugs = float(round(rhythm.place))
        own = [line for line in tonal if _on_comb(line, lugs)]
        # Lines at every lug multiple are the blows themselves; a few high ones among them may be a gear's.
        own = own if len(own) >= 2 else [line for line in own if line.place < 3.5 * lugs]
        members = tuple([rhythm, *(line for line in envelope if line is not rhythm), *own])
        causes.append((_named(members, lug_count, blows=True), members))
        tonal = [line for line in tonal if line not in own]
    elif envelope:
        causes.append((_unknown_rhythm(envelope), tuple(envelope)))
    causes += [(_named(family, lug_count, blows=False), family) for family in _order_families(tonal)]
    return causes


def _rhythm(envelope: list[Line], lug_count: int | None) -> Line | None:
    """The envelope line that may be lugs passing: a whole number a turn, which the others are multiples of."""
    whole = [line for line in envelope if 3.5 < line.place < MOST_LUGS + 0.5 and abs(_from_whole(line)) < 3.0]
    if lug_count:
        whole = [line for line in whole if round(line.place) % lug_count == 0] or whole
    for line in sorted(whole, key=lambda line: line.place):
        strongest = max(whole, key=lambda other: other.gain.nats)
        if _is_multiple(strongest, line):
            return line
    return None


def _from_whole(line: Line) -> float:
    """Distance of an order from the next whole number, in its standard deviations."""
    return (line.place - round(line.place)) / float(np.hypot(line.sd, _SCALE_ERROR * line.place))


def _on_comb(line: Line, lugs: float) -> bool:
    k = max(round(line.place / lugs), 1)
    return abs(line.place - k * lugs) < 3.0 * float(np.hypot(line.sd, _SCALE_ERROR * line.place * 0.3)) + 0.02


def _order_families(lines: list[Line]) -> list[tuple[Line, ...]]:
    """Group orders: the lowest strong one, the fundamental, then its harmonics, and sidebands a few turns from them."""
    rest = sorted(lines, key=lambda line: line.place)
    families = []
    while rest:
        strongest = max(rest, key=lambda line: line.gain.nats)
        # The fundamental is the lowest line that the strongest is a multiple of.
        first = next(line for line in rest if _is_multiple(strongest, line))
        own = [line for line in rest if _is_multiple(line, first) and line.place >= first.place]
        sides = [line for line in rest if line not in own and _is_sideband(line, own)]
        families.append((first, *(line for line in own + sides if line is not first)))
        rest = [line for line in rest if line not in own and line not in sides]
    return families


def _is_sideband(line: Line, carriers: list[Line]) -> bool:
    for carrier in carriers:
        offset = abs(line.place - carrier.place)
        if 0.5 < offset < 4.5 and line.gain.nats < carrier.gain.nats and carrier.place > 12.0:
            return abs(offset - round(offset)) < 0.25
    return False


def _named(family: tuple[Line, ...], lug_count: int | None, *, blows: bool) -> SoundCause:
    """Weigh lugs against gear mesh: whole number or not, blows in the envelope, how many harmonics, known count."""
    first = family[0]
    order, sd = first.place, float(np.hypot(first.sd, _SCALE_ERROR * first.place))
    harmonics = sum(line.family == "order" for line in family)
    odds = 0.0 if order <= MOST_LUGS else -6.0
    # Lugs are whole in number, a gear's order is anything: density of the distance against a uniform one.
    odds += float(np.clip(stats.norm.logpdf(order - round(order), 0.0, sd), -8.0, 3.0))
    odds += (5.0 if blows else -1.5) + (1.5 if harmonics >= 5 else 0.0)
    if lug_count:
        off = abs(order / lug_count - max(round(order / lug_count), 1)) * lug_count
        odds += 4.0 if off < 3.0 * sd + 0.05 else -6.0
    lug = posterior({"lug_passing": odds, "gear_mesh": 0.0})["lug_passing"]
    if order < 3.5:
        return _once_a_turn(family)
    name, other = ("lug_passing", "gear_mesh") if lug > 0.5 else ("gear_mesh", "lug_passing")
    sure = max(lug, 1.0 - lug)
    parameters = {"lug_count": Estimate(float(round(order)), sd)} if name == "lug_passing" else {}
    parameters |= {
        "order": Estimate(order, sd, _PER_TURN),
        "excess": _excess(first.gain.line, envelope=first.family == "envelope"),
        "harmonics": Estimate(float(harmonics), np.nan),
    }
    return _cause(
        name, sure * first.probability, parameters, _nats(family),
        indistinguishable_from=(other,) if sure < 0.9 else (),
        would_tell="the number of lugs, or the drive run with the wheel off the ground" if sure < 0.9 else "",
    )  # fmt: skip


def _once_a_turn(family: tuple[Line, ...]) -> SoundCause:
    first = family[0]
    return _cause(
        UNKNOWN, first.probability, {"order": Estimate(first.place, first.sd, _PER_TURN)}, _nats(family),
        would_tell="a look at the wheel: something strikes or rubs once or a few times a turn",
    )  # fmt: skip


def _unknown_rhythm(envelope: list[Line]) -> SoundCause:
    first = max(envelope, key=lambda line: line.gain.nats)
    return _cause(
        UNKNOWN, first.probability, {"order": Estimate(first.place, first.sd, _PER_TURN)},
        _nats(envelope), subtracted=False,
        would_tell="a look at the wheel: the loudness swells that often a turn, which no number of lugs explains",
    )  # fmt: skip
