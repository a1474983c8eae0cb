"""Posterior probabilities of sets of effects, of effects, and of something that the catalogue lacks.

P(set | data) is proportional to the prior of the set times its evidence, averaged over the forms of its effects. Each
set competes with and without a discrepancy.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ...framework.core.explanation import UNKNOWN
from .evidence import Discrepancy, discrepancy
from .hyperparameters import PRIOR_EFFECT, PRIOR_UNKNOWN, TEMPERATURE
from .search import Hypothesis, Search

_MOST_DISCREPANCIES = 6
"""Number of the most probable sets for which a discrepancy is computed."""


@dataclass(frozen=True)
class Posterior:
    """Probabilities.

    Parameters
    ----------
    sets
        Of each set of effects (slugs), with or without a discrepancy (``"unknown"``), the most probable first.
    effects
        Of each effect by slug, summed over the sets.
    unknown
        Of something that the catalogue lacks.
    best
        Best hypothesis of each set.
    discrepancies
        Of the best hypotheses of the sets for which it was computed.
    """

    sets: dict[frozenset[str], float]
    effects: dict[str, float]
    unknown: float
    best: dict[frozenset[str], Hypothesis]
    discrepancies: dict[frozenset[str], Discrepancy]


def posterior(
    found: Search, *, effect: float = PRIOR_EFFECT, unknown: float = PRIOR_UNKNOWN, temperature: float = TEMPERATURE
) -> Posterior:
    """Compute the posterior from all hypotheses that were fitted.

    Parameters
    ----------
    found
        Result of the search.
    effect, unknown, temperature
        Prior probabilities of an effect that does not state its own and of something that the catalogue lacks, and the
        divisor of differences of log evidence [-].
    """
    by_set: dict[frozenset[str], list[float]] = {}
    for each in found.hypotheses:
        by_set.setdefault(each.slugs, []).append(each.log_evidence / temperature + found.log_prior(each, effect))
    best = found.best()
    weight = {slugs: float(np.logaddexp.reduce(values)) for slugs, values in by_set.items()}
    known = math.log(1.0 - unknown)
    total = {slugs: value + known for slugs, value in weight.items()}
    leading = sorted(weight, key=lambda slugs: -weight[slugs])[:_MOST_DISCREPANCIES]
    discrepancies = {}
    for slugs in dict.fromkeys([frozenset[str](), *leading]):
        added = discrepancy(found.problem, best[slugs].fitted)
        discrepancies[slugs] = added
        total[slugs | {UNKNOWN}] = weight[slugs] + added.log_evidence / temperature + math.log(unknown)
    whole = np.logaddexp.reduce(list(total.values()))
    sets = {slugs: float(np.exp(value - whole)) for slugs, value in sorted(total.items(), key=lambda kv: -kv[1])}
    effects: dict[str, float] = {}
    for slugs, probability in sets.items():
        for slug in slugs:
            effects[slug] = effects.get(slug, 0.0) + probability
    return Posterior(sets, effects, effects.pop(UNKNOWN, 0.0), best, discrepancies)
