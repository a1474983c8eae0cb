"""Search of the catalogue: single effects, then the neighbours of the most probable hypotheses.

A hypothesis is a set of effects. Its neighbours have one effect less, one more, or one replaced by another effect or
form. A score test ranks hypotheses that are not fitted yet.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np

from ...framework.core.concurrency import together
from ..effects.catalogue import effects_for
from ..effects.effect import Effect, Group, Situation
from ..effects.grouped import in_every_group
from ..mechanics.augmented import SOIL_COUNT, Entry
from .evidence import log_evidence
from .fit import Fitted, fit, with_effect
from .hyperparameters import PRIOR_EFFECT, TEMPERATURE
from .likelihood import UNIFORM_SD, Problem
from .places import best_patches
from .samples import ANSWERS
from .steps import Prior, solve_step
from .whitening import GROSS, Noise

MOST_EFFECTS = 3
"""Most effects in a hypothesis."""

MOST_EXPANDED = 6
"""Most hypotheses whose neighbours are fitted."""

WINDOW = 5.0
"""Largest deficit in log posterior of a hypothesis that is expanded [nats] (Occam's window; D. Madigan, A. E. Raftery,
J. Am. Stat. Assoc. 89 (1994), 1535-1546)."""

ADDED, SWAPPED, FORMS = 6, 3, 3
"""Most effects that are added to an expanded hypothesis, that replace each of its effects, and other forms of that."""

LEAST_GAIN, LEAST_ADDED_GAIN, LEAST_SHARE = 2.5, 4.0, 0.3
"""Least expected gains by the score test for fitting an effect alone, and with others [nats], and least share of the
largest expected gain [-]."""

MOST_NOISE_FITS = 8
"""Most fits of each round whose noise is refitted: those with the highest score at the noise of their base."""

LARGEST_DEFICIT = 50.0
"""Largest deficit in score, at the noise of the base, for refitting the noise [nats]: that gains less."""

_SHORT_STEPS = 6
"""Steps of fits by which the initial values of an effect are compared."""


@dataclass(frozen=True)
class Hypothesis:
    """A set of effects, fitted with the soil and the noise.

    log_evidence is relative to the textbook wheel's [nats].
    """

    effects: tuple[Effect, ...]
    fitted: Fitted
    log_evidence: float

    @property
    def slugs(self) -> frozenset[str]:
        """Public names of the effects."""
        return frozenset(effect.slug for effect in self.effects)

    @property
    def names(self) -> frozenset[str]:
        """Names of the effects' forms."""
        return frozenset(effect.name for effect in self.effects)


@dataclass
class Search:
    """Hypotheses that were fitted.

    Parameters
    ----------
    problem, situation, textbook
        The samples, what they can show, and the hypothesis of no effect.
    catalogue
        Forms of effects that these data can show.
    origin
        Log evidence of the textbook wheel [nats].
    hypotheses
        All hypotheses that were fitted, including the textbook wheel.
    forms, names
        Number of forms considered, by slug, and their names.
    screened
        Effects that the score test screened out, with their expected gain [nats].
    """

    problem: Problem
    situation: Situation
    textbook: Hypothesis
    catalogue: Sequence[Effect]
    origin: float
    hypotheses: list[Hypothesis] = field(default_factory=list)
    forms: dict[str, int] = field(default_factory=dict)
    names: set[str] = field(default_factory=set)
    screened: dict[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.hypotheses.append(self.textbook)
        self.consider(self.catalogue)

    def consider(self, effects: Iterable[Effect]) -> None:
        """Count forms of effects, each once."""
        for effect in effects:
            if effect.name not in self.names:
                self.forms[effect.slug] = self.forms.get(effect.slug, 0) + 1
                self.names.add(effect.name)

    def take(self, fits: Iterable[Fitted]) -> None:
        """Add hypotheses; of several fits of the same forms keep the one with the highest score."""
        for fitted in fits:
            evidence = log_evidence(self.problem, fitted) - self.origin
            new = Hypothesis(fitted.model.effects, fitted, evidence)
            same = next((at for at, each in enumerate(self.hypotheses) if each.names == new.names), None)
            if same is None:
                self.hypotheses.append(new)
            elif fitted.score > self.hypotheses[same].fitted.score:
                self.hypotheses[same] = new

    def fit_added(
        self, base: Fitted, effects: Sequence[Effect], *, again: Sequence[Effect] = (), uniform: Sequence[Effect] = ()
    ) -> None:
        """Fit a model with each of several effects added, unless done before, and refit the noise of the best.

        Effects of `again` are fitted at the noise of the base even if done before. Effects of `uniform` are
        fitted from nearly uniform ground: its variation may have absorbed them.
        """
        new = [effect for effect in effects if not self.has((*base.model.effects, effect))]
        starts = [(base.noise, effect) for effect in (*new, *again)]
        uniform_noise = replace(self.problem.uniform_ground_noise, smoothness=base.noise.smoothness)
        fits = together(lambda start: add_effect(self.problem, base, *start), starts)
        uniform_fits = together(partial(add_effect, self.problem, base, uniform_noise), uniform)
        highest = max(each.score for each in (*(each.fitted for each in self.hypotheses), *fits))
        leading = [*_best_forms(fits[: len(new)]), *fits[len(new) :]]
        leading = [each for each in leading if each.score > highest - LARGEST_DEFICIT]
        best: dict[str, Fitted] = {}
        for each in (*fits, *together(partial(refit_with_noise, self.problem), [*leading, *_best_forms(uniform_fits)])):
            name = each.model.effects[-1].name
            if name not in best or each.score > best[name].score:
                best[name] = each
        self.take(best.values())

    def has(self, effects: Sequence[Effect]) -> bool:
        """Return whether these forms were fitted together."""
        names = frozenset(effect.name for effect in effects)
        return any(each.names == names for each in self.hypotheses)

    def log_prior(self, each: Hypothesis, effect: float = PRIOR_EFFECT) -> float:
        """Log prior odds of a hypothesis [nats]; the forms of an effect share its prior equally.

        `effect` is the prior probability of effects that do not state their own.
        """
        stated = ((one.slug, one.prior_probability or effect) for one in each.effects)
        return sum(math.log(share / (1.0 - share) / self.forms[slug]) for slug, share in stated)

    def log_posterior(self, each: Hypothesis) -> float:
        """Log posterior of a hypothesis without a discrepancy [nats], up to a constant."""
        return each.log_evidence / TEMPERATURE + self.log_prior(each)

    def best(self) -> dict[frozenset[str], Hypothesis]:
        """Return the best hypothesis of each set of effects."""
        answer: dict[frozenset[str], Hypothesis] = {}
        for each in self.hypotheses:
            if each.slugs not in answer or each.log_evidence > answer[each.slugs].log_evidence:
                answer[each.slugs] = each
        return answer


def search(
    problem: Problem, fitted: Fitted, slugs: Iterable[str], progress: Callable[[str], None] = lambda _: None
) -> Search:
    """Fit single effects, then the neighbours of the most probable hypotheses.

    Parameters
    ----------
    problem, fitted
        The samples, and the fit of the textbook wheel.
    slugs
        Public names of the effects to consider.
    progress
        Called with a description of each step.
    """
    shown = situation(problem, fitted)
    textbook, origin = Hypothesis((), fitted, 0.0), log_evidence(problem, fitted)
    found = Search(problem, shown, textbook, effects_for(shown, tuple(slugs)), origin)
    progress("fitting every effect alone")
    _fit_alone(found)
    expanded: set[frozenset[str]] = set()
    for _ in range(MOST_EXPANDED):
        ranked = sorted(found.best().values(), key=found.log_posterior, reverse=True)
        near = [each for each in ranked if found.log_posterior(each) > found.log_posterior(ranked[0]) - WINDOW]
        selected = next((each for each in near if each.effects and each.names not in expanded), None)
        if selected is None:
            break
        progress("fitting neighbours of " + " and ".join(sorted(selected.names)))
        expanded.add(selected.names)
        _fit_neighbours(found, selected)
    return found


def _fit_alone(found: Search) -> None:
    """Fit single effects that pass the score test, at the fitted variation of the ground or at a small one."""
    problem, base = found.problem, found.textbook.fitted
    gains = _gains(problem, base, found.catalogue)
    passing, uniform = _passes_screen(gains, LEAST_GAIN), []
    if base.noise.ground_sd.max() > 2.0 * UNIFORM_SD:
        other = problem.with_uniform_ground()
        refitted = fit(other, base.model, base.vector, None, Entry(base.theta_1))
        uniform = _best_ranked(other, refitted, found.catalogue, ADDED)
    effects = [effect for effect, passes in zip(found.catalogue, passing, strict=True) if passes]
    found.fit_added(base, effects, uniform=uniform)
    for effect, gain, passes in zip(found.catalogue, gains, passing, strict=True):
        if not passes and effect not in uniform:
            found.screened[effect.name] = float(gain)


def _fit_neighbours(found: Search, base: Hypothesis) -> None:
    """Fit a hypothesis with an effect removed, replaced by another effect or form, or added."""
    problem = found.problem
    smaller = [_without_effect(problem, base.fitted, effect) for effect in base.effects]
    new = [bare for bare in smaller if not found.has(bare.model.effects)]
    found.take(together(lambda bare: fit(problem, bare.model, bare.vector, bare.noise, Entry(bare.theta_1)), new))
    for effect, bare in zip(base.effects, smaller, strict=True):
        others = [each for each in found.catalogue if each.slug not in base.slugs]
        same = [each for each in found.catalogue if each.slug == effect.slug and each.name != effect.name]
        derived = [*effect.extensions(), *in_every_group(effect, found.situation)]
        found.consider(derived)
        forms = _ranked(problem, bare, same)[:FORMS]
        found.fit_added(bare, _best_ranked(problem, bare, others, SWAPPED), again=[*forms, *derived])
    if len(base.effects) < MOST_EFFECTS:
        others = [each for each in found.catalogue if each.slug not in base.slugs]
        found.fit_added(base.fitted, _best_ranked(problem, base.fitted, others, ADDED))


def _best_forms(fits: Iterable[Fitted]) -> list[Fitted]:
    """Return the fits whose noise is to be refitted: the best form of each effect, the highest scores first."""
    best: dict[str, Fitted] = {}
    for each in sorted(fits, key=lambda each: -each.score):
        best.setdefault(each.model.effects[-1].slug, each)
    return list(best.values())[:MOST_NOISE_FITS]


def _best_ranked(problem: Problem, base: Fitted, effects: Sequence[Effect], most: int) -> list[Effect]:
    """Return the effects that a score test ranks first, each in its best form."""
    best: dict[str, Effect] = {}
    for effect in _ranked(problem, base, effects):
        best.setdefault(effect.slug, effect)
    return list(best.values())[:most]


def _ranked(problem: Problem, base: Fitted, effects: Sequence[Effect]) -> list[Effect]:
    """Return the effects that pass the score test, the largest expected gain first."""
    gains = _gains(problem, base, effects)
    passing = _passes_screen(gains, LEAST_ADDED_GAIN)
    return [effects[index] for index in np.argsort(-gains) if passing[index]]


def _gains(problem: Problem, base: Fitted, effects: Sequence[Effect]) -> np.ndarray:
    return np.array(together(partial(expected_gain, problem, base), effects), dtype=float)


def _passes_screen(gains: np.ndarray, least: float) -> np.ndarray:
    return gains >= max(least, LEAST_SHARE * float(gains.max(initial=0.0)))


def _without_effect(problem: Problem, fitted: Fitted, dropped: Effect) -> Fitted:
    """Return a fit without one of its effects, the other parameters unchanged."""
    kept = [(effect, where) for effect, where in fitted.model.slices() if effect is not dropped]
    vector = np.concatenate([fitted.vector[fitted.model.soils], *[fitted.vector[where] for _, where in kept]])
    model = fitted.model.with_effects(tuple(effect for effect, _ in kept))
    return fit(problem, model, vector, fitted.noise, Entry(fitted.theta_1), steps=0)


def expected_gain(problem: Problem, base: Fitted, effect: Effect) -> float:
    """Gain of an effect added to a fit, to first order [nats].

    By a step from its null values (score test), or, if it does not vanish smoothly there, by the best multiple of what
    it changes at one of its initial values.
    """
    if effect.nested:
        model, vector = with_effect(base, effect, np.array([each.null for each in effect.parameters]))
        response = problem.linearise(model, vector, base.response.entry(), base.response)
        return _gain(
            problem, base, problem.columns(response)[..., -len(effect.parameters) :], problem.prior(model), vector
        )
    prior, vector = problem.prior(base.model), np.append(base.vector, 0.0)
    size = len(prior.mean)
    precision = np.zeros((size + 1, size + 1))
    precision[:size, :size] = prior.precision
    prior = Prior(np.append(prior.mean, 0.0), precision, np.append(prior.lower, 0.0), np.append(prior.upper, np.inf))
    gains = []
    for start in effect.starts():
        model, there = with_effect(base, effect, start)
        channels = model.predict(problem.samples.drive, problem.imposed, there, base.theta_1).channels
        change = (channels - base.response.channels)[:, problem.answers, None]
        change = np.where(problem.seen[..., None], np.nan_to_num(change), 0.0)
        gains.append(_gain(problem, base, change, prior, vector))
    return max(gains)


def _gain(problem: Problem, base: Fitted, columns: np.ndarray, prior: Prior, vector: np.ndarray) -> float:
    """Gain [nats] of columns (n, m, k) added to a fit, all parameters refitted to first order, with priors (p,)."""
    white, _ = problem.whitener(base.noise, base.response).whiten(columns, base.white.weights)
    jacobian = np.concatenate([base.white.jacobian, white], axis=-1)
    gradient, information = problem.normal_equations(base.white.innovations, jacobian)
    return solve_step(gradient, information, prior, np.clip(vector, prior.lower, prior.upper), 0.0)[1]


def add_effect(problem: Problem, base: Fitted, noise: Noise, effect: Effect) -> Fitted:
    """Fit a model with one more effect at a fixed noise, from the best of the effect's initial values."""
    entry = base.response.entry()
    starts = [with_effect(base, effect, start) for start in effect.starts()]
    if len(starts) == 1:
        return fit(problem, *starts[0], noise, entry, fit_noise=False)
    short = [fit(problem, *start, noise, entry, steps=_SHORT_STEPS, fit_noise=False) for start in starts]
    best = max(short, key=lambda each: each.score)
    return fit(problem, best.model, best.vector, noise, best.response.entry(), fit_noise=False)


def refit_with_noise(problem: Problem, fitted: Fitted) -> Fitted:
    """Continue a fit, including the noise."""
    return fit(problem, fitted.model, fitted.vector, fitted.noise, fitted.response.entry())


def situation(problem: Problem, fitted: Fitted) -> Situation:
    """Return what determines which forms of an effect the samples can show."""
    samples, measured = problem.samples, problem.samples.measured
    innovations = np.full_like(measured, np.nan)
    # A gross error contributes to every line of the spectrum.
    white = np.clip(fitted.white.innovations, -GROSS, GROSS)
    innovations[:, problem.answers] = np.where(problem.seen, white, np.nan)
    seen = np.isfinite(measured).any(axis=0)
    typical = np.where(seen, np.sqrt(np.nanmean(np.where(seen, measured, 0.0) ** 2, axis=0)), np.nan)
    typical[[channel for channel in ANSWERS if channel not in samples.answers]] = np.nan
    soil = np.median(fitted.vector[fitted.model.soils].reshape(-1, SOIL_COUNT), axis=0)
    return Situation(
        samples.wheel, samples.drive, typical, measured[:, 2], innovations, float(soil[0]),
        float(soil[1]), math.exp(soil[3]), best_patches(problem, fitted),
        tuple(Group(name, "wheel", (number,)) for number, name in enumerate(samples.wheels)),
        tuple(Group(name, "ground", tuple(numbers)) for name, numbers in samples.classes.items()),
    )  # fmt: skip
