"""Makes training sound varied as microphones, rooms and vehicles vary: without it a classifier learns the recordist.

Labelled contact sound comes from few sources, each with its own microphone, distance and background. What the copies
made here change is what differs from source to source (colour, room, band width, tempo, background noise), and what
they keep is what distinguishes grounds. The noises are synthetic and of the kinds that ride along on a
vehicle: broadband hiss, wind, the harmonic tones of an engine, the chopped noise of a rotor or fan, and rattle or rain.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import scipy.fft
import scipy.signal
import soxr

from .features import RATE_HZ, WINDOW_S

_WINDOW = round(WINDOW_S * RATE_HZ)


def _unit(noise: np.ndarray) -> np.ndarray:
    return noise / max(float(np.sqrt(np.mean(np.square(noise)))), 1e-12)


def coloured_noise(
    count: int, rng: np.random.Generator, slope: float, rate_hz: float = RATE_HZ, flat_below_hz: float = 20.0
) -> np.ndarray:
    """Gaussian noise (count,) of unit power whose power density falls as frequency to the power -slope."""
    size = int(scipy.fft.next_fast_len(count, True) or count)
    frequency = np.maximum(np.fft.rfftfreq(size, 1.0 / rate_hz), flat_below_hz)
    spectrum = rng.normal(size=(2, frequency.size)) * frequency ** (-slope / 2.0)
    return _unit(np.asarray(scipy.fft.irfft(spectrum[0] + 1j * spectrum[1], size))[:count])


def _slow(count: int, rng: np.random.Generator, knots: int, spread: float) -> np.ndarray:
    """A positive gain (count,) that wanders smoothly, log-normal with standard deviation `spread`."""
    return np.exp(np.interp(np.arange(count), np.linspace(0, count, knots), rng.normal(0, spread, knots)))


def broadband(count: int, rng: np.random.Generator) -> np.ndarray:
    """Hiss, tyres on a road, surf: coloured noise that comes and goes slowly."""
    return _unit(coloured_noise(count, rng, rng.uniform(-0.5, 1.5)) * _slow(count, rng, 4, rng.uniform(0, 0.5)))


def wind(count: int, rng: np.random.Generator) -> np.ndarray:
    """Wind on a microphone: low rumble whose strength fluctuates with the gusts."""
    return _unit(coloured_noise(count, rng, rng.uniform(1.5, 3.0)) * _slow(count, rng, 10, rng.uniform(0.4, 1.0)))


def engine(count: int, rng: np.random.Generator) -> np.ndarray:
    """Engine or motor: harmonics of a slowly varying speed, over some broadband noise."""
    speed = rng.uniform(20.0, 250.0) * _slow(count, rng, 4, 0.03)
    order = np.arange(1, 40)
    strength = rng.exponential(size=order.size) * order ** -rng.uniform(0.2, 1.3)
    phase = 2 * np.pi * np.cumsum(speed) / RATE_HZ
    tones = strength @ np.sin(order[:, None] * phase + rng.uniform(0, 2 * np.pi, (order.size, 1)))
    return _unit(_unit(tones) + rng.uniform(0.1, 0.8) * coloured_noise(count, rng, rng.uniform(0, 2)))


def rotor(count: int, rng: np.random.Generator) -> np.ndarray:
    """Blades, fans, single-cylinder engines: noise chopped at a steady rate."""
    beat = np.sin(np.pi * rng.uniform(8.0, 60.0) * np.arange(count) / RATE_HZ + rng.uniform(0, np.pi)) ** 2
    chopped = coloured_noise(count, rng, rng.uniform(0, 2)) * beat ** rng.uniform(1, 6)
    return _unit(_unit(chopped) + rng.uniform(0.05, 0.5) * coloured_noise(count, rng, rng.uniform(0, 2)))


def rattle(count: int, rng: np.random.Generator) -> np.ndarray:
    """Rain on the body, loose parts, crackle: short ringing impacts at random times."""
    train = np.zeros(count)
    hits = rng.integers(0, count, size=max(1, rng.poisson(10 ** rng.uniform(0.3, 2.8) * count / RATE_HZ)))
    np.add.at(train, hits, rng.normal(size=hits.size) * rng.exponential(size=hits.size))
    low = 10 ** rng.uniform(2.5, 3.5)
    band = scipy.signal.butter(1, [low, min(low * rng.uniform(1.5, 5), 7500)], "bandpass", fs=RATE_HZ, output="sos")
    return _unit(
        _unit(np.asarray(scipy.signal.sosfilt(band, train))) + rng.uniform(0.02, 0.5) * coloured_noise(count, rng, 0.5)
    )


NOISES: tuple[Callable[[int, np.random.Generator], np.ndarray], ...] = (broadband, wind, engine, rotor, rattle)
"""Kinds of background noise, each giving (count,) samples of unit power."""


def recolour(samples: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Filter sound (m,) as another microphone at another place would: a random smooth response, often band-limited."""
    size = int(scipy.fft.next_fast_len(samples.size, True) or samples.size)
    octave = np.log2(np.maximum(np.fft.rfftfreq(size, 1.0 / RATE_HZ), 40.0) / 1000.0)
    gain_dB = np.interp(octave, np.linspace(-4.7, 3.0, 10), rng.normal(0, 2.5, 10)) + rng.normal(0, 1.5) * octave
    if rng.random() < 0.15:
        gain_dB -= np.maximum(0.0, octave - np.log2(rng.uniform(2.5, 7.0))) * rng.uniform(20, 60)
    if rng.random() < 0.15:
        gain_dB -= np.maximum(0.0, np.log2(rng.uniform(0.08, 0.4)) - octave) * rng.uniform(6, 24)
    spectrum = np.asarray(scipy.fft.rfft(samples, size)) * 10 ** (gain_dB / 20)
    return np.asarray(scipy.fft.irfft(spectrum, size))[: samples.size]


def retime(samples: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Play sound (m,) up to 15 % slower or faster, pitch and all: another weight, another pace, (m',)."""
    return soxr.resample(samples, RATE_HZ, RATE_HZ * np.exp(rng.uniform(-0.15, 0.15)), quality="LQ")


def reverberate(samples: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Add the diffuse echo of a random surrounding to sound (m,): exponential decay over 0.05 to 0.4 s."""
    count = int(rng.uniform(0.05, 0.4) * RATE_HZ)
    echo = rng.normal(size=count) * 10 ** (-3 * np.arange(count) / count)
    echo *= 10 ** (rng.uniform(-20, -4) / 20) / np.sqrt(np.sum(echo**2))
    echo[0] += 1.0
    return scipy.signal.fftconvolve(samples, echo)[: samples.size + count // 2]


def place(samples: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Fill one window with sound (m,): a random piece of it, or the sound over and over from a random point on."""
    spare = samples.size - _WINDOW
    if spare >= 0:
        at = int(rng.integers(0, spare + 1))
        return samples[at : at + _WINDOW]
    return np.roll(np.resize(samples, _WINDOW), int(rng.integers(_WINDOW)))


def varied_window(samples: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Give one window (WINDOW_S,) of the sound (m,) as another source might have recorded it, without noise."""
    samples = retime(recolour(samples, rng), rng)
    if rng.random() < 0.4:
        samples = reverberate(samples, rng)
    return place(samples, rng)


def add_noise(window: np.ndarray, snr_dB: float, rng: np.random.Generator) -> np.ndarray:
    """Add a random kind of noise to a window (m,) at a signal-to-noise ratio [dB].

    The signal's power is that of its sounding part, so that pauses between steps do not count.
    """
    noise = NOISES[int(rng.integers(len(NOISES)))](window.size, rng)
    return window + noise * np.sqrt(sounding_power(window)) * 10 ** (-snr_dB / 20)


def sounding_power(samples: np.ndarray) -> float:
    """Mean power of the 10 ms pieces of sound (m,) that lie within 30 dB of its loudest piece."""
    pieces = samples[: samples.size // 160 * 160].reshape(-1, 160)
    power = np.mean(np.square(pieces), axis=1)
    return float(power[power > 1e-3 * power.max()].mean()) if power.size and power.max() > 0 else 0.0
