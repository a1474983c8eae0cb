"""Recordings that are bags: ROS 1, ROS 2 (SQLite, MCAP) and plain MCAP, without ROS (see `topic_map`, `bag_files`)."""

from __future__ import annotations

import struct
from collections import Counter
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..errors import InputError
from ..origin import Origin
from ..track.jumps import without_jumps
from ..track.way import heading_of, pose_from_wheel
from ..vehicle import Vehicle
from .bag_camera import with_camera
from .bag_files import BagFile
from .bag_frames import Frames
from .bag_images import no_picture
from .bag_messages import DecodeError, decode, number, stamp_ns
from .bag_messages import field as field_of
from .bag_places import FAR_M, FIXES, MISFIT_M, UNNAMED, Fixes, frame_of, in_order, pitch_and_roll, pose_of, stays
from .bag_streams import BagCamera, BagSound, SoundLayout
from .bag_vibration import shaken, vibration_of
from .bag_wheel import WheelChannels, follows_the_wheels, merge, with_speed_of_angle
from .clock import interpolate
from .digest import StreamDigest
from .mirrored import about_axes, mirrored_of, with_axes_forward
from .opened_bag import OpenedBag, Samples, open_bag, take_samples
from .recognition import Recognised
from .sound_messages import READERS, SoundReader
from .sound_source import SoundError, find_source
from .topic_map import SoundTopic
from .types import Pose, Recording, WheelTable
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
    speeds: list[WheelChannels]
    frames: Frames = field(default_factory=Frames)
    fixes: Fixes = field(default_factory=Fixes)
    shaken: list[tuple[float, ...]] = field(default_factory=list)
    attitude: list[tuple[float, ...]] = field(default_factory=list)
    attitude_frame: str = ""
    poses: list[tuple[int, float, float, float]] = field(default_factory=list)
    pose_frame: str = ""
    undecoded: Counter[str] = field(default_factory=Counter)
    reasons: dict[str, str] = field(default_factory=dict)
    speed: str = ""
    """The topic from which the travel speed is taken, where no wheel topic gives it."""
    against: tuple[str, ...] = ()
    """Wheels that turn against the vehicle's travel; where all do their signs are not turned."""

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
    return read_streams(open_bag(bag, take_samples(bag), vehicle, topics), vehicle)[0]


class Decided(NamedTuple):
    """What only the messages say: the topic that gives the travel speed where no wheel's does, topics whose load's sign
    was turned, and wheels whose joints are mirrored.
    """

    speed: str = ""
    turned: frozenset[str] = frozenset()
    mirrored: frozenset[str] = frozenset()


def read_streams(opened: OpenedBag, vehicle: Vehicle | None) -> tuple[Recording, Decided]:
    """Read the streams that were recognised, and say what was decided by their messages. Raises as `read_bag` does."""
    bag, samples, given, known = opened.bag, opened.samples, opened.given, opened.known
    path = bag.path
    unheard: list[str] = []
    heard = _sound_reader(bag, known.topics.sound, None if given is None else given.sound, samples, unheard)
    digest = StreamDigest()
    gathered = _gather(bag, known, heard, digest, path)
    problems, notes = [*bag.problems, *known.assumed, *unheard, *_undecoded(gathered)], [*known.chosen]
    origin = min((time for times in gathered.times.values() for time in times), default=None)
    if origin is None:
        raise InputError(path, "no message of the streams can be read", expected="a bag with messages")
    turned = [
        channels.source.topic
        for channels in gathered.wheel
        if channels.source.topic in known.guessed_wrenches and channels.turn_load_up()
    ]
    problems += [f"{topic}: force z is negative, taken as a load with its sign turned" for topic in turned]
    pose, place = _pose(gathered, origin, known, path, problems, notes)
    wheel = _wheel(gathered, origin, known, vehicle, pose, path, problems)
    mirrored = mirrored_of(wheel, gathered.against)
    if gathered.against:
        (notes if mirrored else problems).append(about_axes(gathered.against, every=not mirrored))
    if wheel is not None and vehicle is not None and (wheel.wheel is not None or len(vehicle.wheels) == 1):
        wheel = derive_all(wheel, vehicle)
    if wheel is not None and pose is None:
        pose, found = pose_from_wheel(wheel, vehicle)
        problems += found
    camera = _camera(bag, known, samples.content, gathered, origin, problems)
    if camera is not None and known.topics.camera is not None:
        vehicle, geometry = with_camera(
            vehicle, known.topics.camera.topic, samples.topics, samples.content, gathered.frames
        )
        notes += geometry
    vibration, found = vibration_of(gathered.shaken, origin, wheel, known.topics.vibration, path)
    problems += found
    recording = Recording(
        name=known.topics.name or path.resolve().name.split(".")[0],
        source=path,
        vehicle=vehicle,
        start_time=datetime.fromtimestamp(origin / 1e9, UTC) if origin > _EARLIEST_NS else None,
        site=known.topics.site,
        digest=digest.hexdigest(),
        wheel=wheel,
        pose=pose,
        camera=camera,
        sound=_sound(bag, heard, gathered, origin, problems),
        problems=tuple(problems),
        vibration=vibration,
        origin=place,
        frame=gathered.pose_frame,
        shared_speed=any(each.source.shares_speed for each in (*gathered.wheel, *gathered.speeds)),
        notes=tuple(notes),
    )
    return recording, Decided(gathered.speed, frozenset(turned), mirrored)


def _sound_reader(
    bag: BagFile, sound: SoundTopic | None, given: SoundTopic | None, samples: Samples, said: list[str]
) -> SoundReader | None:  # fmt: skip
    """Give what reads the sound; none, which is said, where it is of a kind that is not read."""
    if sound is None:
        return None
    try:
        source = find_source(sound, given, samples.first, samples.content, bag)
    except SoundError as error:
        said.append(f"{sound.topic}: sound is left out: {error}")
        return None
    if given is not None and source.sample_rate is None and source.coding == "pcm":
        raise InputError(
            bag.path, f"the sample rate of {sound.topic} is not known", expected="sample_rate_Hz under [sound]"
        )
    return READERS[source.coding](source)


def _gather(bag: BagFile, known: Recognised, heard: SoundReader | None, digest: StreamDigest, path: Path) -> _Gathered:
    """Pass once over the messages of the streams."""
    topics = known.topics
    gathered = _Gathered(
        {}, [WheelChannels(source) for source in topics.wheel], [WheelChannels(source) for source in known.speeds]
    )
    by_topic: dict[str, list[WheelChannels]] = {}
    for channels in (*gathered.wheel, *gathered.speeds):
        by_topic.setdefault(channels.source.topic, []).append(channels)
    camera = None if topics.camera is None else topics.camera.topic
    sound = None if heard is None else heard.source.topic
    vibration = None if topics.vibration is None else topics.vibration.topic
    streams = {part.topic for part in (topics.pose, topics.attitude, topics.camera, heard and heard.source) if part}
    streams |= {vibration} - {None}
    wanted = {*by_topic, *streams}
    for message in bag.messages({*wanted, *known.about}):
        topic = message.topic.name
        time_ns, content = message.time_ns, None
        try:
            content = decode(message)
            time_ns = stamp_ns(message, content)
            _add_about(gathered, known, topic, time_ns, content)
            if topic == vibration:
                gathered.shaken.append((time_ns, *shaken(content)))
            for channels in by_topic.get(topic, ()):
                channels.add(time_ns, content)
            if topics.pose is not None and topic == topics.pose.topic and topics.pose.pose != "":
                gathered.poses.append((time_ns, *pose_of(content, topics.pose)))
                if len(gathered.poses) == 1:
                    gathered.pose_frame = frame_of(content)
        except DecodeError as error:
            gathered.fail(topic, str(error))
        if topic not in wanted:
            continue
        digest.add(topic, struct.pack("<qQ", message.time_ns, len(message.data)))
        digest.add(topic, message.data)
        gathered.times.setdefault(topic, []).append(time_ns)
        if heard is not None and topic == sound:
            try:
                heard.count(time_ns, content)
            except DecodeError as error:
                gathered.fail(topic, str(error))
    _refuse_empty(gathered, {camera, sound, vibration}, path)
    return gathered


def _add_about(gathered: _Gathered, known: Recognised, topic: str, time_ns: int, content: Any) -> None:
    """Add what a message says of frames, places on Earth and attitude."""
    if topic in known.frames:
        gathered.frames.add(content)
    if topic in known.fixes:
        gathered.fixes.add(time_ns, content)
    attitude = known.topics.attitude
    if attitude is not None and topic == attitude.topic:
        turn = field_of(content, attitude.orientation or "orientation")
        gathered.attitude.append((time_ns, *(number(turn, axis) for axis in "xyzw")))
        if attitude.orientation == "orientation" and not gathered.attitude_frame:
            gathered.attitude_frame = str(field_of(content, "header.frame_id"))


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


def _wheel(
    gathered: _Gathered, origin: int, known: Recognised, vehicle: Vehicle | None, pose: Pose | None, path: Path,
    problems: list[str],
) -> WheelTable | None:  # fmt: skip
    """Merge the wheels' channels, axes forwards, with the first travel speed that is independent of them, and with the
    attitude.
    """
    wheel, against = None, ()
    for speed in (*gathered.speeds, None):
        wheel, found = merge(
            [*gathered.wheel, *([speed] if speed else [])], origin, known.topics.max_gap_s, path
        )  # fmt: skip
        if wheel is not None:
            wheel, against = with_axes_forward(with_speed_of_angle(wheel), pose)
        follows = "" if speed is None or wheel is None else follows_the_wheels(wheel, vehicle)
        if not follows:
            problems += found
            gathered.speed = speed.source.topic if speed else ""
            break
        problems.append(
            f"{speed.source.topic if speed else ''}: not used as travel speed, for it is made from the wheels' own "
            f"({follows}): slip would be zero on any ground; record visual odometry or a satellite receiver's speed"
        )
    gathered.against = against
    if wheel is None or not gathered.attitude:
        return wheel
    return _with_attitude(wheel, gathered, origin, known)


def _with_attitude(wheel: WheelTable, gathered: _Gathered, origin: int, known: Recognised) -> WheelTable:
    """Add pitch and roll of the vehicle to each row, where no wheel topic gives them."""
    times = (np.array([each[0] for each in gathered.attitude], dtype=np.int64) - origin) * 1e-9
    turns = np.array([each[1:] for each in gathered.attitude])
    good = np.isfinite(turns).all(axis=1) & (np.linalg.norm(turns, axis=1) > 0.5)
    mount = None
    if gathered.attitude_frame and gathered.frames.base:
        placed = gathered.frames.pose(gathered.attitude_frame, gathered.frames.base)
        mount = None if placed is None else placed[:3, :3]
    if not good.any():
        return wheel
    pitch, roll = pitch_and_roll(turns[good], mount)
    if not (np.ptp(pitch) or np.ptp(roll)):
        return wheel  # an odometry in the plane knows neither
    order = np.argsort(times[good], kind="stable")
    added = {
        name: interpolate(times[good][order], values[order], wheel["time_s"], known.topics.max_gap_s)
        for name, values in (("pitch_rad", pitch), ("roll_rad", roll))
        if name not in wheel
    }
    return WheelTable({**wheel.columns, **added}, wheel.wheel, wheel.run, wheel.source)


def _pose(
    gathered: _Gathered, origin: int, known: Recognised, path: Path, problems: list[str], notes: list[str]
) -> tuple[Pose | None, Origin | None]:
    """Give the poses, and where on Earth their x = y = 0 lies as far as that is known."""
    fixes, stated = gathered.fixes, known.topics.pose
    pose, place = None, None
    frame = (stated.frame if stated is not None else None) or gathered.pose_frame or UNNAMED
    gathered.pose_frame = frame
    if gathered.poses:
        time = (np.array([pose[0] for pose in gathered.poses], dtype=np.int64) - origin) * 1e-9
        pose = in_order(time, np.array([pose[1:] for pose in gathered.poses]))
        if stated is not None and stated.origin is not None:
            if not stays(frame):
                raise InputError(
                    path, f"[pose] origin is stated, and the frame {frame} starts with the recording",
                    expected='`--origin` with each recording, or `frame = "map"` under [pose]',
                )  # fmt: skip
            place = stated.origin
        elif pose is not None and len(fixes) >= 2:
            place = fixes.origin_of(pose, origin)
            if place is None:
                notes.append(
                    "the satellite fixes do not say how the frame of the poses lies: the way is shorter than "
                    f"{2 * FAR_M:g} m, or does not agree with them within {MISFIT_M:g} m"
                )
    elif len(fixes) and stated is not None and stated.pose == "":
        latitude, longitude = fixes.places()
        place = stated.origin or Origin(float(latitude[0]), float(longitude[0]))
        x, y = place.from_local(*place.east_north(latitude, longitude))
        rows = np.column_stack([x, y, heading_of(x, y)])
        gathered.pose_frame = FIXES
        pose = in_order(fixes.time_s(origin), rows)
    if pose is None:
        return None, None
    if place is not None:
        notes.append(f"x = y = 0 of the places lies at {place}")
    times = pose.time_s
    pose, found = without_jumps(pose, path, lambda row: f"pose at {times[row]:.3f} s")
    problems += found
    return pose, place


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
