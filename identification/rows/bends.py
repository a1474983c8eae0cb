"""Travel speed and slip angle of each wheel in bends, from the vehicle's own speed and its turning.

A point at (x, y) of a rigid vehicle that moves ahead by V and turns by w moves ahead by V - w y and aside by w x
(K. Iagnemma and S. Dubowsky, *Mobile Robots in Rough Terrain* (2004), Sec. 2.3).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...framework.core.findings import Finding, note
from ...framework.core.recording.clock import interpolate
from ...framework.core.recording.types import Pose, WheelTable
from ...framework.core.recording.wheel_file import derive_all, slip_from_speeds
from ...framework.core.vehicle import Vehicle
from .noise import noise_of_series
from .travel import WINDOWS_S, slopes

_KNOWN = 0.01
"""Standard deviation of what turning adds to a wheel's speed that is small, relative to the speed [-]."""

_SHOWS = 0.01
"""Share of the speed that is worth a note [-]."""


def with_bends(
    table: WheelTable, vehicle: Vehicle, pose: Pose | None
) -> tuple[WheelTable, Finding | None]:  # fmt: skip
    """Return the rows with the travel speed, slip and slip angle of each wheel, and a note; as they are where turning
    or the wheels' places are not known, or turning so badly that it would add more error than it takes away.

    Wheels count as not steered: one that is has no such slip angle, and a column `slip_angle_rad` of its own says so.

    Parameters
    ----------
    table
        Rows of named wheels, with `time_s` and the vehicle's own `travel_speed_m_s`, which is that of its reference
        point; slip that is derived of it is derived again.
    vehicle
        Its wheels' places.
    pose
        Its heading.
    """
    if pose is None or table.wheel is None or not {"time_s", "travel_speed_m_s"} <= set(table.columns):
        return table, None
    of = {wheel.name: wheel for wheel in vehicle.wheels}
    names = table.wheel.astype(str).tolist()
    if not set(names) <= set(of):
        return table, None
    x_m, y_m = np.array([of[name].position_m for name in names], dtype=float).T
    speed = table["travel_speed_m_s"]
    turning = _turning(pose, table["time_s"], float(np.abs([x_m, y_m]).max()), float(np.nanmedian(np.abs(speed))))
    if turning is None:
        return table, None
    ahead, aside = speed - turning * y_m, turning * x_m
    share = np.abs(turning * y_m) > _SHOWS * np.abs(speed)
    columns = {**table.columns, "travel_speed_m_s": ahead}
    if "slip_angle_rad" not in table:
        columns["slip_angle_rad"] = np.arctan2(aside, np.maximum(np.abs(ahead), 1e-9))
    radius = np.array([of[name].radius_m for name in names])
    rim = table.get("wheel_speed_rad_s")
    if rim is not None and "slip" in table:
        derived = slip_from_speeds(rim * radius, speed)
        if np.allclose(derived, table["slip"], atol=1e-9, equal_nan=True):
            del columns["slip"]
    answer = replace(table, columns=columns)
    answer = answer if "slip" in columns else derive_all(answer, vehicle)
    most = float(np.nanmax(np.abs(turning * y_m), initial=0.0))
    return answer, note("bends", n=int(share.sum()), most_m_s=most) if share.any() else None


def _turning(pose: Pose, at_s: np.ndarray, reach_m: float, speed_m_s: float) -> np.ndarray | None:
    """Rate of turning (n,) [rad/s] at times [s], over the shortest window in which it is known; None where in none."""
    seen = np.isfinite(pose.yaw_rad)
    time_s, rows = np.unique(pose.time_s[seen], return_index=True)
    if len(time_s) < 3 or not reach_m > 0.0:
        return None
    yaw = np.unwrap(pose.yaw_rad[seen][rows])
    noise = np.nan_to_num(noise_of_series([yaw]))
    for window_s in WINDOWS_S:
        rate, error = slopes(time_s, yaw, window_s)
        if np.isfinite(error).any() and reach_m * noise * float(np.nanmedian(error)) <= _KNOWN * speed_m_s:
            return np.nan_to_num(interpolate(time_s, rate, at_s, window_s))
    return None
