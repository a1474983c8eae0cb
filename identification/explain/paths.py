"""Expected load, slip, speeds and accelerations of a drive, each regime of speed by its own noise and dynamics."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from scipy.ndimage import median_filter

from ...framework.core.recording.types import WheelTable
from ...framework.core.track.positions import runs_of
from ...framework.core.vehicle import Wheel
from ..effects.effect import Drive
from ..rows.gate import GRAVITY_M_S2, LIMITS
from ..rows.noise import from_running_median, noise_from_neighbours
from .latent import Path, independent, path_of

_ISOLATED, _MOST_ISOLATED = 7.0, 0.05
"""Distance from the median of neighbours in time, in standard deviations of the noise, beyond which load or slip is a
gross error, and the largest share of a stretch that may be [-]."""

_REGIME = 21
"""Rows over whose median a regime of speed is decided: one that does not last is none."""


def regimes(table: WheelTable, wheel: Wheel, stretch: np.ndarray) -> np.ndarray:
    """Number the regimes (n,): 1 where a stretch was driven too fast for a static balance for some time, else 0."""
    speed = table.get("travel_speed_m_s")
    if speed is None:
        return np.zeros(len(table), dtype=int)
    fast = (np.abs(np.nan_to_num(speed)) > LIMITS.froude * math.sqrt(GRAVITY_M_S2 * wheel.radius_m)).astype(int)
    for rows in runs_of(stretch):
        fast[rows] = median_filter(fast[rows], min(_REGIME, len(rows)), mode="nearest")
    return fast


def path_without_outliers(
    values: np.ndarray, time_s: np.ndarray, sd: float, stretch: np.ndarray, regime: np.ndarray, timed: bool
) -> Path:  # fmt: skip
    """Estimate the latent path of load or slip without gross errors."""
    if not timed:
        return independent(values, np.full(len(values), sd))
    outlier = from_running_median(values, stretch) > _ISOLATED * sd
    number = np.cumsum(np.diff(stretch, prepend=stretch[:1]) != 0)
    # Many outliers mean that the channel changes rapidly, not that it is faulty.
    share = np.bincount(number, outlier) / np.maximum(np.bincount(number, np.isfinite(values)), 1.0)
    values = np.where(outlier & (share[number] <= _MOST_ISOLATED), math.nan, values)
    return path_of(values, time_s, stretch, regime, sd)


def smooth_speeds(drive: Drive, table: WheelTable, wheel: Wheel, regime: np.ndarray) -> Drive:
    """Return the drive with smoothed speeds and their expected rates of change.

    Regressions on expected values are not attenuated (Berkson errors, as in `latent`).
    """
    changed, of_rim = {}, 1.0 / wheel.radius_m
    for name, rate, scale in (
        ("rim_speed_m_s", "angular_acceleration_rad_s2", of_rim), ("travel_speed_m_s", "acceleration_m_s2", 1.0)
    ):  # fmt: skip
        values = getattr(drive, name)
        if drive.has(name):
            noise, seen = noise_from_neighbours(table, values), np.isfinite(values)
            path = path_of(values, drive.time_s, drive.stretch, regime, noise)
            changed[name] = np.where(seen, path.mean, math.nan)
            changed[rate] = np.where(seen, scale * path.rate, math.nan)
    return replace(drive, **changed)
