"""What is collected of a bag's messages: numbers, and times of images and sounds."""

from __future__ import annotations

import struct
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..errors import InputError
from .bag_files import BagFile, Message
from .bag_frames import Frames
from .bag_messages import DecodeError, decode, number, stamp_ns
from .bag_messages import field as field_of
from .bag_places import Fixes, frame_of, pose_of
from .bag_vibration import shaken
from .bag_wheel import WheelChannels
from .digest import StreamDigest
from .mirrored import OF_A_JOINT
from .opened_bag import OpenedBag
from .recognition import Recognised
from .sound_messages import READERS, SoundReader
from .sound_source import SoundError, find_source
from .topic_map import WheelTopic


@dataclass
class Gathered:
    """What a pass over a bag's messages collects.

    Parameters
    ----------
    known
        The streams.
    heard
        Reads the sound; None where there is none.
    wheel, speeds
        Channels of the wheels, and those that may be the travel speed.

    Attributes
    ----------
    times
        Time of each message [ns], by topic.
    speed
        The topic from which the travel speed is taken, where no wheel topic gives it.
    against
        Wheels that turn against the vehicle's travel; where all do their signs are not turned.
    """

    known: Recognised
    heard: SoundReader | None
    wheel: list[WheelChannels]
    speeds: list[WheelChannels]
    times: dict[str, list[int]] = field(default_factory=dict)
    frames: Frames = field(default_factory=Frames)
    fixes: Fixes = field(default_factory=Fixes)
    shaken: list[tuple[float, ...]] = field(default_factory=list)
    attitude: list[tuple[float, ...]] = field(default_factory=list)
    attitude_frame: str = ""
    poses: list[tuple[int, float, float, float]] = field(default_factory=list)
    pose_frame: str = ""
    undecoded: Counter[str] = field(default_factory=Counter)
    reasons: dict[str, str] = field(default_factory=dict)
    digest: StreamDigest = field(default_factory=StreamDigest)
    speed: str = ""
    against: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        topics = self.known.topics
        self._by_topic: dict[str, list[WheelChannels]] = {}
        for channels in (*self.wheel, *self.speeds):
            self._by_topic.setdefault(channels.source.topic, []).append(channels)
        streams = (topics.pose, topics.attitude, topics.camera, topics.vibration, self.heard and self.heard.source)
        self.streams = frozenset({*self._by_topic, *(each.topic for each in streams if each)})

    @property
    def wanted(self) -> frozenset[str]:
        """Names of the topics that are read."""
        return self.streams | self.known.about

    def fail(self, topic: str, reason: str) -> None:
        """Count a message that cannot be used."""
        self.undecoded[topic] += 1
        self.reasons.setdefault(topic, reason)

    def take(self, message: Message) -> tuple[int, Any]:
        """Take in a message of a topic that is wanted; give its time [ns] and content, None where it has none."""
        topic = message.topic.name
        time_ns, content = message.time_ns, None
        try:
            content = decode(message)
            time_ns = stamp_ns(message, content)
            self._add(topic, time_ns, content)
        except DecodeError as error:
            self.fail(topic, str(error))
        if topic in self.streams:
            self.digest.add(topic, struct.pack("<qQ", message.time_ns, len(message.data)))
            self.digest.add(topic, message.data)
        return time_ns, content

    def _add(self, topic: str, time_ns: int, content: Any) -> None:
        known, topics = self.known, self.known.topics
        if topic in known.frames:
            self.frames.add(content)
        if topic in known.fixes:
            self.fixes.add(time_ns, content)
        if topics.attitude is not None and topic == topics.attitude.topic:
            self._add_attitude(time_ns, content, topics.attitude.orientation or "orientation")
        if topics.vibration is not None and topic == topics.vibration.topic:
            self.shaken.append((time_ns, *shaken(content)))
        for channels in self._by_topic.get(topic, ()):
            channels.add(time_ns, content)
        if topics.pose is not None and topic == topics.pose.topic and topics.pose.pose != "":
            self.poses.append((time_ns, *pose_of(content, topics.pose)))
            if not self.pose_frame:
                self.pose_frame = frame_of(content)

    def _add_attitude(self, time_ns: int, content: Any, path: str) -> None:
        turn = field_of(content, path)
        self.attitude.append((time_ns, *(number(turn, axis) for axis in "xyzw")))
        if path == "orientation" and not self.attitude_frame:
            self.attitude_frame = str(field_of(content, "header.frame_id"))

    @property
    def mount(self) -> np.ndarray | None:
        """Axes (3, 3) of the sensor of the attitude in those of the vehicle; None where no frame says it."""
        if not (self.attitude_frame and self.frames.base):
            return None
        placed = self.frames.pose(self.attitude_frame, self.frames.base)
        return None if placed is None else placed[:3, :3]

    def said(self) -> Iterator[str]:
        """Say of which topics messages cannot be used."""
        for topic, count in self.undecoded.items():
            many = f" of {len(self.times[topic])}" if topic in self.times else ""
            yield f"{topic}: {count}{many} messages cannot be used, first: {self.reasons[topic]}"


class Decided(NamedTuple):
    """What only the messages say.

    Parameters
    ----------
    speed
        The topic that gives the travel speed, where no wheel's does.
    turned
        Topics whose load's sign is turned.
    mirrored
        Wheels whose joints are.
    origin_ns
        Zero of the recording's clock [ns].
    clocks
        Topic whose messages are the rows of a wheel, by the wheel's name; None where it has none.
    leans
        Whether the attitude says more than an odometry in the plane does.
    mount
        As of `Gathered`.
    """

    speed: str = ""
    turned: frozenset[str] = frozenset()
    mirrored: frozenset[str] = frozenset()
    origin_ns: int = 0
    clocks: Mapping[str | None, str] = {}
    leans: bool = False
    mount: np.ndarray | None = None

    def signed(self, source: WheelTopic) -> WheelTopic:
        """Give a topic's fields with the signs that were decided."""
        mirrored = OF_A_JOINT if source.wheel in self.mirrored else ()
        turned = {"load_N", *mirrored} if source.topic in self.turned else {*mirrored}
        fields = {
            column: each.model_copy(update={"scale": -each.scale, "offset": 0.0 - each.offset})
            if column in turned
            else each
            for column, each in source.fields.items()
        }
        return source.model_copy(update={"fields": fields})


def sound_reader(opened: OpenedBag, said: list[str]) -> SoundReader | None:
    """Give what reads the sound; none, which is said, where it is of a kind that is not read."""
    sound, bag = opened.known.topics.sound, opened.bag
    given = None if opened.given is None else opened.given.sound
    if sound is None:
        return None
    try:
        source = find_source(sound, given, opened.samples.first, opened.samples.content, bag)
    except SoundError as error:
        said.append(f"{sound.topic}: sound is left out: {error}")
        return None
    if given is not None and source.sample_rate is None and source.coding == "pcm":
        raise InputError(
            bag.path, f"the sample rate of {sound.topic} is not known", expected="sample_rate_Hz under [sound]"
        )
    return READERS[source.coding](source)


def gather(bag: BagFile, known: Recognised, heard: SoundReader | None) -> Gathered:
    """Pass once over the messages of the streams; raises `InputError` where none of a topic of numbers is of use."""
    topics = known.topics
    gathered = Gathered(
        known, heard, [WheelChannels(source) for source in topics.wheel],
        [WheelChannels(source) for source in known.speeds],
    )  # fmt: skip
    for message in bag.messages(gathered.wanted):
        topic = message.topic.name
        time_ns, content = gathered.take(message)
        if topic not in gathered.streams:
            continue
        gathered.times.setdefault(topic, []).append(time_ns)
        if heard is not None and topic == heard.source.topic:
            try:
                heard.count(time_ns, content)
            except DecodeError as error:
                gathered.fail(topic, str(error))
    media = {part.topic for part in (topics.camera, topics.vibration, heard and heard.source) if part}
    _refuse_empty(gathered, media, bag.path)
    return gathered


def _refuse_empty(gathered: Gathered, media: set[str], path: Path) -> None:
    """Refuse a topic of numbers of which not one message could be used: its map or its type is wrong."""
    for topic, times in gathered.times.items():
        if topic not in media and gathered.undecoded[topic] >= len(times):
            raise InputError(path, gathered.reasons[topic], expected="fields that its messages have", place=topic)
