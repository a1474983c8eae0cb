"""The sound of a wheel on ground: grains that strike and ring, rubbing that hisses, and the drive's whine.

A wheel strikes grains at a rate proportional to its speed, as a Poisson process along the way; each strike rings in one
of a few damped resonances (Gaver 1993, "How do we hear in the world?", impact and scraping sounds). What each terrain
sounds like is chosen by ear and spectrogram, not measured.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy import signal

_SPEED_FLOOR_M_S = 0.02
_RESONANCES = 9


@dataclass(frozen=True)
class Strikes:
    """Grains that ring when the wheel strikes them.

    Parameters
    ----------
    per_m
        How many lie along a metre [1/m].
    frequency_Hz, octaves
        Middle of the resonances and their standard deviation in octaves.
    decay_s
        Time constant of the ringing [s].
    level
        Root mean square at 1 m/s [-].
    tail
        Standard deviation of the logarithm of the strikes' amplitude: how rare and loud the loudest are.
    glide
        Octaves by which a resonance falls while it rings: suction and release in wet ground.
    """

    per_m: float
    frequency_Hz: float
    octaves: float
    decay_s: float
    level: float
    tail: float = 0.6
    glide: float = 0.0


@dataclass(frozen=True)
class Rubbing:
    """Noise between two frequencies [Hz] of root mean square `level` at 1 m/s, swelling `flutter` times a metre."""

    low_Hz: float
    high_Hz: float
    level: float
    flutter: float = 0.0


@dataclass(frozen=True)
class Voice:
    """What one terrain class sounds like; `tread_per_m` ribs hum where the ground is hard."""

    strikes: tuple[Strikes, ...]
    rubbing: tuple[Rubbing, ...]
    tread_per_m: float = 0.0
    tread_level: float = 0.0


VOICES: dict[str, Voice] = {
    "sand": Voice((Strikes(900.0, 5200.0, 0.5, 0.0006, 0.010, 0.4),), (Rubbing(1800.0, 7500.0, 0.026, 2.0),)),
    "loam": Voice(
        (Strikes(60.0, 420.0, 0.5, 0.010, 0.026, 0.8), Strikes(220.0, 1500.0, 0.5, 0.002, 0.009)),
        (Rubbing(250.0, 1800.0, 0.016, 3.0),),
    ),
    "gravel": Voice(
        (Strikes(140.0, 2600.0, 0.45, 0.0035, 0.050, 0.9), Strikes(45.0, 800.0, 0.4, 0.007, 0.026, 0.8)),
        (Rubbing(900.0, 5000.0, 0.012, 5.0),),
    ),
    "grass": Voice(
        (Strikes(120.0, 6000.0, 0.4, 0.0009, 0.006, 0.6),),
        (Rubbing(3200.0, 9800.0, 0.024, 9.0), Rubbing(150.0, 600.0, 0.010, 2.0)),
    ),
    "clay": Voice(
        (Strikes(16.0, 180.0, 0.35, 0.030, 0.034, 0.6, 0.8), Strikes(30.0, 650.0, 0.4, 0.006, 0.010, 0.8, -0.6)),
        (Rubbing(60.0, 450.0, 0.014, 2.0),),
    ),
    "asphalt": Voice((Strikes(260.0, 1900.0, 0.5, 0.0012, 0.007, 0.5),), (Rubbing(300.0, 1400.0, 0.020),), 26.0, 0.012),
}
"""By class name."""


def contact_sound(
    terrain: str,
    speed_m_s: np.ndarray,
    rate_Hz: int,
    rng: np.random.Generator,
    *,
    site: np.random.Generator | None = None,
) -> np.ndarray:
    """Synthesise the contact sound of a wheel on one site of a class.

    Parameters
    ----------
    terrain
        One of `VOICES`.
    speed_m_s : (m,)
        Travel speed at each sample [m/s].
    rate_Hz
        Samples a second.
    rng
        Source of randomness.
    site
        What draws the site: tuning, density of the grains and loudness. Generators of one seed are one site; `rng`
        where absent.

    Returns
    -------
    (m,) float32
        Full scale is 1; loud strikes may pass it.
    """
    voice = VOICES[terrain]
    site = rng if site is None else site
    tune, loud = math.exp(site.normal(0.0, 0.14)), math.exp(site.normal(0.0, 0.18))
    speed = np.maximum(speed_m_s, _SPEED_FLOOR_M_S).astype(np.float64)
    way = np.cumsum(speed) / rate_Hz
    sound = np.zeros(len(speed), dtype=np.float32)
    for part in voice.strikes:
        sound += _struck(part, tune * math.exp(site.normal(0.0, 0.08)), speed, way, rate_Hz, rng, site)
    for part in voice.rubbing:
        sound += _rubbed(part, tune * math.exp(site.normal(0.0, 0.08)), speed, way, rate_Hz, rng)
    if voice.tread_level:
        phase = 2.0 * np.pi * voice.tread_per_m * tune * way
        hum = np.sin(phase) + 0.5 * np.sin(2.0 * phase + 1.0) + 0.25 * np.sin(3.0 * phase + 2.0)
        sound += (voice.tread_level * speed**0.9 * hum).astype(np.float32)
    return loud * sound


def _struck(
    part: Strikes,
    tune: float,
    speed: np.ndarray,
    way: np.ndarray,
    rate: int,
    rng: np.random.Generator,
    site: np.random.Generator,
) -> np.ndarray:
    per_m = part.per_m * math.exp(site.normal(0.0, 0.2))
    count = rng.poisson(per_m * way[-1])
    where = np.searchsorted(way, rng.uniform(0.0, way[-1], count)).clip(0, len(way) - 1)
    # A kernel of unit energy struck per_m * v times a second with amplitude a has power per_m v a^2 / rate.
    amplitude = np.exp(rng.normal(0.0, part.tail, count) - part.tail**2) * part.level * math.sqrt(rate / per_m)
    amplitude *= speed[where] ** 0.4 * rng.choice([-1.0, 1.0], count)
    which = rng.integers(0, _RESONANCES, count)
    sound = np.zeros(len(speed), dtype=np.float32)
    for index in range(_RESONANCES):
        own = which == index
        train = np.bincount(where[own], weights=amplitude[own], minlength=len(speed)).astype(np.float32)
        frequency = part.frequency_Hz * tune * 2.0 ** (part.octaves * site.normal())
        sound += signal.oaconvolve(train, _ringing(part, min(frequency, 0.42 * rate), rate))[: len(speed)]
    return sound


def _ringing(part: Strikes, frequency: float, rate: int) -> np.ndarray:
    time = np.arange(max(8, int(6.0 * part.decay_s * rate))) / rate
    swept = frequency * 2.0 ** (-part.glide * np.minimum(time / (2.0 * part.decay_s), 1.0))
    attack = -np.expm1(-time / (0.15 * part.decay_s))
    kernel = attack * np.exp(-time / part.decay_s) * np.sin(2.0 * np.pi * np.cumsum(swept) / rate)
    return (kernel / np.linalg.norm(kernel)).astype(np.float32)


def _rubbed(
    part: Rubbing, tune: float, speed: np.ndarray, way: np.ndarray, rate: int, rng: np.random.Generator
) -> np.ndarray:
    noise = band_of_noise(len(speed), part.low_Hz * tune, min(part.high_Hz * tune, 0.45 * rate), rate, rng)
    envelope = part.level * speed**0.8
    if part.flutter:
        knots = int(way[-1] * part.flutter) + 3
        swell = np.exp(0.35 * rng.standard_normal(knots) - 0.06)
        envelope = envelope * np.interp(way * part.flutter, np.arange(knots), swell)
    return (noise * envelope).astype(np.float32)


def band_of_noise(count: int, low_Hz: float, high_Hz: float, rate: int, rng: np.random.Generator) -> np.ndarray:
    """Noise between two frequencies [Hz], of root mean square 1: (count,) float32."""
    sections = np.asarray(signal.butter(2, [low_Hz, high_Hz], "bandpass", fs=rate, output="sos"), dtype=np.float32)
    lead = int(0.2 * rate)
    noise = np.asarray(signal.sosfilt(sections, rng.standard_normal(count + lead, dtype=np.float32)))[lead:]
    return (noise / math.sqrt(2.0 * (high_Hz - low_Hz) / rate)).astype(np.float32)


def motor_whine(wheel_speed_rad_s: np.ndarray, rate_Hz: int, rng: np.random.Generator) -> np.ndarray:
    """Whine of the drive, (m,) float32: harmonics of the wheel's speed times its gear, louder when it turns faster."""
    mesh = 170.0 * math.exp(rng.normal(0.0, 0.05))
    phase = np.cumsum(wheel_speed_rad_s) * (mesh / rate_Hz)
    level = 0.0016 * np.sqrt(np.abs(wheel_speed_rad_s))
    gains = np.array([1.0, 0.6, 0.35, 0.0, 0.2]) * np.exp(rng.normal(0.0, 0.3, 5))
    whine = sum(gain * np.sin(k * phase + k) for k, gain in enumerate(gains, start=1) if gain)
    return (level * whine).astype(np.float32)


def wind(count: int, rate_Hz: int, rng: np.random.Generator) -> np.ndarray:
    """Wind on the microphone, (count,) float32: gusts of noise below some 150 Hz, loud enough to clip at times."""
    rumble = band_of_noise(count, 12.0, 140.0, rate_Hz, rng) + 0.12 * band_of_noise(count, 140.0, 900.0, rate_Hz, rng)
    knots = int(count / rate_Hz / 0.5) + 3
    gust = np.exp(0.5 * rng.standard_normal(knots))
    envelope = np.interp(np.arange(count) / (0.5 * rate_Hz), np.arange(knots), gust)
    return (0.30 * envelope * rumble).astype(np.float32)


def engine(count: int, rate_Hz: int, rng: np.random.Generator) -> np.ndarray:
    """An engine nearby, (count,) float32: harmonics of a firing rate that wanders, and its broadband noise."""
    knots = int(count / rate_Hz) + 3
    firing = 31.0 + 1.5 * np.interp(np.arange(count) / rate_Hz, np.arange(knots), rng.standard_normal(knots))
    phase = 2.0 * np.pi * np.cumsum(firing) / rate_Hz
    sound = np.zeros(count)
    for k in range(1, 25):
        sound += k**-0.7 * math.exp(rng.normal(0.0, 0.4)) * np.sin(k * phase + rng.uniform(0.0, 6.3))
    sound *= 0.16 / max(float(sound.std()), 1e-9)
    return (sound + 0.05 * band_of_noise(count, 300.0, 4000.0, rate_Hz, rng)).astype(np.float32)
