"""Residuals made white: what sensors, uncertain load and slip, and soil that varies from place to place do to them.

Stiffness and strength vary along the track like two Ornstein-Uhlenbeck processes or, where that is likelier, like two
Matern processes of order 3/2 or 5/2, which have derivatives (C. E. Rasmussen, C. K. I. Williams, "Gaussian Processes
for Machine Learning" (2006), Eq. 4.17; J. Hartikainen, S. Sarkka, IEEE MLSP (2010)); a Kalman filter turns residuals
and their derivatives into innovations, which are independent with unit variance where the model is right (A. C. Harvey,
"Forecasting, Structural Time Series Models and the Kalman Filter" (1989), Sec. 3.4).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numba import njit

_STEEPEST = 1e12
"""Derivatives beyond this, SI, are those of a wheel about to be swallowed."""

HUBER = 4.0
"""Innovations beyond this count linearly, not squared: a gross error does not rule the fit."""

TO_ONE_OVER_E = (1.0, 2.146193220620582, 2.9046299750299145)
"""Where exp(-x), (1 + x) exp(-x) and (1 + x + x^2 / 3) exp(-x), correlations of variations ever smoother, are 1/e."""

_FORGOTTEN = 60.0
"""Such an x beyond which nothing is left of them [-]."""

SMOOTHEST = 2
"""Derivatives that a variation may have."""

_STRETCHES = 24
"""Stretches of a track that are taken to err independently: many enough to show it, long enough to be so."""


@dataclass(frozen=True)
class NoiseModel:
    """Standard deviations of the answers (m,), of ln stiffness and ln strength (2,), the length over which the
    variation's correlation falls to 1/e, and how many derivatives it has.
    """

    answers: np.ndarray
    spread: np.ndarray
    length: float
    smooth: int = 0


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


def correlation(apart: np.ndarray, noise: NoiseModel) -> np.ndarray:
    """Correlation of the variation at places so far apart [m or s], of any shape."""
    far = TO_ONE_OVER_E[noise.smooth] * np.abs(apart) / noise.length
    return np.exp(-far) * (1.0, 1.0 + far, 1.0 + far + far**2 / 3.0)[noise.smooth]


@njit(cache=True, nogil=True, error_model="numpy")
def stationary(smooth):
    """Covariance (k, k) of one process and its derivatives by far (`carried`), of unit variance."""
    answer = np.eye(smooth + 1)
    if smooth == 2:
        answer[1, 1] = 1.0 / 3.0
        answer[0, 2] = answer[2, 0] = -1.0 / 3.0
    return answer


@njit(cache=True, nogil=True, error_model="numpy")
def carried(far, carry):
    """Fill carry (k, k) with what becomes of a process and its derivatives over so many of its lengths."""
    keep = math.exp(-far)
    if len(carry) == 1 or far > _FORGOTTEN:
        carry[:] = keep
    elif len(carry) == 2:
        carry[0, 0], carry[0, 1] = keep * (1.0 + far), keep * far
        carry[1, 0], carry[1, 1] = -keep * far, keep * (1.0 - far)
    else:
        half = 0.5 * far * far
        carry[0, 0], carry[0, 1], carry[0, 2] = keep * (1.0 + far + half), keep * (far + 2.0 * half), keep * half
        carry[1, 0], carry[1, 1], carry[1, 2] = -keep * half, keep * (1.0 + far - 2.0 * half), keep * (far - half)
        carry[2, 0], carry[2, 1] = keep * (half - far), keep * (2.0 * half - 3.0 * far)
        carry[2, 2] = keep * (1.0 - 2.0 * far + half)


@njit(cache=True, nogil=True, error_model="numpy")
def _multiply(carry, columns):
    """Put carry (k, k) times columns (k, q) in their place."""
    if len(carry) == 1:
        for column in range(columns.shape[1]):
            columns[0, column] *= carry[0, 0]
    elif len(carry) == 2:
        for column in range(columns.shape[1]):
            first, second = columns[0, column], columns[1, column]
            columns[0, column] = carry[0, 0] * first + carry[0, 1] * second
            columns[1, column] = carry[1, 0] * first + carry[1, 1] * second
    else:
        for column in range(columns.shape[1]):
            first, second, third = columns[0, column], columns[1, column], columns[2, column]
            columns[0, column] = carry[0, 0] * first + carry[0, 1] * second + carry[0, 2] * third
            columns[1, column] = carry[1, 0] * first + carry[1, 1] * second + carry[1, 2] * third
            columns[2, column] = carry[2, 0] * first + carry[2, 1] * second + carry[2, 2] * third


@njit(cache=True, nogil=True, error_model="numpy")
def _carry_on(state, p, spread, carry, everywhere):
    """Carry the variations' state (2 k, q) and its covariance p (2 k, 2 k) on, in place.

    What is known of p beyond what it is everywhere is carried; the rest is as everywhere.
    """
    size = len(carry)
    for half in range(2):
        at = half * size
        for i in range(size):
            for j in range(size):
                p[at + i, at + j] -= spread[half] ** 2 * everywhere[i, j]
        _multiply(carry, state[at : at + size])
        _multiply(carry, p[at : at + size])
    for half in range(2):
        at = half * size
        _multiply(carry, p.T[at : at + size])
        for i in range(size):
            for j in range(size):
                p[at + i, at + j] += spread[half] ** 2 * everywhere[i, j]


@njit(cache=True, nogil=True, error_model="numpy")
def _unknown_ground(count, spread, everywhere):
    """State (2 k, q) of nothing known of the variation yet, and its covariance (2 k, 2 k)."""
    size = len(everywhere)
    p = np.zeros((2 * size, 2 * size))
    for half in range(2):
        for i in range(size):
            for j in range(size):
                p[half * size + i, half * size + j] = spread[half] ** 2 * everywhere[i, j]
    return np.zeros((2 * size, count)), p


@njit(cache=True, nogil=True, error_model="numpy")
def _whiten_row(
    columns, at, row, seen, by_variation, by_latent, latent_covariance, variance, state, p, covariance, vary, gain,
    scales,
):  # fmt: skip
    """Whiten the next row, whose columns stand in `columns[at]`, in place, and fill its scales in `scales[at]`.

    The other arguments are those of `whiten`. State (s, q) and p (s, s), its covariance, go along from row to row;
    covariance (m, m), vary (m, 2) and gain (s,) are room to work in.
    """
    _, channels, count = columns.shape
    size = len(p)
    other = size // 2
    for i in range(channels):
        by_load = by_latent[row, i, 0] * latent_covariance[0, 0] + by_latent[row, i, 1] * latent_covariance[1, 0]
        by_slip = by_latent[row, i, 0] * latent_covariance[0, 1] + by_latent[row, i, 1] * latent_covariance[1, 1]
        own = 1.0
        if seen[row, i]:
            own = by_load * by_latent[row, i, 0] + by_slip * by_latent[row, i, 1] + variance[i]
        # Cholesky, one over the roots on its diagonal, and forward substitution of the columns as it goes.
        for j in range(i):
            value = 0.0
            if seen[row, i] and seen[row, j]:
                value = by_load * by_latent[row, j, 0] + by_slip * by_latent[row, j, 1]
            for a in range(j):
                value -= covariance[i, a] * covariance[j, a]
            covariance[i, j] = value * covariance[j, j]
            own -= covariance[i, j] ** 2
        root = math.sqrt(max(own, 1e-300))
        covariance[i, i] = 1.0 / root
        inverse = covariance[i, i] if seen[row, i] else 0.0
        for a in range(2):
            value = by_variation[row, i, a]
            for j in range(i):
                value -= covariance[i, j] * vary[j, a]
            vary[i, a] = value * inverse
        for column in range(count):
            value = columns[at, i, column]
            for j in range(i):
                value -= covariance[i, j] * columns[at, j, column]
            columns[at, i, column] = value * inverse
        scales[at, i] = root if seen[row, i] else 1.0
    for i in range(channels):
        if not seen[row, i]:
            continue
        h0, h1 = vary[i, 0], vary[i, 1]
        for a in range(size):
            gain[a] = p[a, 0] * h0 + p[a, other] * h1
        scale = h0 * gain[0] + h1 * gain[other] + 1.0
        root, per_scale = math.sqrt(scale), 1.0 / scale
        away = columns[at, i, 0] - h0 * state[0, 0] - h1 * state[other, 0]
        # A gross error must not be taken for soil.
        trust = min(1.0, HUBER * root / max(abs(away), 1e-300))
        inverse = 1.0 / root
        for a in range(size):
            for b in range(size):
                p[a, b] -= gain[a] * gain[b] * per_scale
        for a in range(size):
            gain[a] *= trust * per_scale
        for column in range(count):
            innovation = columns[at, i, column] - h0 * state[0, column] - h1 * state[other, column]
            for a in range(size):
                state[a, column] += gain[a] * innovation
            columns[at, i, column] = innovation * inverse
        scales[at, i] *= root


@njit(cache=True, nogil=True, error_model="numpy")
def whiten(columns, seen, by_variation, by_latent, latent_covariance, variance, spread, length, smooth, gap, scales):
    """Whiten columns in place: residuals first, their derivatives after.

    columns (n, m, q); seen (n, m); by_variation (n, m, 2): derivatives of the channels by ln stiffness and ln strength;
    by_latent (n, m, 2): by load and slip; latent_covariance (2, 2); variance (m,) of the sensors; spread (2,) standard
    deviations of the variation; length [m or s] over which its correlation falls to 1/e; smooth: number of derivatives
    that it has; gap (n,) distance from the row before, infinite where there is none. Fills scales (n, m): the
    innovations' standard deviations, one where nothing was seen.
    """
    rows, channels, count = columns.shape
    everywhere, carry = stationary(smooth), np.empty((smooth + 1, smooth + 1))
    state, p = _unknown_ground(count, spread, everywhere)
    covariance, vary, gain = np.empty((channels, channels)), np.empty((channels, 2)), np.empty(len(p))
    for row in range(rows):
        carried(TO_ONE_OVER_E[smooth] * gap[row] / length, carry)
        _carry_on(state, p, spread, carry, everywhere)
        _whiten_row(
            columns, row, row, seen, by_variation, by_latent, latent_covariance, variance, state, p, covariance, vary,
            gain, scales,
        )  # fmt: skip


@njit(cache=True, nogil=True, error_model="numpy")
def weigh_white(
    columns, seen, by_variation, by_latent, latent_covariance, variance, spread, length, smooth, gap, gradient,
    information,
):  # fmt: skip
    """Loss [nats] of columns once they are white, which are as in `whiten` and stay as they are.

    Fills gradient (q - 1,) and information (q - 1, q - 1) of the log-likelihood by what the derivatives belong to.
    """
    rows, channels, count = columns.shape
    everywhere, carry = stationary(smooth), np.empty((smooth + 1, smooth + 1))
    state, p = _unknown_ground(count, spread, everywhere)
    covariance, vary, gain = np.empty((channels, channels)), np.empty((channels, 2)), np.empty(len(p))
    white, scales = np.empty((1, channels, count)), np.empty((1, channels))
    gradient[:], information[:] = 0.0, 0.0
    loss = 0.0
    for row in range(rows):
        white[0] = columns[row]
        carried(TO_ONE_OVER_E[smooth] * gap[row] / length, carry)
        _carry_on(state, p, spread, carry, everywhere)
        _whiten_row(
            white, 0, row, seen, by_variation, by_latent, latent_covariance, variance, state, p, covariance, vary,
            gain, scales,
        )  # fmt: skip
        wide = 1.0
        for i in range(channels):
            if not seen[row, i]:
                continue
            wide *= scales[0, i]
            size = abs(white[0, i, 0])
            weight = min(1.0, HUBER / max(size, 1e-12))
            loss += 0.5 * size**2 if size <= HUBER else HUBER * (size - 0.5 * HUBER)
            for a in range(1, count):
                weighed = weight * white[0, i, a]
                gradient[a - 1] += weighed * white[0, i, 0]
                for b in range(a, count):
                    information[a - 1, b - 1] += weighed * white[0, i, b]
        loss += math.log(wide)
    for a in range(count - 1):
        for b in range(a):
            information[a, b] = information[b, a]
    return loss


@njit(cache=True, nogil=True, error_model="numpy")
def lay_out(residuals, by_parameter, order, answers, seen, carried, columns):
    """Fill columns (n, m, 1 + p): residuals (n, m), and derivatives (n, c, p) of the `answers` (m,) among c channels.

    Their rows follow the `order` (n,). What was not seen (n, m) is zero; so are derivatives in rows that are not
    carried (n,), and such as have no bounds: at the edge of being carried the entry angle's answer has none.
    """
    for at in range(len(order)):
        row = order[at]
        for i in range(len(answers)):
            columns[at, i, 0] = residuals[row, i] if seen[row, i] else 0.0
            for p in range(by_parameter.shape[2]):
                slope = by_parameter[row, answers[i], p]
                felt = seen[row, i] and carried[row] and abs(slope) < _STEEPEST
                columns[at, i, 1 + p] = slope if felt else 0.0


def huber_loss(innovation: np.ndarray) -> np.ndarray:
    """Half the square up to `HUBER`, linear beyond [nats]."""
    size = np.abs(innovation)
    return np.where(size <= HUBER, 0.5 * size**2, HUBER * (size - 0.5 * HUBER))


def huber_weight(innovation: np.ndarray) -> np.ndarray:
    """Share with which an innovation counts in the normal equations."""
    return np.minimum(1.0, HUBER / np.maximum(np.abs(innovation), 1e-12))


@dataclass(frozen=True)
class Ready:
    """Residuals and derivatives (n, m, 1 + p), what was seen, and how they answer the soil's variation and latents."""

    columns: np.ndarray
    seen: np.ndarray
    by_variation: np.ndarray
    by_latent: np.ndarray

    def filter(
        self, noise: NoiseModel, latent_covariance: np.ndarray, gap: np.ndarray, derivatives: bool
    ) -> tuple[np.ndarray, np.ndarray]:
        """Whitened columns, and the logarithm of each innovation's scale (n, m)."""
        columns = (self.columns if derivatives else self.columns[..., :1]).copy()
        scales = np.empty(columns.shape[:2])
        whiten(
            columns, self.seen, self.by_variation, self.by_latent, latent_covariance, noise.answers**2, noise.spread,
            noise.length, noise.smooth, gap, scales,
        )  # fmt: skip
        return columns, np.log(scales)

    def weighed(
        self, noise: NoiseModel, latent_covariance: np.ndarray, gap: np.ndarray
    ) -> tuple[float, np.ndarray, np.ndarray]:
        """Loss [nats] of the whitened residuals, with gradient (p,) and information (p, p) by what derives them."""
        size = self.columns.shape[-1] - 1
        gradient, information = np.empty(size), np.empty((size, size))
        loss = weigh_white(
            self.columns, self.seen, self.by_variation, self.by_latent, latent_covariance, noise.answers**2,
            noise.spread, noise.length, noise.smooth, gap, gradient, information,
        )  # fmt: skip
        return loss, gradient, information
