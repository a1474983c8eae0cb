"""Where the soil changes along a drive that says nothing of its grounds, from the wheels alone.

A step of stiffness and strength at any of many times is a column of the linearised model; steps are added one by one
where the likelihood gains most (forward selection), as long as a further soil is worth its parameters (G. Schwarz, Ann.
Statist. 6 (1978)).
"""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np

from ...framework.core.explanation import UNKNOWN
from ...framework.core.track.grounds import Ground
from ..mechanics.augmented import SOIL_COUNT
from .evidence import log_evidence
from .fit import Fitted, fit_textbook
from .likelihood import Problem
from .places import cell_scores, in_cells
from .posterior import Posterior
from .search import Search
from .soil_prior import SOIL_PRIOR
from .steps import scaled_inverse

_LN_STIFFNESS_SD = 2.0
"""Standard deviation of ln stiffness of soils of all kinds [-]: from snow to gravel, Wong (2010), Table 2.3."""

_CELLS = 100
"""Cells of time between which the soil may change."""

_VARIES = 0.1
"""Standard deviation of stiffness or strength along the track from which on several soils are tried [-]: within one
place they vary by some per cent."""

CONVINCING = 10.0
"""Gain in log evidence from which on several soils are taken [nats]: odds of 20,000."""

_LEAST_ROWS, _MOST_CHANGES = 30, 12
"""Least rows of a ground, and most changes."""


def changed_grounds(found: Search, posterior: Posterior) -> tuple[Ground, ...]:
    """Divide a drive into grounds where the soil changes, each without the cell at a change.

    Empty if it does not change, or if several soils explain the drive worse than the effects that were found on one.

    Parameters
    ----------
    found, posterior
        Hypotheses on one ground, and their probabilities.
    """
    times = _changes(found.problem, found.textbook.fitted)
    if not times:
        return ()
    time_s = found.problem.samples.drive.time_s
    borders = [float(time_s.min()), *times, float(time_s.max())]
    problem, textbook = fit_textbook(found.problem.samples.divided_at(times))
    several = log_evidence(problem, textbook) + _log_prior_of_soils(problem)
    if several < _total_evidence(found, posterior) + CONVINCING:
        return ()
    cell_s = (borders[-1] - borders[0]) / _CELLS
    starts, ends = [borders[0], *(each + cell_s for each in times)], [*(each - cell_s for each in times), borders[-1]]
    return tuple(Ground("", *span) for span in zip(starts, ends, strict=True))


def _changes(problem: Problem, fitted: Fitted) -> list[float]:
    """Times at which the soil changes [s]; none if rows are no time series."""
    drive = problem.samples.drive
    if not drive.timed:
        return []
    edges = np.linspace(drive.time_s.min(), drive.time_s.max(), _CELLS + 1)
    inside = in_cells(drive.time_s, edges)
    gradient, information = cell_scores(problem, fitted, problem.first_noise, inside)
    rows = inside.sum(axis=0)
    found: list[int] = []
    worth = 0.5 * SOIL_COUNT * np.log(len(problem.samples))
    while len(found) < _MOST_CHANGES:
        base = _gain(gradient, information, found)
        borders = [0, *sorted(found), _CELLS]
        possible = [
            each for low, high in pairwise(borders) for each in range(low + 1, high)
            if min(rows[low:each].sum(), rows[each:high].sum()) >= _LEAST_ROWS
        ]  # fmt: skip
        if not possible:
            break
        gains = [_gain(gradient, information, [*found, each]) - base for each in possible]
        best = int(np.argmax(gains))
        if gains[best] < worth:
            break
        found.append(possible[best])
    return [float(edges[each]) for each in sorted(found)]


def seems_changed(found: Search, posterior: Posterior) -> bool:
    """Return whether several soils are to be tried: the ground varies much, or something is unknown."""
    best = posterior.best[next(iter(posterior.sets)) - {UNKNOWN}]
    return posterior.unknown > 0.5 or best.fitted.noise.ground_sd.max() > _VARIES


def _total_evidence(found: Search, posterior: Posterior) -> float:
    """Log evidence of all hypotheses, weighted by their priors, and of the soil [nats]."""
    weights = []
    for slugs, best in posterior.best.items():
        weights.append(best.log_evidence + found.log_prior(best))
        if slugs in posterior.discrepancies:
            weights.append(weights[-1] + posterior.discrepancies[slugs].log_evidence)
    return found.origin + float(np.logaddexp.reduce(weights)) + _log_prior_of_soils(found.problem)


def _log_prior_of_soils(problem: Problem) -> float:
    """Ln of the normalisation of the soils' priors, less that of unit normal ones."""
    widths = [sd if math.isfinite(sd) else _LN_STIFFNESS_SD for _, sd in SOIL_PRIOR.values()]
    return -problem.grounds * float(np.log(widths).sum())


def _gain(gradient: np.ndarray, information: np.ndarray, steps: list[int]) -> float:
    """Gain [nats] of steps of stiffness and strength before cells, to first order."""
    if not steps:
        return 0.0
    after = np.arange(gradient.shape[1]) >= np.array(steps)[:, None]
    slope = (gradient @ after.T).ravel()
    curve = np.einsum("acbd,sc,td->asbt", information, after, after).reshape(len(slope), -1)
    return 0.5 * float(slope @ scaled_inverse(curve) @ slope)
