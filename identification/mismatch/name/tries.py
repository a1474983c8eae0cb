"""Sets of effects that were tried, each fitted beside others that promise enough, and the set that is put forward."""

from __future__ import annotations

import math
from collections import Counter, deque
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np

from ...effects.catalogue import FROM_RESIDUALS, effects_for
from ...effects.effect import Effect
from ..fit.fitting import Problem
from ..fit.together import THREADS, together
from ..fit.trial import ASKED_FOR, NOT_EXCLUDED, Trial, situation, temperature, try_adding
from ..locate.noise_floor import dispersion
from .asked import ROUGH, is_bump, standing
from .preferred import as_large, plainest, published
from .promise import promised_by

LEAST_PROMISE, _LEAST_BESIDE = 2.5, 8.0
"""Effects that promise less alone, and beside others, are not fitted [nats]: beside others less than is asked of them,
for a fit gains more than its first step promises (11.8, and then 20)."""

_TRIED_IN_SETS = 6
"""Effects tried beside those already found: the most promising ones."""

_FORMS_AT_ONCE = 3
"""Forms of one effect among those: further ones take no other effect's place."""

_FAR_LESS = 0.1
"""Effects that promise less than this share of what another one gained are not fitted [-]."""

_PLUS = " + "
"""Between the names of effects in a set."""


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
class Tries:
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
        most: int = _TRIED_IN_SETS, formerly: Sequence[Trial] = (), rival: Trial | None = None,
    ) -> list[Trial]:  # fmt: skip
        """Fit those effects beside a set that promise enough, at most so many; sorted by what they promise.

        A set that was reached in another order is fitted again: from another start it may end elsewhere. How far one
        stays behind a `rival` is not told exactly, unless this one may leave to the ground what the other explains.
        """
        to_beat = -math.inf
        if rival is not None and rival.fitted.noise.spread.max() <= ROUGH:
            to_beat = self.textbook.fitted.score + rival.gain
        former = {trial.effects[-1].name: trial for trial in formerly if trial.gain >= ASKED_FOR}
        # What cannot be weighed takes no other's place, and follows the most promising: a rival ends fits early.
        unweighed = [pair for pair in promised if pair[0] == np.inf]
        weighed = [pair for pair in promised if pair[0] < np.inf]
        most = _with_room(weighed, most) + len(unweighed)
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
                ahead = max([to_beat, *(trial.fitted.score for trial in answer)])
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
        passed = {frozenset(name.split(_PLUS)): (name, nats) for name, nats in self.passed}
        left = tuple(each for names, each in passed.items() if names not in unique)
        best = unique.get(best.names, best)
        causes = standing(best, without_bumps(self.textbook, tuple(unique.values())))
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


def gain_of(trial: Trial) -> float:
    """Sort sets by what they gain."""
    return trial.gain


def without_bumps(textbook: Trial, trials: Sequence[Trial]) -> list[Trial]:
    """Leave out sets with a place that nothing shows to be one."""
    return [trial for trial in trials if not is_bump(textbook, trial)]


def _with_room(promised: Sequence[tuple[float, Effect]], most: int) -> int:
    """Number of the most promising effects, among which there are so many but for further forms of the same."""
    room, forms = 0, Counter[str]()
    for number, (_, effect) in enumerate(promised, start=1):
        forms[effect.slug] += 1
        room += forms[effect.slug] <= _FORMS_AT_ONCE
        if room == most:
            return number
    return len(promised)


def _named(base: Trial, effect: Effect) -> str:
    return _PLUS.join(each.name for each in (*base.effects, effect))
