"""Sound without what was found in it: a stream that can be classified in place of the recorded one.

Lines, those of lugs and gears and steady tones, are tracked by their phase, which the wheel's angle (or time) gives,
and taken away; resonances are levelled; wind is held down by the gain of spectral subtraction, for wind of that speed.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import scipy.ndimage
import scipy.signal
from numba import njit

from ...framework.core.recording.types import SoundBlock, SoundStream
from ..features import RATE_HZ, resample
from .drive_spectra import BLOCK_S, Speeds
from .line_fit import NOISE_BINS
from .resonances import ResonanceFinding
from .wind import WindModel

_PIECE_S = 0.5
_RUN_PIECES = 16
_MARGIN_S = 1.0
_STEP = 128
_TRACK_S = 0.6
"""Length of the Hann window that a line's amplitude is averaged over [s]: it may change that fast, and lines 3 Hz
away stay."""
_FFT = 1024
_LEAST_GAIN = 0.03
_LEAST_APART_HZ = 6.0


@dataclass(frozen=True)
class TrackedLine:
    """Lines to take away.

    Parameters
    ----------
    place
        Multiple of the wheel's turns [-], or frequency [Hz].
    turns
        Whether it is the former.
    multiples, excess : (k,)
        Ascending whole multiples of it that are lines, and the excess of each over a bin's noise [-].
    """

    place: float
    turns: bool
    multiples: tuple[int, ...]
    excess: tuple[float, ...]


@dataclass(frozen=True)
class Subtraction:
    """All that is taken away."""

    lines: tuple[TrackedLine, ...] = ()
    wind: WindModel | None = None
    resonances: tuple[ResonanceFinding, ...] = ()

    def __bool__(self) -> bool:
        return bool(self.lines or self.wind or self.resonances)

    def apply(self, samples: np.ndarray, start_s: float, speeds: Speeds) -> np.ndarray:
        """Clean sound (m,) at `RATE_HZ` whose first sample is at `start_s` [s]: (m,) float32."""
        clean = samples.astype(np.float32, copy=True)
        if self.lines:
            turned = speeds.angle(start_s, samples.size, RATE_HZ)
            clock = 2.0 * np.pi * np.arange(samples.size) / RATE_HZ
            for line in self.lines:
                clean -= _tracked(clean, line, turned if line.turns else clock)
        if self.wind is not None or self.resonances:
            clean = self._levelled(clean, start_s, speeds)
        return clean

    def _levelled(self, samples: np.ndarray, start_s: float, speeds: Speeds) -> np.ndarray:
        """Short-time spectra times the gains of wind and resonances, put together again."""
        if samples.size < _FFT:
            return samples
        hz, at, spectra = scipy.signal.stft(samples, RATE_HZ, nperseg=_FFT, noverlap=3 * _FFT // 4)
        gain = np.ones((hz.size, 1))
        for hump in self.resonances:
            gain = gain / np.sqrt(hump.power_ratio(hz))[:, None]
        if self.wind is not None:
            gain = gain * _wiener(spectra, self.wind.power(hz, speeds.travel(start_s + at)).T)
        return scipy.signal.istft(spectra * gain, RATE_HZ, nperseg=_FFT, noverlap=3 * _FFT // 4)[1][
            : samples.size
        ].astype(np.float32)


def _wiener(spectra: np.ndarray, wind: np.ndarray) -> np.ndarray:
    """Gain (k, t) for spectra (k, t) with wind of power density (k, t) [1/Hz], smoothed over time against warbling."""
    # scipy's stft divides by the window's sum: a density follows with the window's noise bandwidth, one-sided.
    window = np.asarray(scipy.signal.get_window("hann", _FFT))
    density = 2.0 * np.abs(spectra) ** 2 * window.sum() ** 2 / (RATE_HZ * np.sum(window**2))
    density = scipy.ndimage.uniform_filter1d(density, 15, axis=1, mode="nearest")
    return np.sqrt(np.clip(1.0 - wind / np.maximum(density, 1e-20), _LEAST_GAIN**2, 1.0))


def _tracked(samples: np.ndarray, line: TrackedLine, angle: np.ndarray) -> np.ndarray:
    """The line's part of the sound (m,): brought to zero frequency, averaged over `_TRACK_S`, and brought back."""
    count = samples.size // _STEP
    if count < 8:
        return np.zeros_like(samples)
    phase = np.exp(1j * (line.place * angle % (2.0 * np.pi)))
    multiple = np.array(line.multiples)
    slow = _brought_down(samples, phase, multiple, _STEP)
    width = min(round(_TRACK_S * RATE_HZ / _STEP) | 1, (count - 1) | 1)
    window = np.hanning(width + 2)[1:-1]
    norm = np.convolve(np.ones(count), window, mode="same")
    slow = scipy.ndimage.convolve1d(slow, window, axis=1, mode="constant") / norm
    # Of what is tracked, noise of this bandwidth is a part: only the line's share is taken away.
    bandwidth = RATE_HZ / _STEP * float(np.sum(window**2) / window.sum() ** 2)
    power = np.array(line.excess) * NOISE_BINS / BLOCK_S / bandwidth
    slow *= (2.0 * power / (1.0 + power))[:, None]
    if multiple.size > 1:
        # Where the teeth of a comb are closer than the window resolves, each would take its neighbours' part as well.
        apart_hz = np.abs(np.gradient(angle))[_STEP // 2 :: _STEP][:count] * line.place * RATE_HZ / (2.0 * np.pi)
        slow *= np.clip((apart_hz - 0.5 * _LEAST_APART_HZ) / (0.5 * _LEAST_APART_HZ), 0.0, 1.0)
    return _brought_back(slow, phase, multiple, _STEP)


@njit(cache=True)
def _brought_down(samples, phase, multiple, step):  # pragma: no cover
    """Means over `step` samples of samples (m,) times the conjugate powers of phase (m,): (k, m // step) complex."""
    count = samples.size // step
    answer = np.zeros((multiple.size, count), dtype=np.complex128)
    for block in range(count):
        for at in range(block * step, (block + 1) * step):
            turn = phase[at].conjugate()
            power, reached = 1.0 + 0.0j, 0
            for index in range(multiple.size):
                while reached < multiple[index]:
                    power *= turn
                    reached += 1
                answer[index, block] += samples[at] * power
    return answer / step


@njit(cache=True)
def _brought_back(slow, phase, multiple, step):  # pragma: no cover
    """Sum over lines of the real part of slow (k, n), interpolated linearly, times powers of phase (m,): float32."""
    answer = np.zeros(phase.size, dtype=np.float32)
    last = slow.shape[1] - 1
    for at in range(phase.size):
        place = (at + 0.5) / step - 0.5
        left = min(max(int(np.floor(place)), 0), last - 1)
        share = min(max(place - left, 0.0), 1.0)
        power, reached, total = 1.0 + 0.0j, 0, 0.0
        for index in range(multiple.size):
            while reached < multiple[index]:
                power *= phase[at]
                reached += 1
            own = slow[index, left] * (1.0 - share) + slow[index, left + 1] * share
            total += own.real * power.real - own.imag * power.imag
        answer[at] = total
    return answer


@dataclass(frozen=True)
class CleanedSound:
    """A `SoundStream` at `RATE_HZ` of another stream's sound, cleaned as it is read."""

    recorded: SoundStream
    speeds: Speeds
    subtraction: Subtraction

    @property
    def sample_rate(self) -> int:
        """Samples a second [Hz]."""
        return RATE_HZ

    @property
    def start_s(self) -> float:
        """Time of the first sample [s]."""
        return self.recorded.start_s

    @property
    def duration_s(self) -> float:
        """Length of what is readable [s]."""
        return self.recorded.duration_s

    def blocks(self, block_s: float, hop_s: float) -> Iterator[SoundBlock]:
        """Yield cleaned blocks of `block_s` seconds, `hop_s` apart; one that holds a gap has its problem instead."""
        length, hop = round(block_s * RATE_HZ), round(hop_s * RATE_HZ)
        ready, begin, problem, problem_end = np.zeros(0, np.float32), self.start_s, "", -np.inf
        for start_s, samples, trouble in self._cleaned():
            if samples is None:
                samples = np.zeros(round(_PIECE_S * RATE_HZ), np.float32)
                problem, problem_end = trouble, start_s + _PIECE_S
            ready = np.concatenate([ready, samples])
            while ready.size >= length:
                bad = begin < problem_end - 1e-6 and problem
                yield SoundBlock(begin, None, problem) if bad else SoundBlock(begin, ready[:length].copy())
                ready, begin = ready[hop:], begin + hop / RATE_HZ

    def _cleaned(self) -> Iterator[tuple[float, np.ndarray | None, str]]:
        """Runs of unbroken sound, cleaned with a second of their neighbours for context, and gaps."""
        before, run = [], []
        for block in self.recorded.blocks(_PIECE_S, _PIECE_S):
            if block.samples is None:
                yield from self._flush(before, run, 0)
                before, run = [], []
                yield block.start_s, None, block.problem or "sound could not be read"
                continue
            run.append(block)
            keep = round(_MARGIN_S / _PIECE_S)
            if len(run) >= _RUN_PIECES + keep:
                yield from self._flush(before, run, keep)
                before, run = run[-2 * keep : -keep], run[-keep:]
        yield from self._flush(before, run, 0)

    def _flush(
        self, before: list[SoundBlock], run: list[SoundBlock], after: int
    ) -> Iterator[tuple[float, np.ndarray | None, str]]:
        if len(run) <= after:
            return
        pieces = [block.samples for block in before + run if block.samples is not None]
        samples = resample(np.concatenate(pieces), self.recorded.sample_rate)
        start_s = (before + run)[0].start_s
        clean = self.subtraction.apply(samples, start_s, self.speeds)
        piece = round(_PIECE_S * RATE_HZ)
        yield run[0].start_s, clean[len(before) * piece : (len(before) + len(run) - after) * piece], ""
