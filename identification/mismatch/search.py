"""Search for what was left out: effects fitted with the soil, one by one, then in sets, judged on held-out blocks."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial

import numpy as np

from ...framework.core.soil import SoilKnowledge
from ..augmented import SOIL_COUNT, AugmentedWheel
from ..effects.catalogue import FROM_RESIDUALS, effects_for
from ..effects.effect import LOAD, SLIP, Effect, Situation
from .fitting import Fitted, Problem, fit
from .held_out import HeldOut, hold_out
from .samples import Samples, quietness
from .steps import normal_equations, scaled_inverse
from .textbook import best_fit, fit_textbook

ASKED_FOR = 12.0
"""An effect is added where it gains more than this many nats on held-out blocks."""

MOST_EFFECTS = 3
SHARE_ASKED_FOR, MOST_ASKED_FOR = 0.08, 40.0
"""A further effect has to gain at least this share of what is gained already [-], up to so many nats."""

_LEAST_PROMISE = 2.5
"""Effects that promise less [nats] are not fitted."""

_GLIMPSE = 8
"""Iterations that show whether an effect that cannot be weighed from nothing is worth fitting beside others."""

_TRIED_IN_SETS = 6
"""Effects tried beside those already found: the most promising ones."""

_FAR_LESS = 0.1
"""Effects that promise less than this share of what another one gained are not fitted [-]."""

_THREADS = 2
"""Effects fitted at once: the heavy parts let go of Python's lock."""

_SHORT, _STILL_MOVING = 5, 3.0
"""Iterations by which starts are compared, and how far behind the best [nats] one has not come to rest by then."""

_LAID_OUT = 15
"""Iterations by which a place along the track is laid out."""

_ANCHORS = 3
"""Effects from whose soils the textbook wheel is fitted once more."""


@dataclass(frozen=True)
class Trial:
    """A set of effects, its fit and how it predicts.

    `gain` over the textbook wheel [nats] is the lesser of that on held-out blocks and that in the fit: a wrong model
    may fail wildly on a block that the others do not foresee, and what merely calms that failure explains nothing.
    """

    effects: tuple[Effect, ...]
    fitted: Fitted
    held_out: HeldOut
    gain: float

    @property
    def slugs(self) -> frozenset[str]:
        """Public names of the effects."""
        return frozenset(effect.slug for effect in self.effects)


@dataclass(frozen=True)
class Search:
    """The textbook wheel, every set of effects tried, and the set that held-out blocks ask for (may be empty).

    `passed` names sets that were not fitted, with the nats that they promised.
    """

    textbook: Trial
    trials: tuple[Trial, ...]
    passed: tuple[tuple[str, float], ...]
    chosen: Trial


def situation(problem: Problem, textbook: Fitted) -> Situation:
    """Describe the recording to the catalogue."""
    samples = problem.samples
    measured = samples.measured
    residuals = np.full_like(measured, np.nan)
    residuals[:, problem.answers] = textbook.residuals / textbook.noise.answers
    with np.errstate(invalid="ignore"):
        seen = np.isfinite(measured).any(axis=0)
        typical = np.where(seen, np.sqrt(np.nanmean(np.where(seen, measured, 0.0) ** 2, axis=0)), np.nan)
    absent = [channel for channel in (1, 2, 4) if channel not in samples.answers]
    typical[absent] = np.nan
    return Situation(
        samples.wheel,
        samples.drive,
        typical,
        measured[:, 2],
        residuals,
        float(textbook.vector[0]),
        float(textbook.vector[1]),
    )


def textbook_trial(samples: Samples, known: SoilKnowledge | None = None) -> tuple[Problem, Trial]:
    """Fit the textbook wheel and hold its blocks out."""
    problem, fitted = fit_textbook(samples, known)
    return problem, Trial((), fitted, hold_out(problem, fitted), 0.0)


def try_adding(problem: Problem, textbook: Trial, base: Trial, effect: Effect, rival: float = -math.inf) -> Trial:
    """Fit a set with one more effect, from each of its starts, and hold its blocks out.

    The further it stays behind the score of a `rival`, the less exactly it is fitted.
    """
    effects = (*base.effects, effect)
    model = AugmentedWheel(problem.samples.wheel, effects)
    starts = _starts(base, effect)
    points = [(start, base.fitted.noise) for start in starts]
    if effect.local:
        points += [(_laid_out(problem, model, base, start), problem.first_noise) for start in starts]
    several = len(points) > 1
    fits = [
        fit(problem, model, start, noise, base.fitted.theta_1, iterations=_SHORT if several else 25, rival=rival)
        for start, noise in points
    ]
    fits.sort(key=lambda fitted: -fitted.score)
    best = fits[0]
    if several:
        best = fit(problem, model, best.vector, best.noise, best.theta_1, rival=rival)
        if best.score < base.fitted.score + ASKED_FOR:
            # The first ones came to rest where the effect is nothing: those that have not are followed to their end.
            slow = [each for each in fits[1:] if fits[0].score - each.score > _STILL_MOVING]
            ended = [fit(problem, model, each.vector, each.noise, each.theta_1, rival=rival) for each in slow]
            best = max([best, *ended], key=lambda fitted: fitted.score)
    if best.score >= base.fitted.score + ASKED_FOR:
        for variant in effect.variants():
            model = AugmentedWheel(problem.samples.wheel, (*base.effects, variant))
            fitted = fit(problem, model, best.vector, best.noise, best.theta_1, rival=max(rival, best.score))
            best = max(best, fitted, key=lambda each: each.score)
    return _trial(problem, textbook, best.model.effects, best, hold_out(problem, best))


def _starts(base: Trial, effect: Effect) -> list[np.ndarray]:
    """Vectors from which a set with one more effect may be fitted."""
    soil, others = np.split(base.fitted.vector, [SOIL_COUNT])
    return [np.concatenate([effect.beside(soil), others, start]) for start in effect.starts()]


def _laid_out(problem: Problem, model: AugmentedWheel, base: Trial, start: np.ndarray) -> np.ndarray:
    """Fit a place while the ground elsewhere is held to vary little: else its variation has explained it already."""
    noise = problem.first_noise
    return fit(problem, model, start, noise, base.fitted.theta_1, iterations=_LAID_OUT, settle=False).vector


def _of_quiet(problem: Problem, fitted: Fitted) -> float:
    """Nats that a delay gains because errors of averaged load and slip are quieter there, and not for being right."""
    weights = problem.weights or fitted.response
    by_latent = np.nan_to_num(weights.by_latent[:, problem.answers])
    answer = 0.0
    for effect, where in fitted.model.slices():
        late = effect.delay(fitted.vector[where])
        if late is None:
            continue
        channel, lag = late
        own = by_latent
        if channel in (LOAD, SLIP):
            own = by_latent * (np.array([LOAD, SLIP]) == channel)
        spread = np.einsum("nca,ab,ncb->nc", own, problem.latent_covariance, own)
        everything = np.einsum("nca,ab,ncb->nc", by_latent, problem.latent_covariance, by_latent)
        share = problem.seen * spread / (everything + fitted.noise.answers**2)
        if channel not in (LOAD, SLIP):
            share = share[:, problem.answers.index(channel)]
        answer += 0.5 * max(1.0 - quietness(lag), 0.0) * float(share.sum())
    return answer


def _trial(
    problem: Problem, textbook: Trial, effects: tuple[Effect, ...], fitted: Fitted, held: HeldOut
) -> Trial:  # fmt: skip
    gain = min(held.gain(textbook.held_out)[0], fitted.score - textbook.fitted.score)
    gain -= sum(effect.sought for effect in effects) + _of_quiet(problem, fitted)
    return Trial(effects, fitted, held, gain)


def without(problem: Problem, textbook: Trial, trial: Trial, dropped: Effect) -> Trial:
    """Fit a set less one of its effects."""
    kept = [(effect, where) for effect, where in trial.fitted.model.slices() if effect is not dropped]
    if not kept:
        return textbook
    model = AugmentedWheel(problem.samples.wheel, tuple(effect for effect, _ in kept))
    vector = np.concatenate([trial.fitted.vector[:SOIL_COUNT], *[trial.fitted.vector[where] for _, where in kept]])
    fitted = fit(problem, model, vector, trial.fitted.noise, trial.fitted.theta_1)
    held = hold_out(problem, fitted)
    return _trial(problem, textbook, model.effects, fitted, held)


def promise(problem: Problem, base: Trial, effect: Effect) -> float:
    """Nats that an effect's first step promises on top of a fitted set, everything else following.

    The step is from nothing and, where the effect has several starts, from each of those: a channel that is late by
    more than what it follows takes to change is no better for being a little less late.
    """
    model = AugmentedWheel(problem.samples.wheel, (*base.effects, effect))
    prior = problem.prior(model)
    starts = effect.starts()
    null = np.array([parameter.null for parameter in effect.parameters])
    nowhere, promised = 0.0, []
    for number, start in enumerate([null, *(starts if len(starts) > 1 else [])]):
        vector = np.concatenate([base.fitted.vector, start])
        answer = problem.linearise(model, vector, base.fitted.theta_1)
        innovations, jacobian, loss = problem.whitened(answer, base.fitted.noise)
        total = float(loss.sum()) + prior.loss(vector)
        gradient, information = normal_equations(innovations, jacobian)
        if number == 0:
            # The set itself is at its best.
            nowhere, gradient[: len(base.fitted.vector)] = total, 0.0
        else:
            gradient += prior.precision * (prior.mean - vector)
        information[np.diag_indices_from(information)] += prior.precision + 1e-12
        free = ~((vector <= prior.lower) & (gradient < 0.0)) & ~((vector >= prior.upper) & (gradient > 0.0))
        if number == 0:
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
        for start in _starts(base, effect)
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
        # Alone, and where the ground's variation would explain a place first, only a fit tells.
        return _glimpse(problem, base, effect) if base.effects and not effect.local else np.inf

    def attempt(base: Trial, effects: Sequence[Effect], least: float, most: int) -> list[Trial]:
        """Fit those effects beside a set that promise enough, at most so many."""
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
                each = partial(try_adding, problem, textbook, base, rival=ahead)
                answer += pool.map(each, [effect for _, effect in now])
        passed.extend((named(base, effect), nats) for nats, effect in promised)
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
        singles = attempt(textbook, catalogue, _LEAST_PROMISE, len(catalogue))
    best = max(singles, key=lambda trial: trial.gain, default=textbook)
    if best.gain < ASKED_FOR:
        return Search(textbook, tuple(trials), tuple(passed), textbook)
    allowed = frozenset(effect.slug for effect in catalogue)

    while len(best.effects) < MOST_EFFECTS:
        larger = attempt(best, _others(problem, best, catalogue, allowed, best.slugs), ASKED_FOR, _TRIED_IN_SETS)
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
    return max(ASKED_FOR, min(SHARE_ASKED_FOR * trial.gain, MOST_ASKED_FOR))


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
