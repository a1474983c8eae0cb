"""Whether sensors remember, asked of what a fit leaves: ground that varies and what a model misses may look alike."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...noise import in_time
from .fitting import Fitted, Problem
from .memory import STEPS_APART, of_second_differences, rho_shown
from .samples import Samples
from .soil_variation import correlation

REMEMBERED = 0.2
"""Correlation of neighbours from which on noise has a memory [-]: then 1.5 rows say the same."""

TOLD = 25.0
"""Nats that a memory has to gain over none, or another one."""

_ANOTHER = 0.15
"""Difference of correlations from which on a memory is another one [-]."""

_ORDERS = 4
"""Multiples of the lugs' number that their ripple has: it would look like a memory before anything explains it."""

_BORNE_OUT = 0.5
"""Share of the neighbours in place that are of different passes, from which on these bear out that the ground varies: a
memory of the noise would not return with the place [-]."""


def remembering(samples: Samples, problem: Problem, fitted: Fitted) -> Samples | None:
    """Give samples with sensors that remember as much as what a fit leaves shows; nothing where they do, or do not,
    already, nor of trials.

    Whether they do a fit to them tells, by `TOLD` or more (`Fitted.score`): it takes what is ground, and is foretold
    by other channels and passes, for what it is.

    Parameters
    ----------
    samples
        Rows, with a memory that is taken already or none.
    problem, fitted
        The same made ready, gross errors blanked, and what is fitted to them.
    """
    if not samples.drive.timed:
        return None
    rho = np.zeros(len(samples.memory))
    waves = _of_lugs(samples)
    for position, channel in enumerate(problem.answers):
        series = in_time(_less(fitted.residuals[:, position], waves), samples.drive.stretch)
        shown = rho_shown(series, ground_apart(problem, fitted, position))
        rho[channel] = shown if shown > REMEMBERED else 0.0
    if np.abs(rho - samples.memory).max() < _ANOTHER:
        return None
    # Second differences show what is new in each row, and that less than it is.
    wider = of_second_differences(rho) / of_second_differences(samples.memory)
    return replace(samples, memory=rho, noise=np.where(samples.stated, samples.noise, samples.noise * wider))


def _of_lugs(samples: Samples) -> np.ndarray:
    """Waves (n, k) of the wheel angle that the lugs of the vehicle's description make, NaN in rows without an angle;
    none where it announces no lugs or no row has one.
    """
    phase = samples.wheel.grouser_count * samples.drive.wheel_angle_rad[:, None] * np.arange(1, _ORDERS + 1)
    waves = np.concatenate([np.cos(phase), np.sin(phase)], axis=1)
    return waves if samples.wheel.grouser_count and np.isfinite(phase).any() else waves[:, :0]


def _less(residuals: np.ndarray, waves: np.ndarray) -> np.ndarray:
    """Residuals (n,) less waves (n, k), as large as they are in them; rows without waves keep theirs."""
    good = np.isfinite(residuals) & np.isfinite(waves).all(axis=1)
    own = np.linalg.lstsq(waves[good], residuals[good], rcond=None)[0]
    return residuals - np.nan_to_num(waves) @ own


def ground_apart(problem: Problem, fitted: Fitted, position: int, *, new: bool = False) -> np.ndarray:
    """Mean squares (3,), SI, of what neighbours one, two and three rows apart in time differ by in a channel, or in
    what is `new` in its rows (`Memory.new_in`), for the ground's varying; nothing where no other passes bear that
    out, for a memory of the noise passes for it there.
    """
    samples, noise = problem.samples, fitted.noise
    stretch, place = samples.drive.stretch, samples.position
    beside = np.isfinite(problem.gap[1:])
    if not beside.any() or np.mean((np.diff(stretch[problem.order]) != 0)[beside]) < _BORNE_OUT:
        return np.zeros(len(STEPS_APART))
    by_ground = np.nan_to_num((problem.weights or fitted.response).by_ground[:, problem.answers])
    by_ground = problem.memory.new_in(by_ground) if new else by_ground
    felt, answer = by_ground[:, position] * noise.spread, []
    for step in STEPS_APART:
        first, second = felt[:-step], felt[step:]
        alike = correlation(place[step:] - place[:-step], noise)[:, None]
        squares = np.sum(first**2 + second**2 - 2.0 * alike * first * second, axis=1)
        inside = stretch[step:] == stretch[:-step]
        answer.append(float(squares[inside].sum() / max(inside.sum(), 1)))
    return np.array(answer)
