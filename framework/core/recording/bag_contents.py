"""Contents of a bag: each topic with the streams that it feeds, and a topic map and a vehicle file of these."""

from __future__ import annotations

import re
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InputError
from ..vehicle import Vehicle
from .bag_camera import camera_info
from .bag_files import Topic
from .bag_frames import Frames
from .bag_gathering import Decided
from .bag_index import BagExcerpt
from .bag_messages import DecodeError, decode, field, fields_of
from .bag_places import is_oriented
from .bags import read_streams
from .column_names import stem_of
from .contents import Contents, Source
from .opened_bag import OpenedBag, Samples, open_bag, take_samples
from .recognition import TRANSFORMS, short_type
from .robots import matches
from .topic_map import COLUMNS, WheelTopic, load_topic_map
from .topic_map_text import topic_map_text
from .types import Recording
from .vehicle_text import vehicle_text
from .wheel_names import castors

_CHANNELS = {column.casefold() for column in COLUMNS} | {"current"}
"""What topics of wheels end in."""

_FRAMES = 2000
"""Most messages of transforms that are looked at: all frames of a robot come in a second."""

_MEANT = (
    ("current", "current_A"), ("torque", "torque_Nm"), ("effort", "torque_Nm"), ("sink", "sinkage_m"),
    ("load", "load_N"), ("tick", "wheel_angle_rad"), ("encoder", "wheel_angle_rad"), ("speed", "wheel_speed_rad_s"),
    ("vel", "wheel_speed_rad_s"),
)  # fmt: skip
"""What a topic of numbers may be, by a word in its name."""

_NO_ORIENTATION = "without an orientation, which pitch and roll need; a filter such as Madgwick's adds it"

_READ_AS = {
    "WrenchStamped": "N, N m; force x forward, force z made positive, torque y",
    "Wrench": "N, N m; force x forward, force z made positive, torque y",
    "NavSatFix": "degrees, WGS 84",
    "LocationFix": "degrees, WGS 84",
}


def inspect_bag(path: Path, *, vehicle: Vehicle | None = None, topics: Path | None = None) -> Contents:
    """Say what is in a bag; of a large one by its index, and by a part of it (`BagExcerpt`).

    Raises
    ------
    InputError
        It is no bag, or not one message of it can be read; or the topic map is at fault by itself.
    """
    if topics is not None:
        load_topic_map(topics)
    bag = BagExcerpt(path)
    samples = take_samples(bag)
    frames = _frames(bag, samples)
    opened: OpenedBag | None = None
    recording: Recording | None = None
    fault, decided = None, Decided()
    try:
        opened = open_bag(bag, samples, vehicle, topics)
        recording, decided = read_streams(opened, vehicle)
    except InputError as error:
        fault = error
    problems = bag.problems if recording is None else recording.problems
    notes = () if recording is None else recording.notes
    if recording is None and opened is not None:
        problems, notes = [*problems, *opened.known.assumed], opened.known.chosen
    start = min(each.first_ns for each in bag.index.values())
    said = (*problems, *notes)
    sources = tuple(
        Source(
            name, each.topic.message_type, each.n_messages, (each.first_ns - start) * 1e-9,
            (each.last_ns - start) * 1e-9, *_use(name, samples, opened, decided.speed, frames, said, recording),
        )
        for name, each in sorted(bag.index.items())
    )  # fmt: skip
    if bag.span is not None:
        part = f"from {(bag.span[0] - start) * 1e-9:.0f} s to {(bag.span[1] - start) * 1e-9:.0f} s"
        notes = (f"a large bag: its messages were looked at {part}; numbers and times of messages are of all", *notes)
    return Contents(
        sources, recording, fault, tuple(problems), tuple(notes),
        _files(opened, recording, vehicle, frames, decided), "topics.toml", path.parent,
    )  # fmt: skip


def _files(
    opened: OpenedBag | None, recording: Recording | None, vehicle: Vehicle | None, frames: Frames, decided: Decided
) -> dict[str, str]:
    files: dict[str, str] = {}
    if opened is not None and opened.given is None:
        files["topics.toml"] = topic_map_text(opened, decided)
    if vehicle is None and opened is None:
        files["vehicle.toml"] = vehicle_text(recording)
    elif vehicle is None and opened is not None:
        topics, samples = opened.known.topics, opened.samples
        info = topics.camera and camera_info(topics.camera.topic, samples.topics, samples.content)
        files["vehicle.toml"] = vehicle_text(
            recording, joints=_joints(topics.wheel), castors=castors([*frames, *_named(samples)]), frames=frames,
            camera=topics.camera is not None, intrinsics=info is not None,
        )  # fmt: skip
    return files


def _joints(wheels: tuple[WheelTopic, ...]) -> dict[str, str]:
    """Give the joint, or what else names it, of each wheel that has a name."""
    found: dict[str, str] = {}
    for source in wheels:
        if source.wheel is not None:
            called = [match[1] for each in source.fields.values() if (match := re.search(r"\[(.+)\]$", each.field))]
            found.setdefault(source.wheel, called[0] if called else source.wheel)
    return found


def _named(samples: Samples) -> list[str]:
    """Names of joints."""
    return [str(each) for content in samples.content.values() for each in getattr(content, "name", ())]


def _frames(bag: BagExcerpt, samples: Samples) -> Frames:
    """Take the frames of a robot, those that move as they are in the beginning."""
    frames = Frames()
    names = {name for name, topic in samples.topics.items() if short_type(topic) in TRANSFORMS}
    static = {name for name in names if name.endswith("static")}
    for wanted in (names - static, static):  # what is fixed is believed
        for message in islice(bag.messages(wanted) if wanted else (), _FRAMES):
            try:
                frames.add(decode(message))
            except DecodeError:
                continue
    return frames


def _use(
    name: str, samples: Samples, opened: OpenedBag | None, speed: str, frames: Frames, said: tuple[str, ...],
    recording: Recording | None,
) -> tuple[str, str]:  # fmt: skip
    """Say what a topic feeds, and in which unit and frame it is taken; or nothing, and why it is not used."""
    topic, content = samples.topics.get(name), samples.content.get(name)
    if topic is None:
        return "", "its first message cannot be found"
    if opened is not None:
        if matches(name, opened.known.topics.ignore):
            given = opened.given is not None and matches(name, opened.given.ignore)
            return "", "the topic map ignores it" if given else "of another robot"
        feeds = _feeds(name, opened, speed, recording)
        if feeds:
            return "; ".join(feeds), _read_as(short_type(topic), content, feeds, frames)
    if content is None:
        return "", "its messages cannot be decoded"
    mentioned = re.compile(rf"(?<![\w/]){re.escape(name)}(?![\w/])")
    if any(mentioned.search(line) for line in said):
        return "", "see below"
    if opened is not None and any(name == each.topic for each in opened.known.speeds):
        return "", "another topic gives the travel speed"
    if name.rsplit("/", 1)[-1].casefold() in _CHANNELS:
        return "", "a wheel's by its name; vehicle.toml has to name that wheel"
    return "", _unknown(topic, content)


def _unknown(topic: Topic, content: Any) -> str:
    """Say why a topic is not used that nothing names, and how a topic map can name it."""
    if short_type(topic) == "Imu" and not is_oriented(content):
        return _NO_ORIENTATION
    values = field(content, "data") if "data" in fields_of(content) else None
    if values is None or isinstance(values, str | bytes):
        return "not known by its name or type; a topic map can name its fields"
    quantity = next((each for word, each in _MEANT if word in topic.name.casefold()), "CHANNEL")
    where = "data" if np.ndim(values) == 0 else "data[0]"
    whose = "a number" if np.ndim(values) == 0 else f"{len(values)} numbers without names"
    read = f'{{ field = "{where}", scale = RADIANS }}' if quantity == "wheel_angle_rad" else f'"{where}"'
    return (
        f'{whose}: in a topic map [[wheel]] topic = "{topic.name}", wheel = "NAME", fields = {{ {quantity} = {read} }}'
    )


def _feeds(name: str, opened: OpenedBag, speed: str, recording: Recording | None) -> list[str]:
    known, topics = opened.known, opened.known.topics
    wheels: dict[tuple[str, ...], list[str]] = {}
    for source in topics.wheel:
        if source.topic == name:
            wheels.setdefault(tuple(source.fields), []).append(source.wheel or "")
    feeds = [", ".join(columns) + _of(names) for columns, names in wheels.items()]
    leans = recording is None or recording.wheel is None or "pitch_rad" in recording.wheel
    shakes = recording is not None and recording.vibration is not None
    camera = None if topics.camera is None else topics.camera.topic
    kind = short_type(opened.samples.topics[name])
    uses = {
        "travel_speed_m_s": name == speed,
        "pose": topics.pose is not None and topics.pose.topic == name,
        "pitch_rad, roll_rad": leans and topics.attitude is not None and topics.attitude.topic == name,
        "camera": camera == name,
        "camera's intrinsics": camera is not None
        and camera_info(camera, opened.samples.topics, opened.samples.content) == name,
        "vibration": shakes and topics.vibration is not None and topics.vibration.topic == name,
        "sound": topics.sound is not None and topics.sound.topic == name,
        "sound's rate and format": topics.sound is not None and kind == "AudioInfo",
        "mounting of sensors": name in known.frames,
        "origin on Earth": name in known.fixes and (topics.pose is None or topics.pose.topic != name),
    }
    return [*feeds, *(text for text, used in uses.items() if used)]


def _of(wheels: list[str]) -> str:
    names = [name for name in wheels if name]
    return f" of {', '.join(names)}" if names else ""


def _read_as(kind: str, content: Any, feeds: list[str], frames: Frames) -> str:
    """Say in which unit, frame and with which sign a topic's numbers are taken."""
    frame = _text(content, "header.frame_id")
    if kind in _READ_AS:
        return _READ_AS[kind]
    if kind == "JointState":
        parts = {
            "wheel_speed_rad_s": "velocity in rad/s, forward positive", "wheel_angle_rad": "position in rad",
            "torque_Nm": "effort in N m at the wheel's axle, after the gear",
        }  # fmt: skip
        return "; ".join(text for column, text in parts.items() if column in feeds[0])
    if kind == "Imu":
        placed = frames.base is not None and frames.pose(frame, frames.base) is not None
        mounted = (
            f"mounted as frame {frame} in {frames.base}" if placed else "taken as mounted along the vehicle's axes"
        )
        turned = "; ".join(["orientation, z up", mounted] if is_oriented(content) else [_NO_ORIENTATION])
        return f"rad/s, m/s^2; {turned}"
    if kind in ("CompressedImage", "Image", "RawImage", "CompressedVideo", "FFMPEGPacket"):
        coded = _text(content, "format") or _text(content, "encoding")
        return ", ".join(part for part in (coded, f"frame {frame}" if frame else "") if part)
    if kind == "Odometry":
        within, of = f"m in frame {frame}", _text(content, "child_frame_id") or "the vehicle"
        parts = [within] * ("pose" in feeds) + [f"m/s along x of {of}"] * ("travel_speed_m_s" in feeds)
        return "; ".join(parts)
    if "travel_speed_m_s" in feeds:
        return f"m/s along x of {frame or 'the vehicle'}"
    if "pose" in feeds:
        return f"m in frame {frame}"
    columns = [column for each in feeds for column in each.split(" of ")[0].split(", ")]
    units = dict.fromkeys(stem_of(column)[1].replace("_", "/") for column in columns)
    return f"{', '.join(units)}, by its name" if all(units) else ""


def _text(content: Any, path: str) -> str:
    try:
        return str(field(content, path))
    except DecodeError:
        return ""
