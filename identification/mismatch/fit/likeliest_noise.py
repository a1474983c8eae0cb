"""Noise of the sensors and variation of the ground under which residuals are likeliest, by scoring.

The information of the innovations shows the way (A. C. Harvey, "Forecasting, Structural Time Series Models and the
Kalman Filter" (1989), Sec. 3.4.5). Derivatives by the few numbers that describe the noise are the filter's differences
(`noise_score`).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from .noise_score import told_of
from .soil_variation import NoiseModel, Ready
from .steps import Prior, step_from

_SPREAD_PRIOR, _LENGTH_PRIOR = 0.15, 1.5
"""Soil varies along a track by some per cent, seldom more (standard deviation of ln stiffness and ln strength), over a
length [m or s] known to a factor of a few (standard deviation of its logarithm)."""

_MOST_BELOW = 1.5
"""No sensor's ln(noise) is further below what neighbours show."""

_LONGEST_NOISE, _LONGEST_SPREAD, _LONGEST_LENGTH = 1.0, 0.1, 1.5
"""Longest steps of ln(noise), the variation and ln(length)."""

_NOISE_STEP, _SPREAD_STEP, _LENGTH_STEP = 3e-6, 1e-6, 5e-5
"""Steps of the differences."""

_LEAST_SPREAD, _FELT_SPREAD = 1e-5, 0.003
"""Ground that does not vary, and variation below which the score no longer tells whether there is any [-]."""

_STEPS, _ENOUGH = 20, 0.02
"""Steps at most, and what one promises [nats] below which it is not taken."""

_MOST_DAMPED = 1e4


@dataclass(frozen=True)
class NoiseKnown:
    """What is known of the noise before the fit.

    Parameters
    ----------
    first
        Noise that neighbours show or the vehicle states; its length is a guess.
    sd : (m,)
        Standard deviation of ln(noise) about it.
    shortest, longest
        Between which the variation's length lies [m or s].
    """

    first: NoiseModel
    sd: np.ndarray
    shortest: float
    longest: float

    def prior(self, most: NoiseModel) -> Prior:
        """Prior and bounds of ln(noise) (m,), variation (2,) and ln(length), none more than the `most`."""
        mean = _packed(self.first)
        mean[-3:-1] = 0.0
        sd = np.concatenate([self.sd, np.full(2, _SPREAD_PRIOR), [_LENGTH_PRIOR]])
        low = np.concatenate([mean[:-3] - _MOST_BELOW, np.full(2, _LEAST_SPREAD), [math.log(self.shortest)]])
        high = np.concatenate([np.log(most.answers), most.spread, [math.log(self.longest)]])
        return Prior(mean, sd**-2.0, np.minimum(low, high), high)

    def loss(self, noise: NoiseModel) -> float:
        """Minus the log-density [nats], up to a constant."""
        return self.prior(noise).loss(_packed(noise))


@dataclass(frozen=True)
class Weighed:
    """Residuals under a noise.

    Parameters
    ----------
    loss
        Theirs, less what parameters gain that follow the noise [nats].
    columns
        The residuals, and what those parameters take from them, if there are any.
    at_rest
        Whether these are where they gain most: then it does not matter to the loss which way they go.
    """

    loss: float
    columns: Ready
    at_rest: bool = True


def likeliest(
    weigh: Callable[[NoiseModel], Weighed], start: NoiseModel, prior: Prior, latent_covariance: np.ndarray,
    gap: np.ndarray, share: float = 1.0,
) -> NoiseModel:  # fmt: skip
    """Noise of the least loss within bounds.

    Parameters
    ----------
    weigh
        Weighs residuals under a noise.
    start
        Where to start.
    prior
        Of the noise (`NoiseKnown.prior`).
    latent_covariance, gap
        As in `Ready.filter`.
    share
        With which what the columns tell counts in the loss [-].
    """
    sensors = len(start.answers)
    longest = np.repeat([_LONGEST_NOISE, _LONGEST_SPREAD, _LONGEST_LENGTH], [sensors, 2, 1])
    steps = np.repeat([_NOISE_STEP, _SPREAD_STEP, _LENGTH_STEP], [sensors, 2, 1])

    def derive(vector: np.ndarray, weighed: Weighed) -> tuple[np.ndarray, np.ndarray]:
        """Score (k,) and information (k, k)."""
        there = [_unpacked(vector + step, start.smooth) for step in np.diag(steps)]
        noises = [_unpacked(vector, start.smooth), *there]
        score, information = told_of(weighed.columns, noises, steps, latent_covariance, gap)
        if not weighed.at_rest:
            return (weighed.loss - np.array([weigh(noise).loss for noise in there])) / steps, share * information
        return share * score, share * information

    vector, damping = _packed(start), 1e-3
    vector[-3:-1] = np.maximum(vector[-3:-1], _FELT_SPREAD)
    vector = np.clip(vector, prior.lower, prior.upper)
    weighed = weigh(_unpacked(vector, start.smooth))
    total = weighed.loss + prior.loss(vector)
    score, information = derive(vector, weighed)
    for _ in range(_STEPS):
        step, promised = step_from(score, information, prior, vector, damping, longest)
        if promised < _ENOUGH or damping > _MOST_DAMPED:
            break
        trial = np.clip(vector + step, prior.lower, prior.upper)
        weighed = weigh(_unpacked(trial, start.smooth))
        reached = weighed.loss + prior.loss(trial)
        if reached < total:
            vector, total, damping = trial, reached, max(damping / 10.0, 1e-6)
            score, information = derive(vector, weighed)
        else:
            damping = max(damping, 1e-3) * 30.0
    return _unpacked(vector, start.smooth)


def _packed(noise: NoiseModel) -> np.ndarray:
    return np.concatenate([np.log(noise.answers), noise.spread, [math.log(noise.length)]])


def _unpacked(vector: np.ndarray, smooth: int) -> NoiseModel:
    return NoiseModel(np.exp(vector[:-3]), vector[-3:-1], math.exp(vector[-1]), smooth)
