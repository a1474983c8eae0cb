"""The answer in words."""

from __future__ import annotations

from ..explanation import Explanation, Missing
from ..locate.variables import CONSTANT, LAG
from ..name.naming import ASSERTED
from . import readable
from .readable import AT_NOISE, above_noise, bare
from .rivals import fits_best, probabilities

_WORTH_A_WORD = 0.2
"""A candidate that nothing asks for is spoken of from this probability on [-]."""

_TOLD = 3
"""Parameters of an effect that are told in the summary."""

_BETTER, _WORSE = 0.97, 1.03
"""A channel's held-out error has fallen below, and risen above, this share of what it was before [-]."""


def summarise(explanation: Explanation) -> str:
    """Say in a few sentences what differs, what was left out, and what modelling it gains."""
    if explanation.verdict == "none":
        return _nothing(explanation)
    parts = [_where(explanation)]
    sure = [each for each in explanation.missing if each.probability >= ASSERTED]
    unsure = [each for each in explanation.missing if each.probability < ASSERTED]
    if explanation.verdict == "unknown":
        parts += [_beyond_catalogue(each) for each in explanation.missing if each.kind == "unknown"]
    parts += [_statement(each) for each in sure if each.kind != "unknown"]
    if unsure and explanation.verdict != "unknown":
        beside = "Beside that these" if sure else "These"
        parts.append(f"{beside} data do not tell for sure what it is. {probabilities(explanation, unsure)}")
        parts.append(_kinds(unsure))
        tell = next((each.would_tell for each in unsure if each.would_tell), "")
        if tell:
            parts.append(f"What would tell: {tell}.")
    parts.append(_errors(explanation))
    return " ".join(part for part in parts if part)


def _nothing(explanation: Explanation) -> str:
    n, far, other = explanation.n, above_noise(explanation), readable.apart(explanation)
    if other:
        return (
            f"The other simulator's {readable.listed(other)} differ from the recording; the textbook wheel on another "
            f"soil differs less. Over {n} samples its physics is not what is missing, its soil is another."
        )
    if not far:
        within = f"The simulation agrees within noise over {n} samples: nothing was found that held-out data ask for."
        return within + (" So few would not show an effect that is small." if readable.few(explanation) else "")
    why = "as where the ground varies from place to place, or something is missing that these data do not show"
    return (
        f"Over {n} samples the simulation misses {readable.listed(far)} by more than noise, {why}: of what was tried "
        f"nothing gains enough on rows held out to be named.{_nearest(explanation)}"
    )


def _nearest(explanation: Explanation) -> str:
    """Say what comes nearest to being asked for."""
    best = max(explanation.candidates, key=lambda each: each.probability, default=None)
    if best is None or best.kind == "unknown" or best.probability < _WORTH_A_WORD:
        return ""
    named = readable.effect(best.effect)
    return f" {named[0].upper()}{named[1:]} comes nearest ({readable.percent(best.probability)}): more rows would tell."


def _where(explanation: Explanation) -> str:
    if not explanation.located:
        return "The channels leave the simulation, but nowhere in particular."
    first = explanation.located[0]
    named = list(dict.fromkeys(bare(region.channel) for region in explanation.located))
    channels = named[0] if len(named) == 1 else ", ".join(named[:-1]) + " and " + named[-1]
    verb = "leaves" if len(named) == 1 else "leave"
    most = f"{bare(first.channel)} most clearly" if len(named) > 1 else "most clearly"
    where = f"for {readable.shown(first.variable).name} from {readable.interval(first)}"
    if first.variable == "wheel_angle_rad":
        where = f"with {readable.interval(first)}"
    elif first.variable == CONSTANT:
        where = f"by {readable.interval(first)} everywhere"
    elif first.variable == LAG:
        where = f"as if it came {readable.interval(first)} late"
    return f"{channels[0].upper()}{channels[1:]} {verb} the simulation, {most} {where}."


def _beyond_catalogue(each: Missing) -> str:
    if not readable.is_like(each):
        return f"Nothing in the catalogue explains it; what is left: {each.description}."
    likely = readable.percent(each.probability)
    return f"Nothing in the catalogue explains it as well as {each.description} ({likely}), {_values(each)}."


def _values(each: Missing) -> str:
    told = [readable.estimate(name, estimate) for name, estimate in each.parameters.items()]
    count = len(told) - _TOLD
    further = [f"and {count} more parameter{'s' if count > 1 else ''}"] if count > 0 else []
    return ", ".join(told[:_TOLD] + further)


def _statement(each: Missing) -> str:
    fault = "a fault of an instrument or of what is configured: " if each.kind == "instrument" else ""
    return (
        f"What was left out is {fault}{readable.effect(each.effect)} ({readable.percent(each.probability)}), "
        f"{_values(each)}."
    )


def _kinds(rivals: list[Missing]) -> str:
    """Say whether rivals agree on its being physics or a fault, and else how likely each is."""
    listed = {each.effect for each in rivals}
    if len(rivals) < 2 or any(listed - {each.effect, *each.indistinguishable_from} for each in rivals):
        return ""  # more than one effect is missing, or something unknown
    physics, fault = (
        sum(each.probability for each in rivals if each.kind == kind) for kind in ("physics", "instrument")
    )
    if physics and fault:
        return (
            f"That it is physics has {readable.percent(physics)}, that it is a fault of an instrument or of what is "
            f"configured {readable.percent(fault)}."
        )
    if physics + fault < ASSERTED:
        return ""
    return f"Whichever it is, it is {'physics' if physics else 'a fault of an instrument or of what is configured'}."


def _errors(explanation: Explanation) -> str:
    falls, rises = [], []
    for channel, fit in explanation.fits.items():
        how = readable.shown(channel)
        before, after = readable.number(fit.rmse_before, how.scale), readable.number(fit.rmse_after, how.scale)
        change = f"{bare(channel)} from {before} to {after} {how.unit}"
        if fit.rmse_after < _BETTER * fit.rmse_before:
            falls.append(change + (", which is noise" if fit.rmse_after < AT_NOISE * fit.noise else ""))
        elif fit.rmse_after > _WORSE * fit.rmse_before:
            rises.append(change)
    best, with_it, against = fits_best(explanation)
    fallen = f"With {with_it} the held-out error falls: {'; '.join(falls)}." if falls else ""
    risen = f"It speaks against {against} that the held-out error rises: {'; '.join(rises)}." if rises else ""
    return " ".join(each for each in (best, fallen, risen) if each)


def trust(explanation: Explanation) -> str:
    """Say what can be vouched for: the prediction, the parameters, both or neither."""
    far = above_noise(explanation)
    if far:
        incomplete = "the form of the model is not complete"
        if explanation.verdict == "none":
            incomplete = f"the ground varies, or {incomplete} in a way that nothing tried makes up for"
        prediction = f"Held-out error of {readable.listed(far)} stays above the noise: {incomplete}"
    else:
        prediction = "Held-out rows are predicted to within noise"
    sure = all(each.probability >= ASSERTED for each in explanation.missing)
    certain = explanation.verdict in ("none", "physics", "instrument") and sure and not far
    certain = certain and not any(fit.rmse_after > _WORSE * fit.rmse_before for fit in explanation.fits.values())
    if certain:
        return (
            f"{prediction}, and the parameters can be used with their standard deviations, as far as zeros and gains "
            "of the instruments are right: some errors of them look wholly like another soil."
        )
    return (
        f"{prediction}. The prediction can be used where rows like these were driven; soil and effect parameters are "
        "those of the model that fits best, not measurements of the ground: another form could fit as well with others."
    )
