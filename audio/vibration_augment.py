"""Makes runs of an inertial sensor worse, as sensors and vehicles are worse: noise, motors, slow, clipped, coarse.

Recordings to learn from come from few vehicles, each with its own sensor. What the copies made here have in common is
that something was added that is not the ground, or something of the ground was lost. Both are an error in what was
recorded, and how far the ground stands above that error is one ratio for all of them.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..framework.core.recording.types import VibrationRun
from ..framework.core.recording.vibration import on_clock
from .augment import coloured_noise
from .vibration_features import WINDOW_S

NOISE_DB = (-15.0, 30.0)
"""Range of the ratio of a run's vibration to the noise that is added [dB]."""
SLOW_HZ = (20.0, 80.0)
"""Range of the rate of a slow sensor [Hz]."""
CLIPPED = (0.002, 0.3)
"""Range of the share of samples beyond the range of a sensor [-]."""
COARSE = (0.1, 5.0)
"""Range of the step of a coarse sensor, in standard deviations of what it records [-]."""


def worsened(run: VibrationRun, rng: np.random.Generator) -> VibrationRun:
    """Give a run as a worse sensor, or one nearer to motors, would have recorded it: one fault of it or two."""
    level = np.nanmean(run.channels, axis=0)
    moved = run.channels - level
    spread = np.maximum(np.nanstd(moved, axis=0), 1e-9)
    for fault in rng.permutation(len(FAULTS))[: rng.integers(1, 3)]:
        moved = FAULTS[fault](moved, spread, run, rng)
    return replace(run, channels=level + moved)


def ratio_dB(run: VibrationRun, worse: VibrationRun, first: np.ndarray) -> np.ndarray:
    """Give the ratio of vibration to what was changed in it, the mean over the channels [dB].

    `first` (n,) are the first samples of windows; (n,), NaN for one with a gap.
    """
    rows = first[:, None] + np.arange(min(round(WINDOW_S * run.sample_rate_Hz), len(run.time_s)))
    whole, error = run.channels[rows], (worse.channels - run.channels)[rows]
    power, lost = (np.maximum(part.var(axis=1), 1e-20) for part in (whole, error))
    return np.asarray(10.0 * np.log10(power / lost).mean(axis=1))


def _noisy(moved: np.ndarray, spread: np.ndarray, run: VibrationRun, rng: np.random.Generator) -> np.ndarray:
    """Noise of any colour in every channel."""
    slope, size = rng.uniform(-0.5, 1.5), _size(rng)
    noise = np.column_stack([coloured_noise(len(moved), rng, slope, run.sample_rate_Hz, 0.5) for _ in spread])
    return moved + size * spread * noise


def _driven(moved: np.ndarray, spread: np.ndarray, run: VibrationRun, rng: np.random.Generator) -> np.ndarray:
    """Harmonics of a motor or fan, whose speed varies a little; each channel feels them with a strength of its own."""
    knots = max(2, len(moved) // 500)
    speed = rng.uniform(3.0, 40.0) * np.exp(
        np.interp(np.arange(len(moved)), np.linspace(0, len(moved), knots), rng.normal(0, 0.05, knots))
    )
    phase = 2 * np.pi * np.cumsum(speed) / run.sample_rate_Hz
    order = np.arange(1, 6)
    tones = np.sin(phase[:, None] * order + rng.uniform(0, 2 * np.pi, order.size))
    mixed = tones @ rng.normal(size=(order.size, moved.shape[1]))
    return moved + _size(rng) * spread * mixed / mixed.std(axis=0)


def _slow(moved: np.ndarray, spread: np.ndarray, run: VibrationRun, rng: np.random.Generator) -> np.ndarray:
    """Fewer samples a second, without a low pass before them, brought onto the clock again."""
    rate = np.exp(rng.uniform(*np.log(SLOW_HZ)))
    time = np.arange(run.time_s[0], run.time_s[-1] + 1.0 / rate, 1.0 / rate)
    gap = 5.0 / run.sample_rate_Hz
    thin = (on_clock(run.time_s, each, time, run.sample_rate_Hz, gap) for each in moved.T)
    return np.column_stack([on_clock(time, each, run.time_s, rate, 5.0 / rate) for each in thin])


def _clipped(moved: np.ndarray, spread: np.ndarray, run: VibrationRun, rng: np.random.Generator) -> np.ndarray:
    """A sensor whose range is too small."""
    share = np.exp(rng.uniform(*np.log(CLIPPED)))
    most = np.nanquantile(np.abs(moved), 1.0 - share, axis=0)
    return np.clip(moved, -most, most)


def _coarse(moved: np.ndarray, spread: np.ndarray, run: VibrationRun, rng: np.random.Generator) -> np.ndarray:
    """A sensor of few bits."""
    step = spread * np.exp(rng.uniform(*np.log(COARSE)))
    return step * np.round(moved / step)


def _size(rng: np.random.Generator) -> float:
    """Amplitude of what is added, relative to the vibration [-]."""
    return float(10.0 ** (-rng.uniform(*NOISE_DB) / 20.0))


FAULTS = (_noisy, _driven, _slow, _clipped, _coarse)
