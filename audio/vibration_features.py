"""What a stretch of a vehicle's vibration is described by: the ground as it is heard through the structure.

Three blocks of numbers. The inertial sensor's, which is always there; the wheel drives' (current, torque ...); and the
wheel speed's, since the same ground shakes a fast vehicle more than a slow one. A block that was not recorded is
missing, which is not the same as zero: a wheel speed that is zero throughout while the vehicle is shaken is unknown.

Ground resists turning, too. How much of the rotation that the wheels command the vehicle makes, and what load it costs
the drives, are features: ice lets a skid-steered vehicle spin on at little current, snow holds it at a high one.

No feature has a sign that depends on the side or the direction of travel (skewness, left against right), since such a
number tells one run from another and says nothing of the ground. Correlations between axes tell how the sensor is
mounted: by them the gate sees that a model was trained on another vehicle, and the classifier does not see them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations, pairwise

import numpy as np
import scipy.fft

from ..framework.core.recording.types import VibrationRun

WINDOW_S = 5.12
"""Length of one window [s]."""
HOP_S = 1.28
"""Distance between the starts of two windows [s]."""
BAND_EDGES_HZ = (0.8, 1.6, 2.8, 4.2, 6.0, 8.0, 10.5, 13.5, 17.0, 21.0, 26.0, 32.0, 40.0, 50.1)
SPEED_PREFIXES = ("vel", "speed", "wheel_speed")
"""How the name of a wheel speed begins; every other channel of a wheel file is one of its drive."""
STANDSTILL = 0.01
"""A wheel speed that does not exceed this in a whole window was not recorded [m/s, or rad/s]."""
RATE_PREFIXES = ("w", "gyr", "angular")
"""How the name of a rate of rotation [rad/s] begins."""
_BATCH = 512
_SHAPE = ("level", "crest", "kurtosis", "crossings", "centroid", "spread", "flatness", "jerk", "lull")
_DRIVE = ("mean", "sd", "step", "high")
_SPEED = ("mean", "sd", "fastest")
_TURN = ("forward", "turning", "rotation", "turning_response", "turning_load", "level_for_speed")


@dataclass(frozen=True)
class VibrationChannels:
    """Which channels features are made of: of the inertial sensor, of the wheel drives, and of the wheel speeds."""

    inertial: tuple[str, ...]
    drive: tuple[str, ...] = ()
    speed: tuple[str, ...] = ()

    @staticmethod
    def of(run: VibrationRun) -> VibrationChannels:
        """Give the channels of a run."""
        speed = tuple(name for name in run.wheel_names if name.casefold().startswith(SPEED_PREFIXES))
        return VibrationChannels(run.names, tuple(name for name in run.wheel_names if name not in speed), speed)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the features, in the order of the columns of `vibration_features`."""
        bands = [f"band_{i}" for i in range(len(BAND_EDGES_HZ) - 1)]
        answer = [f"{channel}_{name}" for channel in self.inertial for name in (*_SHAPE, *bands)]
        wheels = {"drive": _DRIVE if self.drive else (), "speed": _SPEED if self.speed else ()}
        for block, measures in wheels.items():
            answer += [f"{block}_{name}" for name in measures] + [f"{block}_{name}_differs" for name in measures]
            answer += [*(_TURN if measures and block == "speed" else ()), *([f"{block}_known"] if measures else [])]
        return (*answer, *(f"{a}_with_{b}" for a, b in combinations(self.inertial, 2)))

    @property
    def of_mounting(self) -> int:
        """How many features, the last ones, are of the sensor's mounting: only the gate is to see them."""
        return len(self.inertial) * (len(self.inertial) - 1) // 2

    def blocks(self) -> dict[str, slice]:
        """Columns of the blocks that may be missing: ``drive`` and ``speed``."""
        inertial = len(self.inertial) * (len(_SHAPE) + len(BAND_EDGES_HZ) - 1)
        drive = inertial + (2 * len(_DRIVE) + 1 if self.drive else 0)
        return {"drive": slice(inertial, drive), "speed": slice(drive, len(self.names) - self.of_mounting)}


def cut_run(count: int, rate_hz: float) -> np.ndarray:
    """Windows of a run of `count` samples: their first samples (n,); one window where the run is no longer than it."""
    length, hop = round(WINDOW_S * rate_hz), round(HOP_S * rate_hz)
    return np.arange(0, max(count - length, 0) + 1, hop)


def window_samples(run: VibrationRun) -> int:
    """Samples of a window of a run."""
    return min(round(WINDOW_S * run.sample_rate_Hz), len(run.time_s))


def vibration_features(run: VibrationRun, channels: VibrationChannels) -> tuple[np.ndarray, np.ndarray]:
    """Describe a run window by window.

    Parameters
    ----------
    run
        On a uniform clock.
    channels
        What to make features of; those of a drive or a speed that the run lacks are missing.

    Returns
    -------
    features : (n, d)
        Columns as `channels.names`. A missing block is NaN but for its ``known`` column, which is 0. A window of
        the inertial sensor with a gap is NaN throughout.
    first : (n,)
        First sample of each window.
    """
    first = cut_run(len(run.time_s), run.sample_rate_Hz)
    length = window_samples(run)
    inertial = run.channels[:, [run.names.index(name) for name in channels.inertial]]
    rates = [index for index, name in enumerate(channels.inertial) if name.casefold().startswith(RATE_PREFIXES)]
    drive, speed = (_wheel(run, names) for names in (channels.drive, channels.speed))
    batches = []
    for at in range(0, len(first), _BATCH):
        rows = first[at : at + _BATCH, None] + np.arange(length)
        parts = [_inertial(inertial[rows], run.sample_rate_Hz)]
        if channels.drive:
            parts.append(_drive(drive[rows], run.sample_rate_Hz))
        if channels.speed:
            level = parts[0][:, :: len(_SHAPE) + len(BAND_EDGES_HZ) - 1].mean(axis=1)
            rotation = np.linalg.norm(inertial[rows][:, :, rates].mean(axis=1), axis=1)
            no_drive = np.full(len(rows), np.nan)
            load = np.abs(drive[rows].mean(axis=1)).mean(axis=1) if channels.drive else no_drive
            parts.append(_speed(speed[rows], level, rotation, load))
        batches.append(np.concatenate([*parts, _correlations(inertial[rows])], axis=1))
    return np.concatenate(batches), first


def _wheel(run: VibrationRun, names: Sequence[str]) -> np.ndarray:
    if not set(names) <= set(run.wheel_names):
        return np.full((len(run.time_s), len(names)), np.nan)
    return run.wheel[:, [run.wheel_names.index(name) for name in names]]


def _inertial(x: np.ndarray, rate_hz: float) -> np.ndarray:
    """Shape and spectrum of each channel of windows (n, m, c)."""
    n, m, c = x.shape
    x = x - x.mean(axis=1, keepdims=True)
    variance = np.maximum(np.mean(x**2, axis=1), 1e-16)
    z = x / np.sqrt(variance)[:, None]
    taper = np.hanning(m + 2)[1:-1, None]
    spectrum = np.asarray(scipy.fft.rfft(z * taper, axis=1))
    power = np.square(np.abs(spectrum)) / np.sum(taper**2)
    frequency = np.fft.rfftfreq(m, 1.0 / rate_hz)
    index = np.searchsorted(frequency, BAND_EDGES_HZ)
    used = slice(int(index[0]), None)
    power = power + 1e-9
    share = power[:, used] / power[:, used].sum(axis=1, keepdims=True)
    octave = np.log2(np.maximum(frequency[used], 0.1) / 10.0)[:, None]
    centroid = np.sum(share * octave, axis=1)
    pieces = z[:, : m // 8 * 8].reshape(n, 8, m // 8, c).std(axis=2) if m >= 16 else np.ones((n, 1, c))
    shape = [
        0.5 * np.log(variance),
        np.log(np.maximum(np.abs(z).max(axis=1), 1e-3)),
        np.log(np.maximum(np.mean(z**4, axis=1), 1e-3)),
        np.mean(z[:, 1:] * z[:, :-1] < 0, axis=1),
        centroid,
        np.sqrt(np.maximum(np.sum(share * octave**2, axis=1) - centroid**2, 0.0)),
        np.log(share).mean(axis=1) - np.log(share.mean(axis=1)),
        0.5 * np.log(np.maximum(np.mean(np.diff(z, axis=1) ** 2, axis=1), 1e-12)),
        np.log(np.maximum(pieces.min(axis=1), 1e-3)),
    ]
    bands = [
        np.log(power[:, low : max(high, low + 1)].mean(axis=1) * variance)
        if low < power.shape[1]
        else np.full((n, c), -20.0)
        for low, high in pairwise(index)
    ]
    return np.stack(shape + bands, axis=2).reshape(n, -1)


def _correlations(x: np.ndarray) -> np.ndarray:
    """Correlation of each pair of channels of windows (n, m, c)."""
    z = x - x.mean(axis=1, keepdims=True)
    z /= np.sqrt(np.maximum(np.sum(z**2, axis=1, keepdims=True), 1e-16))
    upper = np.triu_indices(x.shape[2], 1)
    return np.einsum("nta,ntb->nab", z, z)[:, upper[0], upper[1]]


def _finish(measures: Sequence[np.ndarray], more: Sequence[np.ndarray], whole: np.ndarray) -> np.ndarray:
    """Join measures, each (n, c), as mean and range over the c wheels, with more (n,); NaN in rows that are not whole.

    The last column says which are whole.
    """
    by_wheel = np.stack(measures, axis=1)
    values = np.column_stack([by_wheel.mean(axis=2), np.ptp(by_wheel, axis=2), *more])
    return np.column_stack([np.where(whole[:, None], values, np.nan), whole.astype(float)])


def _drive(x: np.ndarray, rate_hz: float) -> np.ndarray:
    """Level and variation of the drives' channels (n, m, c): current rises with what the ground resists."""
    step = max(1, round(0.15 * rate_hz))
    whole = np.asarray(np.isfinite(x).all(axis=(1, 2)))
    x = np.where(np.isfinite(x), x, 0.0)
    moved = x[:, ::step]
    size = np.abs(moved)
    change = np.abs(np.diff(moved, axis=1)).mean(axis=1) if moved.shape[1] > 1 else np.zeros(moved[:, 0].shape)
    measures = (size.mean(axis=1), moved.std(axis=1), change, np.quantile(size, 0.9, axis=1))
    return _finish([np.log(each + 0.1) for each in measures], (), whole)


def _speed(x: np.ndarray, level: np.ndarray, rotation: np.ndarray, load: np.ndarray) -> np.ndarray:
    """Speed of the wheels (n, m, c), how evenly they turn, and what turning and vibration come of it.

    `level`, `rotation` and `load` (n,) are the vibration's level, the vehicle's mean rate of rotation [rad/s], and the
    drives' mean size, NaN where none was recorded.
    """
    size = np.abs(x)
    whole = np.asarray(np.isfinite(x).all(axis=(1, 2)) & (size > STANDSTILL).any(axis=(1, 2)))
    x, size = (np.where(np.isfinite(part), part, 0.0) for part in (x, size))
    mean = x.mean(axis=1)
    forward, difference = np.abs(mean.mean(axis=1)), np.ptp(mean, axis=1)
    turns = np.tanh(difference / 0.05)  # 1 where the wheels command a turn that can be measured
    response = turns * np.log((rotation + 0.02) / (difference + 0.02))
    turning_load = turns * np.log(load + 0.1)
    against = level - np.log(size.mean(axis=(1, 2)) + 0.05)
    logs = (np.log(each + 0.02) for each in (forward, difference, rotation))
    return _finish(
        [size.mean(axis=1), x.std(axis=1), size.max(axis=1)], (*logs, response, turning_load, against), whole
    )
