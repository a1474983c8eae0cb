"""Recordings that are bags: ROS 1, ROS 2 (SQLite, MCAP) and plain MCAP, without ROS (see `topic_map`, `bag_files`)."""

from __future__ import annotations

import struct
from collections import Counter
from contextlib import suppress
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InputError
from ..track.jumps import without_jumps
from ..track.way import pose_from_wheel
from ..vehicle import Vehicle
from .bag_files import BagFile, Message
from .bag_images import no_picture
from .bag_messages import DecodeError, decode, number, stamp_ns
from .bag_messages import field as field_of
from .bag_streams import BagCamera, BagSound, SoundLayout
from .bag_wheel import WheelChannels, merge, reading
from .digest import StreamDigest
from .sound_messages import READERS, SoundReader
from .sound_source import SoundError, find_source
from .topic_map import PoseTopic, Recognised, SoundTopic, TopicMap, complete, load_topic_map, recognise
from .types import Pose, Recording
from .video import BagVideo, codec_of
from .wheel_file import derive_all

_EARLIEST_NS = 946_684_800 * 10**9  # the year 2000: a clock below it counts from the computer's start
_LONGEST_SOUND_S = 7 * 86400.0  # a damaged time would make for silence without end
_MAX_SURPLUS = 0.05  # share of the time; no clock is so fast: the sample rate or number of channels is wrong


@dataclass
class _Gathered:
    """What the pass over a bag's messages collects: numbers, and times of images and sounds."""

    times: dict[str, list[int]]
    wheel: list[WheelChannels]
    poses: list[tuple[int, float, float, float]] = field(default_factory=list)
    undecoded: Counter[str] = field(default_factory=Counter)
    reasons: dict[str, str] = field(default_factory=dict)

    def fail(self, topic: str, reason: str) -> None:
        self.undecoded[topic] += 1
        self.reasons.setdefault(topic, reason)


def read_bag(path: Path, *, vehicle: Vehicle | None = None, topics: Path | None = None) -> Recording:
    """Read a bag; wheel channels, poses and the times of images and sounds into memory, images and sound as streams.

    Parameters
    ----------
    path
        A ``.bag``, ``.mcap`` or ``.db3`` file, or a ROS 2 bag's folder.
    vehicle
        The vehicle.
    topics
        The topic map; None to go by the topics' names and types.

    Returns
    -------
    Recording
        Its clock starts at the first message that is used. `problems` says what was cut off, damaged or taken for
        granted.

    Raises
    ------
    InputError
        The file is no bag, nothing of it can be read, no topic is recognised, or the map does not fit it.
    """
    bag = BagFile(path)
    first = bag.first_messages()
    if not first:
        said = "; ".join(problem.removeprefix(f"{path.name}: ") for problem in bag.problems)
        raise InputError(path, said or "no message in it", expected="a bag with messages")
    samples: dict[str, Any] = {}
    for name, message in first.items():
        with suppress(DecodeError):
            samples[name] = decode(message)
    names = {name: message.topic for name, message in first.items()}
    given = None if topics is None else load_topic_map(topics)
    known = recognise(names, samples, path) if given is None else complete(given, names, samples, path)
    notes: list[str] = []
    heard = _sound_reader(bag, known.topics.sound, None if given is None else given.sound, first, samples, notes)
    digest = StreamDigest()
    gathered = _gather(bag, known.topics, heard, digest, path)
    problems = [*bag.problems, *known.assumed, *notes, *_undecoded(gathered)]
    every = [time for times in gathered.times.values() for time in times]
    if not every:
        raise InputError(path, "no message of the streams can be read", expected="a bag with messages")
    origin = min(every)
    problems += [
        f"{channels.source.topic}: force z is negative, taken as a load with its sign turned"
        for channels in gathered.wheel
        if channels.source.topic in known.guessed_wrenches and channels.turn_load_up()
    ]
    wheel, found = merge(gathered.wheel, origin, known.topics.max_gap_s, path)
    problems += found
    pose, found = _pose(gathered, origin, path)
    problems += found
    if wheel is not None:
        wheel = wheel if vehicle is None else derive_all(wheel, vehicle)
    if wheel is not None and pose is None:
        pose, found = pose_from_wheel(wheel, vehicle)
        problems += found
    return Recording(
        name=known.topics.name or path.resolve().name.split(".")[0],
        source=path,
        vehicle=vehicle,
        start_time=datetime.fromtimestamp(origin / 1e9, UTC) if origin > _EARLIEST_NS else None,
        site=known.topics.site,
        digest=digest.hexdigest(),
        wheel=wheel,
        pose=pose,
        camera=_camera(bag, known, samples, gathered, origin, problems),
        sound=_sound(bag, heard, gathered, origin, problems),
        problems=tuple(problems),
    )


def _sound_reader(
    bag: BagFile, sound: SoundTopic | None, given: SoundTopic | None, first: dict[str, Message],
    samples: dict[str, Any], said: list[str],
) -> SoundReader | None:  # fmt: skip
    """Give what reads the sound; none, which is said, where it is of a kind that is not read."""
    if sound is None:
        return None
    try:
        source = find_source(sound, given, first, samples, bag)
    except SoundError as error:
        said.append(f"{sound.topic}: sound is left out: {error}")
        return None
    if given is not None and source.sample_rate is None and source.coding == "pcm":
        raise InputError(
            bag.path, f"the sample rate of {sound.topic} is not known", expected="sample_rate_Hz under [sound]"
        )
    return READERS[source.coding](source)


def _gather(bag: BagFile, known: TopicMap, heard: SoundReader | None, digest: StreamDigest, path: Path) -> _Gathered:
    """Pass once over the messages of the streams."""
    gathered = _Gathered({}, [WheelChannels(source) for source in known.wheel])
    by_topic: dict[str, list[WheelChannels]] = {}
    for channels in gathered.wheel:
        by_topic.setdefault(channels.source.topic, []).append(channels)
    camera = None if known.camera is None else known.camera.topic
    sound = None if heard is None else heard.source.topic
    wanted = {*by_topic, *(part.topic for part in (known.pose, known.camera) if part is not None)}
    wanted |= set() if sound is None else {sound}
    for message in bag.messages(wanted):
        topic = message.topic.name
        digest.add(topic, struct.pack("<qQ", message.time_ns, len(message.data)))
        digest.add(topic, message.data)
        time_ns, content = message.time_ns, None
        try:
            content = decode(message)
            time_ns = stamp_ns(message, content)
            for channels in by_topic.get(topic, ()):
                channels.add(time_ns, content)
            if known.pose is not None and topic == known.pose.topic:
                gathered.poses.append((time_ns, *_pose_of(content, known.pose)))
        except DecodeError as error:
            gathered.fail(topic, str(error))
        gathered.times.setdefault(topic, []).append(time_ns)
        if heard is not None and topic == sound:
            try:
                heard.count(time_ns, content)
            except DecodeError as error:
                gathered.fail(topic, str(error))
    _refuse_empty(gathered, {camera, sound}, path)
    return gathered


def _refuse_empty(gathered: _Gathered, media: set[str | None], path: Path) -> None:
    """Refuse a topic of numbers of which not one message could be used: its map or its type is wrong."""
    for topic, times in gathered.times.items():
        if topic not in media and gathered.undecoded[topic] >= len(times):
            raise InputError(path, gathered.reasons[topic], expected="fields that its messages have", place=topic)


def _undecoded(gathered: _Gathered) -> list[str]:
    return [
        f"{topic}: {count} of {len(gathered.times[topic])} messages cannot be used, first: {gathered.reasons[topic]}"
        for topic, count in gathered.undecoded.items()
    ]


def _pose_of(content: Any, source: PoseTopic) -> tuple[float, float, float]:
    if source.fields:
        if missing := [name for name in ("x_m", "y_m", "yaw_rad") if name not in source.fields]:
            raise DecodeError(f"the topic map gives no field for {missing[0]}")
        x, y, yaw = (reading(content, source.fields[name]) for name in ("x_m", "y_m", "yaw_rad"))
        return x, y, yaw
    pose = field_of(content, source.pose or "pose")
    qx, qy, qz, qw = (number(pose, f"orientation.{axis}") for axis in "xyzw")
    yaw = np.arctan2(2.0 * (qw * qz + qx * qy), 1.0 - 2.0 * (qy * qy + qz * qz))
    return number(pose, "position.x"), number(pose, "position.y"), float(yaw)


def _pose(gathered: _Gathered, origin: int, path: Path) -> tuple[Pose | None, tuple[str, ...]]:
    if not gathered.poses:
        return None, ()
    time = (np.array([pose[0] for pose in gathered.poses], dtype=np.int64) - origin) * 1e-9
    rows = np.array([pose[1:] for pose in gathered.poses])
    order = np.argsort(time, kind="stable")
    order = order[np.isfinite(rows[order]).all(axis=1)]
    if not len(order):
        return None, ()
    time, rows = time[order], rows[order]
    pose = Pose(time, rows[:, 0], rows[:, 1], np.unwrap(rows[:, 2]))
    return without_jumps(pose, path, lambda row: f"pose at {time[row]:.3f} s")


def _camera(
    bag: BagFile, known: Recognised, samples: dict[str, Any], gathered: _Gathered, origin: int, problems: list[str]
) -> BagCamera | BagVideo | None:
    camera = known.topics.camera
    if camera is None or not gathered.times.get(camera.topic):
        return None
    time = np.maximum.accumulate(np.array(gathered.times[camera.topic], dtype=np.int64))
    sample = samples.get(camera.topic)
    reason = no_picture(camera.topic, sample)
    try:
        codec = codec_of(sample)
    except InputError as error:
        codec, reason = None, str(error)
    if reason:
        problems.append(f"{camera.topic}: images are left out: {reason}")
        return None
    if codec is not None:
        return BagVideo(bag, camera.topic, codec, time, origin)
    return BagCamera(bag, camera.topic, time, origin, camera.bit_depth)


def _sound(
    bag: BagFile, heard: SoundReader | None, gathered: _Gathered, origin: int, problems: list[str]
) -> BagSound | None:
    if heard is None or not heard.frames:
        return None
    topic, fault = heard.source.topic, heard.finish()
    if fault or not sum(heard.frames):
        if fault or not gathered.undecoded[topic]:  # else it was said why
            problems.append(f"{topic}: sound is left out: {fault or 'no sample in it'}")
        return None
    if heard.sample_rate is None:
        problems.append(f"{topic}: sound of an unknown sample rate, left out; a topic map's [sound] can give it")
        return None
    start_s = (np.array(gathered.times[topic], dtype=np.int64) - origin) * 1e-9
    layout = SoundLayout(start_s, np.array(heard.frames, dtype=np.int64), heard.sample_rate)
    stream = BagSound(bag, heard, layout)
    if stream.duration_s > _LONGEST_SOUND_S:
        problems.append(f"{topic}: its messages' times span {stream.duration_s:.0f} s, sound is left out")
        return None
    if layout.surplus_s > _MAX_SURPLUS * stream.duration_s + 1.0:
        problems.append(
            f"{topic}: sound is left out: at {heard.sample_rate} Hz and {heard.channels} channels it lasts "
            f"{layout.surplus_s:.1f} s longer than its messages' times; a topic map's [sound] can correct them"
        )
        return None
    if stream.gap_s > 0:
        problems.append(f"{topic}: {stream.gap_s:.2f} s of {stream.duration_s:.2f} s of sound are missing")
    return stream
