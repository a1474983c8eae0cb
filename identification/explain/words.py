"""Text of the result of `explain`: what is missing, its probability, and which measurement to make."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

from ...framework.core.explanation import ASSERTED
from ...framework.core.soil import PARAMETERS
from ..mechanics.textbook import CHANNELS
from .explanation import ChannelFit, Explanation, Missing, Region
from .quantities import (
    KINDS,
    capital,
    columns_in_words,
    cycles_a_turn,
    effect,
    estimate,
    interval,
    listed,
    number,
    percent,
    shown,
    what_happens,
)
from .variables import CONSTANT, LAG

AT_NOISE = 1.3
"""Ratio of held-out error to noise up to which a channel is predicted within noise [-]."""

BETTER, WORSE = 0.97, 1.03
"""Ratios of held-out errors, after to before, below and above which a channel is predicted better and worse [-]."""

FEW = 4 * len(PARAMETERS)
"""Number of rows below which only a large effect is detectable: four for each parameter of the soil."""

_PARAMETERS, _CHANNELS = 3, 3
"""Most parameters of an effect, and most channels, in the summary."""

_OPENINGS = {"physics": "Missing: ", "unknown": "Missing: ", "instrument": "Fault: "}


def headline(explanation: Explanation) -> str:
    """State the answer with its probability; if undecided, the measurement that decides."""
    missing = explanation.missing
    if not missing:
        return _nothing(explanation)
    if explanation.verdict == "unknown":
        return _beyond_catalogue(missing)
    asserted = [each for each in missing if each.probability >= ASSERTED]
    if not asserted:
        return _undecided(missing)
    parts = []
    for kind, opening in _OPENINGS.items():
        if named := _named(each for each in asserted if each.kind == kind):
            parts.append(f"{opening}{listed(named)}.")
    if possible := _named(each for each in missing if each not in asserted):
        parts.append(f"Possibly also: {listed(possible, 'or')}.")
    return " ".join(parts)


def _beyond_catalogue(missing: Sequence[Missing]) -> str:
    """State that the catalogue lacks something, and which effects are probable in the incomplete model."""
    known = [each for each in missing if each.kind != "unknown"]
    parts = [f"Missing: {listed(_named(each for each in missing if each.kind == 'unknown'))}."]
    asserted = _named(each for each in known if each.probability >= ASSERTED)
    possible = _named(each for each in known if each.probability < ASSERTED)
    named = [listed(asserted)] if asserted else []
    if possible:
        named.append(f"possibly {listed(possible, 'or')}")
    if named:
        parts.append(f"Provisional until that is identified: {'; '.join(named)}.")
    return " ".join(parts)


def details(explanation: Explanation) -> str:
    """Describe the effects, the gain of modelling them, the measurement to make, and the largest region."""
    described = [each for each in explanation.missing if each.probability >= ASSERTED]
    if explanation.verdict == "unknown":
        described = [each for each in explanation.missing if each.kind == "unknown"]
    errors, happens = _errors(explanation), [_happens(each) for each in described]
    if len(described) == 1 and errors and _is_asserted(explanation):
        happens, errors = [_gains(described[0], errors)], ""
    elif errors:
        errors = f"{capital(_modelled(explanation))} {errors}."
    action = _action(explanation.missing) if described else ""
    parts = [*happens, errors, action, _located(explanation.located)]
    return " ".join(part for part in parts if part)


def summarise(explanation: Explanation) -> str:
    """Summarise the answer in a few sentences."""
    return f"{headline(explanation)} {details(explanation)}".rstrip()


def trust(explanation: Explanation) -> str:
    """State whether prediction and parameters are reliable."""
    excess = above_noise(explanation)
    worse = any(fit.rmse_after > WORSE * fit.rmse_before for fit in explanation.fits.values())
    asserted = all(each.probability >= ASSERTED and each.kind != "unknown" for each in explanation.missing)
    prediction = "within noise on held-out rows"
    if excess:
        prediction = f"the held-out error is {_times(excess)}: the form of the model is incomplete"
    if asserted and not excess and (explanation.verdict == "none" or not worse):
        parameters = "usable with their standard deviations, if the sensors' zeros and gains are right"
    else:
        parameters = "those of the best fit; another form of the model may fit as well with other values"
    return f"Prediction: {prediction}. Parameters: {parameters}."


def above_noise(explanation: Explanation) -> dict[str, float]:
    """Ratio of held-out error to noise by channel, for channels where it exceeds `AT_NOISE`."""
    ratios = {name: _ratio(fit.rmse_after, fit.noise) for name, fit in explanation.fits.items()}
    return {name: ratio for name, ratio in ratios.items() if ratio > AT_NOISE}


def predicted_worse(explanation: Explanation) -> list[str]:
    """Names of channels that are predicted worse with the effects than without."""
    if explanation.verdict == "none":
        return []
    return [
        shown(name).words for name, fit in explanation.fits.items() if _ratio(fit.rmse_after, fit.rmse_before) > WORSE
    ]


def missing_lines(missing: Missing) -> list[str]:
    """Describe something missing in lines of text: name and probability, parameters, alternatives."""
    form = f", {missing.form}" if missing.form else ""
    kind = KINDS.get(missing.kind, missing.kind)
    source = f"; {missing.source}" if missing.source else ""
    further = {
        "where": columns_in_words(missing.description),
        "indistinguishable from": ", ".join(map(effect, missing.indistinguishable_from)),
        f"to {aim(missing)}": measurement(missing),
    }
    return [
        f"{capital(name_of(missing))} ({missing.effect}{form}; {kind}): {percent(missing.probability)}",
        *(f"  {estimate(name, value)}" for name, value in missing.parameters.items()),
        f"  {missing.equation}{source}",
        *(f"  {title}: {text}" for title, text in further.items() if text),
    ]


def name_of(missing: Missing) -> str:
    """Name of something missing, with the channel at fault and where it acts, if these are stated."""
    if missing.kind == "unknown":
        return "something that the catalogue lacks"
    channel = _channel(missing)
    of_channel = f" of the {channel}" if channel else ""
    where = f"{' ' if missing.where.startswith('on ') else ', '}{missing.where}" if missing.where else ""
    return effect(missing.effect) + of_channel + where


def _channel(missing: Missing) -> str:
    """Name of the channel in an effect's form; empty if there is none."""
    name = missing.form.partition(", ")[0]
    return shown(name).words if name in CHANNELS else ""


def _ratio(value: float, unit: float) -> float:
    return value / unit if unit > 0.0 else math.nan


def _named(missing: Iterable[Missing]) -> list[str]:
    return [f"{name_of(each)} ({percent(each.probability)})" for each in missing]


def _times(excess: dict[str, float]) -> str:
    return listed(f"{ratio:.2g} times the noise in {shown(name).words}" for name, ratio in excess.items())


def _nothing(explanation: Explanation) -> str:
    excess, few = above_noise(explanation), explanation.n < FEW
    rows = f"{explanation.n:,} rows"
    caution = " With so few rows only a large effect would show." if few else ""
    other = [
        shown(name).words
        for name, fit in explanation.fits.items()
        if _ratio(fit.rmse_before, fit.rmse_after) > AT_NOISE
    ]
    if other:
        return (
            f"No physics is missing: the other simulator's {listed(other)} differ from the recording by its soil, for "
            f"the textbook wheel on another soil agrees better over {rows}.{caution}"
        )
    if excess:
        return (
            f"Nothing that the catalogue holds is missing, but over {rows} the held-out error is {_times(excess)}: no "
            f"effect of the catalogue explains it.{caution}"
        )
    return f"Nothing is missing: over {rows} the simulation agrees with the recording within noise.{caution}"


def _undecided(missing: Sequence[Missing]) -> str:
    """List the possible causes, and the measurement that decides between them."""
    named, decisive = _named(missing), _decisive(missing)
    if len(named) == 1:
        answer = f"Possibly missing: {named[0]}"
    elif sum(each.probability for each in missing) > 1.0:
        answer = f"Cannot tell which are missing, one or several: {listed(named, 'or')}"
    else:
        answer = f"Cannot tell between {listed(named)}"
        if decisive is not None:
            return f"{answer}: {measurement(decisive)}."
    return f"{answer}. {_action(missing)}".rstrip()


def _what(missing: Missing) -> str:
    """Describe an effect in a clause; a discrepancy by its channels and variables."""
    if missing.kind == "unknown":
        return columns_in_words(missing.description) or name_of(missing)
    what, channel = what_happens(missing.effect), _channel(missing)
    return (what.replace("a channel", f"the {channel}") if channel else what) or name_of(missing)


def _values(missing: Missing) -> str:
    """List the first parameters of an effect with standard deviations, and the number of others."""
    values = [estimate(name, value) for name, value in missing.parameters.items()]
    if len(values) > _PARAMETERS:
        values[_PARAMETERS:] = [f"{len(values) - _PARAMETERS} more"]
    return ", ".join(values)


def _happens(missing: Missing) -> str:
    values = _values(missing)
    return f"{capital(_what(missing))}{f' ({values})' if values else ''}."


def _gains(missing: Missing, errors: str) -> str:
    """Describe an effect, and the change in held-out errors."""
    return f"{_happens(missing)} With it {errors}."


def _errors(explanation: Explanation) -> str:
    """Describe the change in held-out errors in a clause; empty if there is none."""
    falls, rises = [], []
    ratios = {name: _ratio(fit.rmse_after, fit.rmse_before) for name, fit in explanation.fits.items()}
    for name, ratio in sorted(ratios.items(), key=lambda pair: pair[1])[:_CHANNELS]:
        if ratio < BETTER:
            falls.append(_change(name, explanation.fits[name]))
        elif ratio > WORSE:
            rises.append(_change(name, explanation.fits[name]))
    if explanation.verdict == "none" or not falls + rises:
        return ""
    parts = [f"{verb} {listed(changes)}" for verb, changes in (("falls", falls), ("rises", rises)) if changes]
    return f"the held-out error {' and '.join(parts)}"


def _change(name: str, fit: ChannelFit) -> str:
    how = shown(name)
    before, after = number(fit.rmse_before, how.scale), number(fit.rmse_after, how.scale)
    noise = " (the noise)" if _ratio(fit.rmse_after, fit.noise) <= AT_NOISE else ""
    return f"from {before} to {how.with_unit(after)}{noise} in {how.words}"


def _is_asserted(explanation: Explanation) -> bool:
    """Return whether the model whose held-out errors are shown has exactly the asserted effects."""
    asserted = {each.effect for each in explanation.missing if each.probability >= ASSERTED}
    effects = {each.slug for each in explanation.simulator.effects}
    return bool(effects) and effects == asserted and not _has_discrepancy(explanation)


def _has_discrepancy(explanation: Explanation) -> bool:
    return any(each.kind == "unknown" and each.probability > 0.5 for each in explanation.missing)


def _modelled(explanation: Explanation) -> str:
    """Describe the model whose held-out errors are shown."""
    if _is_asserted(explanation):
        return "with them"
    named = [effect(each.name) for each in explanation.simulator.effects]
    named += ["a smooth discrepancy"] * _has_discrepancy(explanation)
    return f"with the most probable model{f', {listed(named)},' if named else ''}"


_NOTHING_SEPARATES = (
    "No further channel, soil test, other load, slip or speed, or check of an instrument is expected to separate them."
)


def _decisive(missing: Sequence[Missing]) -> Missing | None:
    """Return the missing item to measure first: a probable discrepancy, else an effect that is not asserted, else one
    that is; None if no measurement is proposed.
    """

    def rank(each: Missing) -> tuple[bool, bool, bool]:
        unknown = each.kind == "unknown"
        return not (unknown and each.probability > 0.5), each.probability >= ASSERTED, unknown

    return min((each for each in missing if each.would_tell), key=rank, default=None)


def aim(missing: Missing) -> str:
    """Purpose of a measurement: to identify something unknown, to check an asserted effect, or to decide."""
    return "identify it" if missing.kind == "unknown" else "check" if missing.probability >= ASSERTED else "decide"


def measurement(missing: Missing) -> str:
    """Measurement to make, with the names of quantities where it is about columns; empty if none is proposed."""
    return columns_in_words(missing.would_tell) if missing.kind == "unknown" else missing.would_tell


def _action(missing: Sequence[Missing]) -> str:
    """State the measurement or check to make."""
    first = _decisive(missing)
    if first is None:
        undecided = any(each.probability < ASSERTED and each.indistinguishable_from for each in missing)
        return _NOTHING_SEPARATES if undecided else ""
    return f"To {aim(first)}: {measurement(first)}."


def _located(regions: Sequence[Region]) -> str:
    """Describe the region with the largest share."""
    if not regions:
        return ""
    first = regions[0]
    channel, where = shown(first.channel).words, interval(first)
    if first.variable == CONSTANT:
        return f"Where: measured {channel} is off by a constant {where}."
    if first.variable == LAG:
        return f"Where: {channel} follows the simulation with a delay of {where}."
    if cycles_a_turn(first):
        return f"Where: {channel} varies with {where}."
    side = "is below" if first.mean < 0.0 else "is above" if first.mean > 0.0 else "departs from"
    return f"Where: measured {channel} {side} the simulated one for {shown(first.variable).words} from {where}."
