"""True load and slip of each row: a latent path, of which every row's measurement is noisy.

A channel is taken for a local linear trend with jumps, plus white noise: level and slope are random walks (A. C. Harvey,
"Forecasting, Structural Time Series Models and the Kalman Filter" (1989), Sec. 2.3.2), whose variances are the likeliest
ones. A jump is where the prediction fails by much more than these explain (A. C. Harvey, S. J. Koopman, J. Bus. Econ.
Stat. 10 (1992), 377-389); the path begins anew there. Given all measurements the error of the path's mean is a Markov
chain, whose transitions the smoother gives (H. E. Rauch et al., AIAA J. 3 (1965), 1445-1450): the likelihood of the other
channels carries it along. The error is independent of the mean (a Berkson error; R. J. Carroll et al., "Measurement Error
in Nonlinear Models" (2006), Sec. 1.4), so that regressing on the mean attenuates nothing.

How much of the white part is the sensor's and how much a true change from row to row cannot be seen in one channel: it
is the `noise_share`, which the vehicle's stated noise or the likelihood of the other channels decides.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numba import njit
from scipy.ndimage import maximum_filter1d
from scipy.optimize import minimize

from .whitening import huber_loss

_JUMP, _APART, _SEARCHES = 5.0, 5, 8
"""A step is a jump where the path leaves its prediction by so many standard deviations, more than in so many rows before
and after; jumps are looked for so many times at most."""

_LEAST_NOISE = 1e-6
"""Least white noise, as a share of the channel's size: what a converter's last digit makes [-]."""

_UNKNOWN = 1e6
"""Variance of level and slope before the first reading, in units of the largest variance [-]."""


@dataclass(frozen=True)
class Latent:
    """What is known of a channel's true values.

    Parameters
    ----------
    mean : (n,)
        Expected true value of each row [the channel's unit].
    keep, fresh : (n, 2, 2)
        Transition of the error of level and slope from the row before, and the covariance of what is new in it; the
        level's error is the mean's.
    white : (n,)
        Variance of the part of the error that is independent from row to row.
    """

    mean: np.ndarray
    keep: np.ndarray
    fresh: np.ndarray
    white: np.ndarray


@dataclass(frozen=True)
class Path:
    """The smooth path of a channel and the white part about it, before the noise share is known.

    measured, mean (n,), keep, fresh (n, 2, 2) as in `Latent`, of the path alone; covariance (n, 2, 2) of level and slope,
    and white_sd (n,) standard deviation of the white part about the path.
    """

    measured: np.ndarray
    mean: np.ndarray
    keep: np.ndarray
    fresh: np.ndarray
    covariance: np.ndarray
    white_sd: np.ndarray

    def select(self, rows: np.ndarray, follows: np.ndarray) -> Path:
        """Give some rows (k,); the chain goes on where a row `follows` (k,) the one before."""
        chosen = {name: getattr(self, name)[rows] for name in ("measured", "mean", "covariance", "white_sd")}
        goes_on = follows[:, None, None]
        keep = np.where(goes_on, self.keep[rows], 0.0)
        return Path(keep=keep, fresh=np.where(goes_on, self.fresh[rows], self.covariance[rows]), **chosen)

    def latent(self, noise_share: float) -> Latent:
        """Give the true values if the sensor makes this share of the white part's variance, in (0, 1]."""
        seen = np.isfinite(self.measured)
        own = np.where(seen, noise_share, 1.0)
        mean = own * self.mean + (1.0 - own) * np.where(seen, self.measured, 0.0)
        # A row's own reading pulls it by the same share, which its error follows.
        before = np.concatenate([own[:1], own[:-1]])
        keep, fresh = self.keep * (own / before)[:, None, None], self.fresh * (own**2)[:, None, None]
        return Latent(mean, keep, fresh, own * (1.0 - own) * self.white_sd**2)


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
        nothing = np.zeros((len(measured), 2, 2))
        return Path(measured, measured, nothing, nothing, nothing, np.zeros(len(measured)))
    values, steps = np.where(seen, measured, 0.0), _steps(time_s, jumps)
    least = _LEAST_NOISE * max(float(np.abs(measured[seen]).max()), 1e-300)
    relative = np.maximum(relative, 1e-6)
    first = math.log(max(first_sd, least))
    # White noise about a smooth path, about a rough one, and hardly any noise.
    starts = [first + np.array(start) for start in ((0.0, -3.5, 0.0), (0.0, -0.7, -4.0), (-2.0, 0.0, -3.0))]
    for _ in range(_SEARCHES):
        given = (values, seen, jumps, steps, relative, least)
        found = [
            minimize(_loss, start, given, method="Nelder-Mead", options={"xatol": 0.05, "fatol": 0.1})
            for start in starts
        ]
        point = min(found, key=lambda each: each.fun).x
        starts = [point]
        noise, level, slope = _variances(point, relative, least)
        away = np.abs(_innovations(values, seen, jumps, steps, noise, level, slope)[0])
        new = (away > _JUMP) & (away >= maximum_filter1d(away, 2 * _APART + 1)) & ~jumps
        if not new.any():
            break
        jumps = jumps | new
    noise, level, slope = _variances(point, relative, least)
    mean, covariance, keep, fresh = _smooth(values, seen, jumps, steps, noise, level, slope)
    return Path(measured, mean, keep, fresh, covariance, np.sqrt(noise))


def independent(measured: np.ndarray, sd: np.ndarray) -> Path:
    """Give the path of steady trials, each on its own: shrunk towards their mean by how much of the scatter is noise."""
    seen = np.isfinite(measured)
    centre, total = float(np.mean(measured[seen])), float(np.var(measured[seen]))
    noise = sd**2
    truth = max(total - float(np.mean(noise[seen])), 0.02 * total + 1e-30)
    share = np.where(seen, truth / (truth + noise), 0.0)
    mean = centre + share * (np.where(seen, measured, centre) - centre)
    covariance = np.zeros((len(measured), 2, 2))
    covariance[:, 0, 0] = np.where(seen, share * noise, truth)
    return Path(measured, mean, np.zeros_like(covariance), covariance, covariance, sd)


def exact(values: np.ndarray) -> Path:
    """Give the path of a channel that is known without error."""
    nothing = np.zeros((len(values), 2, 2))
    return Path(values, values, nothing, nothing, nothing, np.zeros(len(values)))


def _steps(time_s: np.ndarray, jumps: np.ndarray) -> np.ndarray:
    """Time from the row before (n,), in usual steps of the clock; 1 where a stretch begins or the clock stands."""
    step = np.diff(time_s, prepend=time_s[:1])
    going = ~jumps & (step > 0.0)
    usual = float(np.median(step[going])) if going.any() else 1.0
    return np.where(going, step / usual, 1.0)


def _variances(point: np.ndarray, relative: np.ndarray, least: float) -> tuple[np.ndarray, float, float]:
    """Variances of the white part (n,), and of what level and slope walk in a step."""
    sd, level, slope = np.exp(point)
    return (relative * max(float(sd), least)) ** 2, float(level) ** 2, float(slope) ** 2


def _loss(
    point: np.ndarray, values: np.ndarray, seen: np.ndarray, jumps: np.ndarray, steps: np.ndarray,
    relative: np.ndarray, least: float,
) -> float:  # fmt: skip
    """Minus the log-likelihood [nats] of ln standard deviations (3,) of the white part, the level's and slope's walk.

    By Huber's loss: a step that is not known for a jump yet must not pass for noise.
    """
    away, log_scale = _innovations(values, seen, jumps, steps, *_variances(point, relative, least))
    # Far down, where a variance makes no difference any more, the search is led back.
    return float(huber_loss(away).sum() + log_scale.sum()) + 1e-3 * float(np.sum((point - np.log(least)) ** 2))


@njit(cache=True, nogil=True, error_model="numpy")
def _innovations(values, seen, jumps, steps, noise, level, slope):
    """Innovations (n,) of a local linear trend and ln of their standard deviations (n,); zero until it is known."""
    rows = len(values)
    away, log_scale = np.zeros(rows), np.zeros(rows)
    at, rate, p00, p01, p11 = 0.0, 0.0, 0.0, 0.0, 0.0
    wide = _UNKNOWN * (noise.max() + level + slope)
    known = 0
    for row in range(rows):
        if jumps[row]:
            at, rate, p00, p01, p11, known = 0.0, 0.0, wide, 0.0, wide, 0
        else:
            dt = steps[row]
            at += dt * rate
            p00 += dt * (2.0 * p01 + dt * p11) + dt * level + dt**3 / 3.0 * slope
            p01 += dt * p11 + 0.5 * dt**2 * slope
            p11 += dt * slope
        if not seen[row]:
            continue
        scale = p00 + noise[row]
        off = values[row] - at
        if known >= 2:
            away[row], log_scale[row] = off / math.sqrt(scale), 0.5 * math.log(scale)
        elif known == 0:
            off = values[row]
            at = 0.0
        known += 1
        gain, turn = p00 / scale, p01 / scale
        at += gain * off
        rate += turn * off
        p11 -= turn * p01
        p01 *= 1.0 - gain
        p00 *= 1.0 - gain
    return away, log_scale


@njit(cache=True, nogil=True, error_model="numpy")
def _smooth(values, seen, jumps, steps, noise, level, slope):
    """Smooth a local linear trend: mean (n,) and covariance (n, 2, 2) of level and slope, keep and fresh (n, 2, 2)."""
    rows = len(values)
    state, ahead_state = np.zeros((rows, 2)), np.zeros((rows, 2))
    p, ahead = np.zeros((rows, 2, 2)), np.zeros((rows, 2, 2))
    keep, fresh = np.zeros((rows, 2, 2)), np.zeros((rows, 2, 2))
    wide = _UNKNOWN * (noise.max() + level + slope)
    carry = np.eye(2)
    for row in range(rows):
        if jumps[row]:
            # Where nothing is known yet the level starts at the next reading.
            nearest = row
            while nearest < rows - 1 and not seen[nearest]:
                nearest += 1
            ahead_state[row, 0] = values[nearest]
            ahead[row] = wide * np.eye(2)
        else:
            dt = steps[row]
            carry[0, 1] = dt
            ahead_state[row] = carry @ state[row - 1]
            ahead[row] = carry @ p[row - 1] @ carry.T
            ahead[row, 0, 0] += dt * level + dt**3 / 3.0 * slope
            ahead[row, 0, 1] += 0.5 * dt**2 * slope
            ahead[row, 1, 0] = ahead[row, 0, 1]
            ahead[row, 1, 1] += dt * slope
        state[row], p[row] = ahead_state[row], ahead[row]
        if seen[row]:
            gain = ahead[row, :, 0].copy() / (ahead[row, 0, 0] + noise[row])
            state[row] += gain * (values[row] - ahead_state[row, 0])
            p[row] -= np.outer(gain, ahead[row, 0])
    fresh[rows - 1] = p[rows - 1]
    for row in range(rows - 2, -1, -1):
        if jumps[row + 1]:
            fresh[row + 1] = p[row + 1]
            continue
        carry[0, 1] = steps[row + 1]
        there = ahead[row + 1]
        determinant = max(there[0, 0] * there[1, 1] - there[0, 1] * there[1, 0], 1e-300)
        inverse = np.array([[there[1, 1], -there[0, 1]], [-there[1, 0], there[0, 0]]]) / determinant
        back = p[row] @ carry.T @ inverse
        state[row] += back @ (state[row + 1] - ahead_state[row + 1])
        common = p[row + 1] @ back.T
        own = p[row] + back @ (p[row + 1] - there) @ back.T
        own[0, 1] = own[1, 0] = 0.5 * (own[0, 1] + own[1, 0])
        determinant = own[0, 0] * own[1, 1] - own[0, 1] ** 2
        if determinant > 1e-12 * own[0, 0] * own[1, 1]:
            inverse = np.array([[own[1, 1], -own[0, 1]], [-own[1, 0], own[0, 0]]]) / determinant
        else:
            inverse = np.array([[1.0 / max(own[0, 0], 1e-300), 0.0], [0.0, 0.0]])
        keep[row + 1] = common @ inverse
        fresh[row + 1] = p[row + 1] - keep[row + 1] @ common.T
        p[row] = own
    fresh[0] = p[0]
    return state[:, 0].copy(), p, keep, fresh
