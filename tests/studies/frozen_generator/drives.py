"""Protocols: how a wheel is loaded, driven and moved while it is recorded.

The values are what faultless instruments with the nominal radius would show; effects turn them into what the soil
feels.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import numpy as np

from .contact import Array, Wheel

GRAVITY = 9.81
TIMED = ("bench", "field", "passes", "speed")
PROTOCOLS = (*TIMED, "table")


@dataclass(frozen=True)
class Drive:
    """One value a row; in a table of steady trials `time` is only the number of the trial."""

    protocol: str
    time: Array
    load: Array
    slip: Array
    wheel_speed: Array
    travel_speed: Array
    angle: Array
    place: Array
    slopes: Array  # course of the pitch, of unit size, where an effect calls for slopes
    pitch: Array
    passes: Array
    wheel_acceleration: Array
    travel_acceleration: Array

    @property
    def rows(self) -> int:
        """Number of rows."""
        return len(self.time)

    @property
    def steady(self) -> bool:
        """Is this a table of trials, whose rows are not neighbours in time?"""
        return self.protocol == "table"

    def take(self, rows: Array) -> Drive:
        """Some of the rows."""
        arrays = {f.name: getattr(self, f.name)[rows] for f in fields(self) if f.name != "protocol"}
        return replace(self, **arrays)


def smooth_wander(rng: np.random.Generator, place: Array, length: float) -> Array:
    """Gaussian random function of the place with unit variance, correlated over about `length`."""
    step = length / 6.0
    low = float(np.min(place)) - 4.0 * length
    count = int(np.ceil((float(np.max(place)) + 4.0 * length - low) / step)) + 1
    kernel = np.exp(-0.5 * (np.arange(-24, 25) / 6.0 * np.sqrt(2.0)) ** 2)
    values = np.convolve(rng.standard_normal(count + 48), kernel / np.linalg.norm(kernel), mode="valid")
    return np.interp(place, low + step * np.arange(len(values)), values)


def _course(rng: np.random.Generator, clock: Array, scale: float) -> Array:
    """Random course over time that covers its range: mean 0, variance 1 over the drive."""
    values = smooth_wander(rng, clock, scale)
    return (values - np.mean(values)) / np.std(values)


def _settled(values: Array, rate: float, seconds: float) -> Array:
    """Steps as an actuator follows them: running mean over `seconds`."""
    width = max(1, round(seconds * rate))
    padded = np.pad(values, (width // 2, width - 1 - width // 2), mode="edge")
    return np.convolve(padded, np.full(width, 1.0 / width), mode="valid")


def _blocks(levels: Array, rows: int) -> Array:
    """Each level for its share of the rows."""
    return np.asarray(levels)[(np.arange(rows) * len(levels)) // rows]


def _slip_course(rng: np.random.Generator, rows: int, low: float, high: float) -> Array:
    """Slip in steps or in a ramp."""
    if rng.random() < 0.5:
        levels = np.linspace(low, high, int(rng.integers(4, 8)))
        return _blocks(rng.permutation(levels) if rng.random() < 0.4 else levels, rows)
    return np.linspace(low, high, rows)


def _bench(rng: np.random.Generator, rows: int, rate: float) -> tuple[Array, Array, Array]:
    """Several loads, at each the slip in steps or ramps, one rim speed."""
    loads = rng.permutation(np.linspace(rng.uniform(0.45, 0.7), rng.uniform(1.3, 1.8), int(rng.integers(2, 5))))
    low, high = rng.uniform(0.03, 0.1), rng.uniform(0.4, 0.75)
    share = rows // len(loads)
    slip = np.concatenate([_slip_course(rng, share, low, high) for _ in loads])
    slip = np.pad(slip, (0, rows - len(slip)), mode="edge")
    load = _blocks(loads, rows)
    return _settled(load, rate, 1.0), _settled(slip, rate, rng.uniform(0.4, 1.0)), np.ones(rows)


def _field(rng: np.random.Generator, rows: int, rate: float) -> tuple[Array, Array, Array]:
    """Load, slip and speed vary smoothly and at random."""
    clock = np.arange(rows) / rate
    scale = rng.uniform(0.5, 2.5)
    load = np.exp(rng.uniform(0.15, 0.35) * _course(rng, clock, scale))
    low, high = rng.uniform(0.03, 0.08), rng.uniform(0.35, 0.6)
    wander = _course(rng, clock, scale * rng.uniform(0.7, 1.5))
    slip = low + (high - low) / (1.0 + np.exp(-1.6 * wander))
    return load, slip, np.exp(0.15 * smooth_wander(rng, clock, 5.0))


def _passes(rng: np.random.Generator, rows: int, rate: float, count: int) -> tuple[Array, Array, Array]:
    """The same course of slip on each pass, the load changed within it."""
    share = rows // count
    load, slip = [], []
    levels = np.linspace(rng.uniform(0.6, 0.8), rng.uniform(1.2, 1.6), int(rng.integers(2, 4)))
    low, high = rng.uniform(0.04, 0.1), rng.uniform(0.3, 0.6)
    for _ in range(count):
        load.append(_settled(_blocks(rng.permutation(levels), share), rate, 1.0))
        slip.append(_settled(_slip_course(rng, share, low, high), rate, 0.6))
    return np.concatenate(load), np.concatenate(slip), np.ones(share * count)


def _speed(rng: np.random.Generator, rows: int, rate: float) -> tuple[Array, Array, Array]:
    """Rim speed up and down by a factor of 3 to 10, slip and load in blocks unlike it in time."""
    clock = np.arange(rows) / rate
    factor = rng.uniform(3.0, 10.0)
    if rng.random() < 0.5:
        course = 0.5 - 0.5 * np.cos(2.0 * np.pi * clock / rng.uniform(5.0, 12.0) + rng.uniform(0.0, 6.0))
    else:
        course = _settled(rng.random(max(8, rows // 60))[(np.arange(rows) // 60) % max(8, rows // 60)], rate, 2.0)
    wander = _course(rng, clock, rng.uniform(1.5, 5.0))
    slip = rng.uniform(0.04, 0.1) + rng.uniform(0.3, 0.5) / (1.0 + np.exp(-1.6 * wander))
    load = _settled(_blocks(np.array([0.6, 1.5, 1.0])[: int(rng.integers(2, 4))], rows), rate, 1.0)
    return load, slip, factor ** (course - 0.5)


def _table(rng: np.random.Generator, rows: int) -> tuple[Array, Array, Array]:
    """Trials: loads and speeds from a few settings, slips over their range."""
    loads = np.linspace(rng.uniform(0.45, 0.7), rng.uniform(1.3, 1.8), int(rng.integers(3, 6)))
    speeds = np.geomspace(rng.uniform(0.3, 0.6), rng.uniform(1.6, 3.0), int(rng.integers(2, 5)))
    slip = rng.uniform(0.03, rng.uniform(0.5, 0.75), rows)
    return rng.choice(loads, rows), slip, rng.choice(speeds, rows)


def _slopes(rng: np.random.Generator, protocol: str, clock: Array) -> Array:
    """Pitch of unit size along the drive."""
    if protocol == "table":
        return rng.choice(np.linspace(-1.0, 1.0, 5), len(clock))
    return np.clip(smooth_wander(rng, clock, float(clock[-1]) / rng.uniform(5.0, 12.0)), -1.5, 1.5) / 1.5


def draw_drive(rng: np.random.Generator, protocol: str, wheel: Wheel, load: float, *, laps: bool = False) -> Drive:
    """A drive by one of the `PROTOCOLS` about a mean `load`; with `laps` it comes by each place more than once."""
    rate = float(rng.choice([5.0, 10.0, 20.0]))
    rows = int(rng.integers(24, 151)) if protocol == "table" else int(rng.integers(300, 1201))
    count = int(rng.integers(3, 7)) if protocol == "passes" else 1
    if protocol == "table":
        course = _table(rng, rows)
    elif protocol == "passes":
        course = _passes(rng, rows, rate, count)
        rows = len(course[0])
    else:
        course = {"bench": _bench, "field": _field, "speed": _speed}[protocol](rng, rows, rate)
    clock = np.arange(rows) / rate
    rim_speed = np.sqrt(GRAVITY * wheel.radius) * np.exp(rng.uniform(np.log(0.06), np.log(0.5))) * course[2]
    slip = course[1]
    travel_speed = rim_speed * (1.0 - slip)
    wheel_speed = rim_speed / wheel.radius
    place = np.concatenate([[0.0], np.cumsum(0.5 * (travel_speed[1:] + travel_speed[:-1])) / rate])
    passes = np.ones(rows)
    time = clock
    if protocol == "passes":
        share = rows // count
        passes = 1.0 + np.arange(rows) // share
        start = (np.arange(rows) // share) * share
        place = place - place[start]
        time = clock + (passes - 1.0) * rng.uniform(8.0, 40.0)
    elif laps:
        length = place[-1] / rng.uniform(2.2, 4.5)
        place = length - np.abs(place % (2.0 * length) - length)  # out and back on one track
    angle = rng.uniform(0.0, 6.0) + np.concatenate(
        [[0.0], np.cumsum(0.5 * (wheel_speed[1:] + wheel_speed[:-1])) / rate]
    )
    steady = protocol == "table"
    return Drive(
        protocol=protocol,
        time=time,
        load=load * course[0],
        slip=slip,
        wheel_speed=wheel_speed,
        travel_speed=travel_speed,
        angle=angle,
        place=place,
        slopes=_slopes(rng, protocol, clock),
        pitch=np.zeros(rows),
        passes=passes,
        wheel_acceleration=np.zeros(rows) if steady else np.gradient(wheel_speed, 1.0 / rate),
        travel_acceleration=np.zeros(rows) if steady else np.gradient(travel_speed, 1.0 / rate),
    )
