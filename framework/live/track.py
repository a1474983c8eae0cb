"""Where the vehicle is and was a minute ago, as far as that is known by now."""

from __future__ import annotations

import math
import threading
from pathlib import Path

import numpy as np

from ..core.recording.types import Pose, Recording, WheelTable
from ..core.track.jumps import reaches
from ..core.track.way import BRIDGED_S, SPEED_WINDOW_S, Track, bridged_s, track_of
from .columns import Columns

KEPT_S = 60.0
"""Places are kept so long while driving [s]; those of the whole drive are in its log."""

_INSISTING = 10
"""So many poses in a row that no vehicle gets to from the last are believed."""

_NOWHERE = Path("live")


class LiveTrack:
    """A `Track` that grows: the same places and speeds between two poses that the whole track gives later.

    That is why what was observed waits for the pose that follows it (`covers`), but for no longer than a straight line
    may join two poses (`way.bridged_s`): where none has come by then, nobody knows the place.
    """

    def __init__(self) -> None:
        self._poses = Columns(4, KEPT_S)
        self._speeds = Columns(2, KEPT_S)
        self._track: Track | None = None
        self._bridge_s: float | None = None
        self._clock_s = -math.inf
        self._began_s = math.inf
        self._yaw_rad = 0.0
        self._has_ended = False
        self._off = self.lost = 0
        self._lock = threading.RLock()

    def go_on(self, clock_s: float) -> None:
        """Say how late it is by the newest sample of any stream [s]."""
        self._clock_s = max(self._clock_s, clock_s)
        self._began_s = min(self._began_s, clock_s)

    def add_pose(self, time_s: float, x_m: float, y_m: float, yaw_rad: float) -> None:
        """Add a pose; one that has the time of the last adds nothing."""
        if time_s <= self.last_pose_s or self._is_off(time_s, x_m, y_m):
            return
        if len(self._poses):  # continuous over a full turn, as `numpy.unwrap` makes it
            yaw_rad = float(np.unwrap([self._yaw_rad, yaw_rad])[1])
        with self._lock:
            self._yaw_rad = yaw_rad
            self._poses.append((time_s, x_m, y_m, yaw_rad))
            self._track = self._bridge_s = None

    def _is_off(self, time_s: float, x_m: float, y_m: float) -> bool:
        """Say whether no ground vehicle gets there from the last pose; poses that insist on it are believed."""
        if len(self._poses):
            before_s, *before, _ = self._poses.rows()[-1].tolist()
            if not reaches(time_s - before_s, math.dist(before, (x_m, y_m))):
                self._off += 1
                if self._off < _INSISTING:
                    self.lost += 1
                    return True
        self._off = 0
        return False

    def add_speed(self, time_s: float, travel_speed_m_s: float) -> None:
        """Add a travel speed."""
        with self._lock:
            self._speeds.append((time_s, travel_speed_m_s))
            self._track = None

    def end(self) -> None:
        """Say that nothing more will come."""
        self._has_ended = True

    @property
    def last_pose_s(self) -> float:
        """Time of the last pose [s]; minus infinity where there is none."""
        with self._lock:
            return float(self._poses.rows()[-1, 0]) if len(self._poses) else -math.inf

    def covers(self, time_s: float) -> bool:
        """Say whether no later sample is to be waited for to know the place and speed at a time [s]."""
        if self._has_ended:
            return True
        poses, speeds = self._poses.rows()[:, 0], self._speeds.rows()[:, 0]
        if self.last_pose_s < time_s:
            return self._clock_s > max(self.last_pose_s, self._began_s) + self._bridged_s()
        following = float(poses[np.searchsorted(poses, time_s)])
        if len(speeds) >= 2:
            return bool(speeds[-1] >= following) or self._clock_s > speeds[-1] + BRIDGED_S
        return bool(poses[-1] >= following + SPEED_WINDOW_S / 2) or self._clock_s > time_s + BRIDGED_S

    def _bridged_s(self) -> float:
        if self._bridge_s is None and len(self._poses) >= 2:
            self._bridge_s = bridged_s(self._poses.rows()[:, 0])
        return self._bridge_s or BRIDGED_S

    def now(self) -> Track | None:
        """Give the way of the last minute; None where nothing is known of it yet."""
        with self._lock:
            if self._track is None and len(self._poses) >= 2:
                self._track = self._made()
            return self._track

    def _made(self) -> Track | None:
        time_s, x_m, y_m, yaw_rad = self._poses.rows().T.copy()
        wheel = None
        if len(self._speeds):
            at, speed = self._speeds.rows().T.copy()
            wheel = WheelTable({"time_s": at, "travel_speed_m_s": speed}, None, None, _NOWHERE)
        pose = Pose(time_s, x_m, y_m, yaw_rad)
        return track_of(Recording("live", _NOWHERE, None, None, "", "", wheel=wheel, pose=pose))

    @property
    def speed_m_s(self) -> np.ndarray:
        """Travel speeds of the last minute, (n,) [m/s]."""
        track = self.now()
        return np.empty(0) if track is None else track.speed_m_s

    def place_at(self, time_s: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Give x [m], y [m] and heading [rad] at times of any shape [s]; NaN where nobody knows by now."""
        track, unknown = self.now(), self._beyond(time_s)
        if track is None:
            x_m, y_m, yaw_rad = np.full((3, *np.shape(time_s)), np.nan)
            return x_m, y_m, yaw_rad
        x_m, y_m, yaw_rad = (np.where(unknown, np.nan, each) for each in track.place_at(time_s))
        return x_m, y_m, yaw_rad

    def speed_at(self, time_s: np.ndarray) -> np.ndarray:
        """Give the travel speed at times of any shape [m/s]; NaN where nobody knows by now."""
        track = self.now()
        if track is None:
            return np.full(np.shape(time_s), np.nan)
        return np.where(self._beyond(time_s), np.nan, track.speed_at(time_s))

    def _beyond(self, time_s: np.ndarray) -> np.ndarray:
        """Times that no pose follows yet: between poses, or in a hole, nobody knows."""
        return (np.asarray(time_s) > self.last_pose_s) & (not self._has_ended)
