"""Load and slip as they probably were in a drive: averaged over neighbours, or what rows really differ by."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from ....framework.core.recording.types import WheelTable
from ...effects.effect import LOAD, SLIP, Drive
from ...noise import noise_from_neighbours

_REACH = 4
"""Neighbours on each side over which load and slip are averaged."""

_LEAST_AVERAGED = 3
"""Neighbours in time, itself one, of whose values a sample's is averaged at least, but for jumps and ends."""

_JUMP = 4.0
"""A sample so far from its own average is that of a jump, not of noise [noise]."""


def smoothed(drive: Drive, table: WheelTable, noise: np.ndarray) -> Drive:
    """Average load, slip and speeds over neighbours in time."""
    noises = {"load_N": noise[LOAD], "slip": noise[SLIP]}
    for name in ("rim_speed_m_s", "travel_speed_m_s"):
        if drive.has(name):
            noises[name] = noise_from_neighbours(table, getattr(drive, name))
    return replace(
        drive, **{name: _averaged(getattr(drive, name), float(sd), drive.stretch) for name, sd in noises.items()}
    )


def _averaged(values: np.ndarray, noise: float, stretch: np.ndarray) -> np.ndarray:
    """Average each sample (n,) with its neighbours, and with further pairs whose surroundings are alike within noise.

    Pairs keep ramps unbiased, the limit keeps steps sharp (after J.-S. Lee, Comput. Vision Graph. Image Process. 24
    (1983), sigma filter). A sample counts in its own average as it does in its neighbours', or a signal that is delayed
    by a sample would be less noisy. Where it jumps further than noise goes, the sample is taken as it stands: the model
    is no straight line over a jump. What varies by less than its noise is one value: its ups and downs would be errors,
    and those of slip and speeds are the same.
    """
    answer = values.copy()
    for rows in np.split(np.arange(len(values)), np.flatnonzero(np.diff(stretch)) + 1):
        seen = np.flatnonzero(np.isfinite(values[rows]))
        if len(seen) < 3:
            continue
        whole = np.interp(np.arange(len(rows)), seen, values[rows[seen]])
        ends = np.pad(whole, _REACH, mode="reflect" if len(rows) > _REACH else "edge")
        around = np.convolve(ends, np.full(3, 1.0 / 3.0), mode="same")
        middle = slice(_REACH, _REACH + len(rows))
        total, weight = ends[middle].copy(), np.ones(len(rows))
        for away in range(1, _REACH + 1):
            before, after = slice(_REACH - away, -_REACH - away), slice(_REACH + away, len(ends) - _REACH + away)
            apart = np.maximum(np.abs(around[before] - around[middle]), np.abs(around[after] - around[middle]))
            pair = ends[before] + ends[after]
            alike = (apart < 3.0 * noise) | (away == 1)
            total += np.where(alike, pair, 0.0)
            weight += 2.0 * alike
        average = total / weight
        jumps = np.abs(whole - average) > _JUMP * noise
        answer[rows] = np.where(np.isfinite(values[rows]), np.where(jumps, whole, average), math.nan)
    if np.nanstd(answer) < noise:
        answer[np.isfinite(answer)] = np.nanmean(answer)
    return answer


def restless(
    drive: Drive, measured: np.ndarray, noise: np.ndarray, shares: tuple[float, float]
) -> tuple[Drive, np.ndarray, np.ndarray]:
    """Give load and slip that really change from row to row as they probably were, and with what error that is known.

    Of how far a row is from its neighbours' average the rest of the variance, beside the noise's, is a real change: so
    much of it is expected of each row, or what answers would seem to follow too weakly. The average errs, too.
    """
    measured, noise = measured.copy(), noise.copy()
    for channel, name, share in ((LOAD, "load_N", shares[0]), (SLIP, "slip", shares[1])):
        if share < 1.0:
            average, real = getattr(drive, name), 1.0 - share**2
            measured[:, channel] = average + real * (measured[:, channel] - average)
            noise[channel] *= math.sqrt(share**2 * real + (1.0 - real) ** 2 / _LEAST_AVERAGED)
            drive = replace(drive, **{name: measured[:, channel]})
    return drive, measured, noise


def quietness(lag: float) -> float:
    """Variance of errors of load and slip behind a delay of so many samples, over that without one [-].

    Residuals are taken at the load and slip measured: e - a(t) + a(t + lag) is left of an error e and its average a.
    Just outside of its window the average has lost the error, and shares others with the one that is taken away.
    """
    size = 2 * _REACH + 1
    away = np.arange(size + 1)
    ratio = 1.0 + 2.0 * away / size**2 - np.where(away > _REACH, 2.0 / size, 0.0)
    return float(np.interp(abs(lag), away, ratio))
