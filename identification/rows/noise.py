"""Noise of the wheel's sensors, from the vehicle's description or from the recording itself."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from scipy.ndimage import median_filter
from scipy.spatial import KDTree
from scipy.stats import binom, norm

from ...framework.core.recording.types import WheelTable
from ...framework.core.track.positions import runs_of
from ...framework.core.vehicle import Vehicle
from ..mechanics.textbook import CHANNELS

NORMAL_MAD = 1.4826
"""Standard deviation of a normal variable, in median absolute deviations [-]."""

_LEAST_SHARE = 2e-3
"""No sensor is taken to be better than this share of the channel's largest value [-]."""

_FEWEST_NEIGHBOURS, _FEWEST_DIFFERENCES = 7, 30

_BY_CHANCE = 0.01
"""Probability below which trials that lie together differ by less than chance [-]."""

_FEWEST_FREE = 8
"""Degrees of freedom from which on the scatter about a surface is known well enough, to a quarter."""


def sensor_noise(table: WheelTable, vehicle: Vehicle) -> np.ndarray:
    """Standard deviation of each channel of `textbook.CHANNELS`, (5,), NaN where the channel is absent.

    What `vehicle.noise` gives is taken. Otherwise, in a recording with time, white noise shows in second differences of
    neighbouring samples; in a file of steady-state trials, in the difference between trials that are nearest in load
    and slip. Both are robust (median of absolute values), and both take a little of the signal for noise: wide rather
    than narrow.
    """
    return np.array([_channel_noise(table, name, vehicle.noise.get(name)) for name in CHANNELS])


def _channel_noise(table: WheelTable, name: str, given: float | None) -> float:
    values = table.get(name)
    if values is None or not np.isfinite(values).any():
        return float("nan")
    return given if given is not None else max(measured_noise(table, name), least_noise(values))


def measured_noise(table: WheelTable, name: str) -> float:
    """Noise of a channel of the table as neighbours in time show it, or the nearest trials; 0 where too few do."""
    values = table[name]
    return noise_from_neighbours(table, values) if "time_s" in table else _from_repeats(table, values, name)


def least_noise(values: np.ndarray) -> float:
    """Least noise that a channel (n,) is taken to have, some of it seen."""
    return _LEAST_SHARE * float(np.nanmax(np.abs(values))) or _LEAST_SHARE


def noise_from_neighbours(table: WheelTable, values: np.ndarray) -> float:
    """Noise of a channel (n,) with time, from second differences, whose variance is six times that of white noise."""
    same = np.ones(max(len(values) - 2, 0), dtype=bool)
    for names in (table.wheel, table.run):
        if names is not None:
            same &= (names[:-2] == names[1:-1]) & (names[1:-1] == names[2:])
    if table.wheel is not None and not same.any():
        # Rows of several wheels alternate: look along one wheel at a time.
        wheels = [table.wheel == wheel for wheel in np.unique(table.wheel)]
        measured = [noise_from_neighbours(table.select(one), values[one]) for one in wheels if one.sum() > 2]
        return float(np.median(measured)) if measured else 0.0
    second = np.diff(values, 2)[same]
    second = second[np.isfinite(second)]
    return _of_second(second) if second.size else 0.0


def noise_of_series(series: Iterable[np.ndarray]) -> float:
    """Noise of stretches of neighbours in time, as `noise_from_neighbours`; NaN where there are too few."""
    second = np.concatenate([np.empty(0), *(np.diff(values, 2) for values in series)])
    second = second[np.isfinite(second)]
    return _of_second(second) if second.size >= _FEWEST_DIFFERENCES else float("nan")


def _of_second(second: np.ndarray) -> float:
    """Standard deviation of the white noise whose second differences are these."""
    return NORMAL_MAD * float(np.median(np.abs(second))) / np.sqrt(6.0)


def _from_repeats(table: WheelTable, values: np.ndarray, name: str) -> float:
    """Noise of steady-state means: the scatter within a trial for what is set, nearest trials for what answers."""
    if name in ("load_N", "slip"):
        stem, _, unit = name.rpartition("_")
        scatter = table.get(f"{stem}_sd_{unit}" if stem else f"{name}_sd")
        # A trial's mean is known better than one sample of it; five independent stretches are assumed in a trial.
        return float(np.nanmedian(scatter)) / np.sqrt(5.0) if scatter is not None else 0.0
    load, slip = table.get("load_N"), table.get("slip")
    if load is None or slip is None or len(values) < 3:
        return 0.0
    place = np.column_stack([load / max(float(np.nanmax(np.abs(load))), 1e-12), slip])
    seen = np.isfinite(place).all(axis=1)
    if seen.sum() < 2:
        return 0.0
    place, values = place[seen], values[seen]
    apart, nearest = map(np.asarray, KDTree(place).query(place, k=2))
    # Of trials at one load and slip either may be the nearer one.
    other = np.where(nearest[:, 0] == np.arange(len(place)), nearest[:, 1], nearest[:, 0])
    near = (apart[:, 1] < 0.1) & np.isfinite(values - values[other])
    pairs = np.unique(np.sort(np.column_stack([np.arange(len(place)), other])[near], axis=1), axis=0)
    of_pairs = values[pairs[:, 0]] - values[pairs[:, 1]]
    of_surface = _about_a_surface(place[:, 0], place[:, 1], values)
    if not np.isfinite(of_surface) or _are_small(of_pairs, of_surface):
        return NORMAL_MAD * float(np.median(np.abs(of_pairs))) / np.sqrt(2.0) if len(of_pairs) else 0.0
    return of_surface


def _are_small(differences: np.ndarray, noise: float) -> bool:
    """Say whether differences (m,) of pairs are smaller than noise of a standard deviation makes them by chance."""
    if not len(differences):
        return False
    middle = float(np.median(np.abs(differences)))
    below = 2.0 * float(norm.cdf(middle / (np.sqrt(2.0) * max(noise, 1e-300)))) - 1.0
    half = (len(differences) + 1) // 2
    return float(binom.sf(half - 1, len(differences), below)) < _BY_CHANCE


def _about_a_surface(load: np.ndarray, slip: np.ndarray, values: np.ndarray) -> float:
    """Scatter of values (n,) about a polynomial in load, over the largest, and slip; infinite where they are few.

    Of the textbook's driven wheel such a surface is right to about a hundredth of what an answer varies by; of others
    it may not be, and then repeated trials show the noise.
    """
    seen = np.isfinite(values)
    load, slip, values = load[seen], slip[seen], values[seen]
    terms = np.column_stack([np.ones(len(load)), slip, slip**2, slip**3, load, load * slip, load * slip**2, load**2])
    coefficients, _, rank, _ = np.linalg.lstsq(terms, values, rcond=1e-6)
    free = len(values) - int(rank)
    if free < _FEWEST_FREE:
        return np.inf
    return float(np.sqrt(np.sum((values - terms @ coefficients) ** 2) / free))


def in_time(values: np.ndarray, stretch: np.ndarray) -> list[np.ndarray]:
    """Series of neighbours in time of values (n,), whose `stretch` (n,) is numbered; such as are too short aside."""
    return [values[rows] for rows in runs_of(stretch) if len(rows) > 2]


def from_running_median(values: np.ndarray, stretch: np.ndarray) -> np.ndarray:
    """How far values (n,) lie from the median of five neighbours in time, NaN where none are seen or fewer than seven.

    `stretch` (n,) numbers the stretches that no neighbourhood crosses; unseen values are passed over.
    """
    away = np.full(len(values), np.nan)
    for rows in runs_of(stretch):
        seen = rows[np.isfinite(values[rows])]
        if len(seen) >= _FEWEST_NEIGHBOURS:
            away[seen] = np.abs(values[seen] - median_filter(values[seen], 5, mode="mirror"))
    return away


def running_median(values: np.ndarray, window: int) -> np.ndarray:
    """Median of values (n,) and their neighbours in a window of rows, over unseen ones by interpolation; as they are
    where fewer than three are seen.
    """
    known = np.isfinite(values)
    if known.sum() < 3:
        return values
    index = np.arange(len(values))
    filled = np.interp(index, index[known], values[known])
    return median_filter(filled, size=min(window, len(values)), mode="mirror")
