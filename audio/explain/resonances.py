"""Resonances of the microphone's mount or the structure: humps that stay where they are on every ground.

Contact sound rings too, and the grains of one ground at the same frequencies all along it. What belongs to the vehicle
is there on every ground; so the drive is first divided into grounds by the shape of its spectrum, and a hump counts by
how high it stands where it is lowest. On a single ground the two are indistinguishable.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.cluster.hierarchy import fcluster, linkage
from scipy.ndimage import convolve1d, uniform_filter1d
from scipy.optimize import curve_fit
from scipy.signal import find_peaks

from .alignment import FOLDS, HeldOut
from .drive_spectra import DriveSpectra
from .lines import FALSE_DISCOVERY_RATE, Line

LEAST_DB = 1.5
"""Lower humps are of no consequence [dB]."""
ALONE_DB = 6.0
"""On a single ground only humps as high as this are mentioned at all [dB]."""
_GROUND_DB = 3.0
_LOW_HZ = 80.0
_BANDS_ABOVE = 8
"""A hump needs so many bands above it, a third of an octave, to be distinguished from the end of what was observed."""
_SIDES = np.array([1.0] * 6 + [0.0] * 11 + [1.0] * 6)
"""What a band is compared with: a quarter octave on either side, a quarter octave away."""
_LOW_QUANTILE = 0.25
"""A hump counts as high as it is on the ground where it is lowest but one in four."""
_SURROGATES = 400
_DB = 10.0 / np.log(10.0)
_EFFECTIVE = 0.3
_WIDEST_Q = 5.0
_SHARPEST_Q = 80.0
_MOST_GAIN = 60.0
_NEAR_OCTAVES = 0.36


@dataclass(frozen=True)
class ResonanceFinding(HeldOut):
    """A hump 1 + G / (1 + (2 Q (f - f_0) / f_0)^2) on contact sound's power.

    Parameters
    ----------
    frequency_hz, q, gain
        f_0 [Hz], Q [-], G [-], each with its standard deviation.
    p_value
        Against spectra of the grounds shifted along frequency.
    grounds
        On how many grounds it stands.
    """

    frequency_hz: tuple[float, float]
    q: tuple[float, float]
    gain: tuple[float, float]
    p_value: float
    grounds: int

    def power_ratio(self, frequency_hz: np.ndarray) -> np.ndarray:
        """Factor on the power at frequencies [Hz]."""
        return np.exp(_hump(frequency_hz, self.frequency_hz[0], self.q[0], self.gain[0]))


def _hump(frequency_hz: np.ndarray, middle: float, q: float, gain: float) -> np.ndarray:
    return np.log1p(gain / (1.0 + (2.0 * q * (frequency_hz - middle) / middle) ** 2))


def find_resonances(
    spectra: DriveSpectra, lines: list[Line], rng: np.random.Generator, reference: np.ndarray | None = None
) -> list[ResonanceFinding]:
    """Find humps that stand on every ground, or, where there is but one ground, high ones that may be its own.

    With a reference, the level (b',) [ln] of contact sound known to be clean, humps over that count; stretches then
    stand for themselves, since what the ground has of its own is in the reference. Of two recorders the one that heard
    less far counts.
    """
    hz, levels = spectra.band_hz, _levels(spectra, lines)
    ground = _grounds(spectra)
    if reference is not None:
        both = min(hz.size, reference.size)
        hz, levels, ground = hz[:both], levels[:, :both] - reference[:both], np.arange(len(levels))
    if len(levels) < FOLDS:
        return []
    # Both sides weigh the same, so that a slope, however steep, is no relief.
    relief = levels - convolve1d(levels, _SIDES / _SIDES.sum(), axis=1, mode="nearest")
    by_ground = np.stack([relief[ground == number].mean(axis=0) for number in np.unique(ground)])
    alone = len(by_ground) == 1
    lowest = _lowest(by_ground)
    inside = (hz > _LOW_HZ) & (np.arange(hz.size) < hz.size - _BANDS_ABOVE)
    limit = ALONE_DB / _DB if alone else LEAST_DB / _DB
    p_value = np.full(hz.size, 1.0) if alone else _p_values(by_ground, lowest, inside, rng)
    found = []
    for peak in find_peaks(np.where(inside, lowest, -1.0), height=limit, distance=4)[0]:
        if not alone and p_value[peak] > FALSE_DISCOVERY_RATE:
            continue
        finding = _fitted(hz, levels, float(lowest[peak]), int(peak), float(p_value[peak]), len(by_ground))
        if finding is not None and finding.nats > 0:
            found.append(finding)
    return found


def _lowest(by_ground: np.ndarray) -> np.ndarray:
    """How high the relief of grounds (g, b) stands on the low ones, neighbours averaged (b,)."""
    return uniform_filter1d(np.quantile(by_ground, _LOW_QUANTILE, axis=0), 2, mode="nearest")


def _levels(spectra: DriveSpectra, lines: list[Line]) -> np.ndarray:
    """Mean log spectrum of each stretch (s, b) [ln], what lines stand in left out."""
    hz = spectra.band_hz
    logs = np.log(np.maximum(spectra.band_power, 1e-20)).astype(float)
    for line in lines:
        if line.family == "envelope":
            continue
        at = line.place * (spectra.shaft_hz if line.family == "order" else np.ones(len(logs)))
        logs[np.abs(hz - at[:, None]) < np.minimum(np.maximum(0.02 * at, 2.0), 8.0)[:, None]] = np.nan
    return np.stack([_nan_mean(logs[spectra.stretch == number]) for number in spectra.stretches])


def _nan_mean(values: np.ndarray) -> np.ndarray:
    """Column means, interpolated over columns that hold nothing."""
    seen = ~np.isnan(values)
    count = seen.sum(axis=0)
    mean = np.where(seen, values, 0.0).sum(axis=0) / np.maximum(count, 1)
    there = np.flatnonzero(count > 0)
    return np.interp(np.arange(mean.size), there, mean[there]) if there.size else mean


def _grounds(spectra: DriveSpectra) -> np.ndarray:
    """Which ground each stretch is on (s,), by the shape of its third octaves above 200 Hz."""
    use = spectra.band_hz > 200.0
    count = int(use.sum()) // 8
    logs = np.log(np.maximum(spectra.band_power[:, use][:, : count * 8], 1e-20))
    shape = np.stack([logs[spectra.stretch == number].mean(axis=0) for number in spectra.stretches])
    shape = _DB * shape.reshape(len(shape), count, 8).mean(axis=2)
    shape = shape - shape.mean(axis=1, keepdims=True)
    if len(shape) < 2:
        return np.ones(len(shape), dtype=int)
    # Euclidean distance over `count` bands of a root mean square difference.
    return fcluster(linkage(shape, "average"), _GROUND_DB * np.sqrt(count), "distance")


def _p_values(by_ground: np.ndarray, lowest: np.ndarray, inside: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Chance that shifted grounds reach as high *anywhere* (b,): controls the error over the whole spectrum."""
    own = by_ground[:, inside]
    highest = np.empty(_SURROGATES)
    for index in range(_SURROGATES):
        shift = rng.integers(0, own.shape[1], len(own))
        highest[index] = _lowest(np.stack([np.roll(row, k) for row, k in zip(own, shift, strict=True)])).max()
    return (1.0 + np.sum(highest[:, None] >= lowest, axis=0)) / (1.0 + _SURROGATES)


def _fitted(
    hz: np.ndarray, levels: np.ndarray, height: float, peak: int, p_value: float, grounds: int
) -> ResonanceFinding | None:
    """Fit the hump on a smooth course of each stretch's own, and score fits to four fifths of them on the rest.

    The course is a parabola over the logarithm of frequency, projected out of spectra and hump alike (Golub and
    Pereyra 1973, doi:10.1137/0710036); stretches are joined by their median, for some have peaks of their own there.
    """
    near = np.abs(np.log2(hz / hz[peak])) < _NEAR_OCTAVES
    f = hz[near]
    basis = np.linalg.qr(np.vander(np.log2(f / hz[peak]), 3))[0]
    rest = np.eye(f.size) - basis @ basis.T
    y = levels[:, near] @ rest
    start = (hz[peak], 12.0, float(np.expm1(max(height, 0.3))))
    bounds = ([hz[peak] / 1.06, _WIDEST_Q, 0.02], [hz[peak] * 1.06, _SHARPEST_Q, _MOST_GAIN])

    def shape(_: np.ndarray, middle: float, q: float, gain: float) -> np.ndarray:
        return rest @ _hump(f, middle, q, gain)

    def fit(rows: np.ndarray) -> tuple[np.ndarray, np.ndarray] | None:
        try:
            return curve_fit(shape, f, np.median(rows, axis=0), start, bounds=bounds, max_nfev=400)
        except (RuntimeError, ValueError):
            return None

    whole = fit(y)
    if whole is None:
        return None
    fold = np.arange(len(y)) % FOLDS
    spread = float(np.maximum(np.median((y - shape(f, *whole[0])) ** 2) / 0.455, 0.02))
    by_stretch, before, after, places = np.zeros(len(y)), 0.0, 0.0, []
    for held in range(FOLDS):
        part = fit(y[fold != held])
        if part is None:
            return None
        places.append(part[0])
        own = y[fold == held]
        error = own - shape(f, *part[0])
        by_stretch[fold == held] = _EFFECTIVE * 0.5 * np.sum(_bounded(own, spread) - _bounded(error, spread), axis=1)
        before, after = before + _DB**2 * float(np.sum(own**2)), after + _DB**2 * float(np.sum(error**2))
    jack = np.sqrt((FOLDS - 1) / FOLDS * np.sum((np.array(places) - np.mean(places, axis=0)) ** 2, axis=0))
    sd = np.hypot(jack, np.sqrt(np.maximum(np.diag(whole[1]), 0.0)))
    middle, q, gain = (float(x) for x in whole[0])
    if not (1.02 * _WIDEST_Q < q < 0.98 * _SHARPEST_Q and gain < 0.98 * _MOST_GAIN):
        return None  # no hump of this form: a shoulder, a step, or a line
    return ResonanceFinding(
        by_stretch, before, after, int(y.size), (middle, float(sd[0])), (q, float(sd[1])), (gain, float(sd[2])),
        p_value, grounds,
    )  # fmt: skip


def _bounded(error: np.ndarray, spread: float) -> np.ndarray:
    """Squared errors over their spread, growing as a logarithm beyond 3 standard deviations: a ground's own peak."""
    return 9.0 * np.log1p(error**2 / spread / 9.0)
