"""Sensors, and the soil's variation along the track."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.signal import lfilter

from .drives import Plan
from .effects_ground import scaled_ground
from .mechanics import ANSWERS, Channels, Drive, Ground

MOST_BUMPS = 360
"""No more bumps than this describe how the soil varies along all lanes together."""


@dataclass(frozen=True)
class Variation:
    """How the soil varies from place to place.

    Stiffness is multiplied by exp(s g(x)) and c and tan phi by exp(t h(x)); g and h are sums of bumps with unit
    variance, so that rows at the same place of the same lane have the same soil.

    Parameters
    ----------
    bumps : (m, b)
        Weight of each bump in each row; for steady trials the identity, each trial being run on soil prepared anew.
    stiffness_sd, strength_sd
        Relative standard deviations s and t [-].
    length_m
        Correlation length [m].
    """

    bumps: np.ndarray
    stiffness_sd: float
    strength_sd: float
    length_m: float

    def draw(self, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
        """Draw the factors of stiffness and strength, (m,) each."""
        g, h = rng.normal(size=(2, self.bumps.shape[1]))
        return np.exp(self.stiffness_sd * self.bumps @ g), np.exp(self.strength_sd * self.bumps @ h)

    def of(self, ground: Ground, factors: tuple[np.ndarray, np.ndarray]) -> Ground:
        """Give the soil by row."""
        return scaled_ground(ground, *factors)


def draw_variation(rng: np.random.Generator, plan: Plan) -> Variation:
    """Draw how much and over what length the soil varies."""
    stiffness, strength = float(rng.uniform(0.01, 0.05)), float(rng.uniform(0.005, 0.03))
    length = float(np.exp(rng.uniform(np.log(0.1), np.log(1.0))))
    drive = plan.drive
    if plan.protocol == "steady":
        return Variation(np.eye(len(drive)), stiffness, strength, 0.0)
    lanes = np.unique(drive.lane)
    length = max(length, _least_length(drive, lanes))
    return Variation(_bumps(drive, lanes, length), stiffness, strength, length)


def variation_along(drive: Drive, length_m: float, stiffness_sd: float, strength_sd: float) -> Variation:
    """Give a variation of stated sizes along the lanes of a drive, and of this length or the least one possible."""
    lanes = np.unique(drive.lane)
    length_m = max(length_m, _least_length(drive, lanes))
    return Variation(_bumps(drive, lanes, length_m), stiffness_sd, strength_sd, length_m)


def _least_length(drive: Drive, lanes: np.ndarray) -> float:
    """Correlation length that `MOST_BUMPS` can describe [m]."""
    span = sum(float(np.ptp(drive.x_m[drive.lane == lane])) for lane in lanes)
    return 4.0 * span / (0.8 * MOST_BUMPS)


def _bumps(drive: Drive, lanes: np.ndarray, length: float) -> np.ndarray:
    """Bell curves on each lane, a third of their variance three times as narrow; unit variance at each row."""
    blocks = []
    for lane in lanes:
        rows = drive.lane == lane
        low, high = float(drive.x_m[rows].min()), float(drive.x_m[rows].max())
        for scale, share in ((length, 0.7), (length / 3.0, 0.3)):
            centres = np.arange(low - 2.0 * scale, high + 2.0 * scale + 1e-9, scale)
            apart = (drive.x_m[rows][:, None] - centres[None, :]) / (0.7 * scale)
            block = np.zeros((len(rows), len(centres)))
            bells = np.exp(-0.5 * apart**2)
            block[rows] = np.sqrt(share) * bells / np.linalg.norm(bells, axis=1, keepdims=True)
            blocks.append(block)
    return np.concatenate(blocks, axis=1)


@dataclass(frozen=True)
class Sensors:
    """Noise by column (standard deviation, SI), and quanta of the converters; `speed` relative.

    `gross` is the share of rows with a gross error, `missing` the share of the rows that drop out in stretches,
    `stated` whether vehicle.toml states the noise. `correlation` is that of the noise of load and answers from one row
    to the next, 0 for white noise; the noise of the speeds is white.
    """

    noise: dict[str, float]
    speed: float
    quanta: dict[str, float]
    gross: float
    missing: float
    stated: bool
    correlation: float = 0.0

    def draw(self, rng: np.random.Generator, name: str, count: int) -> np.ndarray:
        """Draw the noise of load or an answer, (count,)."""
        noise = self.noise[name] * rng.normal(size=count)
        if self.correlation == 0.0:
            return noise
        fresh = np.sqrt(1.0 - self.correlation**2)
        start = np.array([(1.0 - fresh) * noise[0]])  # so that the first value is as large as the others
        return lfilter([fresh], [1.0, -self.correlation], noise, zi=start)[0]

    def louder(self, factor: float) -> Sensors:
        """Give the same sensors with more noise."""
        return replace(
            self, noise={name: factor * sd for name, sd in self.noise.items()}, speed=factor * self.speed,
            quanta={name: factor * step for name, step in self.quanta.items()},
        )  # fmt: skip

    def deviation(self, name: str) -> float:
        """Give the standard deviation of noise and rounding together."""
        return float(np.hypot(self.noise[name], self.quanta[name] / np.sqrt(12.0)))

    def slip_deviation(self, drive: Drive) -> np.ndarray:
        """Give the noise of a slip computed from the two noisy speeds, (m,)."""
        slower = np.where(drive.slip >= 0.0, 1.0 - drive.slip, 1.0 + drive.slip)
        return slower * self.speed * np.sqrt(1.25)


def draw_sensors(rng: np.random.Generator, truth: Channels, steady: bool, factor: float) -> Sensors:
    """Draw noise of 0.3 to 3 % of each channel's range, quanta, faults.

    In steady trials, whose rows are means, it is half of that; it is multiplied by `factor`.
    """
    noise, quanta = {}, {}
    for name in ("load_N", *ANSWERS):
        values = getattr(truth, name)
        span = float(max(np.ptp(values), 0.1 * np.abs(values).max()))
        share = float(np.exp(rng.uniform(np.log(0.003), np.log(0.03))))
        noise[name] = span * factor * (0.5 if steady else 1.0) * share
        quanta[name] = _round_quantum(noise[name] * float(rng.uniform(0.1, 1.2)))
    noise["load_N"] = min(noise["load_N"], 0.015 * float(truth.load_N.mean()))
    speed = factor * (0.5 if steady else 1.0) * float(np.exp(rng.uniform(np.log(0.002), np.log(0.012))))
    gross = float(rng.uniform(0.003, 0.01)) if rng.random() < 0.12 else 0.0
    missing = float(rng.uniform(0.01, 0.04)) if rng.random() < 0.12 and not steady else 0.0
    return Sensors(noise, speed, quanta, gross, missing, bool(rng.random() < 0.5))


def _round_quantum(size: float) -> float:
    """Give a converter's step: 1, 2 or 5 of a decimal place."""
    place = 10.0 ** np.floor(np.log10(size))
    return float(place * max(step for step in (1.0, 2.0, 5.0) if step <= size / place * 1.0000001))


def quantise(values: np.ndarray, step: float) -> np.ndarray:
    return np.round(values / step) * step


def slip_of(rim: np.ndarray, travel: np.ndarray) -> np.ndarray:
    """Give slip from rim speed r omega and travel speed V, both forwards (CONTRACTS.md)."""
    return np.where(rim >= travel, 1.0 - travel / rim, rim / travel - 1.0)
