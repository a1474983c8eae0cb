"""What effects gained alone, or beside others: which ones, and which forms, are tried in place of each other."""

from __future__ import annotations

import math
from collections.abc import Sequence

from ...effects.effect import Effect
from ..fit.trial import ASKED_FOR, NOT_EXCLUDED, Trial, temperature

_NOT_FAR = 0.5
"""A second effect is sought beside runners-up and other forms too, where they gained this share of the best [-]."""

_RUNNERS_UP = 3
"""Other effects beside which a second one is sought."""

_FORMS = 3
"""Other forms of an effect beside which a second one is sought."""

FORMS_APART = 0.05
"""Share of what is gained by which forms of one effect may differ, besides what excludes a set [-]: of two recordings
in which a right set was missed for it a wedge was 0.047 behind Rankine's pressure, and Kacigin and Guskov's hump 0.021
behind what stood in for it."""

MOST_ALIKE = 4
"""Effects that do as well alone as one of a set, or beside the others, and are tried in its place."""


def runners_up(singles: Sequence[Trial], best: Trial) -> list[Trial]:
    """Other single effects that are not far behind the best one, each of which may be one of two that are there."""
    first: dict[frozenset[str], Trial] = {}
    for trial in sorted(singles, key=lambda trial: -trial.gain):
        if trial.slugs != best.slugs and trial.gain >= max(ASKED_FOR, _NOT_FAR * best.gain):
            first.setdefault(trial.slugs, trial)
    return list(first.values())[:_RUNNERS_UP]


def other_forms(singles: Sequence[Trial], effect: Effect) -> list[Trial]:
    """Other forms of an effect, not far behind alone: which one is right may show only beside a second effect."""
    forms = sorted((trial for trial in singles if effect.slug in trial.slugs), key=lambda trial: -trial.gain)
    near = [trial for trial in forms if trial.gain >= max(ASKED_FOR, _NOT_FAR * forms[0].gain)]
    return [trial for trial in near if trial.effects[0].name != effect.name][:_FORMS]


def alike(singles: Sequence[Trial], effect: Effect) -> set[str]:
    """Names of the single effects that do as well as an effect alone, few: each may be what it stands in for."""
    own = max((trial.gain for trial in singles if effect.slug in trial.slugs), default=math.inf)
    others = [trial for trial in singles if effect.slug not in trial.slugs and trial.gain >= ASKED_FOR]
    most = NOT_EXCLUDED * temperature(own) + FORMS_APART * own
    near = [trial for trial in others if abs(trial.gain - own) < most]
    near.sort(key=lambda trial: abs(trial.gain - own))
    return {trial.effects[0].name for trial in near[:MOST_ALIKE]}


def alike_beside(tried: Sequence[Trial], best: Trial, effect: Effect) -> list[Effect]:
    """Effects that do as well in one's place, the nearest first, whatever the forms of the others of a set were: a form
    of these that came late may not have been tried beside them.
    """
    kept = best.slugs - {effect.slug}
    own: dict[frozenset[str], float] = {}
    for trial in tried:
        if trial.slugs == best.slugs:
            forms = _forms(trial, kept)
            own[forms] = max(own.get(forms, 0.0), trial.gain)
    behind: dict[str, tuple[float, Effect]] = {}
    for trial in tried:
        forms, others = _forms(trial, kept), [each for each in trial.effects if each.slug not in best.slugs]
        if len(others) != 1 or len(trial.effects) != len(best.effects) or forms not in own:
            continue
        nats = own[forms] - trial.gain
        if nats < NOT_EXCLUDED * temperature(own[forms]):
            nearest = behind.get(others[0].slug)
            if nearest is None or nats < nearest[0]:
                behind[others[0].slug] = nats, others[0]
    return [other for _, other in sorted(behind.values(), key=lambda pair: pair[0])]


def _forms(trial: Trial, slugs: frozenset[str]) -> frozenset[str]:
    """Names of the forms that a set has of some effects."""
    return frozenset(effect.name for effect in trial.effects if effect.slug in slugs)
