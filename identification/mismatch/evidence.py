"""How much evidence there is: where neighbouring rows repeat each other, and where held-out errors stay large.

Nats are counted as if what a right model leaves were white. Noise with a memory, as behind a slow amplifier, says the
same several times over: a model that follows a stretch of it by chance seems to predict the rows beside it.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from ..noise import autocorrelations
from .fitting import Fitted, Problem
from .search import ASKED_FOR, Search, Trial
from .soil_variation import HUBER

_SHOWN = 3.0
"""An autocorrelation counts from so many of its standard deviations on, as white noise has them [-]."""

_FEWEST = 50
"""Rows below which a channel does not tell."""


_WORSE, _FAR = 0.05, 0.7
"""Growth of the errors on held-out rows with a set, and their distance from the noise with it, from which on the set is
doubted: means over the channels of ln(ratio). Of 439 sets that were asserted on the study's recordings those that were
right let errors grow by 0.03 at most, and left them 0.54 above the noise, but for one."""


def at_odds(problem: Problem, search: Search) -> bool:
    """Say whether errors on held-out rows speak against the chosen set: it makes errors likelier, but not small."""
    if not search.chosen.effects:
        return False
    before, after = (
        np.sqrt(np.nanmean(trial.held_out.residuals**2, axis=0)) for trial in (search.textbook, search.chosen)
    )
    floor = np.array([noise_floor(problem, search.chosen.fitted, each) for each in range(len(problem.answers))])
    good = (before > 0.0) & (after > 0.0)
    if not good.any():
        return False
    growth, distance = (float(np.mean(np.log(after[good] / other[good]))) for other in (before, floor))
    return growth > _WORSE or distance > _FAR


def unheard_of(chosen: Trial) -> tuple[str, ...]:
    """Parameters of a set, in words, that are beyond what has been published of their effects."""
    return tuple(
        f"{effect.slug} with {parameter.name} = {value:.3g}"
        for effect, where in chosen.fitted.model.slices()
        for parameter, value in zip(effect.parameters, chosen.fitted.vector[where], strict=True)
        if not parameter.published[0] <= value <= parameter.published[1]
    )


def noise_floor(problem: Problem, fitted: Fitted, position: int) -> float:
    """Least error to be had: the sensor's noise, what uncertain load and slip do, and ground that varies unforeseen."""
    weights = problem.weights or fitted.response
    channel = problem.answers[position]
    by_latent, by_ground = np.nan_to_num(weights.by_latent[:, channel]), np.nan_to_num(weights.by_ground[:, channel])
    uncertain = np.einsum("na,ab,nb->n", by_latent, problem.latent_covariance, by_latent)
    varying = by_ground**2 @ fitted.noise.spread**2
    return math.sqrt(float(fitted.noise.answers[position]) ** 2 + float(np.mean(uncertain + varying)))


def repetition(problem: Problem, innovations: np.ndarray) -> float:
    """Number of neighbouring rows that say the same, 1 where they are independent: geometric mean of the channels.

    A channel's is 1 + 2 sum of autocorrelations (M. S. Bartlett, J. R. Stat. Soc. Suppl. 8 (1946), 27-41), as far as
    they stand out from the first lag on. Trials have no neighbours.

    Parameters
    ----------
    problem
        The samples.
    innovations : (n, m)
        What is left of them, whitened.
    """
    if not np.isfinite(problem.samples.drive.time_s).all():
        return 1.0
    times = []
    for column, seen in zip(innovations.T, problem.seen.T, strict=True):
        values = np.clip(column[seen], -HUBER, HUBER)
        values = values - values.mean() if len(values) else values
        if len(values) < _FEWEST or not values.any():
            times.append(1.0)
            continue
        correlation = autocorrelations(values)[1:]
        hidden = correlation < _SHOWN / np.sqrt(len(values))
        first = int(np.argmax(hidden)) if hidden.any() else len(correlation)
        times.append(1.0 + 2.0 * float(correlation[:first].sum()))
    return float(np.exp(np.mean(np.log(times))))


def warranted(search: Search, repeated: float) -> Search:
    """Give the search with a chosen set that still has evidence enough once `repeated` rows count as one."""
    chosen = search.chosen
    while chosen.effects:
        smaller = [search.textbook, *(trial for trial in search.trials if trial.slugs < chosen.slugs)]
        next_best = max(smaller, key=lambda trial: trial.gain)
        if chosen.gain - next_best.gain >= ASKED_FOR * repeated:
            break
        chosen = next_best
    return search if chosen is search.chosen else replace(search, chosen=chosen)
