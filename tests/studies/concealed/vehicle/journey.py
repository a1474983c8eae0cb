"""Where a vehicle drives and how: its wheels, a curved track over several grounds, slow and fast parts."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.integrate import cumulative_trapezoid
from scipy.ndimage import gaussian_filter1d

from ..drives import smooth_noise
from ..mechanics import Body, travel_ratio
from ..soils import draw_body
from ..turns import Track
from .confined import VehicleDrive

RATE_Hz, POSE_Hz = 10.0, 20.0
"""Rates of the wheels' rows and of the poses."""

SLOW_M_S = 0.3
"""Rim speed of the slow parts [m/s]."""

_AHEAD = 10.0
"""Track that is known before the start and after the end [m]."""


@dataclass(frozen=True)
class Vehicle:
    """Wheels of one shape: names, and places in the vehicle's frame, forward and left [m]."""

    body: Body
    names: tuple[str, ...]
    places: tuple[tuple[float, float], ...]

    @property
    def in_line(self) -> bool:
        """Whether wheels run behind others."""
        return len({forward for forward, _ in self.places}) > 1


@dataclass(frozen=True)
class Path(Track):
    """A track whose places are counted from where the vehicle's reference point starts."""

    def at(self, place_m: np.ndarray) -> np.ndarray:
        """Give x and y (m, 2) [m] of places along the line (m,) [m]."""
        return super().at(np.asarray(place_m) + _AHEAD)

    def heading(self, place_m: np.ndarray) -> np.ndarray:
        """Give the direction (m,) [rad] of the line at places along it."""
        ahead, behind = self.at(place_m + 0.25), self.at(place_m - 0.25)
        return np.arctan2(*(ahead - behind).T[::-1])


@dataclass(frozen=True)
class Pose:
    """Recorded poses of the reference point, (k,) each."""

    time_s: np.ndarray
    x_m: np.ndarray
    y_m: np.ndarray
    yaw_rad: np.ndarray


@dataclass(frozen=True)
class Journey:
    """A drive: what the wheels do, where, and which columns are recorded.

    `borders_s` (g + 1,) are the times at which the reference point enters and leaves the grounds, `borders_m` the
    places; `fast` (m,) marks rows of the fast parts.
    """

    drive: VehicleDrive
    path: Path
    pose: Pose
    borders_s: np.ndarray
    borders_m: np.ndarray
    fast: np.ndarray
    columns: tuple[str, ...]


def draw_vehicle(rng: np.random.Generator, needs: frozenset[str], wheels: int) -> Vehicle:
    """Draw a vehicle of 1, 2 or 4 wheels of 0.1 to 0.45 m radius, with lugs where they are needed or by chance."""
    lugs = "lugs" in needs or rng.random() < 0.15
    body = draw_body(rng, lugs)
    while not 0.1 <= body.radius_m <= 0.45:
        body = draw_body(rng, lugs)
    base, gauge = np.round(body.radius_m * rng.uniform([3.0, 2.5], [6.0, 4.0]), 2).tolist()
    rear = -round(base * float(rng.choice([0.0, 0.5, rng.uniform(0.3, 0.7)])), 3)
    front = round(base + rear, 3)
    if wheels == 1:
        return Vehicle(body, ("wheel",), ((0.0, 0.0),))
    if wheels == 2:
        return Vehicle(body, ("front", "rear"), ((front, 0.0), (rear, 0.0)))
    left = round(gauge / 2.0, 3)
    names = ("front_left", "front_right", "rear_left", "rear_right")
    return Vehicle(body, names, ((front, left), (front, -left), (rear, left), (rear, -left)))


def draw_journey(
    rng: np.random.Generator, vehicle: Vehicle, grounds: int, usual_load_N: float, needs: frozenset[str]
) -> Journey:
    """Draw a drive of 150 to 300 s over so many grounds."""
    shares = rng.uniform(0.75, 1.25, grounds)
    length_s = round(max(rng.uniform(150.0, 300.0), 36.0 * grounds))
    time = np.arange(int(length_s * POSE_Hz) + 1) / POSE_Hz
    borders_s = np.concatenate([[0.0], np.cumsum(shares / shares.sum())]) * length_s
    fast = _fast_parts(rng, time, borders_s, 1.0 if "accelerations" in needs else 0.7)
    blend = gaussian_filter1d(fast.astype(float), rng.uniform(0.5, 1.0) * POSE_Hz, mode="nearest")
    slip = _slips(rng, len(vehicle.names), blend)
    speed = (1.0 - blend) * SLOW_M_S * (1.0 - slip.mean(axis=0)) + blend * _hurried(rng, time)
    way = cumulative_trapezoid(speed, time, initial=0.0)
    path = _draw_path(rng, float(way[-1]))
    borders_m = np.interp(borders_s, time, way)
    bend = np.gradient(np.unwrap(path.heading(way)), way)
    slope = _slopes(rng, needs, float(way[-1]))
    loads = _loads(rng, vehicle, usual_load_N, blend)
    parts = []
    every = int(POSE_Hz / RATE_Hz)
    for number, (forward, left) in enumerate(vehicle.places):
        travel = speed * (1.0 - bend * left)
        rim = travel / (vehicle.body.radius_m * travel_ratio(slip[number]))
        place = way + forward
        on = np.clip(np.searchsorted(borders_m, place, side="right") - 1, 0, grounds - 1)
        behind = any(ahead > forward and left == beside for ahead, beside in vehicle.places)
        own = np.ones(len(time))
        part = VehicleDrive(
            time_s=time, load_N=loads[number], slip=slip[number], wheel_speed=rim, travel_speed=travel,
            wheel_acceleration=np.gradient(rim, time), travel_acceleration=np.gradient(travel, time),
            wheel_angle=cumulative_trapezoid(rim, time, initial=0.0), pitch_rad=slope(place),
            passes=(2.0 if behind else 1.0) * own, x_m=place, lane=(np.sign(left) * own).astype(int),
            run=np.full(len(time), -1), wheel=np.full(len(time), number), ground=on,
        )  # fmt: skip
        parts.append(part.rows(np.arange(0, len(time), every)))
    drive = parts[0].joined(parts[1:])
    pose = _recorded_pose(rng, path, time, way)
    columns = _columns(rng, vehicle, needs)
    return Journey(drive, path, pose, borders_s, borders_m, np.tile(fast[::every], len(parts)), columns)


def _fast_parts(rng: np.random.Generator, time: np.ndarray, borders_s: np.ndarray, likely: float) -> np.ndarray:
    """Mark fast parts of most grounds, of one at least: at the beginning, in the middle or at the end of each."""
    chosen = rng.random(len(borders_s) - 1) < likely
    chosen[int(rng.integers(len(chosen)))] = True
    fast = np.zeros(len(time), dtype=bool)
    for start, end, there in zip(borders_s[:-1], borders_s[1:], chosen, strict=True):
        length = (end - start) * rng.uniform(0.25, 0.42)
        begin = start + (end - start - length) * float(rng.choice([0.0, 0.5, 1.0]))
        if there:
            fast |= (time >= begin) & (time < begin + length)
    return fast


def _hurried(rng: np.random.Generator, time: np.ndarray) -> np.ndarray:
    """Travel speed of the fast parts: 2 to 3 m/s, now and then slower."""
    top, depth, period = rng.uniform([2.2, 0.15, 3.0], [3.0, 0.35, 7.0])
    wave = np.sin(2.0 * math.pi * time / period + rng.uniform(0.0, 6.0))
    return top * (1.0 - depth * (0.5 + 0.5 * wave)) * (1.0 + 0.04 * smooth_noise(rng, len(time), POSE_Hz))


def _slips(rng: np.random.Generator, wheels: int, blend: np.ndarray) -> np.ndarray:
    """Slips (w, k): swept up and down in slow parts, all wheels nearly together, small in fast ones."""
    low, high, period = rng.uniform([0.06, 0.42, 9.0], [0.1, 0.56, 18.0])
    phase = np.cumsum(1.0 - blend) / POSE_Hz / period + rng.uniform()
    swept = low + (high - low) * gaussian_filter1d(1.0 - np.abs(1.0 - 2.0 * (phase % 1.0)), 0.4 * POSE_Hz)
    most = rng.uniform(0.15, 0.3)
    small = low + (most - low) * 0.5 * (1.0 + np.tanh(smooth_noise(rng, len(blend), 1.5 * POSE_Hz)))
    both = (1.0 - blend) * swept + blend * small
    own = np.array([np.tanh(smooth_noise(rng, len(blend), 3.0 * POSE_Hz)) for _ in range(wheels)])
    return np.clip(both * (1.0 + 0.12 * own), 0.05, 0.6)


def _loads(rng: np.random.Generator, vehicle: Vehicle, usual_N: float, blend: np.ndarray) -> np.ndarray:
    """Loads (w, k): shared unevenly, swept slowly in slow parts, bouncing in fast ones."""
    count, wheels = len(blend), len(vehicle.names)
    front = rng.uniform(0.9, 1.1)
    swing, bounce = math.log(rng.uniform(1.4, 1.8)), rng.uniform(0.08, 0.2)
    rows = []
    for number in range(wheels):
        share = front if vehicle.places[number][0] > 0.0 or wheels == 1 else 2.0 - front
        swept = swing * np.tanh(smooth_noise(rng, count, POSE_Hz * rng.uniform(2.0, 5.0)))
        quick = bounce * smooth_noise(rng, count, POSE_Hz * rng.uniform(0.08, 0.15))
        rows.append(usual_N * share * np.exp((1.0 - 0.5 * blend) * swept + blend * np.clip(quick, -0.45, 0.45)))
    return np.array(rows)


def _slopes(rng: np.random.Generator, needs: frozenset[str], way_m: float):
    """Draw the slope [rad] as a function of place [m]: level, but where hills are needed or by chance."""
    hilly = "pitch" in needs or rng.random() < 0.15
    steep, length, phase = rng.uniform([4.0, 0.1, 0.0], [9.0, 0.3, 6.0])
    height = math.radians(steep) if hilly else 0.0
    length = max(12.0, length * way_m)
    return lambda place: height * np.sin(2.0 * math.pi * place / length + phase)


def _draw_path(rng: np.random.Generator, way_m: float) -> Path:
    """Draw an arc of 60 to 100 degrees that bends a little to and fro, and never meets itself.

    It turns so much that the way along it is no distance in any one direction.
    """
    place = np.arange(-_AHEAD, way_m + _AHEAD + 0.25, 0.25)
    turn, swing, length, phase, course = rng.uniform([1.05, 0.0, 80.0, 0.0, -math.pi], [1.75, 0.1, 200.0, 6.0, math.pi])
    turn *= float(rng.choice([-1.0, 1.0]))
    heading = course + turn * place / way_m + swing * np.sin(2.0 * math.pi * place / length + phase)
    corners = [cumulative_trapezoid(along(heading), place, initial=0.0) for along in (np.cos, np.sin)]
    start = rng.uniform(-100.0, 100.0, 2)
    return Path(np.column_stack(corners) + start, "once", float(rng.choice([0.0, 0.005, 0.02])))


def _recorded_pose(rng: np.random.Generator, path: Path, time: np.ndarray, way: np.ndarray) -> Pose:
    """Give the poses with errors that wander, as those of a filter do."""
    error = [path.position_sd_m * smooth_noise(rng, len(time), 5.0 * POSE_Hz) for _ in range(2)]
    x, y = path.at(way).T + np.array(error)
    yaw = np.unwrap(path.heading(way)) + 0.003 * smooth_noise(rng, len(time), 3.0 * POSE_Hz)
    return Pose(time, x, y, (yaw + math.pi) % (2.0 * math.pi) - math.pi)


def _columns(rng: np.random.Generator, vehicle: Vehicle, needs: frozenset[str]) -> tuple[str, ...]:
    """Which columns are kept: those of the bench but the place, which the poses give."""
    kept = [
        "time_s", "load_N", "torque_Nm", "sinkage_m", "slip", "wheel_speed_rad_s", "travel_speed_m_s"
    ]  # fmt: skip
    likely: Sequence[tuple[str, bool, float]] = (
        ("drawbar_pull_N", "pull" in needs, 0.6), ("wheel_angle_rad", "lugs" in needs, 0.4),
        ("pitch_rad", "pitch" in needs, 0.4), ("pass", False, 0.5 if vehicle.in_line else 0.0),
    )  # fmt: skip
    kept += [name for name, needed, chance in likely if rng.random() < chance or needed]
    return tuple(kept)
