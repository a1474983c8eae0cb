"""Which of several sets of effects that do nearly as well is put forward."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from ..fit.fitting import Problem
from ..fit.trial import ASKED_FOR, UNHEARD_OF, WORTH_FURTHER, Trial

_AS_GOOD = 0.05
"""Mean ln(square) of held-out errors by which one form may err more than another and still do as well [-]."""

_EVEN = 1.0
"""Nats up to which two sets do alike."""


def plainest(problem: Problem, tried: Sequence[Trial], best: Trial) -> Trial:
    """What takes the place of a set with a form that others' further parameters make, or that says no more than
    another's whole law: as many effects by fewer parameters, where those are worth it neither in nats nor in errors.
    """
    most = best.held_out.error(problem) + _AS_GOOD
    near = [each for each in tried if each.gain > best.gain - WORTH_FURTHER and each.held_out.error(problem) < most]
    if any(effect.freed for effect in best.effects):
        fewer = [each for each in near if each.slugs == best.slugs and _size(each) < _size(best)]
        return max(fewer, key=lambda trial: trial.gain, default=best)
    number = whole_law(tried, best)
    return tried[number] if number is not None and tried[number].held_out.error(problem) < most else best


def says_no_more(tried: Iterable[Trial], trial: Trial) -> bool:
    """Say whether one of a set's effects says no more than the part of its law that another's whole law says as well:
    what further parameters it has are not worth it.
    """
    return _said_by(tried, trial) is not None


def _said_by(tried: Iterable[Trial], trial: Trial) -> frozenset[str] | None:
    """Slugs of the set that would say the same by another's whole law; None where each effect says more."""
    parts = [each for each in tried if each.slugs == trial.slugs and trial.gain < each.gain + WORTH_FURTHER]
    for each in (trial, *parts):
        for effect in each.effects:
            if effect.said_by:
                return trial.slugs - {effect.slug} | {effect.said_by}
    return None


def whole_law(tried: Sequence[Trial], trial: Trial) -> int | None:
    """Number of the best set that says by another's whole law what one says by part of its own, and gains as much."""
    slugs = _said_by(tried, trial) or frozenset()
    others = [
        number for number, each in enumerate(tried)
        if each.slugs == slugs and len(slugs) == len(trial.slugs) and each.gain > trial.gain - _EVEN
    ]  # fmt: skip
    return max(others, key=lambda number: tried[number].gain, default=None)


def _size(trial: Trial) -> int:
    return len(trial.fitted.vector)


def published(tried: Iterable[Trial], best: Trial) -> Trial:
    """What takes the place of a set beyond anything published: one as large that is not so far behind as that counts
    against it, else one of one effect more that gains as much. The set itself where there is neither.
    """
    known = [trial for trial in tried if not trial.unheard_of]
    enough = max(ASKED_FOR, best.gain - UNHEARD_OF)
    instead = [trial for trial in known if as_large(trial, best) and trial.gain > enough]
    larger = [trial for trial in known if len(trial.unexpected) == len(best.unexpected) + 1 and trial.gain >= best.gain]
    return max(instead or larger, key=lambda trial: trial.gain, default=best)


def as_large(trial: Trial, best: Trial) -> bool:
    """Say whether a set has as many effects as the best one, or as many besides what the vehicle announces."""
    as_many = len(trial.unexpected) == len(best.unexpected)
    return len(trial.effects) == len(best.effects) or (as_many and bool(best.unexpected))
