"""True load and slip of each row: a latent path, of which every row's measurement is noisy.

A channel is taken for a stationary Gaussian process about the mean of each stretch between jumps, with the Matern
correlation of order 5/2 (C. E. Rasmussen, C. K. I. Williams, "Gaussian Processes for Machine Learning" (2006), Eq.
4.17; as a state-space model J. Hartikainen, S. Sarkka, IEEE MLSP (2010)), plus white noise; amplitude, length and noise
are the likeliest ones. A jump is where the prediction fails by much more than these explain (A. C. Harvey, S. J.
Koopman, J. Bus. Econ. Stat. 10 (1992), 377-389). Given all measurements the error of the path's mean is a Markov chain,
whose transitions the smoother gives (H. E. Rauch et al., AIAA J. 3 (1965), 1445-1450): the likelihood of the other
channels carries it along. The error is independent of the mean (a Berkson error; R. J. Carroll et al., "Measurement
Error in Nonlinear Models" (2006), Sec. 1.4), so that regressing on the mean attenuates nothing.

How much of the white part is the sensor's and how much a true change from row to row cannot be seen in one channel: it
is the `noise_share`, which the vehicle's stated noise or the likelihood of the other channels decides.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numba import njit
from scipy.ndimage import maximum_filter1d
from scipy.optimize import minimize

from .whitening import Noise, matern, robust_loss

STATES = 3
"""States of a path: its value and two derivatives."""

_JUMP, _SEPARATION, _MOST_SEARCHES = 5.0, 5, 8
"""A step is a jump where the path leaves its prediction by so many standard deviations, more than in so many rows
before and after; jumps are looked for so many times at most."""

_FLANK = 2
"""Rows before and after a jump that lie on its flank."""

_LEAST_NOISE = 1e-6
"""Least white noise, as a share of the channel's size: what a converter's last digit makes [-]."""

_LEAST_LENGTH = 0.7
"""Shortest length of the path's correlation, in rows: what is rougher is white."""

_JITTER = 1e-11
"""Share of a covariance that is added to its diagonal before it is inverted [-]."""


@dataclass(frozen=True)
class Latent:
    """What is known of a channel's true values.

    Parameters
    ----------
    mean : (n,)
        Expected true value of each row [the channel's unit].
    transition, process_noise : (n, k, k)
        Transition of the error of the path and its derivatives from the row before, and the covariance of what is new
        in it; the first state's error is the mean's.
    white : (n,)
        Variance of the part of the error that is independent from row to row.
    """

    mean: np.ndarray
    transition: np.ndarray
    process_noise: np.ndarray
    white: np.ndarray


@dataclass(frozen=True)
class Path:
    """The smooth path of a channel and the white part about it, before the noise share is known.

    measured, mean (n,), transition, process_noise (n, k, k) as in `Latent`, of the path alone; covariance (n, k, k) of the states'
    errors, and white_sd (n,) standard deviation of the white part about the path.
    """

    measured: np.ndarray
    mean: np.ndarray
    transition: np.ndarray
    process_noise: np.ndarray
    covariance: np.ndarray
    white_sd: np.ndarray

    def select(self, rows: np.ndarray, follows: np.ndarray) -> Path:
        """Return some rows (k,); the chain goes on where a row `follows` (k,) the one before."""
        chosen = {name: getattr(self, name)[rows] for name in ("measured", "mean", "covariance", "white_sd")}
        continues = follows[:, None, None]
        transition = np.where(continues, self.transition[rows], 0.0)
        return Path(
            transition=transition,
            process_noise=np.where(continues, self.process_noise[rows], self.covariance[rows]),
            **chosen,
        )

    def latent(self, noise_share: float) -> Latent:
        """Return the true values if the sensor makes this share of the white part's variance, in (0, 1]."""
        seen = np.isfinite(self.measured)
        own = np.where(seen, noise_share, 1.0)
        mean = own * self.mean + (1.0 - own) * np.where(seen, self.measured, 0.0)
        # A row's own reading pulls it by the same share, which its error follows.
        before = np.concatenate([own[:1], own[:-1]])
        transition, process_noise = (
            self.transition * (own / before)[:, None, None],
            self.process_noise * (own**2)[:, None, None],
        )
        return Latent(mean, transition, process_noise, own * (1.0 - own) * self.white_sd**2)


def path_of(
    measured: np.ndarray, time_s: np.ndarray, stretch: np.ndarray, relative: np.ndarray, first_sd: float
) -> Path:
    """Find the path of a channel of rows that follow each other in time.

    Parameters
    ----------
    measured, time_s : (n,)
        The channel, NaN where not observed, and the time [s].
    stretch : (n,)
        Number of the uninterrupted stretch of time of each row; a path begins anew in each.
    relative : (n,)
        Standard deviation of the white part by row, up to a common factor.
    first_sd
        A first guess of that factor [the channel's unit].
    """
    jumps = np.concatenate([[True], np.diff(stretch) != 0])
    seen = np.isfinite(measured)
    if not seen.any():
        return exact(np.full(len(measured), math.nan))
    least = _LEAST_NOISE * max(float(np.abs(measured[seen]).max()), 1e-300)
    relative, step = np.maximum(relative, 1e-6), _steps(time_s, jumps)
    first = max(first_sd, least)
    spread = max(float(np.std(measured[seen])), 2.0 * first)
    starts = [np.log([first, amplitude, length]) for amplitude in (spread, 2.0 * first) for length in (4.0, 25.0)]
    readings = _Readings(np.where(seen, measured, 0.0), seen, jumps, step, relative, least)
    point = readings.best(starts)
    for _ in range(_MOST_SEARCHES):
        away = np.abs(readings.innovations(point)[0])
        new = (away > _JUMP) & (away >= maximum_filter1d(away, 2 * _SEPARATION + 1)) & ~readings.jumps
        if not new.any():
            break
        readings = replace(readings, jumps=readings.jumps | new)
        point = readings.best(starts)
    return _smooth_between_jumps(readings, point, measured, jumps)


def _smooth_between_jumps(readings: _Readings, point: np.ndarray, measured: np.ndarray, begins: np.ndarray) -> Path:
    """Smooth the readings but for those about a jump: it takes a few rows, on which the paths before and after it say
    nothing. Each of these stands alone, as does what the path misses. `begins` (n,): where a stretch of time begins.
    """
    path, flank = readings.path(point, measured), np.zeros(len(measured), dtype=bool)
    edges = readings.jumps & ~begins
    edges |= np.append(edges[1:], False)
    for _ in range(_MOST_SEARCHES):
        edges |= np.nan_to_num(np.abs(measured - path.mean)) > _JUMP * path.white_sd
        new = maximum_filter1d(edges, 2 * _FLANK + 1) & ~flank
        if not new.any():
            break
        flank |= new
        readings = replace(readings, jumps=readings.jumps | flank | np.append(False, flank[:-1]))
        path = readings.path(point, measured)
    return path


@dataclass(frozen=True)
class _Readings:
    """Readings (n,), which were seen, where the path begins anew, steps of the clock, and the relative white noise."""

    values: np.ndarray
    seen: np.ndarray
    jumps: np.ndarray
    step: np.ndarray
    relative: np.ndarray
    least: float

    @cached_property
    def _gaps(self) -> tuple[np.ndarray, np.ndarray]:
        """The different gaps between rows, infinite where a path begins, and which one is before each row."""
        return np.unique(np.where(self.jumps, np.inf, self.step), return_inverse=True)

    @cached_property
    def _centre(self) -> np.ndarray:
        """Mean (n,) of the readings between two jumps."""
        part = np.cumsum(self.jumps) - 1
        count = np.bincount(part, self.seen)
        return (np.bincount(part, self.values * self.seen) / np.maximum(count, 1.0))[part]

    def _parts(self, point: np.ndarray) -> tuple[np.ndarray, ...]:
        """Arguments of the filter: off the centre, seen, transitions and covariances by gap, gap and noise by row."""
        sd, amplitude, length = np.exp(point)
        gap, which = self._gaps
        noise = Noise(np.ones(1), np.zeros(1), np.full(2, amplitude), max(float(length), _LEAST_LENGTH), STATES - 1)
        transition, process_noise = (np.ascontiguousarray(each[:, :STATES, :STATES]) for each in matern(gap, noise))
        variance = (self.relative * max(float(sd), self.least)) ** 2
        return self.values - self._centre, self.seen, transition, process_noise, which, variance

    def innovations(self, point: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Innovations (n,) and ln of their standard deviations (n,)."""
        return _innovations(*self._parts(point))

    def loss(self, point: np.ndarray) -> float:
        """Minus the log-likelihood [nats] of ln(noise, amplitude, length).

        A step that is not known for a jump yet must not pass for noise: the loss is robust.
        """
        if not (np.abs(point) < 60.0).all():
            return math.inf
        away, log_scale = self.innovations(point)
        return float(robust_loss(away).sum() + log_scale.sum())

    def best(self, starts: list[np.ndarray]) -> np.ndarray:
        """Return the likeliest ln(noise, amplitude, length) that is found from some starts."""
        options = {"xatol": 0.05, "fatol": 0.1}
        found = [minimize(self.loss, start, method="Nelder-Mead", options=options) for start in starts]
        return min(found, key=lambda each: each.fun).x

    def path(self, point: np.ndarray, measured: np.ndarray) -> Path:
        """Smooth the readings."""
        parts = self._parts(point)
        mean, covariance, transition, process_noise = _smooth(*parts)
        return Path(measured, self._centre + mean, transition, process_noise, covariance, np.sqrt(parts[-1]))


def independent(measured: np.ndarray, sd: np.ndarray) -> Path:
    """Return the path of steady trials, each on its own, shrunk to their mean by the noise's share of the scatter."""
    seen = np.isfinite(measured)
    centre, total = float(np.mean(measured[seen])), float(np.var(measured[seen]))
    noise = sd**2
    truth = max(total - float(np.mean(noise[seen])), 0.02 * total + 1e-30)
    share = np.where(seen, truth / (truth + noise), 0.0)
    mean = centre + share * (np.where(seen, measured, centre) - centre)
    covariance = np.zeros((len(measured), STATES, STATES))
    covariance[:, 0, 0] = np.where(seen, share * noise, truth)
    return Path(measured, mean, np.zeros_like(covariance), covariance, covariance, sd)


def exact(values: np.ndarray) -> Path:
    """Return the path of a channel that is known without error."""
    nothing = np.zeros((len(values), STATES, STATES))
    return Path(values, values, nothing, nothing, nothing, np.zeros(len(values)))


def _steps(time_s: np.ndarray, jumps: np.ndarray) -> np.ndarray:
    """Time from the row before (n,), in usual steps of the clock; 1 where a stretch begins or the clock stands."""
    step = np.diff(time_s, prepend=time_s[:1])
    going = ~jumps & (step > 0.0)
    usual = float(np.median(step[going])) if going.any() else 1.0
    return np.where(going, step / usual, 1.0)


@njit(cache=True, nogil=True, error_model="numpy")
def _innovations(values, seen, transition, process_noise, which, noise):
    """Innovations (n,) of a path and ln of their standard deviations (n,), zero where nothing was seen.

    transition, process_noise (g, k, k): transitions over each of the gaps; which (n,): the gap before each row; noise (n,): variance.
    """
    rows, size = len(values), transition.shape[1]
    away, log_scale = np.zeros(rows), np.zeros(rows)
    state, predicted = np.zeros(size), np.zeros(size)
    p, product = np.zeros((size, size)), np.zeros((size, size))
    for row in range(rows):
        a, q = transition[which[row]], process_noise[which[row]]
        for i in range(size):
            predicted[i] = 0.0
            for j in range(size):
                predicted[i] += a[i, j] * state[j]
                product[i, j] = 0.0
                for k in range(size):
                    product[i, j] += a[i, k] * p[k, j]
        for i in range(size):
            state[i] = predicted[i]
            for j in range(size):
                value = q[i, j]
                for k in range(size):
                    value += product[i, k] * a[j, k]
                p[i, j] = value
        if not seen[row]:
            continue
        scale = p[0, 0] + noise[row]
        off = values[row] - state[0]
        away[row], log_scale[row] = off / math.sqrt(scale), 0.5 * math.log(scale)
        for i in range(size):
            predicted[i] = p[i, 0] / scale
        for i in range(size):
            state[i] += predicted[i] * off
            for j in range(size):
                product[i, j] = predicted[i] * p[0, j]
        for i in range(size):
            for j in range(size):
                p[i, j] -= product[i, j]
    return away, log_scale


@njit(cache=True, nogil=True, error_model="numpy")
def _inverse(matrix):
    """Inverse of a covariance, its diagonal a little raised."""
    return np.linalg.inv(matrix + _JITTER * np.trace(matrix) * np.eye(len(matrix)))


@njit(cache=True, nogil=True, error_model="numpy")
def _smooth(values, seen, transition, process_noise, which, noise):
    """Smooth a path: mean (n,) and covariance (n, k, k), and transition and process_noise (n, k, k) of its error's chain.

    Arguments as in `_innovations`.
    """
    rows, size = len(values), transition.shape[1]
    state, ahead_state = np.zeros((rows, size)), np.zeros((rows, size))
    p, ahead = np.zeros((rows, size, size)), np.zeros((rows, size, size))
    chain, new = np.zeros((rows, size, size)), np.zeros((rows, size, size))
    before, spread = np.zeros(size), np.zeros((size, size))
    for row in range(rows):
        a = transition[which[row]]
        ahead_state[row] = a @ before
        ahead[row] = a @ spread @ a.T + process_noise[which[row]]
        before, spread = ahead_state[row].copy(), ahead[row].copy()
        if seen[row]:
            gain = ahead[row, :, 0].copy() / (ahead[row, 0, 0] + noise[row])
            before = before + gain * (values[row] - before[0])
            spread = spread - np.outer(gain, ahead[row, 0].copy())
        state[row], p[row] = before, spread
    new[rows - 1] = p[rows - 1]
    for row in range(rows - 2, -1, -1):
        a = transition[which[row + 1]]
        back = p[row] @ a.T @ _inverse(ahead[row + 1])
        state[row] += back @ (state[row + 1] - ahead_state[row + 1])
        own = p[row] + back @ (p[row + 1] - ahead[row + 1]) @ back.T
        own = 0.5 * (own + own.T)
        common = p[row + 1] @ back.T
        chain[row + 1] = common @ _inverse(own)
        new[row + 1] = p[row + 1] - chain[row + 1] @ own @ chain[row + 1].T
        p[row] = own
    new[0] = p[0]
    return state[:, 0].copy(), p, chain, new
