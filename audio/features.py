"""What a stretch of contact sound is described by: a vector that gain does not move.

Every window of sound becomes one row of numbers: the shape of its spectrum on the mel scale and how that shape
moves, moments of the spectrum, and, because gravel differs from sand by grains rather than by colour, how
impulsive the sound is in each of a few bands. All of them are ratios, so neither the microphone's gain nor the
distance to the wheel matters. The mel filters are librosa's; all else is NumPy and SciPy in single precision on whole
batches of windows, ten times as fast as librosa's own spectra.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import lru_cache
from itertools import pairwise

import numpy as np
import scipy.fft
import soxr

RATE_HZ = 16000
"""Working sample rate [Hz]: what cheap microphones and speech codecs keep too, so that sources remain comparable."""
WINDOW_S = 1.0
"""Length of one window of sound [s]."""
HOP_S = 0.5
"""Distance between the starts of two windows [s]."""
FFT_SIZE = 512
FRAME_STEP = 128
LOW_HZ = 60.0
"""Below this lie wind, handling and suspension [Hz]: nothing of it enters the features."""
MEL_BANDS = 40
CEPSTRA = 16
_BATCH = 16  # their spectra fit into the processor's cache
_DYNAMIC_RANGE = 1e-6
_ACTIVE = 1e-3
_HEARD = 1e-5
_SILENT = 1e-10
_GRAIN_EDGES_HZ = (60.0, 300.0, 1000.0, 3000.0, 8000.0)
_MODULATION_EDGES_HZ = (2.0, 6.0, 12.0, 25.0, 50.0)
_CONTRAST_EDGES_HZ = (100.0, 300.0, 800.0, 1800.0, 3500.0, 7800.0)


def resample(samples: np.ndarray, rate_hz: float) -> np.ndarray:
    """Bring mono sound (m,) from `rate_hz` [Hz] to the working rate, (m',) float32."""
    samples = np.ascontiguousarray(samples, dtype=np.float32)
    if rate_hz == RATE_HZ or samples.size == 0:
        return samples
    return np.asarray(soxr.resample(samples, rate_hz, RATE_HZ, quality="HQ"), dtype=np.float32)


def cut_windows(samples: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Cut sound at the working rate into windows that overlap by half.

    A stretch shorter than a window, a single footstep say, is repeated until it fills one: silence put behind it would
    pass for a quiet background.

    Parameters
    ----------
    samples : (m,)
        Mono sound at `RATE_HZ`.

    Returns
    -------
    windows : (n, window)
        Windows, float32; the last one ends with the sound.
    start_s : (n,)
        Their starts [s].
    """
    length, hop = round(WINDOW_S * RATE_HZ), round(HOP_S * RATE_HZ)
    if samples.size <= length:
        return np.resize(samples, (1, length)).astype(np.float32), np.zeros(1)
    starts = np.arange(0, samples.size - length + 1, hop)
    if starts[-1] + length < samples.size - hop // 2:
        starts = np.append(starts, samples.size - length)
    return samples[starts[:, None] + np.arange(length)].astype(np.float32), starts / RATE_HZ


@lru_cache(maxsize=1)
def mel_filters() -> np.ndarray:
    """Triangular filters of height 1, evenly spaced on the mel scale: (FFT_SIZE // 2 + 1, MEL_BANDS) [-], float32."""
    # Imported here: librosa takes two seconds to import, and compiles itself for some more the very first time.
    import librosa.filters

    filters = librosa.filters.mel(
        sr=RATE_HZ, n_fft=FFT_SIZE, n_mels=MEL_BANDS, fmin=LOW_HZ, fmax=RATE_HZ / 2, htk=True, norm=None
    )
    return np.ascontiguousarray(filters.T, dtype=np.float32)


@lru_cache(maxsize=1)
def _taper() -> np.ndarray:
    return np.hanning(FFT_SIZE + 1)[:-1].astype(np.float32)


@lru_cache(maxsize=1)
def frequencies() -> np.ndarray:
    """Frequencies of the bins of `power_spectra` [Hz], (FFT_SIZE // 2 + 1,)."""
    return np.fft.rfftfreq(FFT_SIZE, 1.0 / RATE_HZ).astype(np.float32)


def power_spectra(windows: np.ndarray) -> np.ndarray:
    """Short-time power spectra of windows (n, m): (n, frames, FFT_SIZE // 2 + 1), float32."""
    frames = np.lib.stride_tricks.sliding_window_view(windows, FFT_SIZE, axis=1)[:, ::FRAME_STEP]
    spectra: np.ndarray = np.asarray(scipy.fft.rfft(frames * _taper(), axis=2))
    return np.square(np.abs(spectra))


def spectra_in_batches(windows: np.ndarray) -> Iterator[tuple[slice, np.ndarray]]:
    """Give `power_spectra` of windows (n, m) a few at a time, each with the rows that they are of."""
    windows = np.asarray(windows, dtype=np.float32)
    for at in range(0, len(windows), _BATCH):
        yield slice(at, at + _BATCH), power_spectra(windows[at : at + _BATCH])


def _weighted(values: np.ndarray, weight: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Mean and standard deviation over frames of values (n, frames, d) with weights (n, frames), each (n, d)."""
    mean = np.einsum("ntd,nt->nd", values, weight)
    square = np.einsum("ntd,nt->nd", np.square(values), weight)
    return mean, np.sqrt(np.maximum(square - mean**2, 0.0))


def _bands(edges_hz: Sequence[float]) -> list[slice]:
    index = np.searchsorted(frequencies(), edges_hz)
    return [slice(int(low), int(high)) for low, high in pairwise(index)]


def _shape(mel: np.ndarray, weight: np.ndarray, heard: np.ndarray) -> list[tuple[list[str], np.ndarray]]:
    """Cepstra of the mel spectrum: its shape, how the shape varies, and how fast it moves."""
    cepstra = np.asarray(scipy.fft.dct(np.log(mel), axis=2, norm="ortho"))[:, :, : CEPSTRA + 1]
    mean, deviation = _weighted(cepstra, weight)
    step = cepstra[:, 4:] - cepstra[:, :-4]
    step_weight = weight[:, 2:-2]
    step_weight = step_weight / np.maximum(step_weight.sum(axis=1, keepdims=True), 1e-12)
    _, speed = _weighted(step, step_weight)
    average = np.einsum("ntd,nt->nd", mel, weight)
    total = np.asarray(scipy.fft.dct(np.log(np.maximum(average, 1e-12)), axis=1, norm="ortho"))[:, 1 : CEPSTRA + 1]
    plain = heard / np.maximum(heard.sum(axis=1, keepdims=True), 1.0)
    course, spread = _weighted(cepstra[:, :, 1:], plain)
    _, drift = _weighted(np.diff(cepstra[:, :, 1:], axis=1), plain[:, 1:])
    names = [f"{i}" for i in range(CEPSTRA + 1)]
    return [
        ([f"cepstrum_plain_{i}" for i in names[1:]], course),
        ([f"cepstrum_plain_sd_{i}" for i in names[1:]], spread),
        ([f"cepstrum_plain_speed_{i}" for i in names[1:]], drift),
        ([f"cepstrum_mean_{i}" for i in names[1:]], mean[:, 1:]),
        ([f"cepstrum_sd_{i}" for i in names], deviation),
        ([f"cepstrum_speed_{i}" for i in names], speed),
        ([f"cepstrum_total_{i}" for i in names[1:]], total),
    ]


def _moments(power: np.ndarray, weight: np.ndarray) -> list[tuple[list[str], np.ndarray]]:
    """Centroid, spread, flatness and contrast of the spectrum: means and deviations over frames."""
    used = slice(int(np.searchsorted(frequencies(), LOW_HZ)), None)
    power, frequency = power[:, :, used], frequencies()[used]
    octave = np.log2(frequency / 1000.0)
    moments = power @ np.stack([octave, octave**2, np.ones_like(octave)], axis=1)
    total = moments[:, :, 2]
    centroid = moments[:, :, 0] / total
    spread = np.sqrt(np.maximum(moments[:, :, 1] / total - centroid**2, 0.0))
    flatness = np.log(power).mean(axis=2) - np.log(total / octave.size)
    values = np.stack([centroid, spread, flatness], axis=2)
    mean, deviation = _weighted(values, weight)
    names = ["centroid", "spread", "flatness"]
    contrast = []
    for band in _bands(_CONTRAST_EDGES_HZ):
        part = np.log(np.einsum("ntf,nt->nf", power[:, :, band.start - used.start : band.stop - used.start], weight))
        part = np.sort(part, axis=1)
        edge = max(1, part.shape[1] // 5)
        contrast.append(part[:, -edge:].mean(axis=1) - part[:, :edge].mean(axis=1))
    return [
        ([f"{name}_mean" for name in names], mean),
        ([f"{name}_sd" for name in names], deviation),
        ([f"contrast_{i}" for i in range(len(contrast))], np.stack(contrast, axis=1)),
    ]


def _grain(power: np.ndarray, active: np.ndarray) -> list[tuple[list[str], np.ndarray]]:
    """How impulsive the sound is, band by band: crest, fluctuation, onsets, decay and slow modulation of envelopes."""
    envelopes = np.stack([power[:, :, band].sum(axis=2) for band in _bands(_GRAIN_EDGES_HZ)], axis=2)
    envelopes = np.concatenate(
        [envelopes, envelopes[:, :, 0:1] + envelopes[:, :, 1:].sum(axis=2, keepdims=True)], axis=2
    )
    count = np.maximum(active.sum(axis=1), 1)[:, None]
    peak = envelopes.max(axis=1)
    mean = np.einsum("ntd,nt->nd", envelopes, active.astype(np.float32)) / count
    crest = np.log(peak / mean)
    level = np.log(envelopes)
    flux = np.einsum("ntd,nt->nd", np.abs(np.diff(level, axis=1)), active[:, 1:].astype(np.float32)) / count
    rising = np.diff(level, axis=1) > 0.7
    onsets = np.einsum("ntd,nt->nd", rising.astype(np.float32), active[:, 1:].astype(np.float32)) / count
    length = np.stack([np.log(np.sum(envelopes > peak[:, None] * drop, axis=1)) for drop in (0.5, 0.1, 0.01)], axis=2)
    root = np.sqrt(envelopes)
    frame_rate = RATE_HZ / FRAME_STEP
    modulation = np.abs(np.asarray(scipy.fft.rfft(root, n=256, axis=1))) ** 2
    rate = np.fft.rfftfreq(256, 1.0 / frame_rate)
    index = np.searchsorted(rate, _MODULATION_EDGES_HZ)
    share = np.stack([modulation[:, a:b].sum(axis=1) for a, b in pairwise(index)], axis=2)
    share = np.log(share / share.sum(axis=2, keepdims=True))
    n, bands = crest.shape
    return [
        ([f"crest_{b}" for b in range(bands)], crest),
        ([f"flux_{b}" for b in range(bands)], flux),
        ([f"onsets_{b}" for b in range(bands)], onsets),
        ([f"length_{b}_{d}" for b in range(bands) for d in range(3)], length.reshape(n, -1)),
        ([f"modulation_{b}_{r}" for b in range(bands) for r in range(share.shape[2])], share.reshape(n, -1)),
    ]


def batch_features(power: np.ndarray) -> tuple[list[str], np.ndarray]:
    """Give names and values (n, d) of the features of windows with these `power_spectra` (n, frames, bins).

    A row of silence, or with a sample that is not finite, is NaN.
    """
    low = int(np.searchsorted(frequencies(), LOW_HZ))
    energy = power[:, :, low:].sum(axis=2)
    loudest = np.maximum(energy.max(axis=1, keepdims=True), 1e-20)
    power = power / loudest[:, :, None] + np.float32(_DYNAMIC_RANGE / power.shape[2])
    energy = energy / loudest
    active = energy > _ACTIVE
    weight = np.where(active, np.sqrt(energy), 0.0).astype(np.float32)
    weight /= np.maximum(weight.sum(axis=1, keepdims=True), 1e-12)
    mel = power @ mel_filters()
    with np.errstate(divide="ignore", invalid="ignore"):  # of silent windows
        parts = _shape(mel, weight, (energy > _HEARD).astype(np.float32))
        parts += _moments(power, weight) + _grain(power, active)
    values = np.concatenate([values for _, values in parts], axis=1)
    values[~(loudest[:, 0] > _SILENT)] = np.nan
    return [name for names, _ in parts for name in names], values


_NOISE = np.random.default_rng(0).normal(size=(1, round(WINDOW_S * RATE_HZ))).astype(np.float32)
FEATURE_NAMES: tuple[str, ...] = tuple(batch_features(power_spectra(_NOISE))[0])
"""Names of the features, in the order of the columns."""
