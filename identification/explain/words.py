"""The answer in words: what is missing first, how sure that is second, what to do third."""

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
"""A channel whose held-out error is within this factor of its noise is predicted to within noise [-]."""

BETTER, WORSE = 0.97, 1.03
"""Ratios of held-out errors, after to before, below and above which a channel is predicted better and worse [-]."""

FEW = 4 * len(PARAMETERS)
"""Rows below which only a large effect would show: four for each parameter of the soil."""

_PARAMETERS, _CHANNELS = 3, 3
"""Parameters of an effect, and channels, that are given in the summary at most."""

_OPENINGS = {"physics": "Missing: ", "unknown": "Missing: ", "instrument": "Fault: "}


def headline(explanation: Explanation) -> str:
    """Give the answer, and how sure it is."""
    missing = explanation.missing
    if not missing:
        return _nothing(explanation)
    if explanation.verdict == "unknown":
        return _beyond_catalogue(missing)
    sure = [each for each in missing if each.probability >= ASSERTED]
    if not sure:
        return _undecided(missing)
    parts = []
    for kind, opening in _OPENINGS.items():
        if named := _named(each for each in sure if each.kind == kind):
            parts.append(f"{opening}{listed(named)}.")
    if possible := _named(each for each in missing if each not in sure):
        parts.append(f"Possibly also: {listed(possible, 'or')}.")
    return " ".join(parts)


def _beyond_catalogue(missing: Sequence[Missing]) -> str:
    """Say that the catalogue lacks something, and which effects fit best as long as that is not in the model."""
    parts = [f"Missing: {listed(_named(each for each in missing if each.kind == 'unknown'))}."]
    if named := _named(each for each in missing if each.kind != "unknown"):
        parts.append(f"With it, and only as far as it is modelled by a smooth discrepancy: {listed(named)}.")
    return " ".join(parts)


def details(explanation: Explanation) -> str:
    """Say what happens, what modelling it gains, what to do, and where it is located; what to do first if undecided."""
    sure = [each for each in explanation.missing if each.probability >= ASSERTED]
    action, described = _action(explanation.missing), [_happens(each) for each in sure]
    parts = [*described, _errors(explanation), action] if sure else [action, _errors(explanation)]
    parts.append(_located(explanation.located))
    return " ".join(part for part in parts if part)


def summarise(explanation: Explanation) -> str:
    """Give the answer in a few sentences."""
    return f"{headline(explanation)} {details(explanation)}".rstrip()


def trust(explanation: Explanation) -> str:
    """Say what can be relied on: the prediction, the parameters, both or neither."""
    far = above_noise(explanation)
    worse = any(fit.rmse_after > WORSE * fit.rmse_before for fit in explanation.fits.values())
    sure = all(each.probability >= ASSERTED and each.kind != "unknown" for each in explanation.missing)
    prediction = "held-out rows are predicted to within noise"
    if far:
        prediction = f"the held-out error is {_times(far)}, so the form of the model is incomplete"
    if sure and not far and (explanation.verdict == "none" or not worse):
        parameters = "usable with their standard deviations, if the sensors' zeros and gains are right"
    else:
        parameters = "those of the best fit, not measurements of the soil; another form may fit as well with others"
    return f"Prediction: {prediction}. Parameters: {parameters}."


def above_noise(explanation: Explanation) -> dict[str, float]:
    """Channels whose held-out error stays above the noise, and how many times as large it is."""
    ratios = {name: _ratio(fit.rmse_after, fit.noise) for name, fit in explanation.fits.items()}
    return {name: ratio for name, ratio in ratios.items() if ratio > AT_NOISE}


def predicted_worse(explanation: Explanation) -> list[str]:
    """Channels, in words, that are predicted worse with what was added than without."""
    if explanation.verdict == "none":
        return []
    return [
        shown(name).words for name, fit in explanation.fits.items() if _ratio(fit.rmse_after, fit.rmse_before) > WORSE
    ]


def missing_lines(missing: Missing) -> list[str]:
    """Give what is missing in lines of text: its name and probability, its parameters, and what else it may be."""
    form = f", {missing.form}" if missing.form else ""
    kind = KINDS.get(missing.kind, missing.kind)
    source = f"; {missing.source}" if missing.source else ""
    further = {
        "where": missing.description,
        "indistinguishable from": ", ".join(map(effect, missing.indistinguishable_from)),
        "to decide": missing.would_tell,
    }
    return [
        f"{capital(name_of(missing))} ({missing.effect}{form}; {kind}): {percent(missing.probability)}",
        *(f"  {estimate(name, value)}" for name, value in missing.parameters.items()),
        f"  {missing.equation}{source}",
        *(f"  {title}: {text}" for title, text in further.items() if text),
    ]


def name_of(missing: Missing) -> str:
    """Name what is missing; a fault of one channel with that channel."""
    if missing.kind == "unknown":
        return "something that the catalogue lacks"
    channel = _channel(missing)
    return effect(missing.effect) + (f" of the {channel}" if channel else "")


def _channel(missing: Missing) -> str:
    """Name the channel that a form is of; empty where it is of none."""
    name = missing.form.partition(", ")[0]
    return shown(name).words if name in CHANNELS else ""


def _ratio(value: float, unit: float) -> float:
    return value / unit if unit > 0.0 else math.nan


def _named(missing: Iterable[Missing]) -> list[str]:
    return [f"{name_of(each)} ({percent(each.probability)})" for each in missing]


def _times(far: dict[str, float]) -> str:
    return listed(f"{ratio:.2g} times the noise in {shown(name).words}" for name, ratio in far.items())


def _nothing(explanation: Explanation) -> str:
    far, few = above_noise(explanation), explanation.n < FEW
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
    if far:
        return (
            f"Nothing that the catalogue holds is missing, but over {rows} the held-out error is {_times(far)}: no "
            f"effect of the catalogue explains it.{caution}"
        )
    return f"Nothing is missing: over {rows} the simulation agrees with the recording within noise.{caution}"


def _undecided(missing: Sequence[Missing]) -> str:
    named = _named(missing)
    if len(named) == 1:
        return f"Cannot tell whether it is {named[0]}."
    if sum(each.probability for each in missing) > 1.0:
        return f"Cannot tell which are missing, one or several: {listed(named, 'or')}."
    return f"Cannot tell between {listed(named)}."


def _happens(missing: Missing) -> str:
    """Say what an effect does, with its parameters; of the unknown, where it lives."""
    what = what_happens(missing.effect)
    if missing.kind == "unknown":
        what = columns_in_words(missing.description)
    elif channel := _channel(missing):
        what = what.replace("a channel", f"the {channel}")
    values = [estimate(name, value) for name, value in missing.parameters.items()]
    if len(values) > _PARAMETERS:
        values[_PARAMETERS:] = [f"{len(values) - _PARAMETERS} more"]
    sentence = " ".join(each for each in (what or name_of(missing), f"({', '.join(values)})" if values else "") if each)
    return f"{capital(sentence)}."


def _errors(explanation: Explanation) -> str:
    """Say by how much held-out errors change with what was found."""
    falls, rises = [], []
    ratios = {name: _ratio(fit.rmse_after, fit.rmse_before) for name, fit in explanation.fits.items()}
    for name, ratio in sorted(ratios.items(), key=lambda pair: pair[1])[:_CHANNELS]:
        if ratio < BETTER:
            falls.append(_change(name, explanation.fits[name]))
        elif ratio > WORSE:
            rises.append(_change(name, explanation.fits[name]))
    if explanation.verdict == "none" or not falls + rises:
        return ""
    parts = [f"falls: {', '.join(falls)}"] * bool(falls) + [f"rises: {', '.join(rises)}"] * bool(rises)
    return f"With {_modelled(explanation)} the held-out error {'; it '.join(parts)}."


def _change(name: str, fit: ChannelFit) -> str:
    how = shown(name)
    before, after = number(fit.rmse_before, how.scale), number(fit.rmse_after, how.scale)
    noise = " (the noise)" if _ratio(fit.rmse_after, fit.noise) <= AT_NOISE else ""
    return f"{how.words} from {before} to {how.with_unit(after)}{noise}"


def _modelled(explanation: Explanation) -> str:
    """Name the model whose held-out errors are shown, where it is not what is asserted."""
    effects = explanation.simulator.effects
    sure = {each.effect for each in explanation.missing if each.probability >= ASSERTED}
    smooth = any(each.kind == "unknown" and each.probability > 0.5 for each in explanation.missing)
    if not smooth and effects and {each.slug for each in effects} == sure:
        return "it" if len(sure) == 1 else "them"
    named = [effect(each.name) for each in effects] + ["a smooth discrepancy"] * smooth
    if not effects:
        return named[0] if smooth else "what fits best"
    return f"the most probable set, {listed(named)},"


_NOTHING_SEPARATES = (
    "No measurement considered would separate them (further channels, a soil test, other loads, slips and speeds, "
    "checks of instruments)."
)


def _action(missing: Sequence[Missing]) -> str:
    """Say which measurement or check decides."""
    proposed = sorted((each for each in missing if each.would_tell), key=lambda each: each.probability >= ASSERTED)
    if not proposed:
        undecided = any(each.probability < ASSERTED and each.indistinguishable_from for each in missing)
        return _NOTHING_SEPARATES if undecided else ""
    first = proposed[0]
    if first.kind == "unknown":
        return f"To find it: {columns_in_words(first.would_tell)}."
    return f"To {'check' if first.probability >= ASSERTED else 'decide'}: {first.would_tell}."


def _located(regions: Sequence[Region]) -> str:
    """Say where the difference is largest."""
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
