"""The answer in its first sentence: what is missing, or that the data do not tell."""

from __future__ import annotations

from collections.abc import Sequence

from ..explanation import Explanation, Missing
from ..name.naming import ASSERTED, UNKNOWN
from . import readable
from .readable import effect, in_words, is_like, likelihood, listed, one_of, percent
from .rivals import neither


def verdict(explanation: Explanation) -> str:
    """Put the verdict in one sentence."""
    missing = explanation.missing
    if explanation.verdict == "none":
        return _nothing(explanation)
    if explanation.verdict == "unknown":
        return _beyond_catalogue(missing)
    if explanation.verdict == "cannot_tell":
        left = neither(explanation, {slug for each in missing for slug in (each.effect, *each.indistinguishable_from)})
        named = [f"{in_words(each)} ({likelihood(each.probability)})" for each in missing]
        named += [f"{name} ({likelihood(share)})" for name, share in left if len(missing) > 1]
        return f"Something was left out, but these data do not tell what: {'; '.join(named)}."
    sure = [each for each in missing if each.probability >= ASSERTED]
    parts = []
    for kind, opening in (
        ("physics", "the simulation leaves out "),
        ("instrument", "an instrument or a configured value is at fault: "),
    ):
        named = [f"{effect(each.effect)} ({likelihood(each.probability)})" for each in sure if each.kind == kind]
        if named:
            parts.append(opening + listed(named))
    doubtful = [each for each in missing if each not in sure]
    if doubtful:
        named = [one_of(each, missing, likelihood(each.probability)) for each in doubtful]
        parts.append(f"considered, but not asserted: {'; '.join(named)}")
    sentence = "; ".join(parts) or "something was left out"
    return f"{sentence[0].upper()}{sentence[1:]}."


def _beyond_catalogue(missing: Sequence[Missing]) -> str:
    """Say that something is missing which the catalogue lacks, what it is like where that is known, and what else is
    missing beside it.
    """
    unknown, known = ([each for each in missing if (each.kind == UNKNOWN) is kind] for kind in (True, False))
    like = [f"{in_words(each)} ({likelihood(each.probability)})" for each in unknown if is_like(each)]
    smooth = [f" ({likelihood(each.probability)})" for each in unknown if not is_like(each)]
    sure, others = (
        listed([f"{effect(e.effect)} ({percent(e.probability)})" for e in known if (e.probability >= ASSERTED) is kind])
        for kind in (True, False)
    )
    explains = f"as well as {listed(like)}" if like else f"well enough{''.join(smooth)}"
    return (
        f"Simulation and recording differ, and nothing in the catalogue explains it {explains}."
        + (" Something else is left beside that." if like and smooth else "")
        + (f" What the simulation leaves out beside that is {sure}." if sure else "")
        + (f" Considered, but not asserted: {others}." if others else "")
    )


def _nothing(explanation: Explanation) -> str:
    """Say that nothing was found, and not that all is well where errors stay above the noise or rows are few."""
    far, other = listed(readable.above_noise(explanation)), listed(readable.apart(explanation))
    n, few = explanation.n, readable.few(explanation)
    if other:
        return f"No physics is known to be missing, but the other simulator's soil is another: its {other} differ."
    if far and few:
        return f"{n} rows are too few to tell what is missing: the simulation misses {far} by more than noise."
    if far:
        return f"The simulation misses {far} by more than noise, and what was recorded does not tell why."
    nothing = "Nothing that held-out data ask for is missing from the simulation"
    return f"{nothing}, as far as {n} rows can tell." if few else f"{nothing}."
