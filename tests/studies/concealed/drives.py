"""Random drives of a wheel as in experiments: on benches, in fields, in steady trials, ramps of slip and turns."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import gaussian_filter1d

from .mechanics import Body, Drive, Ground, loaded, travel_ratio
from .turns import Track, draw_track

PROTOCOLS = ("bench", "field", "steady", "ramps", "turns")

PROTOCOL_SHARES = (0.5, 0.25, 0.25, 0.0, 0.0)
"""Probabilities of the protocols where none is given; ramps and turns are drawn only if they are given."""

LACKED = {"steady": frozenset({"time"}), "ramps": frozenset({"accelerations"})}
"""Needs that a protocol never has."""

NEEDS: dict[str, frozenset[str]] = {
    "rate_dependence": frozenset({"speeds"}),
    "multipass_compaction": frozenset({"passes"}),
    "soil_patch": frozenset({"time"}),
    "bulldozing": frozenset({"pull"}),
    "side_wall_friction": frozenset({"pull"}),
    "grousers": frozenset({"lugs", "time"}),
    "slope_gravity": frozenset({"pitch", "pull"}),
    "inertia": frozenset({"accelerations", "time", "pull"}),
    "drivetrain_friction": frozenset({"speeds", "pull"}),
    "torque_offset": frozenset({"pull"}),
    "torque_gain": frozenset({"pull"}),
    "load_gain": frozenset({"pull"}),
    "rim_adhesion": frozenset({"pull"}),
    "time_lag": frozenset({"time"}),
    "drift": frozenset({"time"}),
}
"""What a drive must have for an effect to be seen in it at all."""


def needs_of(slugs: Iterable[str]) -> frozenset[str]:
    """Join what the effects need."""
    return frozenset().union(*(NEEDS.get(slug, frozenset()) for slug in slugs))


@dataclass(frozen=True)
class Plan:
    """A drive, its protocol, rate [Hz] (None for steady trials), and which columns its recorder keeps.

    `track` says where the place along it lies where it turns; else it is straight, along x.
    """

    drive: Drive
    protocol: str
    rate_Hz: float | None
    columns: tuple[str, ...]
    track: Track | None = None


def draw_plan(
    rng: np.random.Generator, protocol: str, body: Body, ground: Ground, needs: frozenset[str], samples: int = 1200
) -> Plan:
    """Draw a drive of a protocol that has what is needed.

    Raises
    ------
    ValueError
        There is no such protocol, or it lacks what is needed.
    """
    if lacked := needs & LACKED.get(protocol, frozenset()):
        raise ValueError(f"{protocol} trials have no {', '.join(sorted(lacked))}")
    loads = _load_levels(rng, body, ground)
    if protocol == "steady":
        return _steady(rng, body, loads, needs)
    if protocol == "ramps":
        return _ramps(rng, body, loads, needs, samples)
    if protocol == "bench":
        return _bench(rng, body, loads, needs, samples)
    if protocol == "field":
        return _field(rng, body, loads, needs, samples)
    if protocol == "turns":
        return _turns(rng, body, loads, needs, samples)
    raise ValueError(f"no protocol {protocol!r}, only {', '.join(PROTOCOLS)}")


def _load_levels(rng: np.random.Generator, body: Body, ground: Ground) -> np.ndarray:
    """Dead weights, 3 to 5: the middle one makes the wheel enter at 20 to 40 degrees."""
    middle = np.array([rng.uniform(0.35, 0.7)])
    zero = np.zeros(1)
    still = Drive(*([zero] * 13))
    weight = float(loaded(middle, np.array([0.2]), ground, body, still)[0][0])
    spread = rng.uniform(1.4, 2.0)
    return weight * np.geomspace(1.0 / spread, spread, int(rng.integers(3, 6)))


def _columns(rng: np.random.Generator, needs: frozenset[str], timed: bool) -> tuple[str, ...]:
    """Which columns are kept: load, torque, sinkage, slip and speeds always, others as needed or by chance."""
    kept = ["load_N", "torque_Nm", "sinkage_m", "slip", "wheel_speed_rad_s", "travel_speed_m_s"]
    if "pull" in needs or rng.random() < 0.7:
        kept.append("drawbar_pull_N")
    if timed:
        kept = ["time_s", *kept, "x_m"]
        if "lugs" in needs or rng.random() < 0.5:
            kept.append("wheel_angle_rad")
    if "pitch" in needs or rng.random() < 0.4:
        kept.append("pitch_rad")
    kept.append("pass")
    return tuple(kept)


def _levels(rng: np.random.Generator, values: np.ndarray, count: int) -> np.ndarray:
    """Give `count` of the values in a random order, each as often as can be."""
    whole = np.concatenate([rng.permutation(values) for _ in range(-(-count // len(values)))])
    return whole[:count]


def _stepped(rng: np.random.Generator, levels: np.ndarray, samples: int, change: float) -> np.ndarray:
    """Hold each level for as long, with smooth changes that take `change` samples."""
    held = levels[np.minimum(np.arange(samples) * len(levels) // samples, len(levels) - 1)]
    return gaussian_filter1d(held, change, mode="nearest") if change > 0 else held


def _slip_limits(rng: np.random.Generator) -> tuple[float, float]:
    low = rng.uniform(-0.2, -0.05) if rng.random() < 0.15 else rng.uniform(0.0, 0.08)
    return float(low), float(rng.uniform(0.4, 0.7))


def _bench(rng: np.random.Generator, body: Body, loads: np.ndarray, needs: frozenset[str], samples: int) -> Plan:
    """A single-wheel test bench: passes, each with a dead weight or two, slip swept or stepped, a speed or two."""
    rate = float(rng.choice([5.0, 10.0, 20.0]))
    passes = int(rng.integers(3, 7))
    same_rut = "passes" in needs or rng.random() < 0.5
    sizes = np.full(passes, samples // passes)
    sizes[: samples - int(sizes.sum())] += 1
    hurried = "accelerations" in needs or rng.random() < 0.12
    track = rng.uniform(8.0, 25.0) if hurried else rng.uniform(1.5, 6.0)
    typical = track / (samples / passes / rate)
    paces = np.geomspace(0.4, 1.6, 3) if "speeds" in needs else rng.uniform(0.6, 1.4, rng.integers(1, 4))
    speeds = typical * paces
    low, high = _slip_limits(rng)
    weights, fast = _levels(rng, loads, 2 * passes), _levels(rng, speeds, 2 * passes)
    tilt = _levels(rng, np.radians(rng.uniform(4.0, 15.0)) * np.array([-1.0, 0.0, 0.5, 1.0]), passes)
    tilted = "pitch" in needs or rng.random() < 0.15
    gap = rng.uniform(5.0, 60.0) if rng.random() < 0.5 else 0.0
    sweeping, two_loads = rng.random() < 0.5, rng.random() < 0.6
    parts: dict[str, list[np.ndarray]] = {}
    clock = 0.0
    for index, size in enumerate(sizes):
        own = slice(2 * index, 2 * index + 2) if two_loads or "speeds" in needs else slice(2 * index, 2 * index + 1)
        time = np.arange(size) / rate
        if sweeping:
            slip = _swept(rng, low, high, int(size))
        else:
            slip = _stepped(rng, _levels(rng, np.linspace(low, high, 6), 6), int(size), 0.4 * rate)
        speed = _stepped(rng, fast[own], int(size), 0.5 * rate)
        if hurried:
            period = rng.uniform(2.0, 6.0)
            wave = np.sin(2.0 * math.pi * time / period + rng.uniform(0.0, 6.0))
            speed = speed * (1.0 + rng.uniform(0.25, 0.5) * wave)
        load = _stepped(rng, weights[own], int(size), 0.3 * rate) * (
            1.0 + 0.01 * smooth_noise(rng, int(size), 0.5 * rate)
        )
        rows = {
            "time_s": clock + time, "load_N": load, "slip": slip, "speed": speed,
            "pitch_rad": np.full(size, tilt[index] if tilted else 0.0),
            "passes": np.full(size, float(index + 1 if same_rut else 1)),
            "lane": np.full(size, 0 if same_rut else index),
        }  # fmt: skip
        clock += size / rate + gap
        for name, values in rows.items():
            parts.setdefault(name, []).append(values)
    return Plan(_driven(body, parts), "bench", rate, _columns(rng, needs, True))


def _ramps(rng: np.random.Generator, body: Body, loads: np.ndarray, needs: frozenset[str], samples: int) -> Plan:
    """A single-wheel rig: for each dead weight, the lightest first, one slow ramp of slip on fresh ground.

    The wheel turns evenly while the carriage slows down or speeds up; where passes are needed each weight runs in its
    own rut again.
    """
    rate = float(rng.choice([5.0, 10.0, 20.0]))
    again = 3 if "passes" in needs else 1
    speeds = np.geomspace(0.4, 1.6, len(loads)) if "speeds" in needs else np.ones(len(loads))
    sizes = np.diff(np.linspace(0, samples, len(loads) * again + 1).astype(int))
    low, high = _slip_limits(rng)
    typical = rng.uniform(1.5, 6.0) / (sizes[0] / rate)
    tilts = _levels(rng, np.radians(rng.uniform(4.0, 15.0)) * np.array([-1.0, 0.0, 0.5, 1.0]), len(loads))
    tilted = "pitch" in needs
    gap = rng.uniform(20.0, 120.0)
    parts: dict[str, list[np.ndarray]] = {}
    clock = 0.0
    speeds = rng.permutation(speeds)
    for index, size in enumerate(sizes.tolist()):
        weight, number = divmod(index, again)
        slip = low + (high - low) * gaussian_filter1d(np.linspace(0.0, 1.0, size), 3.0, mode="nearest")
        rows = {
            "time_s": clock + np.arange(size) / rate,
            "load_N": loads[weight] * (1.0 + 0.01 * smooth_noise(rng, size, 0.5 * rate)),
            "slip": slip, "speed": typical * speeds[weight] * travel_ratio(slip),
            "pitch_rad": np.full(size, tilts[weight] if tilted else 0.0),
            "passes": np.full(size, float(number + 1)), "lane": np.full(size, weight),
        }  # fmt: skip
        clock += size / rate + gap
        for name, values in rows.items():
            parts.setdefault(name, []).append(values)
    return Plan(_driven(body, parts), "ramps", rate, _columns(rng, needs, True))


def _swept(rng: np.random.Generator, low: float, high: float, samples: int) -> np.ndarray:
    """Sweep slip up and down, one to three times."""
    phase = np.linspace(0.0, float(rng.integers(1, 4)), samples) + (0.5 if rng.random() < 0.3 else 0.0)
    up = 1.0 - np.abs(1.0 - 2.0 * (phase % 1.0))
    return low + (high - low) * gaussian_filter1d(up, 3.0, mode="nearest")


def smooth_noise(rng: np.random.Generator, samples: int, length: float) -> np.ndarray:
    """Unit noise that stays alike over `length` samples."""
    wave = gaussian_filter1d(rng.normal(size=samples), max(length, 0.5), mode="wrap")
    return wave / max(float(wave.std()), 1e-12)


def _field(rng: np.random.Generator, body: Body, loads: np.ndarray, needs: frozenset[str], samples: int) -> Plan:
    """A slow field drive: load, slip, speed and pitch vary slowly; now and then the same track is driven again."""
    rate = float(rng.choice([5.0, 10.0]))
    passes = int(rng.integers(3, 6)) if "passes" in needs else int(rng.choice([1, 1, 1, 3]))
    parts = _wandering(rng, loads, needs, samples, rate)
    bounds = np.linspace(0, samples, passes + 1).astype(int)
    parts |= {"passes": np.repeat(np.arange(1.0, passes + 1.0), np.diff(bounds))}
    split = {name: np.split(values, bounds[1:-1]) for name, values in parts.items()}
    return Plan(_driven(body, split), "field", rate, _columns(rng, needs, True))


def _wandering(
    rng: np.random.Generator, loads: np.ndarray, needs: frozenset[str], samples: int, rate: float
) -> dict[str, np.ndarray]:
    """Give load, slip, speed and pitch that vary slowly, on one pass of one lane."""
    hurried = "accelerations" in needs or rng.random() < 0.12
    length = samples / rate
    track = rng.uniform(30.0, 80.0) if hurried else rng.uniform(8.0, 30.0)
    low, high = _slip_limits(rng)
    middle, swing = math.sqrt(loads[0] * loads[-1]), 0.5 * math.log(loads[-1] / loads[0])
    load = middle * np.exp(swing * np.tanh(smooth_noise(rng, samples, rate * rng.uniform(2.0, 6.0))))
    reach = 0.5 * (1.0 + np.tanh(1.2 * smooth_noise(rng, samples, rate * rng.uniform(1.5, 5.0))))
    vary = rng.uniform(0.5, 0.8) if "speeds" in needs else rng.uniform(0.1, 0.4)
    speed = track / length * np.exp(vary * np.tanh(1.5 * smooth_noise(rng, samples, rate * rng.uniform(2.0, 5.0))))
    if hurried:
        speed = speed * np.exp(0.3 * np.tanh(smooth_noise(rng, samples, rate * 0.8)))
    hilly = "pitch" in needs or rng.random() < 0.15
    slope = np.radians(rng.uniform(4.0, 10.0)) * smooth_noise(rng, samples, rate * rng.uniform(3.0, 8.0))
    return {
        "time_s": np.arange(samples) / rate, "load_N": load, "slip": low + (high - low) * reach, "speed": speed,
        "pitch_rad": np.clip(slope, -0.35, 0.35) if hilly else np.zeros(samples),
        "passes": np.ones(samples), "lane": np.zeros(samples, dtype=int),
    }  # fmt: skip


def _turns(rng: np.random.Generator, body: Body, loads: np.ndarray, needs: frozenset[str], samples: int) -> Plan:
    """A vehicle in the field on a track that turns, in ruts of its own again where passes are needed or by chance."""
    rate = float(rng.choice([5.0, 10.0]))
    parts = _wandering(rng, loads, needs, samples, rate)
    drive = _driven(body, {name: [values] for name, values in parts.items()})
    track = draw_track(rng, float(drive.x_m[-1]), body.width_m, "passes" in needs)
    place, passes = track.on_ground(drive.x_m)
    columns = (*_columns(rng, needs, True), "y_m")
    return Plan(replace(drive, x_m=place, passes=passes), "turns", rate, columns, track)


def _driven(body: Body, parts: dict[str, list[np.ndarray]]) -> Drive:
    """Join the passes; place starts again on each, the wheel turns on."""
    speeds, slips, clocks = parts["speed"], parts["slip"], parts["time_s"]
    rims = [v / (body.radius_m * travel_ratio(i)) for v, i in zip(speeds, slips, strict=True)]
    places = [_integral(t, v) for t, v in zip(clocks, speeds, strict=True)]
    turns, start = [], 0.0
    for t, omega in zip(clocks, rims, strict=True):
        turns.append(start + _integral(t, omega))
        start = float(turns[-1][-1])
    join = {name: np.concatenate(values) for name, values in parts.items()}
    return Drive(
        time_s=join["time_s"], load_N=join["load_N"], slip=join["slip"], wheel_speed=np.concatenate(rims),
        travel_speed=join["speed"], wheel_angle=np.concatenate(turns), pitch_rad=join["pitch_rad"],
        wheel_acceleration=np.concatenate([np.gradient(w, t) for w, t in zip(rims, clocks, strict=True)]),
        travel_acceleration=np.concatenate([np.gradient(v, t) for v, t in zip(speeds, clocks, strict=True)]),
        passes=join["passes"], x_m=np.concatenate(places), lane=join["lane"], run=np.full(len(join["slip"]), -1),
    )  # fmt: skip


def _integral(time: np.ndarray, rate: np.ndarray) -> np.ndarray:
    steps = 0.5 * np.diff(time) * (rate[1:] + rate[:-1])
    return np.concatenate([[0.0], np.cumsum(steps)])


def _steady(rng: np.random.Generator, body: Body, loads: np.ndarray, needs: frozenset[str]) -> Plan:
    """Steady trials: loads by slips by speeds, repeated, in a random order; 20 to 200 rows."""
    low, high = _slip_limits(rng)
    slips = np.linspace(low, high, int(rng.integers(5, 9)))
    pace = 0.3 * math.sqrt(body.radius_m)
    speeds = pace * np.geomspace(0.3, 1.8, 3) if "speeds" in needs else pace * rng.uniform(0.5, 1.5, rng.integers(1, 3))
    passes = np.arange(1.0, 5.0) if "passes" in needs else np.ones(1)
    tilts = np.radians([-8.0, 0.0, 8.0]) if "pitch" in needs else np.zeros(1)
    grid = np.meshgrid(loads, slips, speeds, passes, tilts, indexing="ij")
    table = np.column_stack([axis.ravel() for axis in grid])
    repeats = int(np.clip(round(rng.uniform(40.0, 200.0) / len(table)), 1, 4))
    table = rng.permutation(np.repeat(table, repeats, axis=0))[:200]
    count = len(table)
    load = table[:, 0] * (1.0 + 0.01 * rng.normal(size=count))
    slip = np.clip(table[:, 1] + 0.005 * rng.normal(size=count), -0.3, 0.75)
    speed = table[:, 2] * (1.0 + 0.01 * rng.normal(size=count))
    zero = np.zeros(count)
    drive = Drive(
        time_s=zero, load_N=load, slip=slip, wheel_speed=speed / (body.radius_m * travel_ratio(slip)),
        travel_speed=speed, wheel_acceleration=zero, travel_acceleration=zero, wheel_angle=zero, pitch_rad=table[:, 4],
        passes=table[:, 3], x_m=zero, lane=np.arange(count), run=np.arange(count),
    )  # fmt: skip
    return Plan(drive, "steady", None, _columns(rng, needs, False))
