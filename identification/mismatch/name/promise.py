"""What an effect promises beside a fitted set, before it is fitted with it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...effects.effect import Effect
from ...mechanics.augmented import AugmentedWheel
from ..fit.fitting import Problem, fit
from ..fit.steps import normal_equations, scaled_inverse
from ..fit.textbook import QUIET
from ..fit.trial import Trial, starts_of

_GLIMPSE = 6
"""Iterations that show whether an effect that cannot be weighed from nothing is worth fitting beside others."""


def promised_by(problem: Problem, base: Trial, effect: Effect) -> float:
    """Nats that an effect promises beside a set: infinity where only a fit tells."""
    if effect.nested:
        return promise(problem, base, effect)
    # Three together are not asserted: what only fits tell is not worth them there.
    if len(base.unexpected) > 1:
        return -np.inf
    # Alone, and where the ground's variation would explain a place first, only a fit tells.
    return _glimpse(problem, base, effect) if base.effects and not effect.local else np.inf


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
    if base.effects and base.fitted.noise.spread.max() > 2.0 * QUIET:
        noises.append(replace(base.fitted.noise, spread=np.full(2, QUIET)))
    nowhere, promised = 0.0, []
    for number, start in enumerate([null, *(starts if len(starts) > 1 else [])]):
        vector = np.concatenate([base.fitted.vector, start])
        there = base.fitted.response
        entry = there.entry(np.zeros(len(base.fitted.vector)))
        answer = problem.linearise(model, vector, entry, there if number == 0 else None)
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
