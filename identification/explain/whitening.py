"""Whitening of correlated errors: Kalman filters that turn residuals and their derivatives into innovations.

The first filter runs in order of time. It removes errors of load and slip (`latent`), which propagate into all channels
of a row, and autocorrelated sensor noise. The second runs in order of place. It removes the variation of the ground's
stiffness and strength along the track, two Matern processes (C. E. Rasmussen, C. K. I. Williams, "Gaussian Processes
for Machine Learning" (2006), Eq. 4.17; J. Hartikainen, S. Sarkka, IEEE MLSP (2010)). Innovations are independent with
unit variance if the model is correct (A. C. Harvey, "Forecasting, Structural Time Series Models and the Kalman Filter"
(1989), Sec. 3.4). The first filter assumes uniform ground over the few rows whose errors are correlated.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numba import njit

GROSS = 3.0
"""Innovation beyond which the density falls as a power law [-], so that gross errors bias neither the fit nor the scale
of the noise (F. R. Hampel et al., "Robust Statistics" (1986), Sec. 2.6)."""

TO_ONE_OVER_E = (1.0, 2.146193220620582, 2.9046299750299145)
"""Arguments at which the Matern correlations of order 1/2, 3/2 and 5/2 are 1/e."""

MAX_SMOOTHNESS = 2
"""Largest smoothness of the ground's variation: Matern 5/2."""


@dataclass(frozen=True, eq=False)
class Noise:
    """Sensor noise and variation of the ground.

    Parameters
    ----------
    sd : (m,)
        Standard deviation of the sensors of the answered channels, SI.
    autocorrelation : (m,)
        First-order autocorrelation of their errors [-].
    ground_sd : (2,)
        Standard deviation of ln stiffness and ln strength of the ground [-].
    length
        Distance over which the correlation of these falls to 1/e [m, or s where positions are unknown].
    smoothness
        Number of derivatives that these have: order of the Matern process less 1/2.
    """

    sd: np.ndarray
    autocorrelation: np.ndarray
    ground_sd: np.ndarray
    length: float
    smoothness: int = 0


@dataclass(frozen=True)
class Chain:
    """A Gauss-Markov chain of d states along the rows.

    transition, process_noise (g, d, d): transition matrices from the previous row and process-noise covariances; which
    (n,) of the g each row has; loading (n, m, d) of the m channels; variance (n, m) of the channels' white noise.
    """

    transition: np.ndarray
    process_noise: np.ndarray
    which: np.ndarray
    loading: np.ndarray
    variance: np.ndarray

    def filter(self, seen: np.ndarray, further: np.ndarray | float = 0.0) -> Filter:
        """Return the filter of the channels observed, `seen` (n, m).

        A `further` variance (n, m) of the values, which the chain does not model, raises the limit of gross errors.
        """
        gain, sd, blocks = np.zeros_like(self.loading), np.ones(seen.shape), _blocks(self.transition)
        _fill_gains(
            seen, self.transition, self.process_noise, self.which, self.loading, self.variance, gain, sd, *blocks
        )
        return Filter(
            seen, self.transition, self.which, self.loading, gain, sd, GROSS * np.sqrt(sd**2 + further), *blocks
        )


@dataclass(frozen=True)
class Filter:
    """Kalman filter of a chain; its gains do not depend on the residuals that are filtered.

    seen (n, m); transition, which and loading of the `Chain`; gain (n, m, d) and standard deviation sd (n, m) of each
    innovation, sd 1 where not observed; gross_limit (n, m) beyond which it is a gross error; first, last (d,) as in
    `_blocks`.
    """

    seen: np.ndarray
    transition: np.ndarray
    which: np.ndarray
    loading: np.ndarray
    gain: np.ndarray
    sd: np.ndarray
    gross_limit: np.ndarray
    first: np.ndarray
    last: np.ndarray

    def whiten(self, columns: np.ndarray, order: np.ndarray, weights: np.ndarray | None = None) -> np.ndarray:
        """Whiten columns (n, m, q) in place, row after row of an order (n,).

        Return the robust weights (n, m) of the innovations of the first column in the update of the states, less than 1
        for gross errors. Weights that are given are used instead.
        """
        answer = np.ones(self.seen.shape) if weights is None else weights
        _filter(
            columns, order, self.seen, self.transition, self.which, self.loading, self.gain, self.sd, self.gross_limit,
            self.first, self.last, answer, weights is None,
        )  # fmt: skip
        return answer


@dataclass(frozen=True)
class Whitener:
    """Two filters in sequence.

    in_time, in_place
        Filters of errors correlated in time, and of ground that varies along the track.
    order : (n,)
        Rows in order of place.
    log_sd : (n, m)
        Ln of the standard deviation of each innovation.
    """

    in_time: Filter
    in_place: Filter
    order: np.ndarray
    log_sd: np.ndarray

    def whiten(
        self, columns: np.ndarray, weights: tuple[np.ndarray, np.ndarray] | None = None
    ) -> tuple[np.ndarray, tuple[np.ndarray, np.ndarray]]:
        """Whiten columns (n, m, q), the first of which are residuals unless their `weights` are given.

        Return the white columns and the robust weights of each filter.
        """
        white, (early, late) = columns.copy(), weights or (None, None)
        early = self.in_time.whiten(white, np.arange(len(white)), early)
        return white, (early, self.in_place.whiten(white, self.order, late))


def whitener(
    errors: Filter, ground: np.ndarray, transitions: tuple[np.ndarray, np.ndarray], order: np.ndarray
) -> Whitener:
    """Return the whitener of a noise model.

    Parameters
    ----------
    errors
        Filter of errors correlated in time.
    ground : (n, m, 2)
        Derivatives of the channels by ln stiffness and ln strength of the ground.
    transitions
        Transitions and process noise of these two along the track (`matern`), rows in order of place.
    order : (n,)
        Rows in order of place.
    """
    white, seen, size = ground.copy(), errors.seen, transitions[0].shape[1]
    errors.whiten(white, np.arange(len(white)), np.ones(seen.shape))
    loading = np.zeros((*seen.shape, size))
    loading[..., :: size // 2] = white[order]
    field = Chain(*transitions, np.arange(len(order)), loading, np.ones(seen.shape)).filter(
        np.ascontiguousarray(seen[order])
    )
    log_sd = np.log(errors.sd)
    log_sd[order] += np.log(field.sd)
    return Whitener(errors, field, order, log_sd)


def _blocks(transition: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """First and one past the last state (d,) that each state depends on, in any of the transitions (g, d, d)."""
    linked = (transition != 0.0).any(axis=0) | np.eye(transition.shape[1], dtype=bool)
    return np.argmax(linked, axis=1), transition.shape[1] - np.argmax(linked[:, ::-1], axis=1)


def matern(gap: np.ndarray, noise: Noise) -> tuple[np.ndarray, np.ndarray]:
    """Transitions and process noise (n, 2 k, 2 k) of the ground's two processes over gaps (n,), the first infinite."""
    size = noise.smoothness + 1
    distance = np.minimum(TO_ONE_OVER_E[noise.smoothness] * gap / noise.length, 500.0)
    transition, process_noise = np.zeros((2, len(gap), 2 * size, 2 * size))
    _fill_matern(distance, _STATIONARY[noise.smoothness], noise.ground_sd**2, transition, process_noise)
    return transition, process_noise


_STATIONARY = (
    np.eye(1), np.eye(2), np.array([[1.0, 0.0, -1.0 / 3.0], [0.0, 1.0 / 3.0, 0.0], [-1.0 / 3.0, 0.0, 1.0]])
)  # fmt: skip
"""Stationary covariance of a Matern process of order 1/2, 3/2 and 5/2 and its derivatives, in decay lengths."""


@njit(cache=True, nogil=True, error_model="numpy")
def _fill_matern(distance, stationary, variance, transition, process_noise):
    """Fill transitions and process noise (n, 2 k, 2 k) over distances (n,), in decay lengths."""
    size = len(stationary)
    one, half = np.ones((size, size)), np.empty((size, size))
    for row in range(len(distance)):
        x = distance[row]
        decay, square = math.exp(-x), 0.5 * x * x
        if size == 2:
            one[0, 0], one[0, 1], one[1, 0], one[1, 1] = 1.0 + x, x, -x, 1.0 - x
        elif size == 3:
            one[0, 0], one[0, 1], one[0, 2] = 1.0 + x + square, x + 2.0 * square, square
            one[1, 0], one[1, 1], one[1, 2] = -square, 1.0 + x - 2.0 * square, x - square
            one[2, 0], one[2, 1], one[2, 2] = square - x, 2.0 * square - 3.0 * x, 1.0 - 2.0 * x + square
        for i in range(size):
            for j in range(size):
                half[i, j] = 0.0
                for k in range(size):
                    half[i, j] += one[i, k] * stationary[k, j] * decay
        for i in range(size):
            for j in range(size):
                new = stationary[i, j]
                for k in range(size):
                    new -= half[i, k] * one[j, k] * decay
                for field in range(2):
                    transition[row, field * size + i, field * size + j] = one[i, j] * decay
                    process_noise[row, field * size + i, field * size + j] = variance[field] * new


def robust_loss(innovation: np.ndarray) -> np.ndarray:
    """Half the square up to `GROSS`, beyond it a logarithm that continues with the same slope [nats]."""
    size = np.abs(innovation)
    return 0.5 * np.minimum(size, GROSS) ** 2 + GROSS**2 * np.log(np.maximum(size, GROSS) / GROSS)


def robust_weight(innovation: np.ndarray) -> np.ndarray:
    """Weight of an innovation in the normal equations [-]."""
    return (GROSS / np.maximum(np.abs(innovation), GROSS)) ** 2


@njit(cache=True, nogil=True, error_model="numpy")
def _fill_gains(seen, transition, process_noise, which, loading, variance, gains, sds, first, last):
    """Fill gains (n, m, d) and standard deviations (n, m) of the innovations, channel by channel.

    first, last (d,) as in `_blocks`: states that do not depend on each other are skipped.
    """
    rows, channels, size = loading.shape
    p, half = np.zeros((size, size)), np.empty((size, size))
    for row in range(rows):
        a, q = transition[which[row]], process_noise[which[row]]
        for i in range(size):
            for j in range(size):
                half[i, j] = 0.0
            for k in range(first[i], last[i]):
                share = a[i, k]
                for j in range(size):
                    half[i, j] += share * p[k, j]
        for i in range(size):
            for j in range(i + 1):
                value = q[i, j]
                for k in range(first[j], last[j]):
                    value += half[i, k] * a[j, k]
                p[i, j] = value
                p[j, i] = value
        for channel in range(channels):
            if not seen[row, channel]:
                continue
            h, gain = loading[row, channel], gains[row, channel]
            scale = variance[row, channel]
            for i in range(size):
                value = 0.0
                for k in range(size):
                    value += p[i, k] * h[k]
                gain[i] = value
                scale += h[i] * value
            scale = max(scale, 1e-300)
            for i in range(size):
                share = gain[i] / scale
                for k in range(size):
                    p[i, k] -= share * gain[k]
            for i in range(size):
                gain[i] /= scale
            sds[row, channel] = math.sqrt(scale)


@njit(cache=True, nogil=True, error_model="numpy")
def _filter(columns, order, seen, transition, which, loading, gains, sds, gross_limit, first, last, weights, robust):
    """Whiten columns (n, m, q) in place by gains, rows in the order given (n,); fill weights (n, m) where robust."""
    rows, channels, count = columns.shape
    size = transition.shape[1]
    state, following = np.zeros((size, count)), np.empty((size, count))
    for at in range(rows):
        row, a = order[at], transition[which[at]]
        for i in range(size):
            for column in range(count):
                following[i, column] = 0.0
            for k in range(first[i], last[i]):
                share = a[i, k]
                for column in range(count):
                    following[i, column] += share * state[k, column]
        state, following = following, state
        for channel in range(channels):
            values = columns[row, channel]
            if not seen[at, channel]:
                for column in range(count):
                    values[column] = 0.0
                continue
            h, gain, sd = loading[at, channel], gains[at, channel], sds[at, channel]
            for i in range(size):
                share = h[i]
                if share != 0.0:
                    for column in range(count):
                        values[column] -= share * state[i, column]
            if robust:
                # A gross error must not be mistaken for a change of the states.
                weights[at, channel] = min(1.0, (gross_limit[at, channel] / max(abs(values[0]), 1e-300)) ** 2)
            for i in range(size):
                share = gain[i] * weights[at, channel]
                for column in range(count):
                    state[i, column] += share * values[column]
            for column in range(count):
                values[column] /= sd
