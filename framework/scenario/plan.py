"""A preset made definite by a seed: the track, the speeds and slips along it, the soil of each stretch."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import uniform_filter1d

from ..core.errors import InputError
from .mechanics import Soil
from .presets import SLOW_RIM_SPEED_M_S, Fault, Leg, Preset
from .soils import SOILS

STEP_S = 0.01
"""Time step in which a drive is laid out [s]."""

LEAST_DURATION_S, MOST_DURATION_S = 5.0, 86_400.0
_ACCELERATION_M_S2 = 1.5
_LEAST_SLIP, _GREATEST_SLIP = 0.05, 0.60


@dataclass(frozen=True)
class Stretch:
    """Ground of one class in one place, with the times at which the vehicle's reference point is on it."""

    terrain: str
    start_s: float
    end_s: float
    start_m: float
    end_m: float
    slow_until_s: float
    soil: Soil | None


@dataclass(frozen=True)
class Plan:
    """A drive laid out in steps of `STEP_S`: arrays are (n,).

    Parameters
    ----------
    preset, seed
        What it was made of.
    stretches, faults
        In order of time.
    time_s, way_m, speed_m_s, slip
        Time, distance along the track, travel speed and slip.
    slow
        True in the slow phases of stretches.
    x_m, y_m, yaw_rad
        Track.
    """

    preset: Preset
    seed: int
    stretches: tuple[Stretch, ...]
    faults: tuple[Fault, ...]
    time_s: np.ndarray
    way_m: np.ndarray
    speed_m_s: np.ndarray
    slip: np.ndarray
    slow: np.ndarray
    x_m: np.ndarray
    y_m: np.ndarray
    yaw_rad: np.ndarray

    @property
    def duration_s(self) -> float:
        """How long the drive takes [s]."""
        return round(len(self.time_s) * STEP_S, 6)

    def at(self, values: np.ndarray, time_s: np.ndarray) -> np.ndarray:
        """Interpolate one of the plan's arrays at times [s]."""
        return np.interp(time_s, self.time_s, values)

    def stretch_at(self, way_m: np.ndarray) -> np.ndarray:
        """Number of the stretch at each distance along the track [m]; the last goes on beyond its end."""
        return np.searchsorted([stretch.start_m for stretch in self.stretches][1:], way_m, side="right")

    def fault(self, kind: str, time_s: np.ndarray) -> np.ndarray:
        """Where a fault of that kind is on: bool, one for each time."""
        answer = np.zeros(np.shape(time_s), dtype=bool)
        for fault in self.faults:
            if fault.kind == kind:
                answer |= (time_s >= fault.start_s) & (time_s < fault.end_s)
        return answer

    def generator(self, purpose: int) -> np.random.Generator:
        """Source of randomness for one purpose, the same whatever other purposes drew."""
        return np.random.default_rng([self.seed, purpose])


def make_plan(preset: Preset, seed: int, duration_s: float | None = None) -> Plan:
    """Lay out a drive.

    Parameters
    ----------
    preset
        What to drive.
    seed
        Of everything random in it.
    duration_s
        Cut after this time, or go round again over further places of the same classes until then [s].

    Raises
    ------
    InputError
        The duration is too short, too long or no number.
    """
    wanted = preset.duration_s if duration_s is None else duration_s
    if not LEAST_DURATION_S <= wanted <= MOST_DURATION_S:
        expected = f"at least {LEAST_DURATION_S:g} s and at most {MOST_DURATION_S:g} s, a day"
        raise InputError("scenario", f"duration {duration_s!r} s", expected=expected)
    rounds = math.ceil(wanted / preset.duration_s - 1e-9)
    rng = np.random.default_rng([seed, 0])
    legs = preset.legs * rounds
    ends = np.cumsum([leg.duration_s for leg in legs])
    time = np.arange(round(wanted / STEP_S)) * STEP_S
    pieces = [
        _drive_leg(leg, following, preset, rng, first=index == 0)
        for index, (leg, following) in enumerate(zip(legs, (*legs[1:], None), strict=True))
    ]
    speed, slip, slow = (np.concatenate([piece[i] for piece in pieces])[: len(time)] for i in range(3))
    # Nothing on wheels jumps: a fifth of a second rounds the corners between phases.
    speed, slip = uniform_filter1d(speed, 21), uniform_filter1d(slip, 21)
    way = np.concatenate([[0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]) * STEP_S)])
    yaw, x, y = _track(way, rng)
    stretches = []
    for leg, end in zip(legs, ends, strict=True):
        start = end - leg.duration_s
        if start >= wanted:
            break
        stop = min(end, wanted)
        soil = SOILS[leg.terrain].draw(rng, preset.vehicle.wheels[0].width_m) if leg.terrain in SOILS else None
        start_m, end_m = np.interp([start, stop], time, way)
        stretches.append(
            Stretch(leg.terrain, float(start), float(stop), float(start_m), float(end_m),
                    float(min(start + leg.slow_s, stop)), soil)
        )  # fmt: skip
    faults = [
        replace(fault, start_s=fault.start_s + shift, end_s=min(fault.end_s + shift, wanted))
        for shift in np.arange(rounds) * preset.duration_s
        for fault in preset.faults
        if fault.start_s + shift < wanted
    ]
    return Plan(preset, seed, tuple(stretches), tuple(faults), time, way, speed, slip, slow.astype(bool), x, y, yaw)


def _drive_leg(
    leg: Leg, following: Leg | None, preset: Preset, rng: np.random.Generator, *, first: bool
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Speed [m/s], slip [-] and slowness of one leg in steps of `STEP_S`."""
    hard = leg.terrain not in SOILS
    slow_n, fast_n = round(leg.slow_s / STEP_S), round(leg.fast_s / STEP_S)
    sweep = _slow_slip(slow_n, rng, hard=hard)
    creep = SLOW_RIM_SPEED_M_S * (1.0 - _LEAST_SLIP)
    after = following is None or following.slow_s > 0
    before = leg.slow_s > 0 or first
    fast = _fast_speed(fast_n, preset.fast_speed_m_s, rng, creep if before else None, creep if after else None)
    speed = np.concatenate([SLOW_RIM_SPEED_M_S * (1.0 - sweep), fast])
    slip = np.concatenate([sweep, _fast_slip(fast, rng, hard=hard)])
    return speed, slip, np.arange(slow_n + fast_n) < slow_n


def _slow_slip(count: int, rng: np.random.Generator, *, hard: bool) -> np.ndarray:
    """Slip commanded in a slow phase: two unequal sweeps from the least to the greatest and back."""
    if hard:
        return np.full(count, 0.015)
    share = np.arange(count) / max(count, 1)
    tops = rng.uniform(0.8, 1.0, 2)
    top = np.where(share < 0.5, tops[0], tops[1])
    return _LEAST_SLIP + (_GREATEST_SLIP - _LEAST_SLIP) * top * 0.5 * (1.0 - np.cos(4.0 * np.pi * share))


def _fast_speed(
    count: int, cruise_m_s: float, rng: np.random.Generator, before_m_s: float | None, after_m_s: float | None
) -> np.ndarray:
    """Speed of a fast phase: up from `before_m_s`, wandering about the cruising speed, down to `after_m_s`."""
    time = np.arange(count) * STEP_S
    end = count * STEP_S
    period = rng.uniform(4.0, 6.0)
    # The wander fades out at both ends, so that one fast phase joins on to the next without a step.
    fade = np.minimum(1.0, np.minimum(time, end - time) / 1.0)
    speed = cruise_m_s * (1.0 + 0.15 * fade * np.sin(2.0 * np.pi * time / period + rng.uniform(0.0, 6.3)))
    if before_m_s is not None:
        speed = np.minimum(speed, before_m_s + _ACCELERATION_M_S2 * time)
    if after_m_s is not None:
        speed = np.minimum(speed, after_m_s + _ACCELERATION_M_S2 * (end - time))
    return speed


def _fast_slip(speed: np.ndarray, rng: np.random.Generator, *, hard: bool) -> np.ndarray:
    """Slip at speed: more when accelerating, less when slowing down, and jumping with the bounce of the wheel."""
    base, reach = (0.012, 0.006) if hard else (0.09, 0.03)
    time = np.arange(len(speed)) * STEP_S
    acceleration = np.gradient(speed, STEP_S) if len(speed) > 1 else np.zeros(len(speed))
    jump = sum(rng.uniform(0.4, 1.0) * np.sin(2.0 * np.pi * f * time + rng.uniform(0.0, 6.3)) for f in (1.3, 2.1, 3.4))
    push = 0.8 * np.clip(acceleration / _ACCELERATION_M_S2, -1.0, 1.0)
    return base + reach * (push + jump * np.minimum(speed / 3.0, 1.0))


def _track(way_m: np.ndarray, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Heading [rad] and place [m] along a gently curved track that never meets itself."""
    first, second = rng.uniform(0.0, 2.0 * np.pi, 2)
    base = rng.uniform(-np.pi, np.pi)
    yaw = base + 0.22 * np.sin(2.0 * np.pi * way_m / 85.0 + first) + 0.10 * np.sin(2.0 * np.pi * way_m / 31.0 + second)
    step = np.diff(way_m, prepend=0.0)
    middle = np.concatenate([yaw[:1], 0.5 * (yaw[1:] + yaw[:-1])])
    return yaw, np.cumsum(step * np.cos(middle)), np.cumsum(step * np.sin(middle))
