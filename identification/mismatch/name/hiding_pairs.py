"""Pairs of effects of which either alone explains little, both together much.

A search that adds one effect to what gains enough alone does not come upon them: they hide each other, or each gains
nearly what is asked.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import partial
from itertools import combinations

import numpy as np

from ...effects.effect import Effect
from ...mechanics.augmented import AugmentedWheel
from ..fit.fitting import Problem
from ..fit.steps import Prior, normal_equations, scaled_inverse, scaled_solve
from ..fit.together import together
from ..fit.trial import ASKED_FOR, Trial, try_adding
from .asked import ROUGH
from .tries import Tries, gain_of

_MOST = 6
"""Pairs that are fitted."""

_NEARLY = 5.0
"""Nats that each of two has to gain alone where neither gains what is asked: of 90 of the study's nulls (seeds 793600
to 793899) no two did."""

_BASES = 2
"""Effects that fit better alone beside which a hump and the like are sought: of 74 of the study's nulls (seeds 795000
to 795279) one such pair promised enough to be fitted, and gained 22 nats of the 27 that are asked."""

_RIDGE = 1e-9
"""Of columns that two effects share [-]."""


def hiding_pairs(tries: Tries, singles: Sequence[Trial], best: Trial) -> list[Trial]:
    """Fit pairs that promise more than the best single effect gains, and by what is asked of an effect more together
    than both do alone; a pair of effects in the forms that promise most.

    Weighed are effects that a step from nothing foretells, and neither places nor what the vehicle announces.
    """
    effects = [effect for effect in tries.catalogue if effect.nested and not effect.local and not effect.expected]
    first: dict[frozenset[str], tuple[Effect, Effect]] = {}
    for nats, pair in _promised(tries.problem, tries.textbook, effects):
        if nats >= max(best.gain, ASKED_FOR):
            first.setdefault(frozenset(effect.slug for effect in pair), pair)
    pairs = list(first.values())[:_MOST]
    if not pairs:
        return []
    tries.tell("pairs of effects that hide each other")
    answer = together(partial(_fitted, tries, singles, best), pairs)
    tries.trials.extend(answer)
    return answer


def pairs_of_weak(tries: Tries, singles: Sequence[Trial]) -> list[Trial]:
    """Fit pairs of effects each of which gains nearly what is asked of it, in the forms that gain most alone; from
    either one's fit, for they may end elsewhere.
    """
    first = {trial.slugs: trial for trial in sorted(singles, key=gain_of) if not trial.effects[0].local}
    weak = sorted((trial for trial in first.values() if trial.gain >= _NEARLY), key=gain_of, reverse=True)
    pairs = [(one.effects[0], other.effects[0]) for one, other in combinations(weak, 2)][:_MOST]
    if not pairs:
        return []
    tries.tell("pairs of effects that are weak alone")
    answer = together(partial(_fitted, tries, singles, weak[0]), [*pairs, *((other, one) for one, other in pairs)])
    tries.trials.extend(answer)
    return answer


def pairs_beside_better_fits(tries: Tries, singles: Sequence[Trial]) -> list[Trial]:
    """Fit what only a fit tells, as a hump in the shear stress, with single effects that fit better alone, though they
    foretell rows held out no better: what the soil makes up for of one may need the other.
    """
    better = [trial for trial in sorted(singles, key=_fits) if _fits(trial) >= _fits(tries.textbook) + _NEARLY]
    first = {trial.slugs: trial for trial in better if not trial.effects[0].local}
    answer: list[Trial] = []
    for base in sorted(first.values(), key=_fits, reverse=True)[:_BASES]:
        others = [each for each in tries.others(base.slugs) if not (each.local or each.expected)]
        # Two that a step from nothing foretells are weighed together, in `hiding_pairs`.
        others = [each for each in others if not (each.nested and base.effects[0].nested)]
        answer += tries.attempt(base, tries.weigh(base, others))
    return answer


def _fits(trial: Trial) -> float:
    """Score of a fit, less the nat that each parameter gains of noise, as by Akaike (1974)."""
    return trial.fitted.score - len(trial.fitted.vector)


def _promised(
    problem: Problem, textbook: Trial, effects: Sequence[Effect]
) -> list[tuple[float, tuple[Effect, Effect]]]:  # fmt: skip
    """Pairs that hide each other, with the nats that a step from nothing promises of both, the most first; the effect
    that promises more alone comes first in each.
    """
    if len(effects) < 2:
        return []
    gradient, information, rises, falls, of_effect = _equations(problem, textbook, effects)

    def promise(*numbers: int) -> float:
        return _step(gradient, information, rises, falls, np.concatenate([of_effect[number] for number in numbers]))

    alone = [promise(number) for number in range(len(effects))]
    answer = []
    for one, other in combinations(range(len(effects)), 2):
        if effects[one].slug == effects[other].slug:
            continue
        nats = promise(one, other)
        if nats - alone[one] - alone[other] >= ASKED_FOR:
            one, other = sorted((one, other), key=lambda number: -alone[number])
            answer.append((nats, (effects[one], effects[other])))
    return sorted(answer, key=lambda each: -each[0])


def _equations(
    problem: Problem, textbook: Trial, effects: Sequence[Effect]
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, list[np.ndarray]]:
    """Gradient (k,) and information (k, k) of the parameters of all effects at nothing, the soil following; which may
    rise and which may fall from there (k,); and which of them are each effect's.
    """
    columns, priors = zip(*together(partial(_columns, problem, textbook), effects), strict=True)
    soil = len(textbook.fitted.vector)
    jacobian = np.concatenate([columns[0][1], *[each[:, :, soil:] for _, each in columns[1:]]], axis=-1)
    gradient, information = normal_equations(columns[0][0], jacobian)
    precision = np.concatenate([priors[0].precision, *[prior.precision[soil:] for prior in priors[1:]]])
    information[np.diag_indices_from(information)] += precision
    # The textbook wheel is at its best: its gradient is none.
    across = information[:soil, soil:]
    followed = information[soil:, soil:] - across.T @ scaled_inverse(information[:soil, :soil]) @ across
    null = np.concatenate([[parameter.null for parameter in effect.parameters] for effect in effects])
    low, high = (np.concatenate([getattr(prior, side)[soil:] for prior in priors]) for side in ("lower", "upper"))
    ends = np.cumsum([len(effect.parameters) for effect in effects])
    return gradient[soil:], followed, null < high, null > low, np.split(np.arange(ends[-1]), ends[:-1])


def _columns(
    problem: Problem, textbook: Trial, effect: Effect
) -> tuple[tuple[np.ndarray, np.ndarray], Prior]:  # fmt: skip
    """Innovations and derivatives of the textbook wheel with an effect that is nothing yet, and the prior of both."""
    fitted = textbook.fitted
    model = AugmentedWheel(problem.samples.wheel, (effect,))
    vector = np.concatenate([fitted.vector, [parameter.null for parameter in effect.parameters]])
    there = fitted.response
    answer = problem.linearise(model, vector, there.entry(np.zeros(len(fitted.vector))), there)
    innovations, jacobian, _ = problem.whitened(answer, fitted.noise)
    return (innovations, jacobian), problem.prior(model)


def _step(
    gradient: np.ndarray, information: np.ndarray, rises: np.ndarray, falls: np.ndarray, chosen: np.ndarray
) -> float:
    """Nats that a step of the `chosen` parameters promises that does not leave their bounds."""
    while len(chosen):
        step = scaled_solve(information[np.ix_(chosen, chosen)], gradient[chosen], _RIDGE)
        within = ~((step > 0.0) & ~rises[chosen]) & ~((step < 0.0) & ~falls[chosen])
        if within.all():
            return 0.5 * float(gradient[chosen] @ step)
        chosen = chosen[within]
    return 0.0


def _fitted(tries: Tries, singles: Sequence[Trial], best: Trial, pair: tuple[Effect, Effect]) -> Trial:
    """Fit the second effect of a pair beside the first."""
    problem, textbook, (first, second) = tries.problem, tries.textbook, pair
    alone = next((trial for trial in singles if trial.names == {first.name}), None)
    alone = alone or try_adding(problem, textbook, textbook, first)
    # A rival that leaves much to the ground ends no fit that may explain it.
    rival = best.fitted.score if best.fitted.noise.spread.max() <= ROUGH else -math.inf
    return try_adding(problem, textbook, alone, second, rival)
