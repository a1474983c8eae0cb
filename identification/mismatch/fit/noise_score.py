"""What residuals tell of the noise, by filters under slightly different noises that run side by side.

Each is the filter of `soil_variation`. Its rows follow one another, so it waits for every root and quotient; of several
that are independent the processor has many under way at once. What differs by the noise alone lies innermost in memory.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numba import njit

from .soil_variation import HUBER, TO_ONE_OVER_E, NoiseModel, Ready, carried, stationary

NOISES = 7
"""Noises side by side (l below): one, and it with each of its numbers moved, of which three answers make six."""


@njit(cache=True, nogil=True, error_model="numpy")
def _multiply(carry, columns):
    """Put carry (k, k, l) times columns (k, l) in their place."""
    if len(carry) == 1:
        for noise in range(NOISES):
            columns[0, noise] *= carry[0, 0, noise]
    elif len(carry) == 2:
        for noise in range(NOISES):
            first, second = columns[0, noise], columns[1, noise]
            columns[0, noise] = carry[0, 0, noise] * first + carry[0, 1, noise] * second
            columns[1, noise] = carry[1, 0, noise] * first + carry[1, 1, noise] * second
    else:
        for noise in range(NOISES):
            first, second, third = columns[0, noise], columns[1, noise], columns[2, noise]
            columns[0, noise] = carry[0, 0, noise] * first + carry[0, 1, noise] * second + carry[0, 2, noise] * third
            columns[1, noise] = carry[1, 0, noise] * first + carry[1, 1, noise] * second + carry[1, 2, noise] * third
            columns[2, noise] = carry[2, 0, noise] * first + carry[2, 1, noise] * second + carry[2, 2, noise] * third


@njit(cache=True, nogil=True, error_model="numpy")
def _carry_on(state, p, spread, carry, everywhere):
    """Carry the variations' state (2 k, 2, l) and its covariance p (2 k, 2 k, l) on, in place.

    spread (2, l); carry (k, k, l); everywhere (k, k) as of `stationary`.
    """
    size = len(carry)
    for half in range(2):
        at = half * size
        for i in range(size):
            for j in range(size):
                for noise in range(NOISES):
                    p[at + i, at + j, noise] -= spread[half, noise] ** 2 * everywhere[i, j]
    for half in range(2):
        at = half * size
        for column in range(2):
            _multiply(carry, state[at : at + size, column])
        for column in range(2 * size):
            _multiply(carry, p[at : at + size, column])
    for half in range(2):
        at = half * size
        for row in range(2 * size):
            _multiply(carry, p[row, at : at + size])
        for i in range(size):
            for j in range(size):
                for noise in range(NOISES):
                    p[at + i, at + j, noise] += spread[half, noise] ** 2 * everywhere[i, j]


@njit(cache=True, nogil=True, error_model="numpy")
def _whiten_sensors(white, vary, scales, covariance, seen, by_latent, latent_covariance, variance):
    """Whiten a row's columns (m, 2, l) and its answers to the variation (m, 2, l) by sensors, load and slip, in place.

    Fills scales (m, l). seen (m,); by_latent (m, 2); variance (m, l); covariance (m, m, l) is room.
    """
    channels = len(white)
    for i in range(channels):
        by_load = by_latent[i, 0] * latent_covariance[0, 0] + by_latent[i, 1] * latent_covariance[1, 0]
        by_slip = by_latent[i, 0] * latent_covariance[0, 1] + by_latent[i, 1] * latent_covariance[1, 1]
        common = by_load * by_latent[i, 0] + by_slip * by_latent[i, 1]
        for noise in range(NOISES):
            covariance[i, i, noise] = common + variance[i, noise] if seen[i] else 1.0
        for j in range(i):
            common = 0.0
            if seen[i] and seen[j]:
                common = by_load * by_latent[j, 0] + by_slip * by_latent[j, 1]
            covariance[i, j] = common
            for a in range(j):
                for noise in range(NOISES):
                    covariance[i, j, noise] -= covariance[i, a, noise] * covariance[j, a, noise]
            for noise in range(NOISES):
                covariance[i, j, noise] *= covariance[j, j, noise]
                covariance[i, i, noise] -= covariance[i, j, noise] ** 2
        for noise in range(NOISES):
            root = math.sqrt(max(covariance[i, i, noise], 1e-300))
            # One over the roots stands on the diagonal.
            covariance[i, i, noise] = 1.0 / root
            scales[i, noise] = root if seen[i] else 1.0
        for column in range(2):
            for j in range(i):
                for noise in range(NOISES):
                    white[i, column, noise] -= covariance[i, j, noise] * white[j, column, noise]
                    vary[i, column, noise] -= covariance[i, j, noise] * vary[j, column, noise]
            for noise in range(NOISES):
                inverse = covariance[i, i, noise] if seen[i] else 0.0
                white[i, column, noise] *= inverse
                vary[i, column, noise] *= inverse


@njit(cache=True, nogil=True, error_model="numpy")
def _whiten_variation(white, vary, scales, seen, state, p, gain, room):
    """Whiten the same columns by what rows before tell of the variation, in place; so are scales, state and p.

    gain (2 k, l) and room (3, l) are room to work in.
    """
    channels = len(white)
    size = len(p)
    other = size // 2
    for i in range(channels):
        if not seen[i]:
            continue
        by, along = vary[i, 0], vary[i, 1]
        for a in range(size):
            for noise in range(NOISES):
                gain[a, noise] = p[a, 0, noise] * by[noise] + p[a, other, noise] * along[noise]
        for noise in range(NOISES):
            scale = by[noise] * gain[0, noise] + along[noise] * gain[other, noise] + 1.0
            root = math.sqrt(scale)
            away = white[i, 0, noise] - by[noise] * state[0, 0, noise] - along[noise] * state[other, 0, noise]
            room[0, noise] = 1.0 / scale
            # A gross error must not be taken for soil.
            room[1, noise] = min(1.0, HUBER * root / max(abs(away), 1e-300))
            room[2, noise] = 1.0 / root
            scales[i, noise] *= root
        for a in range(size):
            for b in range(size):
                for noise in range(NOISES):
                    p[a, b, noise] -= gain[a, noise] * gain[b, noise] * room[0, noise]
        for a in range(size):
            for noise in range(NOISES):
                gain[a, noise] *= room[1, noise] * room[0, noise]
        for column in range(2):
            for noise in range(NOISES):
                mine = by[noise] * state[0, column, noise] + along[noise] * state[other, column, noise]
                white[i, column, noise] -= mine
            for a in range(size):
                for noise in range(NOISES):
                    state[a, column, noise] += gain[a, noise] * white[i, column, noise]
            for noise in range(NOISES):
                white[i, column, noise] *= room[2, noise]


@njit(cache=True, nogil=True, error_model="numpy")
def _count(white, scales, seen, per_step, losses, moved, widened, score, information):
    """Add what a row's white columns (m, 2, l) and scales (m, l) tell to score (l,) and information (l, l).

    per_step (l,): one over what each noise differs by; losses, moved and widened (l,) are room to work in.
    """
    for i in range(len(white)):
        if not seen[i]:
            continue
        left, scale = white[i, 0, 0] - white[i, 1, 0], scales[i, 0]
        weight = min(1.0, HUBER / max(abs(left), 1e-12))
        for noise in range(NOISES):
            residual, taken = white[i, 0, noise], white[i, 1, noise]
            share = min(1.0, HUBER / max(abs(residual), 1e-12))
            near = share * residual
            losses[noise] = near * (residual - 0.5 * near) - share * taken * (residual - 0.5 * taken)
            moved[noise] = (residual - taken - left) * per_step[noise]
            widened[noise] = (scales[i, noise] / scale - 1.0) * per_step[noise]
        lost = losses[0]
        for noise in range(NOISES):
            score[noise] += (lost - losses[noise]) * per_step[noise] - widened[noise]
        for a in range(NOISES):
            by_moved, by_widened = weight * moved[a], widened[a]
            for noise in range(NOISES):
                information[a, noise] += by_moved * moved[noise] + by_widened * widened[noise]


@njit(cache=True, nogil=True, error_model="numpy")
def _tell(
    columns, seen, by_variation, by_latent, latent_covariance, gap, variance, spread, length, smooth, per_step, score,
    information,
):  # fmt: skip
    """Fill score (l,) and information (l, l) by noises of which all but the first differ from it by one over per_step.

    columns (n, m, 2); variance (m, l), spread (2, l) and length (l,) of the noises; the rest as in
    `soil_variation.whiten`.
    """
    channels, size = columns.shape[1], smooth + 1
    everywhere, one, carry = stationary(smooth), np.empty((size, size)), np.empty((size, size, NOISES))
    state, p = np.zeros((2 * size, 2, NOISES)), np.zeros((2 * size, 2 * size, NOISES))
    for half in range(2):
        for i in range(size):
            for j in range(size):
                p[half * size + i, half * size + j] = spread[half] ** 2 * everywhere[i, j]
    white, vary, scales = np.empty((channels, 2, NOISES)), np.empty((channels, 2, NOISES)), np.empty((channels, NOISES))
    covariance, gain, room = np.empty((channels, channels, NOISES)), np.empty((2 * size, NOISES)), np.empty((3, NOISES))
    score[:], information[:] = 0.0, 0.0
    for row in range(len(columns)):
        for noise in range(NOISES):
            if noise == 0 or length[noise] != length[noise - 1]:
                carried(TO_ONE_OVER_E[smooth] * gap[row] / length[noise], one)
            carry[:, :, noise] = one
        _carry_on(state, p, spread, carry, everywhere)
        for i in range(channels):
            for a in range(2):
                white[i, a] = columns[row, i, a]
                vary[i, a] = by_variation[row, i, a]
        _whiten_sensors(white, vary, scales, covariance, seen[row], by_latent[row], latent_covariance, variance)
        _whiten_variation(white, vary, scales, seen[row], state, p, gain, room)
        _count(white, scales, seen[row], per_step, room[0], room[1], room[2], score, information)


def told_of(
    columns: Ready, noises: Sequence[NoiseModel], steps: np.ndarray, latent_covariance: np.ndarray, gap: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Score (k,) of a noise, parameters staying where they are, and information (k, k) about it.

    Parameters
    ----------
    columns
        Residuals (n, m, 1) or, where there are parameters, what these take from them, too (n, m, 2)
        (`likeliest_noise.Weighed`).
    noises
        The noise, and k others, `NOISES` at most together, of which each differs from it in one number; ground varies
        as smoothly in all.
    steps : (k,)
        By how much.
    latent_covariance, gap
        As in `Ready.filter`.
    """
    count = len(steps)
    two = np.zeros((*columns.seen.shape, 2))
    two[..., : columns.columns.shape[-1]] = columns.columns
    # Those that are left over are as the first one, and tell nothing.
    noises = [*noises, *[noises[0]] * (NOISES - len(noises))]
    variance = np.column_stack([noise.answers**2 for noise in noises])
    spread, length = np.column_stack([noise.spread for noise in noises]), np.array([noise.length for noise in noises])
    per_step = np.zeros(NOISES)
    per_step[1 : 1 + count] = 1.0 / steps
    score, information = np.empty(NOISES), np.empty((NOISES, NOISES))
    _tell(
        two, columns.seen, columns.by_variation, columns.by_latent, latent_covariance, gap, variance, spread, length,
        noises[0].smooth, per_step, score, information,
    )  # fmt: skip
    return score[1 : 1 + count], information[1 : 1 + count, 1 : 1 + count]
