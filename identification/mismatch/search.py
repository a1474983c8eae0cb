"""Search for what was left out: effects fitted with the soil, one by one, then in sets, judged on held-out blocks."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np

from ..augmented import SOIL_COUNT
from ..effects.catalogue import FROM_RESIDUALS, effects_for
from ..effects.effect import Effect
from .asked import MOST_ASKED_FOR, is_bump, surplus
from .fitting import Problem, fit
from .held_out import hold_out
from .noise_floor import dispersion
from .preferred import as_large, plainest, published
from .promise import promised_by
from .singles import alike, other_forms, runners_up
from .textbook import best_fit
from .together import THREADS, together
from .trial import (
    ASKED_FOR,
    EXPECTED_ASKED_FOR,
    NOT_EXCLUDED,
    Trial,
    less,
    situation,
    temperature,
    try_adding,
    without,
)

MOST_EFFECTS = 3

_LEAST_PROMISE, _LEAST_BESIDE = 2.5, 8.0
"""Effects that promise less alone, and beside others, are not fitted [nats]: beside others less than is asked of them,
for a fit gains more than its first step promises (11.8, and then 20)."""

_TRIED_IN_SETS = 6
"""Effects tried beside those already found: the most promising ones."""

_FAR_LESS = 0.1
"""Effects that promise less than this share of what another one gained are not fitted [-]."""

_WORTH_ANOTHER = 5.0
"""What a second effect has to promise more beside another form of an effect than beside the best one [nats]."""

_RIVALS = 2
"""Sets as large as the best one and not excluded beside it whose effects are tried in other forms."""

_PARTNERS, _CLOSE = 2, 0.02
"""Effects that did nearly as well beside the best one, beside which others are sought in turn, and what share of a gain
is near [-]."""

_BESIDE_EXPECTED, _FAR_BEHIND = 4, 0.25
"""Single effects other than the best beside which what the vehicle's description announces is sought, and what share of
its gain they have [-]."""

_PLUS = " + "
"""Between the names of effects in a set."""

_ANCHORS = 3
"""Effects from whose soils the textbook wheel is fitted once more."""

_BETTER = 2.0
"""Nats by which it has to fit better for all effects to be weighed against it anew."""


@dataclass(frozen=True)
class Search:
    """The textbook wheel, every set of effects tried, and the set that held-out blocks ask for (may be empty).

    `passed` names sets that were not fitted, with the nats that they promised. Where every form is wrong, `dispersion`
    (`noise_floor.dispersion`) is what nats of sets have to be divided by, and `by_errors` has for each of the trials
    the most that it is credited with [nats]: what its errors alone tell on blocks that err independently.
    """

    textbook: Trial
    trials: tuple[Trial, ...]
    passed: tuple[tuple[str, float], ...]
    chosen: Trial
    dispersion: float = 1.0
    by_errors: tuple[float, ...] = ()


@dataclass(frozen=True)
class _Tries:
    """What was tried so far, and what was passed over."""

    problem: Problem
    textbook: Trial
    catalogue: Sequence[Effect]
    tell: Callable[[str], None]
    trials: list[Trial] = field(default_factory=list)
    passed: list[tuple[str, float]] = field(default_factory=list)

    def weigh(self, base: Trial, effects: Sequence[Effect]) -> list[tuple[float, Effect]]:
        """Give effects with what they promise beside a set [nats], the most promising ones first."""
        nats = together(partial(promised_by, self.problem, base), effects)
        return sorted(zip(nats, effects, strict=True), key=lambda pair: -pair[0])

    def attempt(
        self, base: Trial, promised: Sequence[tuple[float, Effect]], least: float = _LEAST_BESIDE,
        most: int = _TRIED_IN_SETS, formerly: Sequence[Trial] = (),
    ) -> list[Trial]:  # fmt: skip
        """Fit those effects beside a set that promise enough, at most so many; sorted by what they promise.

        A set that was reached in another order is fitted again: from another start it may end elsewhere.
        """
        former = {trial.effects[-1].name: trial for trial in formerly if trial.gain >= ASKED_FOR}
        # What cannot be weighed takes no other's place, and follows the most promising: a rival ends fits early.
        unweighed = [pair for pair in promised if pair[0] == np.inf]
        weighed = [pair for pair in promised if pair[0] < np.inf]
        most += len(unweighed)
        first = [pair for pair in weighed[:THREADS] if pair[0] >= least]
        waiting = deque([*first, *unweighed, *weighed[len(first) :]])
        answer: list[Trial] = []
        running: deque[Future[Trial]] = deque()
        with ThreadPoolExecutor(THREADS) as pool:
            while waiting and len(answer) + len(running) < most:
                # What is known by now, the first one's result at least, must not depend on which thread is faster.
                if len(running) > (THREADS if answer else THREADS - 1):
                    answer.append(running.popleft().result())
                gained = max((trial.gain - base.gain for trial in answer), default=0.0)
                if waiting[0][0] < max(least, _FAR_LESS * gained):
                    break
                _, effect = waiting.popleft()
                self.tell(_named(base, effect))
                ahead = max((trial.fitted.score for trial in answer), default=-math.inf)
                each = partial(try_adding, self.problem, self.textbook, base, effect)
                running.append(pool.submit(each, ahead, former.get(effect.name)))
            answer += [each.result() for each in running]
        self.passed.extend((_named(base, effect), nats) for nats, effect in waiting if nats > -np.inf)
        self.trials.extend(answer)
        return answer

    def ended(self, best: Trial) -> Search:
        """Give the search with each set once, as it was fitted best.

        Of sets as large as the best one that are within a unit of log-odds of it the one is chosen that errs least:
        nats forgive a gross failure on a few rows, and whoever predicts with it does not. Where every form is wrong, of
        all that are not excluded.
        """
        unique: dict[frozenset[str], Trial] = {}
        for trial in self.trials:
            unique[trial.names] = max(unique.get(trial.names, trial), trial, key=lambda each: each.gain)
        causes = _causes(self.textbook, tuple(unique.values()))
        passed = {frozenset(name.split(_PLUS)): (name, nats) for name, nats in self.passed}
        left = tuple(each for names, each in passed.items() if names not in unique)
        best = unique.get(best.names, best)
        if best.unheard_of:
            best = published(causes, best)
        rivals = [trial for trial in causes if as_large(trial, best) and trial.gain >= ASKED_FOR]
        spread = dispersion(self.problem, rivals)
        within = temperature(best.gain) * (spread * NOT_EXCLUDED if spread > 1.0 else 1.0)
        near = [trial for trial in rivals if best.gain - trial.gain < within]
        near = [trial for trial in near if best.unheard_of or not trial.unheard_of]
        least = min(near, key=lambda trial: trial.held_out.error(self.problem), default=best)
        least = plainest(self.problem, causes, least)
        found = Search(self.textbook, tuple(unique.values()), left, least)
        if spread == 1.0:
            return found
        return replace(found, dispersion=spread, by_errors=tuple(map(self._by_errors, found.trials)))

    def _by_errors(self, trial: Trial) -> float:
        """Nats that a set gains on blocks held out if each errs by as much as it does, whatever the noise [nats]."""
        less = self.textbook.held_out.error(self.problem) - trial.held_out.error(self.problem)
        return 0.5 * len(np.unique(self.problem.samples.block)) * len(self.problem.answers) * less

    def others(self, taken: frozenset[str]) -> list[Effect]:
        """Give the forms of effects that are not taken, those aside that residuals lay out."""
        return [e for e in self.catalogue if e.slug not in taken and e.slug not in FROM_RESIDUALS]

    def laid_out(self, base: Trial) -> list[Effect]:
        """Give the forms that a set's residuals lay out."""
        wanted = {effect.slug for effect in self.catalogue}.intersection(FROM_RESIDUALS) - base.slugs
        return effects_for(situation(self.problem, base.fitted), wanted)


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
    tries = _Tries(problem, textbook, catalogue, tell)
    tell("every effect alone")
    singles = tries.attempt(textbook, tries.weigh(textbook, catalogue), _LEAST_PROMISE, len(catalogue))
    anchored = _anchored(problem, textbook, singles)
    if anchored is not textbook:
        tell("every effect alone, from a better soil")
        tries = _Tries(problem, anchored, catalogue, tell)
        singles = tries.attempt(anchored, tries.weigh(anchored, catalogue), _LEAST_PROMISE, len(catalogue), singles)
    best = _beside_bump(tries, singles, max(_causes(anchored, singles), key=_gain, default=anchored))
    if best.gain < ASKED_FOR:
        return tries.ended(anchored)
    while len(best.effects) < MOST_EFFECTS:
        beyond = partial(surplus, best)
        larger = _larger(tries, singles, best)
        if len(best.effects) == 1:
            larger += _beside_partners(tries, singles, best, larger)
        challenger = max(larger, key=beyond, default=best)
        if challenger is best or beyond(challenger) < 0.0:
            break
        best = _exchanged(tries, singles, challenger)
    best = _pruned(tries, best)
    better = _rivals_in_other_forms(tries, singles, best)
    return tries.ended(best if better is best else _pruned(tries, better))


def _gain(trial: Trial) -> float:
    return trial.gain


def _causes(textbook: Trial, trials: Sequence[Trial]) -> list[Trial]:
    """Leave out sets with a place that nothing shows to be one."""
    return [trial for trial in trials if not is_bump(textbook, trial)]


def _beside_bump(tries: _Tries, singles: Sequence[Trial], best: Trial) -> Trial:
    """Try others beside a place that gains most, though nothing shows it to be one: beside a second effect, for which
    the ground's variation stood in, it may be, and that effect without it may be little.
    """
    bump = max(singles, key=_gain, default=best)
    if bump.gain < max(ASKED_FOR, best.gain) or not is_bump(tries.textbook, bump):
        return best
    both = _causes(tries.textbook, tries.attempt(bump, tries.weigh(bump, tries.others(bump.slugs))))
    earned = [trial for trial in both if min(surplus(bump, trial), surplus(best, trial)) >= 0.0]
    for pair in sorted(earned, key=_gain, reverse=True):
        if surplus(without(tries.problem, tries.textbook, pair, bump.effects[0]), pair) >= 0.0:
            return pair
    return best


def _named(base: Trial, effect: Effect) -> str:
    return _PLUS.join(each.name for each in (*base.effects, effect))


def _larger(tries: _Tries, singles: Sequence[Trial], best: Trial) -> list[Trial]:
    """Try one more effect beside the best set; beside other forms of a single effect, and runners-up, too."""
    effects = tries.others(best.slugs) + tries.laid_out(best)
    promised = tries.weigh(best, [effect for effect in effects if not effect.expected])
    answer = tries.attempt(best, promised)
    answer += _beside_expected(tries, singles, best)
    if len(best.effects) != 1:
        return answer
    beside_best = {effect.name: nats for nats, effect in promised if effect.nested}
    for form in other_forms(singles, *best.effects):
        again = tries.weigh(form, [effect for _, effect in promised if effect.nested])
        # What the form is behind has to be made up.
        behind = best.gain - form.gain + _WORTH_ANOTHER
        better = [(nats, e) for nats, e in again if nats - behind > max(beside_best[e.name], ASKED_FOR)]
        answer += tries.attempt(form, better)
    # The best one, too, where the runner-up promised little beside it, and its other forms: one may stand in for two.
    for second in runners_up(singles, best):
        tried = {trial.effects[0].name for trial in answer if trial.slugs > second.slugs}
        answer += _weighed_beside(tries, second, second.slugs, frozenset(tried))
    return answer


def _beside_expected(tries: _Tries, singles: Sequence[Trial], best: Trial) -> list[Trial]:
    """Try what the vehicle's description announces beside the best set, and other single effects beside it in turn."""
    expected = [effect for effect in tries.catalogue if effect.expected and effect.slug not in best.slugs]
    bases = [best]
    if len(best.effects) == 1:
        first = {trial.slugs: trial for trial in sorted(singles, key=_gain)}
        near = [trial for trial in first.values() if trial.gain >= _FAR_BEHIND * best.gain]
        others = [trial for trial in near if trial.unexpected and trial.slugs != best.slugs]
        bases += sorted(others, key=lambda trial: -trial.gain)[:_BESIDE_EXPECTED]
    answer: list[Trial] = []
    for base in bases if expected else ():
        answer += tries.attempt(base, tries.weigh(base, expected), EXPECTED_ASKED_FOR)
    alone = max((trial for trial in singles if not trial.unexpected), key=_gain, default=best)
    if len(best.effects) == 1 and alone.slugs != best.slugs and alone.gain >= EXPECTED_ASKED_FOR:
        # What lugs as announced stand beside may be what only a fit tells: one effect beside them is no more than one.
        for form in (alone, *other_forms(singles, *alone.effects)):
            answer += _weighed_beside(tries, form, best.slugs | alone.slugs, only_nested=not form.as_announced)
    return answer


def _weighed_beside(
    tries: _Tries, base: Trial, taken: frozenset[str], tried: frozenset[str] = frozenset(), *, only_nested: bool = True
) -> list[Trial]:
    """Try effects beside a set, not `taken` and whose form was not `tried`: what can be weighed from nothing."""
    others = [e for e in tries.others(taken) if (e.nested or not only_nested) and e.name not in tried]
    return tries.attempt(base, tries.weigh(base, others))


def _beside_partners(
    tries: _Tries, singles: Sequence[Trial], best: Trial, larger: Sequence[Trial]
) -> list[Trial]:  # fmt: skip
    """Try others beside effects that gain most beside the best single one, which may stand in for two."""
    first = max(larger, key=_gain, default=best)
    if first.gain - best.gain < ASKED_FOR:
        return []
    behind = max(MOST_ASKED_FOR, _CLOSE * first.gain)
    known = {first.effects[-1].slug, *best.slugs}.union(*(trial.slugs for trial in runners_up(singles, best)))
    added = [
        trial.effects[-1].slug
        for trial in sorted(larger, key=lambda trial: -trial.gain)
        if first.gain - trial.gain < behind and trial.effects[-1].slug not in known
    ]
    answer: list[Trial] = []
    alone = [[trial for trial in singles if slug in trial.slugs] for slug in dict.fromkeys(added)]
    for forms in [forms for forms in alone if forms][:_PARTNERS]:
        partner = max(forms, key=_gain)
        answer += _weighed_beside(tries, partner, best.slugs | partner.slugs)
    return answer


def _exchanged(tries: _Tries, singles: Sequence[Trial], best: Trial) -> Trial:
    """Exchange what was found before the last effect for others, then for its other forms, and each for what does as
    well alone: another effect's many forms may have taken its place among those tried.
    """
    problem, textbook = tries.problem, tries.textbook
    for effect in best.effects[:-1]:
        rest = without(problem, textbook, best, effect)
        # What residuals lay out was tried beside all that was found: it does not stand in for two.
        instead = tries.weigh(rest, tries.others(best.slugs))
        same = alike(singles, effect)
        instead = [(math.inf if other.name in same and nats > -math.inf else nats, other) for nats, other in instead]
        best = max([best, *tries.attempt(rest, instead)], key=_gain)
    found = best
    for effect in found.effects[:-1]:
        forms = [trial.effects[0] for trial in other_forms(singles, effect)]
        best = max([best, *_with_instead(tries, found, effect, forms)], key=_gain)
    tried = {trial.names for trial in tries.trials}
    for effect in found.effects:
        same, beside = alike(singles, effect), {each.name for each in found.effects if each is not effect}
        others = [e for e in tries.others(found.slugs) if e.name in same and beside | {e.name} not in tried]
        best = max([best, *_with_instead(tries, found, effect, others)], key=_gain)
    return best


def _rivals_in_other_forms(tries: _Tries, singles: Sequence[Trial], best: Trial) -> Trial:
    """Try other forms of the effects of sets that nats do not exclude, as was done for the best one; give the best."""
    causes = _causes(tries.textbook, [trial for trial in tries.trials if len(trial.effects) > 1])
    near = [trial for trial in causes if as_large(trial, best) and trial.slugs != best.slugs]
    near = [trial for trial in near if best.gain - trial.gain < NOT_EXCLUDED * temperature(best.gain)]
    first = {trial.slugs: trial for trial in sorted(near, key=_gain)}
    for rival in sorted(first.values(), key=lambda trial: -trial.gain)[:_RIVALS]:
        for effect in rival.effects:
            tried, beside = {trial.names for trial in tries.trials}, rival.names - {effect.name}
            forms = [trial.effects[0] for trial in other_forms(singles, effect)]
            changed = _with_instead(tries, rival, effect, [e for e in forms if beside | {e.name} not in tried])
            best = max([best, *_causes(tries.textbook, changed)], key=_gain)
    return best


def _with_instead(tries: _Tries, trial: Trial, dropped: Effect, others: Sequence[Effect]) -> list[Trial]:
    """Fit a set with each of other effects in the place of one of its own."""
    if not others:
        return []
    return tries.attempt(_bare(tries.problem, trial, dropped), [(math.inf, other) for other in others])


def _bare(problem: Problem, trial: Trial, dropped: Effect) -> Trial:
    """A set less one of its effects, all else as it is, what the whole set gained too."""
    model, vector = less(trial, dropped)
    fitted = fit(problem, model, vector, trial.fitted.noise, trial.fitted.theta_1, iterations=0, settle=False)
    return replace(trial, effects=model.effects, fitted=fitted)


def _anchored(problem: Problem, textbook: Trial, singles: Sequence[Trial]) -> Trial:
    """Refit the textbook wheel from the soils that effects found: none may shine for having left a poor fit."""
    better = sorted((trial for trial in singles if trial.gain >= ASKED_FOR), key=lambda trial: -trial.fitted.score)
    starts = [(trial.fitted.vector[:SOIL_COUNT], trial.fitted.theta_1) for trial in better[:_ANCHORS]]
    if not starts:
        return textbook
    before = problem.most, problem.weights, problem.first_noise
    fitted = best_fit(problem, starts)
    if fitted.score < textbook.fitted.score + _BETTER:
        problem.most, problem.weights, problem.first_noise = before
        return textbook
    return Trial((), fitted, hold_out(problem, fitted), 0.0)


def _pruned(tries: _Tries, best: Trial) -> Trial:
    """Drop effects that held-out blocks do not ask for once the others are there."""
    while len(best.effects) > 1:
        smaller = together(partial(without, tries.problem, tries.textbook, best), best.effects)
        tries.trials.extend(smaller)
        if min(surplus(trial, best) for trial in smaller) >= 0.0:
            return best
        best = max(_causes(tries.textbook, smaller), key=_gain, default=tries.textbook)
    return best
