"""The soil of stretches that are complete while a drive goes on, for the planner's snapshots."""

from __future__ import annotations

import queue
import threading
from collections import deque
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ...database.observations import SoilObservation
from ...database.physics import ClassPhysics
from ..core.recording.types import Pose, Recording
from ..core.recording.wheel_file import derive_all
from ..core.track.way import Track, cells_under_wheels
from ..engine import learn_known_soil
from ..known_physics import KnownPhysics
from ..segments import ClassTrack, classes_along
from .ground import GroundByNow
from .log import WheelRow, table_of_rows
from .observing import described
from .track import KEPT_S, LiveTrack

LONGEST_S = 50.0
"""A stretch that goes on is taken for complete after so long [s]: places are kept for a minute."""

_JOINED_S = 0.5
"""Two pieces of one stretch end and begin this close to where it was cut [s]."""


class StretchSoils:
    """Identifies each stretch that is complete, as a run does, in a thread of its own.

    A stretch is complete where the ground changes, and after `LONGEST_S`. What it gives is for the way: when the drive
    is closed its soil is identified from all of it.

    Parameters
    ----------
    drive
        The recording that is being made, in the frame of its site.
    physics
        What is known of the physics of classes.
    ground, track
        What is believed of the ground, and where the vehicle is.
    cell_size_m
        Edge of a cell [m].

    Attributes
    ----------
    fault
        Why the last stretch could not be identified; empty where it could, or where its rows do not allow it.
    """

    def __init__(
        self, drive: Recording, physics: Sequence[ClassPhysics], ground: GroundByNow, track: LiveTrack,
        cell_size_m: float,
    ):  # fmt: skip
        self._drive, self._physics, self._ground, self._track = drive, physics, ground, track
        self._cell_size_m = cell_size_m
        self._rows: deque[tuple[float, WheelRow]] = deque()
        self._since_s: float | None = None
        self._lock = threading.Lock()
        self._complete: queue.Queue[tuple[float, float] | None] = queue.Queue()
        self._observed: tuple[SoilObservation, ...] = ()
        self._is_new = False
        self.fault = ""
        self._thread = threading.Thread(target=self._work, name="bevameter stretches", daemon=True)

    def begin(self) -> None:
        """Begin to identify."""
        self._thread.start()

    def end(self) -> None:
        """Identify no more stretch: the whole drive will be."""
        self._complete.put(None)

    def put(self, time_s: float, row: WheelRow) -> None:
        """Take in a sample of a wheel."""
        with self._lock:
            self._rows.append((time_s, row))
            while self._rows[0][0] < time_s - KEPT_S:
                self._rows.popleft()
            since_s = self._since_s = time_s if self._since_s is None else self._since_s
        if time_s - since_s > LONGEST_S:
            self.complete(time_s)

    def complete(self, time_s: float) -> None:
        """Say that the stretch in progress ended at a time [s]."""
        with self._lock:
            since_s, self._since_s = self._since_s, time_s
        if since_s is not None and since_s < time_s:
            self._complete.put((since_s, time_s))

    def take(self) -> tuple[SoilObservation, ...]:
        """Give all stretches that were identified by now; none where no other one was since the last time."""
        with self._lock:
            is_new, self._is_new = self._is_new, False
            return self._observed if is_new else ()

    def _work(self) -> None:
        while (stretch := self._complete.get()) is not None:
            try:
                found = self._identified(*stretch)
            except Exception as error:  # the next stretch may be usable
                self.fault = f"the soil of a stretch is not identified on the way: {described(error)}"
                continue
            self.fault = ""
            if found:
                with self._lock:
                    self._observed, self._is_new = (*self._observed, *found), True

    def _identified(self, start_s: float, end_s: float) -> tuple[SoilObservation, ...]:
        vehicle, track = self._drive.vehicle, self._track.now()
        with self._lock:
            rows = [each for each in self._rows if start_s <= each[0] <= end_s]
        if not rows or track is None or vehicle is None:
            return ()
        table = derive_all(table_of_rows(rows), vehicle)
        pose = Pose(track.time_s, track.x_m, track.y_m, track.yaw_rad)
        part = replace(self._drive, wheel=table, pose=pose, camera=None, sound=None)
        along = self._along(track)
        soil = learn_known_soil(part, track, along, KnownPhysics.of(self._physics, part))
        return tuple(
            _joined(each, start_s, end_s)
            for each in soil.observations
            if each.estimate is not None and each.class_probabilities
        )

    def _along(self, track: Track) -> ClassTrack:
        times, vehicle = track.every(self._cell_size_m), self._drive.vehicle
        _, cells = cells_under_wheels(track, vehicle, times[:-1], times[1:], self._cell_size_m)
        belief = self._ground.belief(np.unique(cells, axis=0))
        return classes_along(belief, track, vehicle, self._cell_size_m)


def _joined(observation: SoilObservation, start_s: float, end_s: float) -> SoilObservation:
    """Let pieces of a stretch that was cut by its length alone end and begin where it was cut: they are one place."""
    first = start_s if observation.start_s < start_s + _JOINED_S else observation.start_s
    last = end_s if observation.end_s > end_s - _JOINED_S else observation.end_s
    return replace(observation, start_s=first, end_s=last)
