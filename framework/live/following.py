"""An MCAP file that grows, or comes through standard input, as a drive that goes on."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ...database.store import TerrainDatabase
from ..core.arguments import path_of
from ..core.recording.bag_increments import BagIncrements, Sample, look_at
from ..core.recording.growing import Growing, GrowingBag
from ..core.recording.readers import vehicle_near
from ..core.recording.types import Recording
from ..core.vehicle import Vehicle, as_vehicle
from ..summary import TraverseSummary
from .clock import DriveClock
from .intake import STREAMS
from .live import LiveTraverse
from .log import WHEEL, WheelRow

HORIZON_S = 1.0
"""Messages may be so much later in the file than others that were taken after them [s]."""


class Following:
    """Follows an MCAP file.

    Parameters
    ----------
    file
        The file; standard input where None.
    vehicle
        The vehicle, or its file; ``vehicle.toml`` beside the file where None.
    topics
        The topic map, where names and types of topics do not say enough.
    idle_s
        The file is taken to be complete where nothing came for so long [s].

    Attributes
    ----------
    source
        Its bytes; `source.stop` ends the following.
    recording
        What it would be if it ended after the first seconds, by which its streams were recognised.

    Raises
    ------
    InputError
        The file, the vehicle or the topic map cannot be used, or no topic is recognised.
    """

    def __init__(
        self,
        file: str | Path | None,
        *,
        vehicle: Vehicle | str | Path | None = None,
        topics: str | Path | None = None,
        idle_s: float = math.inf,
    ):
        path = None if file is None else path_of("file", file, "the path of an MCAP file")
        topic_map = None if topics is None else path_of("topics", topics, "the path of a topic map")
        driven = as_vehicle(vehicle) if vehicle is not None else None if path is None else vehicle_near(path)
        self.source = Growing.of(path, idle_s)
        self._bag = GrowingBag(self.source)
        self._messages = self._bag.messages()
        self._beginning = look_at(self._messages, self.source.path, self._bag.problems, driven, topic_map)
        self._increments: BagIncrements | None = None
        self._clock = DriveClock()

    @property
    def recording(self) -> Recording:
        """What the file would be if it ended after the first seconds."""
        return self._beginning.recording

    @property
    def is_whole(self) -> bool:
        """Whether all of the file was handed over."""
        return self._bag.is_whole

    def begin(self, database: TerrainDatabase | str | Path, **options: Any) -> LiveTraverse:
        """Begin the drive; `options` are those of `LiveTraverse.like`. The file waits for senses that are slower."""
        return LiveTraverse.like(self.recording, database, horizon_s=HORIZON_S, lossless=True, **options)

    def hand_over(self, live: LiveTraverse, show: Callable[[float, np.ndarray], None] | None = None) -> None:
        """Hand over all messages as they come, up to the end of the file or until `source.stop`.

        Parameters
        ----------
        live
            The drive.
        show
            Called with each image that could be read, too.
        """
        increments = self._increments = BagIncrements(self._beginning, live.needed_s)
        held = self._beginning.held[::-1]
        self._beginning.held.clear()
        while held:
            for sample in increments.take(held.pop()):
                self._put(live, sample, show)
        for message in self._messages:
            for sample in increments.take(message):
                self._put(live, sample, show)
        for sample in increments.end():
            self._put(live, sample, show)
        for stream in STREAMS:
            for time_s, values in self._clock.let_go(stream):
                _hand_over(live, Sample(stream, time_s, values), show)

    def _put(self, live: LiveTraverse, sample: Sample, show: Callable[[float, np.ndarray], None] | None) -> None:
        # On the drive's clock already here: `needed_s` of a drive that is resumed is, too.
        for time_s, values in self._clock.on_one_clock(*sample):
            _hand_over(live, Sample(sample.stream, time_s, values), show)

    def close(self, live: LiveTraverse) -> TraverseSummary:
        """End the drive and store it, so that `run_traverse` finds it again by the file; see `LiveTraverse.close`."""
        assert self._increments is not None
        summary = live.close(self._increments.digest)
        said = dict.fromkeys(
            (*summary.problems, *self._clock.problems, *self._bag.problems, *self._increments.problems)
        )
        return replace(summary, problems=tuple(said))


def _hand_over(live: LiveTraverse, sample: Sample, show: Callable[[float, np.ndarray], None] | None) -> None:
    stream, time_s, values = sample
    if time_s < live.needed_s:
        return
    if stream == "wheel":
        live._put(WHEEL, time_s, WheelRow(*values))  # the names were checked; one wheel may stand for several
    elif stream == "imu":
        live.imu(time_s, **dict(zip(("wx", "wy", "wz", "ax", "ay", "az"), values, strict=True)))
    elif stream == "image":
        image, problem = values
        live.image(time_s, image, problem=problem)
        if show is not None and image is not None:
            show(time_s, image)
    elif stream == "sound":
        live.sound(time_s, *values)
    else:
        live.pose(time_s, *values)
