"""How much evidence there is where neighbouring rows repeat each other.

Nats are counted as if what a right model leaves were white. Noise with a memory, as behind a slow amplifier, says the
same several times over: a model that follows a stretch of it by chance seems to predict the rows beside it.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..noise import autocorrelations
from .fitting import Problem
from .search import ASKED_FOR, Search
from .soil_variation import HUBER

_SHOWN = 3.0
"""An autocorrelation counts from so many of its standard deviations on, as white noise has them [-]."""

_FEWEST = 50
"""Rows below which a channel does not tell."""


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
