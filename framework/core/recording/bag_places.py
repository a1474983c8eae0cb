"""Where a bag's vehicle was, and how it leant: poses, fixes of a satellite receiver, attitude."""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from ..origin import ECCENTRICITY2, SEMI_MAJOR_M, Origin
from .bag_messages import DecodeError, fields_of, number
from .bag_messages import field as field_of
from .clock import interpolate
from .topic_map import PoseTopic, Reading
from .types import Pose

FIXES = "fixes"
"""Frame of places that are made of fixes: metres about the origin that is stated, or else the first fix."""

UNNAMED = "unnamed"
"""Frame of a bag's places where no message names it."""

_STAYING = ("", "map", "earth", "utm")
"""Frames that are the same in each recording: that of a folder's site, and those of localisation (ROS REP 105)."""

FAR_M, MISFIT_M = 5.0, 3.0
"""Way [m] from which on two tracks show how one is turned to the other, and how well they have to agree then."""


def reading(content: Any, source: Reading) -> float:
    """Give a number of a message in SI units; raises `DecodeError` where the field is not there."""
    return number(content, source.field) * source.scale + source.offset


def pose_of(content: Any, source: PoseTopic) -> tuple[float, float, float]:
    """Give x [m], y [m] and yaw [rad] of a message; raises `DecodeError` where it has no such fields."""
    if source.fields:
        if missing := [name for name in ("x_m", "y_m", "yaw_rad") if name not in source.fields]:
            raise DecodeError(f"the topic map gives no field for {missing[0]}")
        x, y, yaw = (reading(content, source.fields[name]) for name in ("x_m", "y_m", "yaw_rad"))
        return x, y, yaw
    pose = field_of(content, source.pose or "pose")
    qx, qy, qz, qw = (number(pose, f"orientation.{axis}") for axis in "xyzw")
    yaw = np.arctan2(2.0 * (qw * qz + qx * qy), 1.0 - 2.0 * (qy * qy + qz * qz))
    return number(pose, "position.x"), number(pose, "position.y"), float(yaw)


def frame_of(content: Any) -> str:
    """Give the frame that a message's header names; empty where it has none."""
    for path in ("header.frame_id", "frame_id"):
        with suppress(DecodeError):
            return str(field_of(content, path))
    return ""


def is_oriented(sample: Any) -> bool:
    """Say whether a message of an inertial sensor has an orientation; a covariance of -1 says that it has none."""
    if sample is None:
        return True
    with suppress(DecodeError):
        if number(sample, "orientation_covariance[0]") == -1.0:
            return False
    try:
        return any(number(sample, f"orientation.{axis}") for axis in "xyzw")
    except DecodeError:
        return False


def stays(frame: str) -> bool:
    """Say whether a frame of this name is the same in each recording; those of odometry start with the recording."""
    return frame.strip("/").rpartition("/")[2] in _STAYING


@dataclass
class Fixes:
    """Places of a satellite receiver (sensor_msgs/NavSatFix, foxglove.LocationFix), collected message by message."""

    time_ns: list[int] = field(default_factory=list)
    latitude_deg: list[float] = field(default_factory=list)
    longitude_deg: list[float] = field(default_factory=list)

    def __len__(self) -> int:
        return len(self.time_ns)

    def add(self, time_ns: int, content: Any) -> None:
        """Add a message that has a place: without satellites it has none. Raises `DecodeError` where it is no fix."""
        latitude, longitude = number(content, "latitude"), number(content, "longitude")
        without = "status" in fields_of(content) and number(content, "status.status") < 0
        if not without and math.isfinite(latitude) and math.isfinite(longitude):
            self.time_ns.append(time_ns)
            self.latitude_deg.append(latitude)
            self.longitude_deg.append(longitude)

    def clear(self) -> None:
        """Forget those that were added."""
        for each in (self.time_ns, self.latitude_deg, self.longitude_deg):
            each.clear()

    def time_s(self, origin_ns: int) -> np.ndarray:
        """Times (m,) on the recording's clock [s]."""
        return (np.array(self.time_ns, dtype=np.int64) - origin_ns) * 1e-9

    def places(self) -> tuple[np.ndarray, np.ndarray]:
        """Latitudes and longitudes, (m,) each [deg]."""
        return np.array(self.latitude_deg), np.array(self.longitude_deg)

    def origin_of(self, pose: Pose, origin_ns: int) -> Origin | None:
        """Find where on Earth x = y = 0 of poses lies; None where fixes and poses do not say."""
        place = np.column_stack([pose.x_m, pose.y_m])
        return origin_of_frame(pose.time_s, place, self.time_s(origin_ns), *self.places())


def origin_of_frame(
    time_s: np.ndarray, place: np.ndarray, fix_s: np.ndarray, latitude_deg: np.ndarray, longitude_deg: np.ndarray
) -> Origin | None:
    """Find where on Earth a local frame's x = y = 0 lies, by turning and moving its track onto the fixes.

    Least squares (S. Umeyama, IEEE Trans. Pattern Anal. Mach. Intell. 13 (1991), 376-380), the scale held.

    Parameters
    ----------
    time_s, place : (n,), (n, 2)
        The local track [s], [m].
    fix_s, latitude_deg, longitude_deg : (m,)
        The fixes.

    Returns
    -------
    Origin or None
        None where the track is too short to say how it is turned, or does not agree with the fixes.
    """
    first = Origin(float(latitude_deg[0]), float(longitude_deg[0]))
    east, north = first.east_north(latitude_deg, longitude_deg)
    local = interpolate(time_s, place[:, 0], fix_s, 2.0) + 1j * interpolate(time_s, place[:, 1], fix_s, 2.0)
    there = np.isfinite(local)
    local, earth = local[there], (east + 1j * north)[there]
    if len(local) < 3 or np.abs(local - local.mean()).max() < FAR_M:
        return None
    a, b = local - local.mean(), earth - earth.mean()
    turn = np.vdot(a, b)
    turn /= abs(turn) or 1.0
    if np.sqrt(np.mean(np.abs(b - turn * a) ** 2)) > MISFIT_M:
        return None
    zero = earth.mean() - turn * local.mean()
    here = math.radians(first.latitude_deg)
    across = SEMI_MAJOR_M / math.sqrt(1.0 - ECCENTRICITY2 * math.sin(here) ** 2)
    along = across**3 * (1.0 - ECCENTRICITY2) / SEMI_MAJOR_M**2
    # The y axis points 90 degrees to the left of x; the heading is counted clockwise from north.
    # Rounded to 0.1 mm and 0.02 arc seconds, for the last digits are the processor's.
    return Origin(
        round(first.latitude_deg + math.degrees(zero.imag / along), 9),
        round(first.longitude_deg + math.degrees(zero.real / (across * math.cos(here))), 9),
        round(-math.degrees(float(np.angle(turn))), 6),
    )


def pitch_and_roll(quaternions: np.ndarray, mount: np.ndarray | None) -> tuple[np.ndarray, np.ndarray]:
    """Give pitch, nose up, and roll, left side up, (n,) each [rad], of the vehicle.

    Parameters
    ----------
    quaternions : (n, 4)
        x, y, z, w, in a frame whose z axis points up.
    mount : (3, 3)
        Axes of the sensor in those of the vehicle; None where they are the vehicle's.
    """
    turned = Rotation.from_quat(quaternions).as_matrix()
    if mount is not None:
        turned = turned @ mount.T
    return np.arcsin(np.clip(turned[:, 2, 0], -1.0, 1.0)), np.arcsin(np.clip(turned[:, 2, 1], -1.0, 1.0))


def attitude_of(
    rows: Sequence[tuple[float, ...]], mount: np.ndarray | None, origin_ns: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Give time [s], pitch and roll [rad], (n,) in order of time, of messages of the attitude.

    Parameters
    ----------
    rows
        Time [ns] and quaternion x, y, z, w of each; those that are no rotations are left out.
    mount
        As of `pitch_and_roll`.
    origin_ns
        Zero of the recording's clock [ns].
    """
    time_s = (np.array([each[0] for each in rows], dtype=np.int64) - origin_ns) * 1e-9
    turns = np.array([each[1:] for each in rows]).reshape(-1, 4)
    good = np.isfinite(turns).all(axis=1) & (np.linalg.norm(turns, axis=1) > 0.5)
    if not good.any():
        return np.empty(0), np.empty(0), np.empty(0)
    order = np.argsort(time_s[good], kind="stable")
    pitch, roll = pitch_and_roll(turns[good][order], mount)
    return time_s[good][order], pitch, roll


def in_order(time: np.ndarray, rows: np.ndarray) -> Pose | None:
    """Make poses of times (n,) [s] and rows (n, 3) of x, y [m] and yaw [rad], those that are not finite left out."""
    order = np.argsort(time, kind="stable")
    order = order[np.isfinite(rows[order]).all(axis=1)]
    if not len(order):
        return None
    time, rows = time[order], rows[order]
    return Pose(time, rows[:, 0], rows[:, 1], np.unwrap(rows[:, 2]))
