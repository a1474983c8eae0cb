"""Search for what was left out: effects fitted with the soil, one by one, then in sets, judged on held-out blocks."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from ..augmented import SOIL_COUNT, AugmentedWheel
from ..effects.catalogue import FROM_RESIDUALS, effects_for
from ..effects.effect import Effect
from .fitting import Problem, fit
from .held_out import hold_out
from .steps import normal_equations, scaled_inverse
from .textbook import best_fit
from .trial import ASKED_FOR, Trial, situation, starts_of, try_adding, without

MOST_EFFECTS = 3
FURTHER_ASKED_FOR = 23.0
"""Nats that a further effect has to gain on held-out blocks: of 111 right pairs of the study's recordings one gained
less, of six second effects that were not there four did."""

SHARE_ASKED_FOR, MOST_ASKED_FOR = 0.08, 40.0
"""A further effect has to gain at least this share of what is gained already [-], up to so many nats."""

_LEAST_PROMISE = 2.5
"""Effects that promise less [nats] are not fitted."""

_GLIMPSE = 6
"""Iterations that show whether an effect that cannot be weighed from nothing is worth fitting beside others."""

_TRIED_IN_SETS = 6
"""Effects tried beside those already found: the most promising ones."""

_FAR_LESS = 0.1
"""Effects that promise less than this share of what another one gained are not fitted [-]."""

_THREADS = 2
"""Effects fitted at once: the heavy parts let go of Python's lock."""

_QUIET = 0.01
"""How much quiet ground varies [-]."""

_NOT_FAR = 0.5
"""A second effect is sought beside the runner-up too, where it gained at least this share of what the best did [-]."""

_ANCHORS = 3
"""Effects from whose soils the textbook wheel is fitted once more."""


@dataclass(frozen=True)
class Search:
    """The textbook wheel, every set of effects tried, and the set that held-out blocks ask for (may be empty).

    `passed` names sets that were not fitted, with the nats that they promised.
    """

    textbook: Trial
    trials: tuple[Trial, ...]
    passed: tuple[tuple[str, float], ...]
    chosen: Trial


def promise(problem: Problem, base: Trial, effect: Effect) -> float:
    """Nats that an effect's first step promises on top of a fitted set, everything else following.

    The step is from nothing and, where the effect has several starts, from each of those: a channel that is late by
    more than what it follows takes to change is no better for being a little less late. Beside others it is tried in
    quiet ground too, whose variation may have stood in for the effect.
    """
    model = AugmentedWheel(problem.samples.wheel, (*base.effects, effect))
    prior = problem.prior(model)
    starts = effect.starts()
    null = np.array([parameter.null for parameter in effect.parameters])
    noises = [base.fitted.noise]
    if base.effects and base.fitted.noise.spread.max() > 2.0 * _QUIET:
        noises.append(replace(base.fitted.noise, spread=np.full(2, _QUIET)))
    nowhere, promised = 0.0, []
    for number, start in enumerate([null, *(starts if len(starts) > 1 else [])]):
        vector = np.concatenate([base.fitted.vector, start])
        answer = problem.linearise(model, vector, base.fitted.theta_1)
        for noise in noises:
            innovations, jacobian, loss = problem.whitened(answer, noise)
            total = float(loss.sum()) + prior.loss(vector) + problem.noise_loss(noise)
            gradient, information = normal_equations(innovations, jacobian)
            at_best = number == 0 and noise is base.fitted.noise
            if at_best:
                # The set itself is at its best.
                nowhere, gradient[: len(base.fitted.vector)] = total, 0.0
            else:
                gradient += prior.precision * (prior.mean - vector)
            information[np.diag_indices_from(information)] += prior.precision + 1e-12
            free = ~((vector <= prior.lower) & (gradient < 0.0)) & ~((vector >= prior.upper) & (gradient > 0.0))
            if at_best:
                free[: len(base.fitted.vector)] = True
            step = 0.5 * float(gradient[free] @ scaled_inverse(information[np.ix_(free, free)]) @ gradient[free])
            promised.append(nowhere - total + step)
    return max(promised)


def _glimpse(problem: Problem, base: Trial, effect: Effect) -> float:
    """Nats that an effect which cannot be weighed from nothing gains beside others in a few steps, noise as it is."""
    model = AugmentedWheel(problem.samples.wheel, (*base.effects, effect))
    seen = [
        fit(
            problem, model, start, base.fitted.noise, base.fitted.theta_1, iterations=_GLIMPSE, settle=False
        ).score
        for start in starts_of(base, effect)
    ]  # fmt: skip
    return max(seen) - base.fitted.score


def search(
    problem: Problem, textbook: Trial, catalogue: Sequence[Effect], tell: Callable[[str], None] = lambda _: None
) -> Search:
    """Try every effect alone, then add, swap and drop while held-out blocks ask for it.

    Parameters
    ----------
    problem
        The samples.
    textbook
        The fit without effects.
    catalogue
        Forms of effects to try.
    tell
        Told what is being tried.
    """
    trials: list[Trial] = []
    passed: list[tuple[str, float]] = []

    def named(base: Trial, effect: Effect) -> str:
        return " + ".join(each.name for each in (*base.effects, effect))

    def promised_by(base: Trial, effect: Effect) -> float:
        if effect.nested:
            return promise(problem, base, effect)
        # Three together are not asserted: what only fits tell is not worth them there.
        if len(base.effects) > 1:
            return -np.inf
        # Alone, and where the ground's variation would explain a place first, only a fit tells.
        return _glimpse(problem, base, effect) if base.effects and not effect.local else np.inf

    def attempt(
        base: Trial, effects: Sequence[Effect], least: float, most: int, formerly: Sequence[Trial] = ()
    ) -> list[Trial]:
        """Fit those effects beside a set that promise enough, at most so many."""
        former = {trial.effects[-1].name: trial for trial in formerly if trial.gain >= ASKED_FOR}
        answer: list[Trial] = []
        with ThreadPoolExecutor(_THREADS) as pool:
            nats = list(pool.map(partial(promised_by, base), effects))
            promised = sorted(zip(nats, effects, strict=True), key=lambda pair: -pair[0])
            # What cannot be weighed first takes no other's place.
            most += nats.count(np.inf)
            while promised:
                gained = max((trial.gain - base.gain for trial in answer), default=0.0)
                worth = [pair for pair in promised[: most - len(answer)] if pair[0] >= max(least, _FAR_LESS * gained)]
                if not worth:
                    break
                now, promised = worth[:_THREADS], promised[len(worth[:_THREADS]) :]
                tell(", ".join(named(base, effect) for _, effect in now))
                ahead = max((trial.fitted.score for trial in answer), default=-math.inf)
                each = partial(try_adding, problem, textbook, base)
                forms = [effect for _, effect in now]
                answer += pool.map(each, forms, [ahead] * len(now), [former.get(effect.name) for effect in forms])
        passed.extend((named(base, effect), nats) for nats, effect in promised if nats > -np.inf)
        trials.extend(answer)
        return answer

    tell("every effect alone")
    singles = attempt(textbook, catalogue, _LEAST_PROMISE, len(catalogue))
    anchored = _anchored(problem, textbook, singles)
    if anchored is not textbook:
        tell("every effect alone, from a better soil")
        textbook = anchored
        trials.clear()
        passed.clear()
        singles = attempt(textbook, catalogue, _LEAST_PROMISE, len(catalogue), singles)
    best = max(singles, key=lambda trial: trial.gain, default=textbook)
    if best.gain < ASKED_FOR:
        return Search(textbook, tuple(trials), tuple(passed), textbook)
    allowed = frozenset(effect.slug for effect in catalogue)

    while len(best.effects) < MOST_EFFECTS:
        larger = attempt(best, _others(problem, best, catalogue, allowed, best.slugs), ASKED_FOR, _TRIED_IN_SETS)
        if second := _runner_up(singles, best):
            others = _others(problem, second, catalogue, frozenset(), best.slugs | second.slugs)
            larger += attempt(second, [each for each in others if each.nested], ASKED_FOR, _TRIED_IN_SETS)
        challenger = max(larger, key=lambda trial: trial.gain, default=best)
        if challenger.gain - best.gain < _asked_of(best):
            break
        best = challenger
        # What was found first may have stood in for two: exchange it for others.
        for effect in best.effects[:-1]:
            rest = without(problem, textbook, best, effect)
            # What residuals lay out was tried beside all that was found: it does not stand in for two.
            instead = _others(problem, rest, catalogue, frozenset(), best.slugs)
            for trial in attempt(rest, instead, ASKED_FOR, _TRIED_IN_SETS):
                if trial.gain > best.gain:
                    best = trial
    best = _pruned(problem, textbook, best, trials)
    return Search(textbook, tuple(trials), tuple(passed), best)


def _runner_up(singles: Sequence[Trial], best: Trial) -> Trial | None:
    """Single effect that is not far behind the best one, which may stand in for two."""
    others = [trial for trial in singles if trial.slugs != best.slugs]
    second = max(others, key=lambda trial: trial.gain, default=None)
    if len(best.effects) > 1 or second is None or second.gain < max(ASKED_FOR, _NOT_FAR * best.gain):
        return None
    return second


def _others(
    problem: Problem, base: Trial, catalogue: Sequence[Effect], allowed: frozenset[str], taken: frozenset[str]
) -> list[Effect]:
    """Give the forms that are not taken, those that residuals lay out as a set's residuals do."""
    laid_out = effects_for(situation(problem, base.fitted), allowed.intersection(FROM_RESIDUALS) - taken)
    return [e for e in catalogue if e.slug not in taken and e.slug not in FROM_RESIDUALS] + laid_out


def _anchored(problem: Problem, textbook: Trial, singles: Sequence[Trial]) -> Trial:
    """Refit the textbook wheel from the soils that effects found: none may shine for having left a poor fit."""
    better = sorted((trial for trial in singles if trial.gain >= ASKED_FOR), key=lambda trial: -trial.fitted.score)
    starts = [(trial.fitted.vector[:SOIL_COUNT], trial.fitted.theta_1) for trial in better[:_ANCHORS]]
    if not starts:
        return textbook
    before = problem.most, problem.weights
    fitted = best_fit(problem, starts)
    if fitted.score < textbook.fitted.score + 1.0:
        problem.most, problem.weights = before
        return textbook
    return Trial((), fitted, hold_out(problem, fitted), 0.0)


def _asked_of(trial: Trial) -> float:
    """Nats that a further effect has to gain: published forms of one effect differ, and the difference is no effect."""
    if trial.unheard_of:
        return ASKED_FOR
    return max(FURTHER_ASKED_FOR, min(SHARE_ASKED_FOR * trial.gain, MOST_ASKED_FOR))


def _pruned(problem: Problem, textbook: Trial, best: Trial, trials: list[Trial]) -> Trial:
    """Drop effects that held-out blocks do not ask for once the others are there."""
    while len(best.effects) > 1:
        smaller = [without(problem, textbook, best, effect) for effect in best.effects]
        trials.extend(smaller)
        challenger = max(smaller, key=lambda trial: trial.gain)
        if best.gain - challenger.gain >= _asked_of(challenger):
            return best
        best = challenger
    return best
