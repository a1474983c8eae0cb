"""Which of several sets of effects that do nearly as well is put forward."""

from __future__ import annotations

from collections.abc import Iterable

from .fitting import Problem
from .trial import ASKED_FOR, UNHEARD_OF, WORTH_FURTHER, Trial

_AS_GOOD = 0.05
"""Mean ln(square) of held-out errors by which one form may err more than another and still do as well [-]."""


def plainest(problem: Problem, tried: Iterable[Trial], best: Trial) -> Trial:
    """What takes the place of a set with a form that others' further parameters make: the same effects by fewer, where
    those are worth it neither in nats nor in errors.
    """
    if not any(effect.freed for effect in best.effects):
        return best
    most = best.held_out.error(problem) + _AS_GOOD
    fewer = [each for each in tried if each.slugs == best.slugs and len(each.fitted.vector) < len(best.fitted.vector)]
    near = [each for each in fewer if each.gain > best.gain - WORTH_FURTHER]
    enough = [each for each in near if each.held_out.error(problem) < most]
    return max(enough, key=lambda trial: trial.gain, default=best)


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
