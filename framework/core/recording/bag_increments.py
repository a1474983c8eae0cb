"""A bag that goes on: its messages made into samples as they come, by the readers of bags that are complete.

The streams are recognised by the messages of the first seconds; what these decide holds for the rest.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..errors import InputError
from ..origin import Origin
from ..track.way import heading_of
from ..vehicle import Vehicle
from .bag_files import Message
from .bag_gathering import Decided, Gathered, sound_reader
from .bag_images import image_of
from .bag_messages import DecodeError
from .bag_places import attitude_of
from .bag_wheel import WheelChannels, merge, with_pitch_and_roll, with_speed_of_angle
from .bags import read_streams
from .growing import HeldBag
from .opened_bag import OpenedBag, open_bag, take_samples
from .types import Recording, WheelTable
from .video import BagVideo, VideoImages
from .wheel_names import wheel_called

LOOK_S = 10.0
"""Streams are recognised by the messages of so long a time [s]."""

LOOK_BYTES = 128 * 2**20
"""No more of them is held for that [bytes]."""

_STEP_S = 0.1
"""Rows of wheels are made so often, by the messages' times [s]."""

_LONGEST_STEP_S = 1.0
_JUMP_NS = 5 * 10**9
"""A message so much earlier than the newest one [ns] is of a clock that was set back."""

_END_NS = 2**62
"""Later than any message [ns]."""

_HEADING_KEPT_S, _HEADING_LATE_S = 60.0, 1.0
"""Headings of fixes are those of the way of the last minute; a fix waits for the next piece of it for a second [s]."""


class Sample(NamedTuple):
    """A sample of a stream: ``pose`` (x [m], y [m], yaw [rad]), ``wheel`` (name, channels), ``imu`` (six numbers),
    ``image`` (array or None, problem or None) or ``sound`` (samples (m, c), rate [Hz]); and its time [s].
    """

    stream: str
    time_s: float
    values: Any


@dataclass(frozen=True)
class Beginning:
    """The first messages of a bag that goes on, and what was recognised by them.

    Parameters
    ----------
    opened
        Its streams.
    recording
        What it would be if it ended here.
    decided
        What its messages decide.
    """

    opened: OpenedBag
    recording: Recording
    decided: Decided

    @property
    def held(self) -> list[Message]:
        """The messages."""
        assert isinstance(self.opened.bag, HeldBag)
        return self.opened.bag.held


def look_at(messages: Iterable[Message], path: Path, problems: list[str], vehicle: Vehicle | None,
            topics: Path | None) -> Beginning:  # fmt: skip
    """Recognise the streams of a bag by its first messages; those are taken from `messages`.

    Parameters
    ----------
    messages
        Of the bag, in order.
    path, problems
        The bag, and what is wrong with it, once that is known.
    vehicle, topics
        As of `read_bag`.

    Raises
    ------
    InputError
        As `read_bag` does.
    """
    held, passed_s, size = list[Message](), 0.0, 0
    for message in messages:
        if held:
            passed_s += float(np.clip((message.time_ns - held[-1].time_ns) * 1e-9, 0.0, _LONGEST_STEP_S))
        held.append(message)
        size += len(message.data)
        if passed_s >= LOOK_S or size >= LOOK_BYTES:
            break
    bag = HeldBag(path, held, problems)
    opened = open_bag(bag, take_samples(bag), vehicle, topics)
    return Beginning(opened, *read_streams(opened, vehicle))


class BagIncrements:
    """Makes samples of a bag's messages as they come.

    A wheel's row is given once every topic that it is made of has sent a later message, or none for as long as a gap is
    bridged; the rest at once.

    Parameters
    ----------
    beginning
        What was recognised.
    from_s
        No image before it is needed [s], by times that go on after the clock was set back.
    """

    def __init__(self, beginning: Beginning, from_s: float = -math.inf):
        opened, decided = beginning.opened, beginning.decided
        known, recording = opened.known, beginning.recording
        topics = known.topics
        self._path, self._decided, self._max_gap_s = recording.source, decided, topics.max_gap_s
        self._gap_ns, self._from_s = round(topics.max_gap_s * 1e9), from_s
        speeds = [each for each in known.speeds if each.topic == decided.speed]
        others = [each for each in known.speeds if each.topic != decided.speed]
        self._wheels = [WheelChannels(decided.signed(each)) for each in (*topics.wheel, *speeds)]
        heard = sound_reader(opened, [])
        self._gathered = Gathered(known, heard, self._wheels, [WheelChannels(each) for each in others])
        self._heard = None if recording.sound is None else heard
        fields = {name for each in self._wheels for name in each.source.fields}
        # A speed by the change of an angle needs what is before and after it.
        self._angle_ns = 0
        if "wheel_angle_rad" in fields and "wheel_speed_rad_s" not in fields:
            self._angle_ns = round(2e9 * _STEP_S)
        self._camera, self._video = recording.camera, None
        if isinstance(recording.camera, BagVideo) and topics.camera is not None:
            self._video = VideoImages(topics.camera.topic, recording.camera.codec)
        self._bit_depth = None if topics.camera is None else topics.camera.bit_depth
        self._called = _called(decided, recording.vehicle)
        self._headings = None if recording.origin is None else _Headings(recording.origin)
        self._newest_ns = self._merged_ns = decided.origin_ns - 1
        self._given_ns = decided.origin_ns - 1
        self._images, self._faults, self._fault = 0, 0, ""

    @property
    def digest(self) -> str:
        """That of the messages by now; `Recording.digest` of a bag that ends here."""
        return self._gathered.digest.hexdigest()

    @property
    def problems(self) -> tuple[str, ...]:
        """What cannot be used by now."""
        fault = f"{self._fault}: {self._faults} stretches of about {self._max_gap_s:g} s of wheel rows are left out"
        return (*self._gathered.said(), *([fault] if self._faults else []))

    def take(self, message: Message) -> Iterator[Sample]:
        """Take a message; give the samples that are complete with it."""
        topic, own = message.topic.name, self._gathered
        if topic not in own.wanted:
            return
        time_ns, content = own.take(message)
        if topic not in own.streams:
            yield from self._fixed()
            return
        if time_ns < self._newest_ns - _JUMP_NS:
            yield from self._rows(_END_NS)
            self._begin_anew(time_ns)
        self._newest_ns = max(self._newest_ns, time_ns)
        yield from self._numbers()
        topics = own.known.topics
        if topics.camera is not None and topic == topics.camera.topic and self._camera is not None:
            yield from self._image(self._seconds(time_ns), content)
        if self._heard is not None and topic == self._heard.source.topic:
            yield from self._sound(time_ns, content)
        if self._newest_ns - self._merged_ns >= round(_STEP_S * 1e9):
            self._merged_ns = self._newest_ns
            yield from self._rows(self._complete_ns())

    def end(self) -> Iterator[Sample]:
        """Give what is left."""
        yield from self._rows(_END_NS)
        if self._headings is not None:
            yield from self._headings.given(math.inf)
        if self._video is not None:
            for frame in self._video.end():
                yield Sample("image", frame.time_s, (frame.image, frame.problem))

    def _seconds(self, time_ns: int) -> float:
        return (time_ns - self._decided.origin_ns) * 1e-9

    def _numbers(self) -> Iterator[Sample]:
        """Give the poses and the samples of the inertial sensor that came."""
        own = self._gathered
        for stream, rows in (("pose", own.poses), ("imu", own.shaken)):
            for time_ns, *values in rows:
                if np.isfinite(values).all():
                    yield Sample(stream, self._seconds(int(time_ns)), tuple(values))
            rows.clear()
        yield from self._fixed()

    def _fixed(self) -> Iterator[Sample]:
        """Give places of a satellite receiver, where they are the poses."""
        own, pose = self._gathered, self._gathered.known.topics.pose
        fixes = own.fixes
        if len(fixes) and self._headings is not None and pose is not None and pose.pose == "":
            latitude, longitude = fixes.places()
            for each in zip(fixes.time_s(self._decided.origin_ns).tolist(), latitude, longitude, strict=True):
                self._headings.add(*each)
            yield from self._headings.given(self._seconds(self._newest_ns) - _HEADING_LATE_S)
        fixes.clear()

    def _image(self, time_s: float, content: Any) -> Iterator[Sample]:
        topic = self._gathered.known.topics.camera
        assert topic is not None
        if self._video is not None:
            problem = "" if content is not None else self._gathered.reasons[topic.topic]
            for frame in self._video.take(time_s, content, problem):
                yield Sample("image", frame.time_s, (frame.image, frame.problem))
            return
        number, self._images = self._images, self._images + 1
        if time_s < self._from_s:
            return
        image, problem = None, self._gathered.reasons.get(topic.topic)
        if content is not None:
            try:
                image, problem = image_of(content, f"{self._path}, {topic.topic}", self._bit_depth), None
            except (DecodeError, InputError) as error:
                problem = str(error)
        yield Sample("image", time_s, (image, problem and f"{topic.topic}, image {number}: {problem}"))

    def _sound(self, time_ns: int, content: Any) -> Iterator[Sample]:
        assert self._heard is not None
        try:
            samples = self._heard.samples(time_ns, content)
        except DecodeError as error:
            self._gathered.fail(self._heard.source.topic, str(error))
            return
        if len(samples) and self._heard.sample_rate is not None:
            yield Sample("sound", self._seconds(time_ns), (samples, self._heard.sample_rate))

    def _begin_anew(self, time_ns: int) -> None:
        """Go on on a clock that was set back."""
        for each in self._wheels:
            each.forget_before(math.inf)
        self._gathered.attitude.clear()
        self._newest_ns = self._merged_ns = time_ns
        self._given_ns = time_ns - 1
        self._from_s = -math.inf  # is of a clock that went on

    def _complete_ns(self) -> int:
        """Up to when nothing more is expected of the topics that rows are made of [ns]."""
        last = [each.last_ns for each in self._wheels]
        if self._decided.leans and self._gathered.attitude:
            last.append(int(self._gathered.attitude[-1][0]))
        return max(min(last, default=self._newest_ns), self._newest_ns - self._gap_ns) - self._angle_ns

    def _rows(self, until_ns: int) -> Iterator[Sample]:
        """Give the wheels' rows up to a time [ns], and forget what no later row needs."""
        for each in self._gathered.speeds:
            each.forget_before(math.inf)
        if not any(map(len, self._wheels)):
            return
        try:
            table = self._merged(is_end=until_ns == _END_NS)
        except InputError as error:  # a value that no wheel can have
            self._faults, self._fault = self._faults + 1, self._fault or str(error)
            for each in self._wheels:
                each.forget_before(math.inf)
            return
        if table is not None:
            yield from self._samples_of(table, self._seconds(self._given_ns), self._seconds(until_ns))
        self._given_ns = max(self._given_ns, until_ns)
        before_ns = until_ns - 2 * (self._gap_ns + self._angle_ns)
        for each in self._wheels:
            each.forget_before(before_ns)
        rows = self._gathered.attitude
        kept = next((at for at, row in enumerate(rows) if row[0] >= before_ns), len(rows))
        del rows[: max(kept - 1, 0)]

    def _merged(self, *, is_end: bool) -> WheelTable | None:
        decided = self._decided
        clocks = set(decided.clocks.values())
        sources = self._wheels if is_end else [
            each if each.source.topic in clocks else each.held_until(self._newest_ns) for each in self._wheels
        ]  # fmt: skip
        table, _ = merge(sources, decided.origin_ns, self._max_gap_s, self._path, decided.clocks)
        if table is None:
            return None
        if self._angle_ns:
            table = with_speed_of_angle(table)
        rows = self._gathered.attitude
        if decided.leans and rows:
            rows = rows if is_end or rows[-1][0] >= self._newest_ns else [*rows, (self._newest_ns, *rows[-1][1:])]
            attitude = attitude_of(rows, decided.mount, decided.origin_ns)
            table = with_pitch_and_roll(table, *attitude, self._max_gap_s)
        return table

    def _samples_of(self, table: WheelTable, after_s: float, until_s: float) -> Iterator[Sample]:
        time_s = table["time_s"]
        names = [name for name in table.columns if name != "time_s"]
        for row in np.flatnonzero((time_s > after_s) & (time_s <= until_s)).tolist():
            called = "" if table.wheel is None else self._called.get(str(table.wheel[row]), "")
            values = {name: float(table[name][row]) for name in names}
            yield Sample("wheel", float(time_s[row]), (called, values))


def _called(decided: Decided, vehicle: Vehicle | None) -> dict[str, str]:
    """Give the vehicle's names of the wheels; none where one stands for all of them."""
    wheels = () if vehicle is None else vehicle.wheels
    known = {wheel.name for wheel in wheels}
    names = [name for name in decided.clocks if name is not None]
    if len(wheels) == 1 and len(names) == 1:
        return {names[0]: ""}
    return {name: name if name in known else wheel_called(name, wheels) or name for name in names}


class _Headings:
    """Places by satellite, with the heading of the way between them."""

    def __init__(self, origin: Origin):
        self._origin = origin
        self._rows: list[tuple[float, float, float]] = []
        self._given_s = -math.inf

    def add(self, time_s: float, latitude_deg: float, longitude_deg: float) -> None:
        """Add a fix."""
        at = self._origin.from_local(*self._origin.east_north(np.array([latitude_deg]), np.array([longitude_deg])))
        self._rows.append((time_s, float(at[0][0]), float(at[1][0])))
        while self._rows[0][0] < time_s - _HEADING_KEPT_S:
            del self._rows[0]

    def given(self, until_s: float) -> Iterator[Sample]:
        """Give the fixes up to a time [s]."""
        if len(self._rows) < 2:
            return
        time_s, x_m, y_m = np.array(self._rows).T
        new = np.flatnonzero((time_s > self._given_s) & (time_s <= until_s))
        yaw = heading_of(x_m, y_m) if len(new) else np.empty(0)
        for row in new.tolist():
            self._given_s = float(time_s[row])
            yield Sample("pose", self._given_s, (float(x_m[row]), float(y_m[row]), float(yaw[row])))
