"""Travel speed from places, where none was recorded: from a satellite receiver, or an odometry that sees the ground."""

from __future__ import annotations

import numpy as np
from scipy.integrate import cumulative_trapezoid

from ...framework.core.findings import Finding, note, warning
from ...framework.core.recording.bag_wheel import follows_the_wheels
from ...framework.core.recording.clock import interpolate
from ...framework.core.recording.types import Pose, WheelTable
from ...framework.core.vehicle import Vehicle
from .noise import noise_from_neighbours, noise_of_series

WINDOWS_S = (0.5, 1.0, 2.0, 4.0)
"""Times over which a speed is taken [s]: the shortest in which it is known to `KNOWN`, for slip changes meanwhile."""

KNOWN, LEAST_KNOWN = 0.03, 0.3
"""Standard deviation of the speed that is wanted, and from which on none is given, relative to the rim's speed [-]."""

_COMPARED_S = 2.0
"""The speed is compared with the wheels' own over this time at least [s], in which noise of an encoder averages out."""

_FEWEST = 3
"""Fewest places in a window."""


def with_travel_speed(
    table: WheelTable, vehicle: Vehicle, pose: Pose | None
) -> tuple[WheelTable, Vehicle, Finding | None]:
    """Return the rows with the travel speed that the poses show, the vehicle with the slip's noise, and a finding.

    The speed is the slope of a straight line through the way covered in a window about each pose, over the cosine of
    the pitch where it is known, for places are on the map. Its standard deviation follows from the scatter of the
    places about smooth motion; errors that drift, as of a receiver without corrections, are not seen. All are as they
    are where slip or travel speed was recorded, or there are no poses or wheel speeds. Poses made from the wheels show
    no slip: they are not used, with a warning, nor are such as know the speed worse than to `LEAST_KNOWN`.

    Parameters
    ----------
    table
        Rows of wheels, with `time_s` and `wheel_speed_rad_s`.
    vehicle
        Its wheels' radii.
    pose
        Where the vehicle was, with its heading.
    """
    known = any(table.observed(name).size for name in ("slip", "travel_speed_m_s"))
    if known or pose is None or table.run is not None or not vehicle.wheels:
        return table, vehicle, None
    if "time_s" not in table or not table.observed("wheel_speed_rad_s").size:
        return table, vehicle, None
    time_s, way_m = _way(pose)
    rim_m_s = vehicle.wheels[0].radius_m * float(np.median(np.abs(table.observed("wheel_speed_rad_s"))))
    noise_m = np.nan_to_num(noise_of_series([way_m]))
    window_s, speed, sd_m_s = _shortest(time_s, way_m, noise_m, KNOWN * rim_m_s)
    values = {"window_s": window_s, "sd_m_s": sd_m_s, "rim_m_s": rim_m_s, "place_sd_m": noise_m}
    if not sd_m_s <= LEAST_KNOWN * rim_m_s:
        return table, vehicle, warning("travel_speed_uncertain", **values)
    made = follows_the_wheels(_smoothed(table, time_s, way_m, max(window_s, _COMPARED_S)), vehicle)
    if made:
        return table, vehicle, warning("travel_speed_of_wheels", how=made)
    travel = interpolate(time_s, speed, table["time_s"], window_s)
    if "pitch_rad" in table:
        travel = travel / np.cos(np.nan_to_num(table["pitch_rad"]))
    rim_sd_m_s = vehicle.wheels[0].radius_m * noise_from_neighbours(table, table["wheel_speed_rad_s"])
    slip_sd = float(np.hypot(sd_m_s, rim_sd_m_s)) / rim_m_s
    if slip_sd > 0.0:  # neighbours share a window, and do not show it
        vehicle = vehicle.model_copy(update={"noise": {"slip": slip_sd, **vehicle.noise}})
    found = note("travel_speed_computed", **values)
    return table.adding({"travel_speed_m_s": travel}), vehicle, found


def _way(pose: Pose) -> tuple[np.ndarray, np.ndarray]:
    """Times (n,) [s], increasing, and the way covered along the heading, backwards negative, (n,) [m]."""
    good = np.isfinite(np.column_stack([pose.time_s, pose.x_m, pose.y_m, pose.yaw_rad])).all(axis=1)
    time_s, rows = np.unique(pose.time_s[good], return_index=True)
    x_m, y_m, yaw = (values[good][rows] for values in (pose.x_m, pose.y_m, np.unwrap(pose.yaw_rad)))
    middle = 0.5 * (yaw[1:] + yaw[:-1])
    steps = np.diff(x_m) * np.cos(middle) + np.diff(y_m) * np.sin(middle)
    return time_s, np.concatenate([[0.0], np.cumsum(steps)])[: len(time_s)]


def _shortest(
    time_s: np.ndarray, way_m: np.ndarray, noise_m: float, wanted_m_s: float
) -> tuple[float, np.ndarray, float]:
    """Give the shortest window [s] in which the speed (n,) [m/s] is as well known as wanted, else the longest; the
    speed, and its standard deviation [m/s], infinite where no window holds enough places.
    """
    found = WINDOWS_S[0], np.full(len(time_s), np.nan), np.inf
    for window_s in WINDOWS_S:
        speed, error = slopes(time_s, way_m, window_s)
        if np.isfinite(error).any():
            found = window_s, speed, noise_m * float(np.nanmedian(error))
        if found[2] <= wanted_m_s:
            break
    return found


def slopes(time_s: np.ndarray, values: np.ndarray, window_s: float) -> tuple[np.ndarray, np.ndarray]:
    """Slope (n,) of a straight line through the values (n,) in a window about each time [s], by least squares.

    Returns
    -------
    slope, error : (n,)
        Slope [1/s], and its standard deviation for values of standard deviation 1; NaN where fewer than `_FEWEST`
        values are in the window, or they span less than half of it.
    """
    first = np.searchsorted(time_s, time_s - 0.5 * window_s)
    last = np.searchsorted(time_s, time_s + 0.5 * window_s, side="right")
    time = time_s - np.mean(time_s) if len(time_s) else time_s
    moments = (np.ones(len(time)), time, values, time**2, time * values)
    sums = [np.concatenate([[0.0], np.cumsum(each)]) for each in moments]
    n, t, v, tt, tv = (each[last] - each[first] for each in sums)
    spread = tt - t * t / n
    few = (n < _FEWEST) | (time_s[last - 1] - time_s[first] < 0.5 * window_s)
    with np.errstate(divide="ignore", invalid="ignore"):
        slope, error = (tv - t * v / n) / spread, 1.0 / np.sqrt(spread)
    return np.where(few, np.nan, slope), np.where(few, np.nan, error)


def _smoothed(table: WheelTable, time_s: np.ndarray, way_m: np.ndarray, window_s: float) -> WheelTable:
    """Rows at the poses' times, of each wheel, with the speed from places and the wheels' own over the same window."""
    speed_m_s = slopes(time_s, way_m, window_s)[0]
    names = [None] if table.wheel is None else sorted(set(table.wheel.tolist()))
    parts = []
    for name in names:
        own = table if name is None else table.select(table.wheel == name)
        rate = np.nan_to_num(own["wheel_speed_rad_s"])
        turned = np.interp(time_s, own["time_s"], cumulative_trapezoid(rate, own["time_s"], initial=0.0))
        parts.append(slopes(time_s, turned, window_s)[0])
    outside = (time_s < table["time_s"].min()) | (time_s > table["time_s"].max())
    columns = {
        "time_s": np.tile(time_s, len(names)), "wheel_speed_rad_s": np.concatenate(parts),
        "travel_speed_m_s": np.tile(np.where(outside, np.nan, speed_m_s), len(names)),
    }  # fmt: skip
    wheel = None if names == [None] else np.repeat(np.array(names, dtype=object), len(time_s))
    return WheelTable(columns, wheel, None, table.source)
