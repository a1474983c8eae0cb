"""Residuals made white: what sensors, uncertain load and slip, and soil that varies from place to place do to them.

Stiffness and strength vary along the track like two Ornstein-Uhlenbeck processes; a Kalman filter turns residuals and
their derivatives into innovations, which are independent with unit variance where the model is right (A. C. Harvey,
"Forecasting, Structural Time Series Models and the Kalman Filter" (1989), Sec. 3.4).
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

HUBER = 4.0
"""Innovations beyond this count linearly, not squared: a gross error does not rule the fit."""

_STRETCHES = 24
"""Stretches of a track that are taken to err independently: many enough to show it, long enough to be so."""


def neighbours(position: np.ndarray, lane: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Order (n,) in which the soil's variation is followed, and the distance from the row before, (n,).

    Parameters
    ----------
    position, lane : (n,)
        Place [m] or time [s], NaN where rows are trials on soil of their own, and the number of the track.
    """
    count = len(position)
    if not np.isfinite(position).all():
        return np.arange(count), np.full(count, np.inf)
    order = np.lexsort((position, lane))
    gap = np.diff(position[order])
    gap[np.diff(lane[order]) != 0] = np.inf
    return order, np.concatenate([[np.inf], gap])


def stretches(order: np.ndarray, gap: np.ndarray) -> np.ndarray:
    """Number of the stretch of ground that each row lies on, (n,); trials on soil of their own stand alone."""
    number = np.arange(len(order))
    if np.isfinite(gap).any():
        number[order] = np.arange(len(order)) * _STRETCHES // len(order)
    return number


@njit(cache=True, nogil=True, error_model="numpy")
def whiten(columns, seen, by_variation, by_latent, latent_covariance, variance, spread, length, gap, log_scale):
    """Whiten columns in place: residuals first, their derivatives after.

    columns (n, m, q); seen (n, m); by_variation (n, m, 2): derivatives of the channels by ln stiffness and ln strength;
    by_latent (n, m, 2): by load and slip; latent_covariance (2, 2); variance (m,) of the sensors; spread (2,) standard
    deviations of the variation; length [m or s] over which it forgets; gap (n,) distance from the row before, infinite
    where there is none. Fills log_scale (n,): sum of the logarithms of the innovations' standard deviations.
    """
    rows, channels, count = columns.shape
    state = np.zeros((2, count))
    p00, p01, p11 = spread[0] ** 2, 0.0, spread[1] ** 2
    covariance = np.empty((channels, channels))
    vary = np.empty((channels, 2))
    for row in range(rows):
        keep = math.exp(-gap[row] / length)
        fresh = 1.0 - keep * keep
        for column in range(count):
            state[0, column] *= keep
            state[1, column] *= keep
        p00 = keep * keep * p00 + fresh * spread[0] ** 2
        p01 = keep * keep * p01
        p11 = keep * keep * p11 + fresh * spread[1] ** 2
        for i in range(channels):
            for j in range(channels):
                value = 0.0
                if seen[row, i] and seen[row, j]:
                    for a in range(2):
                        for b in range(2):
                            value += by_latent[row, i, a] * latent_covariance[a, b] * by_latent[row, j, b]
                    if i == j:
                        value += variance[i]
                elif i == j:
                    value = 1.0
                covariance[i, j] = value
        log_scale[row] = 0.0
        for i in range(channels):
            # Cholesky, forward substitution of the columns as it goes.
            for j in range(i):
                value = covariance[i, j]
                for a in range(j):
                    value -= covariance[i, a] * covariance[j, a]
                covariance[i, j] = value / covariance[j, j]
            value = covariance[i, i]
            for a in range(i):
                value -= covariance[i, a] ** 2
            root = math.sqrt(max(value, 1e-300))
            covariance[i, i] = root
            for a in range(2):
                value = by_variation[row, i, a] if seen[row, i] else 0.0
                for j in range(i):
                    value -= covariance[i, j] * vary[j, a]
                vary[i, a] = value / root
            for column in range(count):
                value = columns[row, i, column] if seen[row, i] else 0.0
                for j in range(i):
                    value -= covariance[i, j] * columns[row, j, column]
                columns[row, i, column] = value / root
            if seen[row, i]:
                log_scale[row] += math.log(root)
        for i in range(channels):
            if not seen[row, i]:
                continue
            h0, h1 = vary[i, 0], vary[i, 1]
            g0, g1 = p00 * h0 + p01 * h1, p01 * h0 + p11 * h1
            scale = h0 * g0 + h1 * g1 + 1.0
            root = math.sqrt(scale)
            away = columns[row, i, 0] - h0 * state[0, 0] - h1 * state[1, 0]
            # A gross error must not be taken for soil.
            trust = min(1.0, HUBER * root / max(abs(away), 1e-300))
            for column in range(count):
                innovation = columns[row, i, column] - h0 * state[0, column] - h1 * state[1, column]
                state[0, column] += g0 / scale * innovation * trust
                state[1, column] += g1 / scale * innovation * trust
                columns[row, i, column] = innovation / root
            p00 -= g0 * g0 / scale
            p01 -= g0 * g1 / scale
            p11 -= g1 * g1 / scale
            log_scale[row] += math.log(root)


def huber_loss(innovation: np.ndarray) -> np.ndarray:
    """Half the square up to `HUBER`, linear beyond [nats]."""
    size = np.abs(innovation)
    return np.where(size <= HUBER, 0.5 * size**2, HUBER * (size - 0.5 * HUBER))


def huber_weight(innovation: np.ndarray) -> np.ndarray:
    """Share with which an innovation counts in the normal equations."""
    return np.minimum(1.0, HUBER / np.maximum(np.abs(innovation), 1e-12))
