"""Search for what was left out: effects fitted with the soil, one by one, then in sets, judged on held-out blocks."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from ....framework.core.errors import InputError
from ...effects.catalogue import FROM_RESIDUALS, effects_for
from ...effects.effect import Effect
from ...effects.uncatalogued import SLUG as UNCATALOGUED
from ...mechanics.augmented import SOIL_COUNT
from ..fit.fitting import Problem, fit
from ..fit.held_out import hold_out
from ..fit.textbook import best_fit
from ..fit.together import together
from ..fit.trial import ASKED_FOR, NOT_EXCLUDED, Trial, again, less, situation, temperature, textbook_trial, without
from .asked import ROUGH, standing, surplus, worth
from .hiding_pairs import hiding_pairs, pairs_beside_better_fits, pairs_of_weak
from .partners import beside_bump, one_more
from .preferred import as_large
from .singles import FORMS_APART, MOST_ALIKE, alike, alike_beside, other_forms
from .tries import LEAST_PROMISE, Search, Tries, gain_of, without_bumps

MOST_EFFECTS = 3

_RIVALS = 2
"""Sets as large as the best one and not excluded beside it whose effects are tried in other forms."""

_ANCHORS = 3
"""Effects from whose soils the textbook wheel is fitted once more."""

_BETTER = 2.0
"""Nats by which it has to fit better for all effects to be weighed against it anew."""

_CALM = 0.03
"""How much ground varies at most in which sets are sought, too, where it varies much beside the best effect [-]."""

_ROWS, _PROPOSED = 500, 6
"""Rows by which they are sought there at most, and sets that are tried on all."""


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
    tries = Tries(problem, textbook, catalogue, tell)
    tell("every effect alone")
    singles = tries.attempt(textbook, tries.weigh(textbook, catalogue), LEAST_PROMISE, len(catalogue))
    anchored = _anchored(problem, textbook, singles)
    if anchored is not textbook:
        tell("every effect alone, from a better soil")
        tries = Tries(problem, anchored, catalogue, tell)
        singles = tries.attempt(anchored, tries.weigh(anchored, catalogue), LEAST_PROMISE, len(catalogue), singles)
    best = beside_bump(tries, singles, max(without_bumps(anchored, singles), key=gain_of, default=anchored))
    if best.fitted.noise.spread.max() > ROUGH:
        best = _as_in_quiet_ground(tries, best)
    hiding = hiding_pairs(tries, singles, best) if len(best.effects) < 2 else []
    if best.gain < ASKED_FOR:
        hiding += [*pairs_of_weak(tries, singles), *pairs_beside_better_fits(tries, singles)]
        best = max([trial for trial in hiding if surplus(anchored, trial) >= ASKED_FOR], key=gain_of, default=best)
        if len(best.effects) < 2:
            return tries.ended(anchored)
        best = _exchanged(tries, singles, best)
    while len(best.effects) < MOST_EFFECTS:
        further = [*one_more(tries, singles, best), *(hiding if len(best.effects) == 1 else [])]
        challenger = max(further, key=partial(worth, best), default=best)
        if challenger is best or surplus(best, challenger) < 0.0:
            break
        best = _exchanged(tries, singles, challenger)
    best = _pruned(tries, best)
    better = _rivals_in_other_forms(tries, singles, best)
    return tries.ended(best if better is best else _pruned(tries, better))


def _as_in_quiet_ground(tries: Tries, best: Trial) -> Trial:
    """Try the sets that a search in quiet ground finds by some of the rows; give the best.

    Ground that varies makes up for what a law leaves out, along a ramp of slip most of all: one effect of two gains
    little then, and both are not come upon. What comes late, and places, show on all rows or not at all.
    """
    tries.tell("the same in quiet ground")
    known = {form.name: form for effect in tries.catalogue if not effect.local for form in _forms_of(effect)}
    sets = together(partial(_on_all_rows, tries, known), _proposed(tries))
    tries.trials.extend(trial for trial in sets if trial is not None)
    better = max((trial for trial in sets if trial is not None), key=partial(worth, best), default=best)
    return better if surplus(best, better) >= 0.0 else best


def _forms_of(effect: Effect) -> list[Effect]:
    """An effect, its variants, and each of these with further parameters."""
    forms = [effect, *effect.variants()]
    return forms + [freer for form in forms for freer in form.freer()]


def _proposed(tries: Tries) -> list[Trial]:
    """Sets that are not excluded in quiet ground, each in its best form; none where some of the rows do not tell."""
    samples, known = tries.problem.samples, tries.problem.known
    few = samples.select(np.linspace(0, len(samples) - 1, min(len(samples), _ROWS)).round().astype(int))
    if few.answers != samples.answers:
        return []
    try:
        problem, textbook = textbook_trial(few, known, _CALM)
    except InputError:
        return []
    wanted = {effect.slug for effect in tries.catalogue} - {UNCATALOGUED}
    further = [effect for effect in tries.catalogue if effect.slug == UNCATALOGUED]
    effects = [*effects_for(situation(problem, textbook.fitted), wanted), *further]
    found = search(problem, textbook, effects, tries.tell)
    best = found.chosen
    least = max(best.gain - NOT_EXCLUDED * temperature(best.gain), ASKED_FOR)
    causes = without_bumps(found.textbook, found.trials)
    near = [trial for trial in causes if as_large(trial, best) and trial.gain >= least]
    first = {trial.slugs: trial for trial in [*sorted(near, key=gain_of), best] if trial.effects}
    return sorted(first.values(), key=lambda trial: -trial.gain)[:_PROPOSED]


def _on_all_rows(tries: Tries, known: Mapping[str, Effect], proposed: Trial) -> Trial | None:
    """Fit a set that some of the rows proposed to all; None where these do not offer one of its effects."""
    effects = tuple(known[effect.name] for effect in proposed.effects if effect.name in known)
    where = [where for effect, where in proposed.fitted.model.slices() if effect.name in known]
    late = any(effect.delay(proposed.fitted.vector[at]) for effect, at in zip(effects, where, strict=True))
    if len(effects) < len(proposed.effects) or late:
        return None
    return again(tries.problem, tries.textbook, proposed, effects)


def _exchanged(tries: Tries, singles: Sequence[Trial], best: Trial) -> Trial:
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
        best = max([best, *standing(best, tries.attempt(rest, instead))], key=gain_of)
    found = best
    for effect in found.effects[:-1]:
        forms = [trial.effects[0] for trial in other_forms(singles, effect)]
        best = max([best, *standing(best, _with_instead(tries, found, effect, forms))], key=gain_of)
    return _instead_of_each(tries, singles, best)


def _instead_of_each(tries: Tries, singles: Sequence[Trial], found: Trial) -> Trial:
    """Exchange each effect of a set for what does as well alone, or beside the others in other forms; give the best."""
    best, tried = found, {trial.names for trial in tries.trials}
    offered = tries.others(found.slugs)
    for effect in found.effects:
        beside, same = found.names - {effect.name}, alike(singles, effect)
        others = {each.name: each for each in offered if each.name in same}
        # What residuals lay out was tried beside all that was found: it does not stand in for two.
        near = [each for each in alike_beside(tries.trials, found, effect) if each.slug not in FROM_RESIDUALS]
        near = [each for each in near if beside | {each.name} not in tried]
        others |= {each.name: each for each in near[:MOST_ALIKE]}
        untried = [each for name, each in others.items() if beside | {name} not in tried]
        best = max([best, *standing(best, _with_instead(tries, found, effect, untried))], key=gain_of)
    return best


def _rivals_in_other_forms(tries: Tries, singles: Sequence[Trial], best: Trial) -> Trial:
    """Try other forms of the effects of sets that are not excluded, or would not be in another form, as was done for
    the best one; give the best.
    """
    causes = without_bumps(tries.textbook, [trial for trial in tries.trials if len(trial.effects) > 1])
    near = [trial for trial in standing(best, causes) if as_large(trial, best) and trial.slugs != best.slugs]
    most = NOT_EXCLUDED * temperature(best.gain) + FORMS_APART * best.gain
    near = [trial for trial in near if best.gain - trial.gain < most]
    first = {trial.slugs: trial for trial in sorted(near, key=gain_of)}
    for rival in sorted(first.values(), key=lambda trial: -trial.gain)[:_RIVALS]:
        for effect in rival.effects:
            tried, beside = {trial.names for trial in tries.trials}, rival.names - {effect.name}
            forms = [trial.effects[0] for trial in other_forms(singles, effect)]
            # What is nothing alone was tried beside the others in the forms that promised most there.
            known = forms or [each for each in tries.others(rival.slugs - {effect.slug}) if each.slug == effect.slug]
            untried = [each for each in known if beside | {each.name} not in tried]
            changed = _with_instead(tries, rival, effect, untried, weighed=not forms)
            best = max([best, *standing(best, without_bumps(tries.textbook, changed))], key=gain_of)
    return best


def _with_instead(
    tries: Tries, trial: Trial, dropped: Effect, others: Sequence[Effect], *, weighed: bool = False
) -> list[Trial]:
    """Fit a set with each of other effects in the place of one of its own, if `weighed` those that promise enough."""
    if not others:
        return []
    bare = _bare(tries.problem, trial, dropped)
    return tries.attempt(bare, tries.weigh(bare, others) if weighed else [(math.inf, other) for other in others])


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


def _pruned(tries: Tries, best: Trial) -> Trial:
    """Drop effects that held-out blocks do not ask for once the others are there."""
    while len(best.effects) > 1:
        smaller = together(partial(without, tries.problem, tries.textbook, best), best.effects)
        tries.trials.extend(smaller)
        if min(surplus(trial, best) for trial in smaller) >= 0.0:
            return best
        best = max(without_bumps(tries.textbook, standing(best, smaller)), key=gain_of, default=tries.textbook)
    return best
