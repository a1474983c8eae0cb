"""Latent load and slip: the true values of each row, estimated from noisy measurements.

A channel is modelled as a stationary Gaussian process about the mean of each stretch between jumps, with the Matern
correlation of order 5/2 (C. E. Rasmussen, C. K. I. Williams, "Gaussian Processes for Machine Learning" (2006), Eq.
4.17; as a state-space model J. Hartikainen, S. Sarkka, IEEE MLSP (2010)), plus white noise. Amplitude, length and noise
maximise the likelihood. A jump is an outlying innovation (A. C. Harvey, S. J. Koopman, J. Bus. Econ. Stat. 10 (1992),
377-389). Given all measurements the error of the smoothed mean is a Markov chain, whose transitions the smoother yields
(H. E. Rauch et al., AIAA J. 3 (1965), 1445-1450); it is part of the likelihood of the other channels. The error is
independent of the mean (a Berkson error; R. J. Carroll et al., "Measurement Error in Nonlinear Models" (2006), Sec.
1.4), so that regression on the mean is not attenuated.

One channel does not determine how much of the white part is sensor noise and how much a true change from row to row.
This share, `noise_share`, follows from the noise that the vehicle states or from the likelihood of the other channels.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields, replace
from functools import cached_property

import numpy as np
from numba import njit
from scipy.ndimage import maximum_filter1d
from scipy.optimize import minimize

from .whitening import TO_ONE_OVER_E, Noise, matern, robust_loss

STATES = 3
"""States of a path: its value and two derivatives."""

_JUMP, _SEPARATION, _MOST_SEARCHES = 5.0, 5, 8
"""An innovation of so many standard deviations is a jump if none is larger within so many rows before and after; most
iterations of the search for jumps."""

_FLANK = 2
"""Rows before and after a jump that belong to its flank."""

_LEAST_NOISE = 1e-6
"""Least white noise, relative to the channel's largest value: the resolution of a converter [-]."""

_LEAST_LENGTH = 0.7
"""Least correlation length of the path [rows]: shorter variation counts as white noise."""

_JITTER = 1e-11
"""Regularisation of a covariance before its inversion, relative to its trace [-]."""


@dataclass(frozen=True)
class Latent:
    """Estimated true values of a channel.

    Parameters
    ----------
    mean : (n,)
        Expected true value of each row [the channel's unit].
    transition, process_noise : (n, k, k)
        Transition matrix and process-noise covariance of the errors of the path and its derivatives; the first state is
        the error of the mean.
    white : (n,)
        Variance of the white part of the error.
    """

    mean: np.ndarray
    transition: np.ndarray
    process_noise: np.ndarray
    white: np.ndarray


@dataclass(frozen=True)
class Path:
    """The smoothed path of a channel and the white part about it, before the noise share is known.

    measured, mean (n,), transition, process_noise (n, k, k) as in `Latent`, of the path alone; rate (n,), its expected
    rate of change [1/s]; covariance (n, k, k) of the errors of states; white_sd (n,), the white part's standard
    deviation.
    """

    measured: np.ndarray
    mean: np.ndarray
    rate: np.ndarray
    transition: np.ndarray
    process_noise: np.ndarray
    covariance: np.ndarray
    white_sd: np.ndarray

    def select(self, rows: np.ndarray, follows: np.ndarray) -> Path:
        """Return some rows (k,); the chain continues where a row `follows` (k,) the previous one."""
        chosen = {name: getattr(self, name)[rows] for name in ("measured", "mean", "rate", "covariance", "white_sd")}
        continues = follows[:, None, None]
        transition = np.where(continues, self.transition[rows], 0.0)
        return Path(
            transition=transition,
            process_noise=np.where(continues, self.process_noise[rows], self.covariance[rows]),
            **chosen,
        )

    def latent(self, noise_share: float) -> Latent:
        """Return the true values if the variance of sensor noise is this share, in (0, 1], of the largest white part's.

        Regimes share a sensor: where the white part is smaller than its noise, all of it is noise.
        """
        seen, variance = np.isfinite(self.measured), self.white_sd**2
        noise = noise_share * float(variance.max(initial=0.0))
        own = np.where(seen & (variance > noise), noise / np.maximum(variance, 1e-300), 1.0)
        mean = own * self.mean + (1.0 - own) * np.where(seen, self.measured, 0.0)
        # The estimate is shrunk towards each row's own reading, and its error by the same factor.
        before = np.concatenate([own[:1], own[:-1]])
        transition, process_noise = (
            self.transition * (own / before)[:, None, None],
            self.process_noise * (own**2)[:, None, None],
        )
        return Latent(mean, transition, process_noise, own * (1.0 - own) * self.white_sd**2)


def path_of(measured: np.ndarray, time_s: np.ndarray, stretch: np.ndarray, regime: np.ndarray, first_sd: float) -> Path:
    """Estimate the path of a channel of a time series.

    Parameters
    ----------
    measured, time_s : (n,)
        The channel, NaN where not observed, and the time [s].
    stretch : (n,)
        Number of the uninterrupted stretch of time of each row; paths of different stretches are independent.
    regime : (n,)
        Number of the regime of each row, which has an amplitude, a length and a noise: slow and fast driving differ.
    first_sd
        Initial guess of the standard deviation of the white part [the channel's unit].
    """
    begins = np.concatenate([[True], (np.diff(stretch) != 0) | (np.diff(regime) != 0)])
    step, step_s = _steps(time_s, begins)
    parts = [np.flatnonzero(regime == each) for each in np.unique(regime)]
    paths = [_path_in_regime(measured[rows], begins[rows], step[rows], first_sd) for rows in parts]
    back = np.argsort(np.concatenate(parts))
    columns = {each.name: [getattr(path, each.name) for path in paths] for each in fields(Path)}
    together = Path(**{name: np.concatenate(values)[back] for name, values in columns.items()})
    return replace(together, rate=together.rate / step_s)


def _path_in_regime(measured: np.ndarray, jumps: np.ndarray, step: np.ndarray, first_sd: float) -> Path:
    """Estimate the path of a channel in one regime.

    jumps (n,): where it begins anew; step (n,): time since the row before [median steps].
    """
    seen, begins = np.isfinite(measured), jumps
    if not seen.any():
        return exact(np.full(len(measured), math.nan))
    least = _LEAST_NOISE * max(float(np.abs(measured[seen]).max()), 1e-300)
    first = max(first_sd, least)
    scatter = max(float(np.std(measured[seen])), 2.0 * first)
    starts = [np.log([first, amplitude, length]) for amplitude in (scatter, 2.0 * first) for length in (4.0, 25.0)]
    readings = _Readings(np.where(seen, measured, 0.0), seen, jumps, step, least)
    point = readings.best(starts)
    for _ in range(_MOST_SEARCHES):
        size = np.abs(readings.innovations(point)[0])
        new = (size > _JUMP) & (size >= maximum_filter1d(size, 2 * _SEPARATION + 1)) & ~readings.jumps
        if not new.any():
            break
        readings = replace(readings, jumps=readings.jumps | new)
        point = readings.best(starts)
    return _smooth_between_jumps(readings, point, measured, begins)


def _smooth_between_jumps(readings: _Readings, point: np.ndarray, measured: np.ndarray, begins: np.ndarray) -> Path:
    """Smooth the readings between jumps; each row on the flank of a jump, or far off the path, is independent.

    A jump takes a few rows, about which the paths before and after it are not informative. `begins` (n,): where a
    stretch of time begins.
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
    """Readings (n,), which were observed, where a path begins, time steps, and the least white noise."""

    values: np.ndarray
    seen: np.ndarray
    jumps: np.ndarray
    step: np.ndarray
    least: float

    @cached_property
    def _gaps(self) -> tuple[np.ndarray, np.ndarray]:
        """Unique gaps between rows, infinite where a path begins, and the index of the one before each row."""
        return np.unique(np.where(self.jumps, np.inf, self.step), return_inverse=True)

    @cached_property
    def _centre(self) -> np.ndarray:
        """Mean (n,) of the readings between two jumps."""
        part = np.cumsum(self.jumps) - 1
        count = np.bincount(part, self.seen)
        return (np.bincount(part, self.values * self.seen) / np.maximum(count, 1.0))[part]

    def _parts(self, point: np.ndarray) -> tuple[np.ndarray, ...]:
        """Arguments of `_innovations` for ln(noise, amplitude, length), the readings centred."""
        sd, amplitude, length = np.exp(point)
        gap, which = self._gaps
        noise = Noise(np.ones(1), np.zeros(1), np.full(2, amplitude), max(float(length), _LEAST_LENGTH), STATES - 1)
        transition, process_noise = (np.ascontiguousarray(each[:, :STATES, :STATES]) for each in matern(gap, noise))
        variance = np.full(len(self.values), max(float(sd), self.least) ** 2)
        return self.values - self._centre, self.seen, transition, process_noise, which, variance

    def innovations(self, point: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Innovations (n,) and ln of their standard deviations (n,)."""
        return _innovations(*self._parts(point))

    def loss(self, point: np.ndarray) -> float:
        """Minus the log-likelihood [nats] of ln(noise, amplitude, length).

        The loss is robust, so that jumps that are not identified yet do not count as noise.
        """
        if not (np.abs(point) < 60.0).all():
            return math.inf
        innovation, log_scale = self.innovations(point)
        return float(robust_loss(innovation).sum() + log_scale.sum())

    def best(self, starts: list[np.ndarray]) -> np.ndarray:
        """Return the maximum-likelihood ln(noise, amplitude, length) over several starts."""
        options = {"xatol": 0.05, "fatol": 0.1}
        found = [minimize(self.loss, start, method="Nelder-Mead", options=options) for start in starts]
        return min(found, key=lambda each: each.fun).x

    def path(self, point: np.ndarray, measured: np.ndarray) -> Path:
        """Smooth the readings."""
        parts = self._parts(point)
        states, covariance, transition, process_noise = _smooth(*parts)
        # Derivatives are in decay lengths.
        rate = states[:, 1] * TO_ONE_OVER_E[STATES - 1] / max(float(np.exp(point[2])), _LEAST_LENGTH)
        mean = self._centre + states[:, 0]
        return Path(measured, mean, rate, transition, process_noise, covariance, np.sqrt(parts[-1]))


def independent(measured: np.ndarray, sd: np.ndarray) -> Path:
    """Return the path of independent steady-state trials, shrunk to their mean by the noise's share of the variance."""
    seen = np.isfinite(measured)
    centre, total = float(np.mean(measured[seen])), float(np.var(measured[seen]))
    noise = sd**2
    truth = max(total - float(np.mean(noise[seen])), 0.02 * total + 1e-30)
    share = np.where(seen, truth / (truth + noise), 0.0)
    mean = centre + share * (np.where(seen, measured, centre) - centre)
    covariance = np.zeros((len(measured), STATES, STATES))
    covariance[:, 0, 0] = np.where(seen, share * noise, truth)
    return Path(measured, mean, np.zeros(len(mean)), np.zeros_like(covariance), covariance, covariance, sd)


def exact(values: np.ndarray) -> Path:
    """Return the path of a channel without error."""
    zero = np.zeros((len(values), STATES, STATES))
    return Path(values, values, np.zeros(len(values)), zero, zero, zero, np.zeros(len(values)))


def _steps(time_s: np.ndarray, jumps: np.ndarray) -> tuple[np.ndarray, float]:
    """Time since the previous row (n,), in median time steps, 1 where a stretch begins or time does not increase; and
    the median time step [s].
    """
    step = np.diff(time_s, prepend=time_s[:1])
    increasing = ~jumps & (step > 0.0)
    median_step = float(np.median(step[increasing])) if increasing.any() else 1.0
    return np.where(increasing, step / median_step, 1.0), median_step


@njit(cache=True, nogil=True, error_model="numpy")
def _innovations(values, seen, transition, process_noise, which, noise):
    """Innovations (n,) of a path and ln of their standard deviations (n,), zero where not observed.

    transition, process_noise (g, k, k) over each gap; which (n,): the gap before each row; noise (n,): variance.
    """
    rows, size = len(values), transition.shape[1]
    innovation, log_scale = np.zeros(rows), np.zeros(rows)
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
        residual = values[row] - state[0]
        innovation[row], log_scale[row] = residual / math.sqrt(scale), 0.5 * math.log(scale)
        for i in range(size):
            predicted[i] = p[i, 0] / scale
        for i in range(size):
            state[i] += predicted[i] * residual
            for j in range(size):
                product[i, j] = predicted[i] * p[0, j]
        for i in range(size):
            for j in range(size):
                p[i, j] -= product[i, j]
    return innovation, log_scale


@njit(cache=True, nogil=True, error_model="numpy")
def _inverse(matrix):
    """Inverse of a regularised covariance."""
    return np.linalg.inv(matrix + _JITTER * np.trace(matrix) * np.eye(len(matrix)))


@njit(cache=True, nogil=True, error_model="numpy")
def _smooth(values, seen, transition, process_noise, which, noise):
    """Smoothed states (n, k), their covariance, and transitions and process noise (n, k, k) of the errors' chain.

    Arguments as in `_innovations`.
    """
    rows, size = len(values), transition.shape[1]
    state, predicted_state = np.zeros((rows, size)), np.zeros((rows, size))
    p, predicted = np.zeros((rows, size, size)), np.zeros((rows, size, size))
    error_transition, error_noise = np.zeros((rows, size, size)), np.zeros((rows, size, size))
    filtered, covariance = np.zeros(size), np.zeros((size, size))
    for row in range(rows):
        a = transition[which[row]]
        predicted_state[row] = a @ filtered
        predicted[row] = a @ covariance @ a.T + process_noise[which[row]]
        filtered, covariance = predicted_state[row].copy(), predicted[row].copy()
        if seen[row]:
            gain = predicted[row, :, 0].copy() / (predicted[row, 0, 0] + noise[row])
            filtered = filtered + gain * (values[row] - filtered[0])
            covariance = covariance - np.outer(gain, predicted[row, 0].copy())
        state[row], p[row] = filtered, covariance
    error_noise[rows - 1] = p[rows - 1]
    for row in range(rows - 2, -1, -1):
        a = transition[which[row + 1]]
        smoother_gain = p[row] @ a.T @ _inverse(predicted[row + 1])
        state[row] += smoother_gain @ (state[row + 1] - predicted_state[row + 1])
        smoothed = p[row] + smoother_gain @ (p[row + 1] - predicted[row + 1]) @ smoother_gain.T
        smoothed = 0.5 * (smoothed + smoothed.T)
        cross = p[row + 1] @ smoother_gain.T
        error_transition[row + 1] = cross @ _inverse(smoothed)
        error_noise[row + 1] = p[row + 1] - error_transition[row + 1] @ smoothed @ error_transition[row + 1].T
        p[row] = smoothed
    error_noise[0] = p[0]
    return state, p, error_transition, error_noise
