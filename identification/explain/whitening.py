"""Correlated errors made white: a Kalman filter that turns residuals and their derivatives into innovations.

Two stages follow each other. In order of time: errors of load and slip (`latent`), which spread into all channels of a
row, and autocorrelated sensor noise. In order of place: stiffness and strength of the ground, which vary along the
track as two Matern processes (C. E. Rasmussen, C. K. I. Williams, "Gaussian Processes for Machine Learning" (2006), Eq.
4.17; J. Hartikainen, S. Sarkka, IEEE MLSP (2010)). Innovations are independent with unit variance where the model is
right (A. C. Harvey, "Forecasting, Structural Time Series Models and the Kalman Filter" (1989), Sec. 3.4). The first
stage takes the ground to be the same over the few rows whose errors are correlated.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numba import njit

HUBER = 4.0
"""Innovations beyond this count linearly, not squared, so that a gross error does not rule the fit [-]."""

TO_ONE_OVER_E = (1.0, 2.146193220620582, 2.9046299750299145)
"""Arguments at which the Matern correlations of order 1/2, 3/2 and 5/2 are 1/e."""

SMOOTHEST = 2
"""Derivatives that the ground's variation may have: Matern 5/2."""


@dataclass(frozen=True)
class Noise:
    """What is random in a recording.

    Parameters
    ----------
    sd : (m,)
        Standard deviation of the sensors of the answered channels, SI.
    memory : (m,)
        Autocorrelation of their errors from one row to the next [-].
    spread : (2,)
        Standard deviation of ln stiffness and ln strength of the ground [-].
    length
        Distance over which their correlation falls to 1/e [m, or s where places are unknown].
    smooth
        Number of derivatives that they have.
    """

    sd: np.ndarray
    memory: np.ndarray
    spread: np.ndarray
    length: float
    smooth: int = 0


@dataclass(frozen=True)
class Chain:
    """A Gauss-Markov chain of d states along the rows.

    keep, fresh (n, d, d): transition from the row before and covariance of what is new; loading (n, m, d) of the m
    channels; variance (n, m) of the channels' white noise.
    """

    keep: np.ndarray
    fresh: np.ndarray
    loading: np.ndarray
    variance: np.ndarray

    def whiten(self, columns: np.ndarray, seen: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Whiten columns (n, m, q), residuals first; give them and the innovations' standard deviations (n, m)."""
        columns, scales = columns.copy(), np.ones(seen.shape)
        _whiten(columns, seen, self.keep, self.fresh, self.loading, self.variance, scales, *_blocks(self.keep))
        return columns, scales


def _blocks(keep: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """First and one past the last state (d,) that each state follows from, in any row of transitions (n, d, d)."""
    linked = (keep != 0.0).any(axis=0) | np.eye(keep.shape[1], dtype=bool)
    return np.argmax(linked, axis=1), keep.shape[1] - np.argmax(linked[:, ::-1], axis=1)


def matern(gap: np.ndarray, noise: Noise) -> tuple[np.ndarray, np.ndarray]:
    """Transitions and new covariances (n, 2 k, 2 k) of the ground's two processes over gaps (n,), infinite at first."""
    size = noise.smooth + 1
    far = np.minimum(TO_ONE_OVER_E[noise.smooth] * gap / noise.length, 500.0)
    decay, half = np.exp(-far), 0.5 * far**2
    one = np.zeros((len(gap), size, size))
    everywhere = np.eye(size)
    # In units of the length over which the process decays.
    if size == 1:
        one[:, 0, 0] = 1.0
    elif size == 2:
        one[:, 0, 0], one[:, 0, 1], one[:, 1, 0], one[:, 1, 1] = 1.0 + far, far, -far, 1.0 - far
    else:
        everywhere = np.array([[1.0, 0.0, -1.0 / 3.0], [0.0, 1.0 / 3.0, 0.0], [-1.0 / 3.0, 0.0, 1.0]])
        one[:, 0] = np.stack([1.0 + far + half, far + 2.0 * half, half], axis=-1)
        one[:, 1] = np.stack([-half, 1.0 + far - 2.0 * half, far - half], axis=-1)
        one[:, 2] = np.stack([half - far, 2.0 * half - 3.0 * far, 1.0 - 2.0 * far + half], axis=-1)
    one *= decay[:, None, None]
    new = everywhere - one @ everywhere @ one.transpose(0, 2, 1)
    keep, fresh = np.zeros((len(gap), 2 * size, 2 * size)), np.zeros((len(gap), 2 * size, 2 * size))
    for field in range(2):
        own = slice(field * size, (field + 1) * size)
        keep[:, own, own], fresh[:, own, own] = one, noise.spread[field] ** 2 * new
    return keep, fresh


def huber_loss(innovation: np.ndarray) -> np.ndarray:
    """Half the square up to `HUBER`, linear beyond [nats]."""
    size = np.abs(innovation)
    near = np.minimum(size, HUBER)
    return near * (size - 0.5 * near)


def huber_weight(innovation: np.ndarray) -> np.ndarray:
    """Share with which an innovation counts in the normal equations."""
    return np.minimum(1.0, HUBER / np.maximum(np.abs(innovation), 1e-12))


@njit(cache=True, nogil=True, error_model="numpy")
def _whiten(columns, seen, keep, fresh, loading, variance, scales, first, last):
    """Whiten columns (n, m, q) in place, channel by channel, and fill scales (n, m) where something was seen.

    first, last (d,) as of `_blocks`: states that do not follow from each other are passed over.
    """
    rows, channels, count = columns.shape
    size = keep.shape[1]
    state, p = np.zeros((size, count)), np.zeros((size, size))
    next_state, half = np.empty((size, count)), np.empty((size, size))
    gain = np.empty(size)
    for row in range(rows):
        a, q = keep[row], fresh[row]
        for i in range(size):
            for column in range(count):
                next_state[i, column] = 0.0
            for j in range(size):
                half[i, j] = 0.0
            for k in range(first[i], last[i]):
                share = a[i, k]
                for column in range(count):
                    next_state[i, column] += share * state[k, column]
                for j in range(size):
                    half[i, j] += share * p[k, j]
        for i in range(size):
            for column in range(count):
                state[i, column] = next_state[i, column]
            for j in range(size):
                value = q[i, j]
                for k in range(first[j], last[j]):
                    value += half[i, k] * a[j, k]
                p[i, j] = value
        for channel in range(channels):
            if not seen[row, channel]:
                for column in range(count):
                    columns[row, channel, column] = 0.0
                continue
            h = loading[row, channel]
            scale = variance[row, channel]
            for i in range(size):
                value = 0.0
                for k in range(size):
                    value += p[i, k] * h[k]
                gain[i] = value
                scale += h[i] * value
            scale = max(scale, 1e-300)
            away = columns[row, channel, 0]
            for i in range(size):
                away -= h[i] * state[i, 0]
            root = math.sqrt(scale)
            # A gross error must not be taken for a change of the states.
            trust = min(1.0, HUBER * root / max(abs(away), 1e-300))
            for column in range(count):
                innovation = columns[row, channel, column]
                for i in range(size):
                    innovation -= h[i] * state[i, column]
                columns[row, channel, column] = innovation / root
                innovation *= trust / scale
                for i in range(size):
                    state[i, column] += gain[i] * innovation
            for i in range(size):
                for k in range(size):
                    p[i, k] -= gain[i] * gain[k] / scale
            scales[row, channel] = root
