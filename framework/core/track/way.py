"""Where the vehicle was at each time of a recording, and how fast it went."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Protocol

import numpy as np
from scipy.integrate import cumulative_trapezoid

from ..errors import InputError
from ..pooling import cells_of
from ..recording.types import Pose, Recording, WheelTable
from ..vehicle import Vehicle, Wheel
from .jumps import FASTEST_M_S, without_jumps

RECORDED, DEAD_RECKONING = "recorded", "dead reckoning"

_REACH_S = 0.5
"""How far beyond the first and last pose a place is still given [s]."""

BRIDGED_S = 2 * _REACH_S
"""Poses this close are always joined by a straight line: every time between them is near one, and a bend of 4 m/s^2
strays from the line by half a metre at most, v^2 / r times the time squared over 8 [s]."""

_BRIDGED_STEPS = 3.5
"""Poses are joined as well over so many of the usual steps between them: a slow sensor that lost two in a row [-]."""

_STOOD_M, _STOOD_RAD = 0.1, 0.1
"""A vehicle that has moved and turned less between two poses stood still [m], [rad]."""

SPEED_WINDOW_S = 0.5
"""Speed from places is taken over this time [s], so that the noise of a pose does not become speed."""

_HEADING_STEP_M = 0.1
"""A path's direction is that between points so far apart [m], so that their noise is small."""

_LEAST_STEP_M = 0.1
"""Way is covered where the vehicle has moved so far [m]: the noise of poses is less, and would add up."""

_MAX_STEPS = 400
"""Most points in which the way of one sound window is followed."""


class Places(Protocol):
    """Where the vehicle was and how fast, as far as that is known by now; see `Track`."""

    @property
    def speed_m_s(self) -> np.ndarray:
        """Travel speeds along the way, (n,) [m/s]."""
        ...

    def place_at(self, time_s: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Give x [m], y [m] and heading [rad] at times of any shape [s]; NaN where nobody knows."""
        ...

    def speed_at(self, time_s: np.ndarray) -> np.ndarray:
        """Give the travel speed [m/s] at times of any shape [s]; NaN where nobody knows."""
        ...


@dataclass(frozen=True)
class Track:
    """The vehicle's way over the ground.

    Parameters
    ----------
    time_s, x_m, y_m, yaw_rad, speed_m_s : (n,)
        Time strictly increasing [s], place in the site frame [m], heading from the x axis leftwards, continuous over
        a full turn [rad], travel speed [m/s].
    origin
        What the places come from: `RECORDED`, or `DEAD_RECKONING` from the travel speed along x.
    holes_s : (h, 2)
        From when to when nobody knows where the vehicle was, in order of time [s].
    """

    time_s: np.ndarray
    x_m: np.ndarray
    y_m: np.ndarray
    yaw_rad: np.ndarray
    speed_m_s: np.ndarray
    origin: str
    holes_s: np.ndarray

    @property
    def problems(self) -> tuple[str, ...]:
        """Say how long the holes are, where there are any."""
        if not len(self.holes_s):
            return ()
        length = np.diff(self.holes_s, axis=1)[:, 0]
        start, end = self.holes_s[np.argmax(length)]
        many = f", in {len(length)} holes, the longest" if len(length) > 1 else ""
        span = f"no places for {length.sum():.1f} s{many} from {start:.1f} s to {end:.1f} s"
        return (f"{span}: what was observed then is not on the map",)

    @property
    def distance_m(self) -> float:
        """Length of the way [m]."""
        return float(self.way_m[-1])

    @cached_property
    def way_m(self) -> np.ndarray:
        """Way covered since the start, (n,) [m]: between points `_LEAST_STEP_M` apart."""
        kept, x_m, y_m = [0], self.x_m.tolist(), self.y_m.tolist()
        for row in range(1, len(x_m)):
            if math.hypot(x_m[row] - x_m[kept[-1]], y_m[row] - y_m[kept[-1]]) >= _LEAST_STEP_M:
                kept.append(row)
        if kept[-1] != len(x_m) - 1:
            kept.append(len(x_m) - 1)
        steps = np.hypot(np.diff(self.x_m[kept]), np.diff(self.y_m[kept]))
        return np.interp(self.time_s, self.time_s[kept], np.append(0.0, np.cumsum(steps)))

    def place_at(self, time_s: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Give x [m], y [m] and heading [rad] at times of any shape [s]; NaN in a hole and well outside."""
        return self._at(time_s, self.x_m), self._at(time_s, self.y_m), self._at(time_s, self.yaw_rad)

    def speed_at(self, time_s: np.ndarray) -> np.ndarray:
        """Give the travel speed [m/s] at times of any shape [s]; NaN in a hole and well outside."""
        return self._at(time_s, self.speed_m_s)

    def _at(self, time_s: np.ndarray, values: np.ndarray) -> np.ndarray:
        time_s = np.asarray(time_s, dtype=float)
        inside = (time_s >= self.time_s[0] - _REACH_S) & (time_s <= self.time_s[-1] + _REACH_S)
        began = np.searchsorted(self.holes_s[:, 0], time_s)
        in_hole = time_s < np.append(-np.inf, self.holes_s[:, 1])[began]
        return np.where(inside & ~in_hole, np.interp(time_s, self.time_s, values), np.nan)

    def every(self, step_m: float) -> np.ndarray:
        """Give times at which the way grows by `step_m` [m], the first and last of the track included: (m,) [s]."""
        way = self.way_m
        moving = np.concatenate([[True], np.diff(way) > 0])
        steps = np.append(np.arange(0.0, way[-1], step_m), way[-1])
        return np.interp(steps, way[moving], self.time_s[moving])


def pose_from_wheel(table: WheelTable, vehicle: Vehicle | None) -> tuple[Pose | None, tuple[str, ...]]:
    """Make poses of the places in wheel rows; the yaw is that of the path, which a vehicle drives nose first.

    The places are those of one wheel, the first named in the table; its position in the vehicle is taken off.
    Impossible places are left out, with a note in `problems`, and all of them where they jump for good: the rows still
    serve for the soil. Rows of several runs are no neighbours in time.

    Returns
    -------
    Pose or None, problems
    """
    several_runs = table.run is not None and len(set(table.run)) > 1
    if several_runs or any(table.get(name) is None for name in ("time_s", "x_m", "y_m")):
        return None, ()
    name = None if table.wheel is None else str(table.wheel[0])
    table = _one_wheel(table)
    rows = ~(np.isnan(table["x_m"]) | np.isnan(table["y_m"]))
    if rows.sum() < 2:
        return None, ()
    time, x, y = (table[column][rows] for column in ("time_s", "x_m", "y_m"))
    recorded = table.get("yaw_rad")
    yaw = heading_of(x, y) if recorded is None or np.isnan(recorded[rows]).any() else recorded[rows]
    wheel = _wheel_named(vehicle, name)
    if wheel is not None:
        forward, left = wheel.position_m
        x, y = moved(x, y, yaw, -forward, -left)
    try:
        return without_jumps(Pose(time, x, y, yaw), Path(table.source), lambda row: f"{time[row]:.9g} s, column x_m")
    except InputError as error:
        return None, (f"no place of the vehicle is taken from its wheels' rows: {error}",)


def _wheel_named(vehicle: Vehicle | None, name: str | None) -> Wheel | None:
    if vehicle is None:
        return None
    return next((wheel for wheel in vehicle.wheels if wheel.name == name or len(vehicle.wheels) == 1), None)


def heading_of(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Give the direction of a path, (n,) [rad]."""
    place = np.floor(np.hypot(np.diff(x, prepend=x[0]), np.diff(y, prepend=y[0])).cumsum() / _HEADING_STEP_M)
    key = np.flatnonzero(np.diff(place, prepend=-1.0) > 0)
    if len(key) < 2:
        return np.full(len(x), np.arctan2(y[-1] - y[0], x[-1] - x[0]))
    between = np.unwrap(np.arctan2(np.diff(y[key]), np.diff(x[key])))
    return np.interp(np.arange(len(x)), (key[1:] + key[:-1]) / 2, between)


def moved(
    x_m: np.ndarray, y_m: np.ndarray, yaw_rad: np.ndarray, forward_m: np.ndarray | float, left_m: np.ndarray | float
) -> tuple[np.ndarray, np.ndarray]:
    """Give the places, x and y [m], that lie so far forward and left [m] of others at a heading [rad]."""
    cos, sin = np.cos(yaw_rad), np.sin(yaw_rad)
    return x_m + cos * forward_m - sin * left_m, y_m + sin * forward_m + cos * left_m


def track_of(recording: Recording) -> Track | None:
    """Find the track of a recording: from its poses or the places in its wheel rows, else by its travel speed along x.

    None where the recording holds none of these.

    Raises
    ------
    InputError
        The places jump for good, or the travel speed that is all there is goes beyond that of any ground vehicle.
    """
    wheel = recording.wheel
    pose = recording.pose
    if pose is None and wheel is not None:
        pose, _ = pose_from_wheel(wheel, recording.vehicle)
    if pose is not None:
        track = _track(pose.time_s, pose.x_m, pose.y_m, pose.yaw_rad, _wheel_speed(wheel), RECORDED)
        if track is not None:
            return track
    speed = _wheel_speed(wheel)
    if speed is None:
        return None
    time_s, travel = speed
    _check_speed(recording, time_s, travel)
    x = np.concatenate([[0.0], np.cumsum(0.5 * (travel[1:] + travel[:-1]) * np.diff(time_s))])
    return _track(time_s, x, np.zeros_like(x), np.zeros_like(x), speed, DEAD_RECKONING)


def _check_speed(recording: Recording, time_s: np.ndarray, travel_m_s: np.ndarray) -> None:
    """Refuse travel speeds that would carry the way, added up from them, off for good."""
    row = int(np.argmax(np.abs(travel_m_s)))
    if abs(travel_m_s[row]) > FASTEST_M_S:
        raise InputError(
            recording.source, f"{travel_m_s[row]:g} m/s", place=f"{time_s[row]:.9g} s, column travel_speed_m_s",
            expected=f"no more than {FASTEST_M_S:g} m/s, for the way is added up from it",
        )  # fmt: skip


def _track(
    time_s: np.ndarray,
    x_m: np.ndarray,
    y_m: np.ndarray,
    yaw_rad: np.ndarray,
    speed: tuple[np.ndarray, np.ndarray] | None,
    origin: str,
) -> Track | None:
    good = np.isfinite(time_s) & np.isfinite(x_m) & np.isfinite(y_m) & np.isfinite(yaw_rad)
    time_s, first = np.unique(np.asarray(time_s, dtype=float)[good], return_index=True)
    if len(time_s) < 2:
        return None
    x_m, y_m, yaw_rad = (np.asarray(values, dtype=float)[good][first] for values in (x_m, y_m, yaw_rad))
    if speed is None:
        early, late = time_s - SPEED_WINDOW_S / 2, time_s + SPEED_WINDOW_S / 2
        early, late = np.maximum(early, time_s[0]), np.minimum(late, time_s[-1])
        dx = np.interp(late, time_s, x_m) - np.interp(early, time_s, x_m)
        dy = np.interp(late, time_s, y_m) - np.interp(early, time_s, y_m)
        travel = np.hypot(dx, dy) / (late - early)
    else:
        travel = np.abs(np.interp(time_s, *speed))
    yaw_rad = np.unwrap(yaw_rad)
    hole = too_far_apart(time_s) & ~_stood(time_s, x_m, y_m, yaw_rad, speed)
    holes_s = np.column_stack([time_s[:-1][hole], time_s[1:][hole]])
    return Track(time_s, x_m, y_m, yaw_rad, travel, origin, holes_s)


def too_far_apart(time_s: np.ndarray) -> np.ndarray:
    """Between which neighbours too much time passed for a straight line, (n - 1,), by the usual step of all."""
    return np.diff(time_s) > bridged_s(time_s)


def bridged_s(time_s: np.ndarray) -> float:
    """Give the time over which poses at times (n,), two at least, are always joined by a straight line [s]."""
    return max(BRIDGED_S, _BRIDGED_STEPS * float(np.quantile(np.diff(time_s), 0.5, method="lower")))


def _stood(
    time_s: np.ndarray,
    x_m: np.ndarray,
    y_m: np.ndarray,
    yaw_rad: np.ndarray,
    speed: tuple[np.ndarray, np.ndarray] | None,
) -> np.ndarray:
    """Between which neighbours the vehicle stood, (n - 1,): it is where it was, and no wheel speed contradicts it."""
    stood = (np.hypot(np.diff(x_m), np.diff(y_m)) < _STOOD_M) & (np.abs(np.diff(yaw_rad)) < _STOOD_RAD)
    if speed is None:
        return stood
    way = np.concatenate([[0.0], cumulative_trapezoid(np.abs(speed[1]), speed[0])])
    return stood & (np.diff(np.interp(time_s, speed[0], way)) < _STOOD_M)


def _wheel_speed(wheel: WheelTable | None) -> tuple[np.ndarray, np.ndarray] | None:
    """Times [s] and travel speeds [m/s] of the wheel rows, where they carry them."""
    if wheel is None or wheel.run is not None or "time_s" not in wheel or "travel_speed_m_s" not in wheel:
        return None
    rows = _one_wheel(wheel)
    good = np.isfinite(rows["travel_speed_m_s"]) & np.isfinite(rows["time_s"])
    return (rows["time_s"][good], rows["travel_speed_m_s"][good]) if good.sum() >= 2 else None


def _one_wheel(wheel: WheelTable) -> WheelTable:
    """Give the rows of the first wheel: every wheel of a vehicle carries the same places and travel speed."""
    return wheel if wheel.wheel is None else wheel.select(wheel.wheel == wheel.wheel[0])


def cells_under_wheels(
    track: Places, vehicle: Vehicle | None, start_s: np.ndarray, end_s: np.ndarray, cell_size_m: float
) -> tuple[np.ndarray, np.ndarray]:
    """Find the cells that the wheels ran over in windows of time.

    Parameters
    ----------
    track, vehicle
        The way, and the wheels' places in the vehicle frame; without a vehicle, its reference point.
    start_s, end_s : (m,)
        The windows [s].
    cell_size_m
        Edge of a cell [m].

    Returns
    -------
    window : (p,)
        Index of a window; each pair of window and cell comes once.
    cells : (p, 2)
        A cell that a wheel ran over in it.
    """
    if not len(start_s):
        return np.empty(0, dtype=np.int64), np.empty((0, 2), dtype=np.int64)
    reach = float(np.nanmax(track.speed_m_s, initial=0.0)) * (end_s - start_s)
    steps = np.clip(np.ceil(4.0 * reach / cell_size_m), 1, _MAX_STEPS).astype(int)
    places = np.array([wheel.position_m for wheel in vehicle.wheels] if vehicle and vehicle.wheels else [(0.0, 0.0)])
    places, parts = np.unique(places, axis=0), []
    for count in np.unique(steps).tolist():  # each window by itself, whatever others it is asked for with
        window = np.flatnonzero(steps == count)
        at = (end_s - start_s)[window, None] * (np.arange(count) + 0.5)[None, :] / count
        x, y, yaw = track.place_at(start_s[window, None] + at)
        wheel_x, wheel_y = moved(x[..., None], y[..., None], yaw[..., None], places[:, 0], places[:, 1])
        which = np.broadcast_to(window[:, None, None], wheel_x.shape)
        there = np.isfinite(wheel_x) & np.isfinite(wheel_y)
        parts.append(np.column_stack([which[there], cells_of(wheel_x[there], wheel_y[there], cell_size_m)]))
    rows = np.unique(np.concatenate(parts), axis=0)
    return rows[:, 0], rows[:, 1:]
