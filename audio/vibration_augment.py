"""Makes runs of an inertial sensor worse, as sensors and vehicles are worse: noise, motors, slow, clipped, coarse.

Recordings to learn from come from few vehicles, each with its own sensor. What the copies made here have in common is
that something was added that is not the ground, or something of the ground was lost. Both are an error in what was
recorded, and how far the ground stands above that error is one ratio for all of them.
"""

from __future__ import annotations

import numpy as np

from ..framework.core.classifier.signal_to_noise import NOISE_FREE_DB
from ..framework.core.recording.types import VibrationRun
from ..framework.core.recording.vibration import on_clock
from .augment import coloured_noise

NOISE_DB = (-15.0, 30.0)
"""Range of the ratio of a run's vibration to the noise that is added [dB]."""
SLOW_HZ = (20.0, 80.0)
"""Range of the rate of a slow sensor [Hz]."""
CLIPPED = (0.002, 0.3)
"""Range of the share of samples beyond the range of a sensor [-]."""
COARSE = (0.1, 5.0)
"""Range of the step of a coarse sensor, in standard deviations of what it records [-]."""


def worsened(run: VibrationRun, rng: np.random.Generator, faded: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
    """Give a run as a worse sensor, or one nearer to motors, would have recorded it: one fault of it or two.

    Parameters
    ----------
    run
        n samples of c channels.
    rng
        Draws the faults.
    faded
        Share of the vibration that is left before, as of quieter ground or a slower vehicle [-].

    Returns
    -------
    worse : (n, c)
        The channels that it would have recorded; as they are where no sample is whole.
    without : (n, c)
        The same without the faults.
    """
    whole = run.channels[np.isfinite(run.channels).all(axis=1)]
    if not len(whole):
        return run.channels, run.channels
    level, spread = whole.mean(axis=0), faded * np.maximum(whole.std(axis=0), 1e-9)
    moved = changed = faded * (run.channels - level)
    for fault in rng.permutation(len(FAULTS))[: rng.integers(1, 3)]:
        changed = FAULTS[fault](changed, spread, run, rng)
    return level + changed, level + moved


def ratio_dB(worse: np.ndarray, without: np.ndarray, first: np.ndarray, length: int) -> np.ndarray:
    """Give how far vibration stands above what a fault made of it, the mean over the channels [dB].

    Parameters
    ----------
    worse, without : (n, c)
        What `worsened` gives.
    first : (m,)
        First samples of windows.
    length
        Samples of a window.

    Returns
    -------
    (m,)
        In each channel at most `NOISE_FREE_DB`, as where a window holds nothing to clip; NaN for one with a gap.
    """
    rows = first[:, None] + np.arange(length)
    power, lost = (np.maximum(part[rows].var(axis=1), 1e-20) for part in (without, worse - without))
    return np.asarray(np.clip(10.0 * np.log10(power / lost), -NOISE_FREE_DB, NOISE_FREE_DB).mean(axis=1))


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
