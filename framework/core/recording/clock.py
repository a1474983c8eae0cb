"""Channels of different clocks brought onto one: linear interpolation that does not bridge gaps."""

from __future__ import annotations

import numpy as np


def interpolate(time_s: np.ndarray, values: np.ndarray, at_s: np.ndarray, max_gap_s: float) -> np.ndarray:
    """Interpolate a channel linearly onto another clock.

    Parameters
    ----------
    time_s, values : (m,)
        Samples in order of time [s]; values that are NaN count as not recorded.
    at_s : (n,)
        Times to interpolate at [s].
    max_gap_s
        No gap that is longer than this is bridged, and before the first and after the last sample a value is held for
        half of it [s].

    Returns
    -------
    np.ndarray
        (n,), NaN where the channel has nothing to say.
    """
    seen = ~np.isnan(values)
    time_s, values = time_s[seen], values[seen]
    if not len(time_s):
        return np.full(len(at_s), np.nan)
    right = np.searchsorted(time_s, at_s, side="left").clip(0, len(time_s) - 1)
    left = np.searchsorted(time_s, at_s, side="right").clip(1, len(time_s)) - 1
    bridged = time_s[right] - time_s[left] <= max_gap_s
    near = np.minimum(np.abs(at_s - time_s[left]), np.abs(time_s[right] - at_s)) <= max_gap_s / 2
    return np.where(bridged & near, np.interp(at_s, time_s, values), np.nan)


def nearest(time_s: np.ndarray, values: np.ndarray, at_s: np.ndarray, max_gap_s: float) -> np.ndarray:
    """Give the value of the sample nearest in time, (n,), NaN where it is further off than half of `max_gap_s`."""
    seen = ~np.isnan(values)
    time_s, values = time_s[seen], values[seen]
    if not len(time_s):
        return np.full(len(at_s), np.nan)
    right = np.searchsorted(time_s, at_s).clip(0, len(time_s) - 1)
    left = np.maximum(right - 1, 0)
    pick = np.where(np.abs(at_s - time_s[left]) <= np.abs(time_s[right] - at_s), left, right)
    return np.where(np.abs(at_s - time_s[pick]) <= max_gap_s / 2, values[pick], np.nan)
