"""What the data do not tell apart, in words: which effects look alike, how probable each is, and what is left over."""

from __future__ import annotations

from collections.abc import Collection, Sequence

from ..explanation import Explanation, Missing
from ..name.naming import ASSERTED, MENTIONED, UNKNOWN
from . import readable

_STANDS_IN = 0.5
"""A cause that the catalogue lacks and that is more likely than this is corrected for in what is shown [-]."""

_LACKED = "a cause that the catalogue lacks"


def probabilities(explanation: Explanation, unsure: Sequence[Missing]) -> str:
    """Give the probability of each effect of a list and of those that look like it, and of none of them.

    Effects that could each take another's place in the set that fits best stand together. An effect may be in several
    sets, which is why what is given here may add up to more than one.
    """
    groups = _groups(unsure)
    share = {each.effect: each.probability for each in unsure}
    told = []
    for group in groups:
        shares = {slug: share.get(slug, _among(explanation, {slug})) for slug in group}
        named = [
            f"{_LACKED if slug == UNKNOWN else readable.effect(slug)} {readable.percent(probability)}"
            for slug, probability in shares.items()
        ]
        told.append(readable.listed(named) + (", which look alike here" if len(group) > 1 else ""))
    slugs = [slug for group in groups for slug in group]
    told += [f"{name} {readable.percent(left)}" for name, left in neither(explanation, slugs)]
    which = "Probability of each, alone or with others" if len(slugs) > 1 else "Probability, alone or with others"
    return f"{which}: {'; '.join(told)}."


def neither(explanation: Explanation, slugs: Collection[str]) -> list[tuple[str, float]]:
    """Say, with its probability, that it is none of some effects; nothing where that is not worth a word."""
    left = 1.0 - _among(explanation, set(slugs))
    if left < MENTIONED:
        return []
    return [("none of these" if len(slugs) > 1 else "something else or nothing", left)]


def fits_best(explanation: Explanation) -> tuple[str, str, str]:
    """Say whose errors on held-out rows are shown: a sentence that names it, empty where all of it was stated; what it
    is called when something is done with it; and what speaks against it speaks against.
    """
    effects = explanation.simulator.effects
    named = readable.listed([readable.effect(each.name) for each in effects])
    smooth = [each for each in explanation.missing if each.kind == UNKNOWN and not readable.is_like(each)]
    if any(each.probability > _STANDS_IN for each in smooth):
        which = "that correction" if explanation.verdict == "unknown" else "a smooth correction"
        return "", f"{which}, beside {named}," if effects else which, "it"
    sure = {each.effect for each in explanation.missing if each.probability >= ASSERTED}
    several = len(effects) > 1
    if not effects or {each.slug for each in effects} == sure == {each.effect for each in explanation.missing}:
        return ("", "them", "them") if several else ("", "it", "it")
    set_name = " + ".join(each.name for each in effects)
    weight = sum(each.probability for each in explanation.candidates if each.effect == set_name)
    just = "just these are missing" if several else "just this is missing"
    best = f"What fits best is {named} (that {just}: {readable.percent(weight)})."
    return (best, "these", "them") if several else (best, "it", "it")


def _groups(unsure: Sequence[Missing]) -> list[list[str]]:
    """Put effects together of which one looks like another, in the order of the list."""
    groups: list[list[str]] = []
    for each in unsure:
        own = [each.effect, *each.indistinguishable_from]
        touched = [group for group in groups if set(group) & set(own)]
        merged = list(dict.fromkeys([slug for group in (*touched, own) for slug in group]))
        groups = [group for group in groups if group not in touched]
        groups.append(merged)
    # Those that are listed themselves first: they are the more probable ones.
    order = {each.effect: number for number, each in enumerate(unsure)}
    return [sorted(group, key=lambda slug: order.get(slug, len(order))) for group in groups]


def _among(explanation: Explanation, slugs: set[str]) -> float:
    """Probability that one of some effects at least is among what is missing, by the sets that were tried."""
    having = [each for each in explanation.candidates if slugs & set(readable.slugs(each.effect))]
    return min(sum(each.probability for each in having), 1.0)
