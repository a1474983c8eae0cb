"""Senses that read a recording's tables, such as that of vibration, observe a drive that goes on piece by piece."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

from ..core.classifier.classifier import TerrainClassifier
from ..core.recording.types import Recording
from ..senses import Observation, Sense
from .log import IMU, POSE, WHEEL, Log, pose_of, vibration_of_imu, wheel_of
from .streams import Waiting
from .track import LiveTrack

PIECE_S = 6.4
"""Length of a piece [s]: two windows of the vibration sense."""

_MOST_PIECES = 4
"""Pieces that wait for their sense, at most."""


class LivePieces(Waiting):
    """Rows of places, wheels and inertial sensor, cut into pieces as they come; for one reader."""

    def __init__(self, changed: threading.Condition, track: LiveTrack):
        super().__init__(changed, track)
        self._log = Log()
        self._since_s: float | None = None

    def put(self, stream: str, time_s: float, row: Any) -> None:
        """Take in a row, in order of time; `changed` is held."""
        if not self.is_used or self.has_ended:
            return
        self._log.add(stream, time_s, row)
        self._since_s = time_s if self._since_s is None else self._since_s
        if time_s - self._since_s >= PIECE_S:
            self.count += 1
            self.add(time_s, self._log)
            self._log, self._since_s = Log(), time_s
            if len(self._items) > _MOST_PIECES:
                self.drop_first()

    def recordings(self, drive: Recording, placed: Callable[[Recording], Recording]) -> Iterator[Recording]:
        """Yield the pieces of a drive as they come; `placed` puts their places into the site's frame."""
        while isinstance(log := self.take(), Log):
            parts = {stream: [columns] for stream, columns in log.cut()}
            wheel = None if drive.vehicle is None else wheel_of(parts.get(WHEEL, []), drive.vehicle)
            vibration, _ = vibration_of_imu(parts.get(IMU, []), wheel)
            pose = pose_of(parts.get(POSE, []))
            yield placed(replace(drive, wheel=wheel, vibration=vibration, pose=pose, camera=None, sound=None))


def observed_in_pieces(
    sense: Sense, pieces: Iterator[Recording], track: LiveTrack, model: TerrainClassifier, cell_size_m: float
) -> Iterator[Observation]:
    """Yield what a sense observes of the pieces that it can observe."""
    for piece in pieces:
        if not sense.absence(piece):
            yield from sense.observe(piece, track, model, cell_size_m)
