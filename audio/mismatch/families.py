"""From lines to causes: gear mesh, lugs, steady tones, or something that is only known to follow the wheel."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy import stats

from .answer import Explained, Parameter
from .combs import MOST_LUGS, Comb
from .drive_spectra import BLOCK_S, ENVELOPE_S
from .line_fit import NOISE_BINS, LineFit
from .lines import Line

SURE = 0.75
"""Below this probability of its kind, an answer names the rivals instead of deciding."""
_SCALE_ERROR = 0.003
"""Wheel speeds are seldom calibrated better than this [-]: an integer order may be off by as much."""
_VARY_SPEED = "drive at varied speed, a factor of 1.3 or more: a fixed tone stays where it is, an order moves with it"


@dataclass(frozen=True)
class Family:
    """Lines of one origin, the fundamental first: orders (k,) in ascending multiples."""

    fundamental: Line
    members: tuple[Line, ...]

    @property
    def nats(self) -> float:
        """Held-out gain of all members."""
        return sum(line.gain.nats for line in self.members)


def causes_of(lines: list[Line], lug_count: int | None) -> list[tuple[Explained, tuple[Line, ...]]]:
    """Name all lines; each cause comes with the lines it explains."""
    open_, sure_order, fixed = [], [], []
    for line in lines:
        total = line.probability + line.rival_probability
        if line.rival is not None and line.rival_probability / total > 1.0 - SURE:
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


def _is_multiple(line: Line, first: Line, most: int = 40) -> bool:
    ratio = line.place / first.place
    k = max(round(ratio), 1)
    tolerance = 3.0 * (line.sd + k * first.sd) / first.place
    # A tolerance as wide as the gaps between multiples would let anything in.
    return k <= most and abs(ratio - k) < min(tolerance + 1e-3, 0.12)


def _steady(group: list[Line]) -> Explained:
    first = group[0]
    return Explained(
        "steady_tone", float(max(line.probability for line in group)),
        {"frequency": Parameter(first.place, first.sd, "Hz"),
         "excess": _excess(first.gain.line)},
        sum(line.gain.nats for line in group), frequencies_Hz=tuple(line.place for line in group),
    )  # fmt: skip


def _excess(line: LineFit, *, envelope: bool = False) -> Parameter:
    """Power of a line over that of the noise in 1 Hz [dB]; None where the fit does not know."""
    in_1_hz = line.excess * NOISE_BINS / (ENVELOPE_S if envelope else BLOCK_S)
    value = float(10.0 * np.log10(max(in_1_hz, 1e-3))) if line.excess_known else None
    return Parameter(value, None, "dB in 1 Hz" + " of the envelope" * envelope)


def _undecided(line: Line) -> list[Explained]:
    """Both readings of a line that stood at one frequency as well as at one order."""
    assert line.rival is not None
    readings = [((line.family, line.place), line.probability, line.sd), (line.rival, line.rival_probability, None)]
    answer = []
    for (family, place), probability, sd in readings:
        effect = "steady_tone" if family == "fixed" else "unknown"
        unit = "Hz" if family == "fixed" else "turns^-1"
        key = "frequency" if family == "fixed" else "order"
        answer.append(
            Explained(
                effect, probability, {key: Parameter(place, sd, unit)}, line.gain.nats if not answer else 0.0,
                orders=() if family == "fixed" or answer else (place,),
                frequencies_Hz=(place,) if family == "fixed" and not answer else (),
                indistinguishable_from=("gear_mesh", "lug_passing") if effect == "steady_tone" else ("steady_tone",),
                would_tell=_VARY_SPEED, applied=not answer,
            )
        )  # fmt: skip
    return answer


def _order_causes(lines: list[Line], lug_count: int | None) -> list[tuple[Explained, tuple[Line, ...]]]:
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
        causes.append((_named(Family(rhythm, members), lug_count, blows=True), members))
        tonal = [line for line in tonal if line not in own]
    elif envelope:
        causes.append((_unknown_rhythm(envelope), tuple(envelope)))
    causes += [(_named(family, lug_count, blows=False), family.members) for family in _order_families(tonal)]
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


def _order_families(lines: list[Line]) -> list[Family]:
    """Group orders: harmonics of the lowest strong one, and sidebands a few turns beside them."""
    rest = sorted(lines, key=lambda line: line.place)
    families = []
    while rest:
        strongest = max(rest, key=lambda line: line.gain.nats)
        # The fundamental is the lowest line that the strongest is a multiple of.
        first = next(line for line in rest if _is_multiple(strongest, line))
        own = [line for line in rest if _is_multiple(line, first) and line.place >= first.place]
        sides = [line for line in rest if line not in own and _is_sideband(line, own)]
        families.append(Family(first, (first, *(line for line in own + sides if line is not first))))
        rest = [line for line in rest if line not in own and line not in sides]
    return families


def _is_sideband(line: Line, carriers: list[Line]) -> bool:
    for carrier in carriers:
        beside = abs(line.place - carrier.place)
        if 0.5 < beside < 4.5 and line.gain.nats < carrier.gain.nats and carrier.place > 12.0:
            return abs(beside - round(beside)) < 0.25
    return False


def _named(family: Family, lug_count: int | None, *, blows: bool) -> Explained:
    """Weigh lugs against gear mesh: whole number or not, blows in the envelope, how many harmonics, known count."""
    first = family.fundamental
    order, sd = first.place, float(np.hypot(first.sd, _SCALE_ERROR * first.place))
    harmonics = sum(line.family == "order" for line in family.members)
    odds = 0.0 if order <= MOST_LUGS else -6.0
    # Lugs are whole in number, a gear's order is anything: density of the distance against a uniform one.
    odds += float(np.clip(stats.norm.logpdf(order - round(order), 0.0, sd), -8.0, 3.0))
    odds += (5.0 if blows else -1.5) + (1.5 if harmonics >= 5 else 0.0)
    if lug_count:
        off = abs(order / lug_count - max(round(order / lug_count), 1)) * lug_count
        odds += 4.0 if off < 3.0 * sd + 0.05 else -6.0
    lug = float(1.0 / (1.0 + np.exp(-odds)))
    if order < 3.5:
        return _once_a_turn(family)
    name, sure = ("lug_passing", lug) if lug > 0.5 else ("gear_mesh", 1.0 - lug)
    probability = sure * first.probability
    parameters = {"order": Parameter(order, sd, "turns^-1")}
    if name == "lug_passing":
        parameters = {"lug_count": Parameter(float(round(order)), sd, "1")} | parameters
    parameters["excess"] = _excess(first.gain.line, envelope=first.family == "envelope")
    parameters["harmonics"] = Parameter(float(harmonics), None, "1")
    other = "gear_mesh" if name == "lug_passing" else "lug_passing"
    return Explained(
        name, probability, parameters, family.nats,
        orders=tuple(line.place for line in family.members if line.family == "order"),
        indistinguishable_from=(other,) if sure < 0.9 else (),
        would_tell="the number of lugs, or the drive run with the wheel off the ground" if sure < 0.9 else "",
    )  # fmt: skip


def _once_a_turn(family: Family) -> Explained:
    first = family.fundamental
    return Explained(
        "unknown", first.probability, {"order": Parameter(first.place, first.sd, "turns^-1")}, family.nats,
        orders=tuple(line.place for line in family.members if line.family == "order"),
        would_tell="a look at the wheel: something strikes or rubs once or a few times a turn",
    )  # fmt: skip


def _unknown_rhythm(envelope: list[Line]) -> Explained:
    first = max(envelope, key=lambda line: line.gain.nats)
    return Explained(
        "unknown", first.probability, {"order": Parameter(first.place, first.sd, "turns^-1")},
        sum(line.gain.nats for line in envelope),
        would_tell="a look at the wheel: the loudness swells that often a turn, which no number of lugs explains",
        applied=False,
    )  # fmt: skip


def comb_cause(comb: Comb, lug_count: int | None) -> Explained:
    """Name a comb: blows at every multiple of a whole number a turn are lugs, whatever else turns with the wheel."""
    nats = sum(gain.nats for gain in comb.gains)
    known = lug_count is None or comb.lugs % lug_count == 0
    return Explained(
        "lug_passing", 0.99 if known else 0.5,
        {"lug_count": Parameter(float(comb.lugs), comb.sd, "1"),
         "excess": _excess(comb.gains[0].line),
         "harmonics": Parameter(float(len(comb.teeth)), None, "1")},
        nats, orders=tuple(k * comb.place for k in comb.teeth),
    )  # fmt: skip


def without_subtraction(cause: Explained) -> Explained:
    """Give the cause marked as not subtracted."""
    return replace(cause, applied=False)
