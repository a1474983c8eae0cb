"""Where samples come in: put in order, kept, and given on to what waits for them."""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Iterable, Mapping
from typing import Any

import numpy as np

from ..core.errors import InputError
from ..core.origin import Offset
from ..core.recording.types import Frame
from .clock import DriveClock
from .log import IMU, POSE, WHEEL, Log, Part, WheelRow
from .order import InOrder
from .pieces import LivePieces
from .streams import LiveCamera, LiveSound
from .track import KEPT_S, LiveTrack

IMAGE, SOUND = "image", "sound"
STREAMS = (POSE, WHEEL, IMU, IMAGE, SOUND)

LONGEST_BLOCK_S = 1.0
"""Blocks of sound are no longer, where a drive is resumed [s]."""

Columns = dict[str, np.ndarray]


class Intake:
    """Takes samples of all sensors, from any thread.

    Parameters
    ----------
    horizon_s
        How much later than another a sample may come that was taken before it [s].
    lossless
        Whether a caller who is faster than the senses has to wait.
    offset
        Where the frame of the poses lies in the site's; None where they are one.
    follow_wheel
        Called with each sample of a wheel, in order.

    Attributes
    ----------
    changed
        Guards all of it, and is notified of what comes.
    """

    def __init__(self, horizon_s: float, lossless: bool, offset: Offset | None):
        self.changed = threading.Condition(threading.RLock())
        self.track, self.log = LiveTrack(), Log()
        self.camera = LiveCamera(self.changed, self.track, lossless=lossless)
        self.sound = LiveSound(self.changed, self.track, lossless=lossless)
        self.of_senses: dict[str, tuple[LiveCamera, LiveSound]] = {}
        self.pieces: list[LivePieces] = []
        self._clock = DriveClock()
        self.has_ended = False
        self.follow_wheel: Callable[[float, WheelRow], None] | None = None
        self._horizon_s, self._lossless, self._offset = horizon_s, lossless, offset
        self._waiting: dict[str, InOrder[Any]] = {each: InOrder() for each in STREAMS}
        self._newest: dict[str, float] = {}
        self._speed_of: str | None = None

    def streams_for_sense(self) -> tuple[LiveCamera, LiveSound]:
        """Make streams of images and sound for one sense, as each of them is read once; `of_senses` is to hold them."""
        loaded = threading.Event()
        return (
            LiveCamera(self.changed, self.track, lossless=self._lossless, is_waited_for=loaded),
            LiveSound(self.changed, self.track, lossless=self._lossless, is_waited_for=loaded),
        )

    @property
    def _cameras(self) -> list[LiveCamera]:
        return [self.camera, *(camera for camera, _ in self.of_senses.values())]

    @property
    def _sounds(self) -> list[LiveSound]:
        return [self.sound, *(sound for _, sound in self.of_senses.values())]

    def put(self, stream: str, time_s: float, sample: Any) -> None:
        """Take in a sample, and give on what no earlier one is waited for any more; raises `InputError` at the end."""
        with self.changed:
            # Whatever comes may let images and sound go on that wait for earlier samples.
            while self._lossless and not self.has_ended and any(s.is_full() for s in (*self._cameras, *self._sounds)):
                self.changed.wait()
            if self.has_ended:
                raise InputError("LiveTraverse", "a sample after the drive was closed", expected="a new one")
            for at_s, one in self._clock.on_one_clock(stream, time_s, sample):
                if self._waiting[stream].put(at_s, one):
                    self._newest[stream] = max(at_s, self._newest.get(stream, at_s))
            self._give_on(self.clock_s - self._horizon_s)

    def _give_on(self, until_s: float) -> None:
        """Give on all samples up to a time [s]: what says where the vehicle was before what was observed there."""
        self.track.go_on(until_s)
        for time_s, row in self._waiting[POSE].until(until_s):
            self._add(POSE, time_s, row)
            self._add_pose(time_s, *row)
        for time_s, row in self._waiting[WHEEL].until(until_s):
            self._add(WHEEL, time_s, row)
            self._add_wheel(time_s, row)
        for time_s, row in self._waiting[IMU].until(until_s):
            self._add(IMU, time_s, row)
        for time_s, (image, problem) in self._waiting[IMAGE].until(until_s):
            for camera in self._cameras:
                camera.put(Frame(time_s, image, problem, urgent=True))
        for time_s, (samples, rate) in self._waiting[SOUND].until(until_s):
            for sound in self._sounds:
                sound.put(time_s, samples, rate)
        self.changed.notify_all()

    def _add(self, stream: str, time_s: float, row: Any) -> None:
        self.log.add(stream, time_s, row)
        for each in self.pieces:
            each.put(stream, time_s, row)

    def _add_pose(self, time_s: float, x_m: float, y_m: float, yaw_rad: float) -> None:
        if self._offset is not None:
            x, y = self._offset.moved(np.array(x_m), np.array(y_m))
            x_m, y_m, yaw_rad = float(x), float(y), yaw_rad + self._offset.yaw_rad
        self.track.add_pose(time_s, x_m, y_m, yaw_rad)

    def _add_wheel(self, time_s: float, row: WheelRow) -> None:
        if self._speed_of is None:
            self._speed_of = row.wheel  # the travel speed is that of the first one, as of a recorded table
        speed = row.channels.get("travel_speed_m_s", math.nan)
        if math.isfinite(speed) and row.wheel == self._speed_of:
            self.track.add_speed(time_s, speed)
        if self.follow_wheel is not None:
            self.follow_wheel(time_s, row)

    @property
    def clock_s(self) -> float:
        """Time of the newest sample [s]."""
        return self._clock.newest_s

    def silent_s(self, stream: str) -> float:
        """Time since the last sample of a stream, by the newest of any [s]; infinite where none has come."""
        return self.clock_s - self._newest[stream] if stream in self._newest else math.inf

    def take_unsaved(self) -> tuple[list[Part], dict[str, Any]]:
        """Give the rows since the last time that this was called, to be written away, and the state."""
        with self.changed:
            passed = {stream: self._waiting[stream].passed_s for stream in (POSE, WHEEL, IMU)}
            log, self.log = self.log, Log()
            state = {
                "passed_s": {stream: time_s for stream, time_s in passed.items() if math.isfinite(time_s)},
                "reads": {name: [each.is_used for each in streams] for name, streams in self.of_senses.items()},
                "clock": self._clock.state(),
                "images": self.camera.count,
                "sound_samples": self.sound.samples,
                "sound_rate": self.sound.rate,
            }
        return log.cut(), state  # made into columns while samples come on

    def restore(self, poses: Iterable[Columns], wheels: Iterable[Columns], state: Mapping[str, Any]) -> float:
        """Take in what another one has written away, before anything comes; give from when on samples are needed [s].

        Parameters
        ----------
        poses, wheels
            Parts of the log.
        state
            Its state, with that of the senses by name.
        """
        from_s = state["passed_s"].get(POSE, math.inf) - KEPT_S
        for part in wheels:
            names, time_s = part["wheel"].tolist(), part["time_s"].tolist()
            speeds = part.get("travel_speed_m_s", np.full(len(names), math.nan)).tolist()
            self._speed_of = names[0] if self._speed_of is None else self._speed_of
            for name, at_s, speed in zip(names, time_s, speeds, strict=True):
                if at_s >= from_s:
                    self._add_wheel(at_s, WheelRow(name, {"travel_speed_m_s": speed}))
        for part in poses:
            for row in zip(*(part[name].tolist() for name in ("time_s", "0", "1", "2")), strict=True):
                if row[0] >= from_s:
                    self._add_pose(*row)
        needed = []
        for stream, passed_s in state["passed_s"].items():
            waiting = self._waiting[stream]
            waiting.passed_s = waiting.taken_s = math.nextafter(passed_s, math.inf)
            needed.append(passed_s)
        froms = {name: state.get(name, {}).get("from_s", -math.inf) for name in self.of_senses}
        reads = state["reads"]
        images_s, sound_s = (
            min((froms[name] for name in froms if reads.get(name, (True, True))[which]), default=math.inf)
            for which in (0, 1)
        )
        self.sound.resume(sound_s, state["sound_samples"], state["sound_rate"])
        for name, (camera, sound) in self.of_senses.items():
            camera.from_s = froms[name]
            sound.resume(froms[name], state["sound_samples"], state["sound_rate"])
        if state["images"] and images_s < math.inf:  # of which none was observed yet, if it does not say from when on
            needed.append(images_s)
        if state["sound_samples"] and sound_s < math.inf:
            needed.append(sound_s - LONGEST_BLOCK_S)  # the block that holds a time begins before it
        self.camera.count = state["images"]
        self.track.go_on(max(needed, default=-math.inf))
        needed_s = min(needed, default=-math.inf)
        self._clock.restore(state["clock"], needed_s)
        return needed_s

    def end(self) -> None:
        """Give on all that waits, and say that nothing more will come."""
        with self.changed:
            self.has_ended = True
            for stream, waiting in self._waiting.items():
                for at_s, one in self._clock.let_go(stream):
                    waiting.put(at_s, one)
            self.track.end()
            self._give_on(math.inf)
            for each in (*self._cameras, *self._sounds, *self.pieces):
                each.end()
            self.changed.notify_all()

    def leave(self) -> None:
        """Give nothing on any more, and forget what waits: the drive is to be resumed."""
        with self.changed:
            self.has_ended = True
            for each in (*self._cameras, *self._sounds, *self.pieces):
                each.leave()
            self.changed.notify_all()

    @property
    def problems(self) -> tuple[str, ...]:
        """What was left out by now."""
        late = (
            f"{each.late} samples of {stream} came more than {self._horizon_s:g} s late and were left out"
            for stream, each in self._waiting.items()
            if each.late
        )
        dropped = (
            f"{stream}: {each.dropped} of {each.count} were dropped, as they came faster than they could be processed"
            for stream, each in (
                *(("images", each) for each in self._cameras),
                *(("blocks of sound", each) for each in self._sounds),
                *(("pieces of the drive", each) for each in self.pieces),
            )
            if each.dropped
        )
        lost = self.track.lost
        places = (f"{lost} places were left out, no ground vehicle gets there",) if lost else ()
        return (*late, *dropped, *self._clock.problems, *places)
