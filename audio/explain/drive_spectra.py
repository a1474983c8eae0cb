"""The spectra of a drive, block by block: as they are, along the wheel's angle, of the envelope, and in bands.

Lines that follow the wheel stand still once time is replaced by the wheel's angle (computed order tracking: Fyfe and
Munck 1997, doi:10.1006/mssp.1996.0056), those that do not smear out; so every block is transformed twice, over time
and over angle. Both spectra are divided by the smooth spectrum around each line, after which noise of any colour and
loudness has the mean 1, and blocks of different speed and ground can be averaged.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import scipy.fft
from scipy.ndimage import map_coordinates

from ...framework.core.errors import InputError
from ...framework.core.recording.types import SoundBlock, SoundStream
from ..features import RATE_HZ, resample
from ..quality import SILENT_RMS

STRETCH_S = 8.0
"""Sound is read, and held out, in stretches of this length [s]."""
BLOCK_S = 1.0
"""Length of one block [s]: a line is resolved to 1 Hz, and few vehicles change speed much within it."""
HOP_S = 0.5
TOP_HZ = 5000.0
"""Lines are looked for up to here [Hz]."""
LOW_HZ = 20.0
"""Lines and bands begin here [Hz]: below, microphones hear little but handling."""
ENVELOPE_S = 4.0
"""Length of one piece of envelope [s]."""
ENVELOPE_RATE_HZ = 250.0
LONGEST_S = 600.0
"""Longer drives are thinned to this much sound, stretches evenly spread [s]: more changes no answer but its time."""
LEAST_RATE_HZ = 1000.0
"""Sound sampled more slowly holds too little of any ground to look for more in it [Hz]."""
_FLAT_SHARE = 0.9
"""Resampling, like the filters of recorders, leaves the spectrum as it is up to this share of half the rate [-]."""
_COARSEST_STEP = 2.0**-7
"""Step of an 8-bit recorder, the coarsest there is [-]."""
_GROUP = 16
_ENVELOPE_GROUP = 8
_BANDS_PER_OCTAVE = 24
_HIGHEST_BAND_HZ = 7000.0


@dataclass(frozen=True)
class Speeds:
    """Speeds of the drive on the recording's clock: time_s [s], wheel_rad_s [rad/s] and travel_m_s [m/s], each (n,)."""

    time_s: np.ndarray
    wheel_rad_s: np.ndarray
    travel_m_s: np.ndarray

    @staticmethod
    def of(time_s: np.ndarray, wheel_speed_rad_s: np.ndarray, travel_speed_m_s: np.ndarray) -> Speeds:
        """Check the channels (n,) and drop rows that were not observed; reversing counts as driving.

        Raises
        ------
        InputError
            Shapes differ, time runs backwards, or fewer than two rows hold both speeds.
        """
        time, wheel, travel = (np.asarray(x, dtype=float) for x in (time_s, wheel_speed_rad_s, travel_speed_m_s))
        if not (time.ndim == 1 and time.shape == wheel.shape == travel.shape):
            raise InputError(
                "wheel table", f"channels of shapes {time.shape}, {wheel.shape}, {travel.shape}",
                expected="time_s, wheel_speed_rad_s and travel_speed_m_s of one length",
            )  # fmt: skip
        whole = np.isfinite(time) & np.isfinite(wheel) & np.isfinite(travel)
        time, wheel, travel = time[whole], np.abs(wheel[whole]), np.abs(travel[whole])
        if time.size < 2:
            raise InputError(
                "wheel table", f"{time.size} rows with both speeds", expected="at least 2 to explain sound"
            )
        back = np.flatnonzero(np.diff(time) < 0)
        if back.size:
            raise InputError(
                "wheel table", f"time runs backwards at {time[back[0] + 1]:g} s", expected="time that does not decrease"
            )
        fresh = np.concatenate([[True], np.diff(time) > 0])
        return Speeds(time[fresh], wheel[fresh], travel[fresh])

    def wheel(self, time_s: np.ndarray) -> np.ndarray:
        """Wheel speed at times [rad/s]."""
        return np.interp(time_s, self.time_s, self.wheel_rad_s)

    def travel(self, time_s: np.ndarray) -> np.ndarray:
        """Travel speed at times [m/s]."""
        return np.interp(time_s, self.time_s, self.travel_m_s)

    def covers(self, start_s: float, end_s: float) -> bool:
        """Whether speeds were recorded from `start_s` to `end_s` [s]; half a second is bridged at the ends."""
        return self.time_s[0] <= start_s + 0.5 and self.time_s[-1] >= end_s - 0.5

    def angle(self, start_s: float, count: int, rate_hz: float) -> np.ndarray:
        """Wheel angle (count,) at samples from `start_s` on, from 0 [rad]: the trapezoid of the interpolated speed."""
        speed = self.wheel(start_s + np.arange(count) / rate_hz)
        return np.concatenate([[0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]))]) / rate_hz


@dataclass(frozen=True)
class DriveSpectra:
    """What is known of the sound of a drive, n blocks and m pieces of envelope in s stretches.

    Parameters
    ----------
    stretch, envelope_stretch : (n,), (m,)
        Number of the stretch each belongs to.
    start_s : (n,)
        Start of the blocks [s].
    shaft_hz, envelope_shaft_hz : (n,), (m,)
        Turns of the wheel a second.
    travel_m_s : (n,)
        Mean travel speed [m/s].
    fixed, turned : (n, k)
        Whitened spectra over time and over angle, mean 1 where there is noise only; bin j lies at j / BLOCK_S [Hz].
        They end where the recorder heard no more; NaN where the wheel's speed varied too much to say that of a bin.
    envelope : (m, q)
        Whitened spectra of the envelope over angle; bin j lies at j / ENVELOPE_S [Hz].
    band_hz : (b,)
        Middle of the bands, 24 an octave, as far as the recorder heard [Hz].
    band_power : (n, b)
        Power density in them [1/Hz of full scale squared]: the geometric mean over bins, which lines hardly move.
    skipped
        What was left out, in words.
    """

    stretch: np.ndarray
    start_s: np.ndarray
    shaft_hz: np.ndarray
    travel_m_s: np.ndarray
    fixed: np.ndarray
    turned: np.ndarray
    envelope: np.ndarray
    envelope_stretch: np.ndarray
    envelope_shaft_hz: np.ndarray
    band_hz: np.ndarray
    band_power: np.ndarray
    skipped: tuple[str, ...]

    @property
    def top_hz(self) -> float:
        """The highest frequency that lines are looked for at: `TOP_HZ`, or what the recorder heard [Hz]."""
        return (self.fixed.shape[1] - 1) / BLOCK_S

    @property
    def stretches(self) -> np.ndarray:
        """Numbers of the stretches that hold blocks."""
        return np.unique(self.stretch)


def stretches_of(sound: SoundStream) -> Iterator[SoundBlock]:
    """Yield the sound in stretches of `STRETCH_S` at `RATE_HZ`, those that could not be read as None."""
    for block in sound.blocks(STRETCH_S, STRETCH_S):
        if block.samples is None or not np.isfinite(block.samples).all():
            yield SoundBlock(block.start_s, None, block.problem or "samples that are no numbers")
        else:
            yield SoundBlock(block.start_s, resample(_centred(block.samples), sound.sample_rate))


def observed_hz(rate_hz: float) -> float:
    """Up to where sound sampled at `rate_hz` [Hz] holds what there was, once it is at `RATE_HZ` [Hz]."""
    return _FLAT_SHARE * 0.5 * min(rate_hz, RATE_HZ)


def _centred(samples: np.ndarray) -> np.ndarray:
    """Samples (m,) about their mean, zeros where they only rest on a level, or flicker by one step of the recorder."""
    low, high = samples.min(), samples.max()
    if high - low <= _COARSEST_STEP and ((samples == low) | (samples == high)).all():
        return np.zeros_like(samples)
    # A constant level is no sound, but its rounding errors would be lines.
    return samples - samples.mean(dtype=np.float64).astype(samples.dtype)


def drive_spectra(sound: SoundStream, speeds: Speeds) -> DriveSpectra:
    """Transform the sound of a drive.

    Raises
    ------
    InputError
        No stretch holds both sound and speeds, or sound is sampled too slowly.
    """
    heard_hz = observed_hz(sound.sample_rate)
    if sound.sample_rate < LEAST_RATE_HZ:
        raise InputError(
            "sound", f"sampled at {sound.sample_rate:g} Hz: nothing above {heard_hz:g} Hz was observed",
            expected=f"{LEAST_RATE_HZ:g} Hz or more",
        )  # fmt: skip
    total = max(int(sound.duration_s // STRETCH_S), 1)
    keep = np.unique(np.linspace(0, total - 1, min(total, int(LONGEST_S // STRETCH_S))).astype(int))
    skipped: dict[str, int] = {}
    parts = []
    for number, block in enumerate(stretches_of(sound)):
        problem = block.problem
        if number < total and number not in keep:
            problem = f"thinned: {LONGEST_S:g} s of sound are enough"
        elif block.samples is not None and not speeds.covers(block.start_s, block.start_s + STRETCH_S):
            problem = "no wheel speed recorded"
        if problem or block.samples is None:
            skipped[problem or "unread"] = skipped.get(problem or "unread", 0) + 1
            continue
        part = _stretch(block.samples, block.start_s, speeds, heard_hz)
        if part is None:
            skipped["silent"] = skipped.get("silent", 0) + 1
        else:
            parts.append(part)
    words = tuple(f"{count} stretches of {STRETCH_S:g} s left out: {why}" for why, count in skipped.items())
    if not parts:
        raise InputError(
            "sound", "; ".join(words) or f"{sound.duration_s:g} s long",
            expected=f"at least {STRETCH_S:g} s of sound while the wheel's speeds were recorded",
        )  # fmt: skip
    if heard_hz < _HIGHEST_BAND_HZ:
        words = (f"sampled at {sound.sample_rate:g} Hz: nothing above {heard_hz:g} Hz was observed", *words)
    blocks = [p["start"].size for p in parts]
    pieces = [p["envelope_shaft"].size for p in parts]
    joined = {name: np.concatenate([p[name] for p in parts]) for name in parts[0]}
    return DriveSpectra(
        np.repeat(np.arange(len(parts)), blocks), joined["start"], joined["shaft"], joined["travel"], joined["fixed"],
        joined["turned"], joined["envelope"], np.repeat(np.arange(len(parts)), pieces), joined["envelope_shaft"],
        _bands(heard_hz)[0], joined["bands"], words,
    )  # fmt: skip


def _stretch(samples: np.ndarray, start_s: float, speeds: Speeds, heard_hz: float) -> dict[str, np.ndarray] | None:
    length, hop = round(BLOCK_S * RATE_HZ), round(HOP_S * RATE_HZ)
    first = np.arange(0, samples.size - length + 1, hop)
    blocks = np.lib.stride_tricks.sliding_window_view(samples, length)[first]
    power = _periodograms(blocks)
    loud = _is_loud(power, heard_hz)
    if not loud.any():
        return None
    first, power = first[loud], power[loud]
    angle = speeds.angle(start_s, samples.size, RATE_HZ)
    turned = np.stack([_turned(samples, angle, at, length) for at in first])
    middle = start_s + (first + length / 2) / RATE_HZ
    top = int(min(TOP_HZ, heard_hz) * BLOCK_S) + 1
    turned = whitened(_periodograms(turned)[:, :top], _GROUP)
    for row, at in zip(turned, first, strict=True):
        row[_last_turned(angle[at : at + length], heard_hz) + 1 :] = np.nan
    envelope, envelope_shaft = _envelopes(samples, angle)
    return {
        "start": start_s + first / RATE_HZ,
        # From the first sample to the last there is one step less than samples.
        "shaft": (angle[first + length - 1] - angle[first]) * RATE_HZ / (2 * np.pi * (length - 1)),
        "travel": speeds.travel(middle),
        "fixed": whitened(power[:, :top], _GROUP),
        "turned": turned,
        "bands": _band_power(power, heard_hz),
        "envelope": envelope,
        "envelope_shaft": envelope_shaft,
    }


def _is_loud(power: np.ndarray, heard_hz: float) -> np.ndarray:
    """Whether blocks (n,) of spectra (n, k) hold sound from `LOW_HZ` to `heard_hz`: a level, or its drift, is none."""
    heard = power[:, round(LOW_HZ * BLOCK_S) : int(heard_hz * BLOCK_S) + 1]
    return np.sqrt(heard.sum(axis=1) / BLOCK_S) > SILENT_RMS


def _last_turned(angle: np.ndarray, heard_hz: float) -> int:
    """The last bin over angle (length,) that was observed all through the block, whatever the wheel's speed in it."""
    fastest = float(np.max(np.diff(angle))) * (angle.size - 1)
    share = (angle[-1] - angle[0]) / fastest if fastest > 0.0 else 1.0
    last = int(heard_hz * share * BLOCK_S)
    # Where the wheel's speed varies, the smooth spectrum around the last bins is of what was not observed.
    return last if share > 0.999 else max(last - 2 * _GROUP, 0)


def reference_level(sound: SoundStream) -> np.ndarray:
    """Mean log level of contact sound known to be clean, in the bands of `DriveSpectra` that it was heard in (b,) [ln].

    Raises
    ------
    InputError
        It holds no second of sound.
    """
    length, heard_hz = round(BLOCK_S * RATE_HZ), observed_hz(sound.sample_rate)
    total, count = np.zeros(_bands(heard_hz)[0].size), 0
    for block in sound.blocks(BLOCK_S, BLOCK_S):
        samples = None if block.samples is None else resample(_centred(block.samples), sound.sample_rate)[:length]
        if samples is None or samples.size < length:
            continue
        power = _periodograms(samples[None])
        if _is_loud(power, heard_hz)[0]:
            total += np.log(_band_power(power, heard_hz)[0])
            count += 1
    if count == 0:
        raise InputError("reference sound", f"{sound.duration_s:g} s, none of it louder than silence", expected="1 s")
    return total / count


def _band_power(power: np.ndarray, heard_hz: float) -> np.ndarray:
    """Geometric means (n, b) of spectra (n, k) over the bands: a line counts as one bin of many, not by its power."""
    return np.exp(np.log(power + np.float32(1e-18)) @ _bands(heard_hz)[1] + np.float32(np.euler_gamma))


def _periodograms(blocks: np.ndarray) -> np.ndarray:
    """Power spectra (n, m // 2 + 1) of blocks (n, m), Hann window, density [1/Hz]."""
    taper = np.hanning(blocks.shape[1] + 1)[:-1].astype(np.float32)
    scale = 2.0 / (RATE_HZ * float(np.sum(taper**2)))
    spectra: np.ndarray = np.asarray(scipy.fft.rfft(blocks * taper, axis=1))
    return np.float32(scale) * np.square(np.abs(spectra))


def _turned(samples: np.ndarray, angle: np.ndarray, first: int, length: int) -> np.ndarray:
    """One block (length,) resampled to equal steps of wheel angle; as it is where the wheel hardly changes speed."""
    own = angle[first : first + length]
    even = np.linspace(own[0], own[-1], length)
    # The warp shifts a line at 1 kHz by less than a sixth of a turn: nothing to gain.
    if own[-1] - own[0] < 1e-6 or np.max(np.abs(own - even)) * length < 1.5e-4 * (own[-1] - own[0]) * length:
        return samples[first : first + length]
    where = np.interp(even, own, np.arange(first, first + length, dtype=float))
    return map_coordinates(samples, where[None], order=3, mode="nearest", prefilter=True, output=np.float32)


def _envelopes(samples: np.ndarray, angle: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Whitened envelope spectra over angle (m, q) of half-overlapping pieces, and the wheel's turns a second (m,)."""
    step = round(RATE_HZ / ENVELOPE_RATE_HZ)
    # The difference of samples weighs high frequencies, where blows are short and rumble is not.
    strength = np.square(np.diff(samples, prepend=samples[:1])).reshape(-1, step).mean(axis=1)
    level = np.log(strength + 1e-3 * strength.mean() + 1e-20)
    turns = angle[step // 2 :: step]
    length = round(ENVELOPE_S * ENVELOPE_RATE_HZ)
    pieces, shaft = [], []
    for first in range(0, level.size - length + 1, length // 2):
        own, piece = turns[first : first + length], level[first : first + length]
        even = np.linspace(own[0], own[-1], length)
        if own[-1] - own[0] > 1e-6:
            piece = np.interp(np.interp(even, own, np.arange(length)), np.arange(length), piece)
        pieces.append(piece - piece.mean())
        shaft.append((own[-1] - own[0]) * ENVELOPE_RATE_HZ / (2 * np.pi * (length - 1)))
    power = np.square(np.abs(np.asarray(scipy.fft.rfft(np.array(pieces) * np.hanning(length), axis=1))))
    return whitened(power.astype(np.float32)[:, : length // 2], _ENVELOPE_GROUP), np.array(shaft)


def whitened(power: np.ndarray, group: int) -> np.ndarray:
    """Divide power spectra (n, k) by the smooth spectrum around each bin: (n, k) float32, mean 1 under noise.

    The smooth spectrum is the median over groups of `group` bins, of three neighbours the middle one, joined
    log-linearly; a line that stands in a group does not move it.
    """
    count = power.shape[1] // group
    medians = np.median(power[:, : count * group].reshape(len(power), count, group), axis=2) / np.log(2.0)
    medians = np.log(np.maximum(medians, 1e-30))
    calm = medians.copy()
    calm[:, 1:-1] = np.median(np.stack([medians[:, :-2], medians[:, 1:-1], medians[:, 2:]]), axis=0)
    place = (np.arange(power.shape[1]) + 0.5) / group - 0.5
    left = np.clip(np.floor(place).astype(int), 0, count - 2)
    share = np.clip(place - left, 0.0, 1.0)
    smooth = calm[:, left] * (1.0 - share) + calm[:, left + 1] * share
    return (power / np.exp(smooth)).astype(np.float32)


@lru_cache(maxsize=8)
def _bands(heard_hz: float) -> tuple[np.ndarray, np.ndarray]:
    """Middles (b,) [Hz] of the bands that end below `heard_hz`, and the matrix (k, b) that takes spectra' means."""
    count = int(np.log2(_HIGHEST_BAND_HZ / LOW_HZ) * _BANDS_PER_OCTAVE)
    middle = LOW_HZ * 2.0 ** ((np.arange(count) + 0.5) / _BANDS_PER_OCTAVE)
    frequency = np.arange(round(RATE_HZ * BLOCK_S / 2) + 1) / BLOCK_S
    # Bands narrower than a bin share it: a triangle at least one bin wide.
    half = np.maximum(middle * (2 ** (0.5 / _BANDS_PER_OCTAVE) - 1.0), 0.5 / BLOCK_S) + 0.5 / BLOCK_S
    whole = middle + half <= heard_hz
    middle, half = middle[whole], half[whole]
    weight = np.clip((half - np.abs(frequency[:, None] - middle)) * BLOCK_S, 0.0, 1.0).astype(np.float32)
    return middle, weight / weight.sum(axis=0)
