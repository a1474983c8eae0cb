"""Which topic of a bag is which stream: the topic map, and what is made of the topics' names and types without one.

The map is TOML, each part of it optional; ``docs/recording.md`` shows it. Fields are paths such as ``wrench.force.z``,
``data[0]``, ``velocity[left_wheel]``. Without a map a topic is recognised

- by its name, ``/wheel/load_N`` or ``/wheel/front_left/load_N``, if it is a number (std_msgs/Float64, Float32);
- by its type: Odometry and PoseStamped are the pose, and Odometry and TwistStamped the travel speed; a WrenchStamped
  whose name has `wheel` in it is the wheel's (force x is the pull, force z the load, its sign made positive, torque y
  the torque); the joints of a JointState whose names have `wheel` in them are wheels; Image and CompressedImage are the
  camera, and audio is the sound.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BeforeValidator, Field

from ..errors import InputError
from ..files import load_toml
from ..models import FileModel, Finite, Positive, Whole, checked
from .bag_files import Topic
from .bag_images import no_picture
from .camera import BitDepth
from .types import WHEEL_COLUMNS

SoundFormat = Literal["pcm8", "pcm16", "pcm24", "pcm32", "float32", "mp3"]

_NUMBERS = {"Float64", "Float32", "Float64Stamped", "Float32Stamped", "Int32", "Int64", "UInt8", "UInt16", "UInt32"}
_POSES = {"Odometry": "pose.pose", "PoseStamped": "pose", "PoseWithCovarianceStamped": "pose.pose"}
_SPEEDS = {"Odometry": "twist.twist.linear.x", "TwistStamped": "twist.linear.x", "Twist": "linear.x"}
_IMAGES = ["CompressedImage", "Image", "RawImage", "FFMPEGPacket", "CompressedVideo"]
_SOUNDS: dict[str, tuple[str, SoundFormat]] = {
    "AudioData": ("data", "pcm16"), "AudioDataStamped": ("audio.data", "pcm16"),
    "AudioStamped": ("audio.data", "pcm16"), "Audio": ("data", "pcm16"), "RawAudio": ("data", "pcm16"),
    "UInt8MultiArray": ("data", "pcm16"), "Int16MultiArray": ("data", "pcm16"), "Int32MultiArray": ("data", "pcm32"),
    "Float32MultiArray": ("data", "float32"),
}  # fmt: skip
_WHEEL_TOPIC = re.compile(r"/?(?:.*/)?wheels?(?:/(?P<wheel>[^/]+))?/(?P<column>[^/]+)")


class Reading(FileModel):
    """A number of a message: the path of its field, and what makes it SI: scale times value plus offset."""

    field: str
    scale: Finite = 1.0
    offset: Finite = 0.0


AnyReading = Annotated[Reading, BeforeValidator(lambda value: {"field": value} if isinstance(value, str) else value)]


def _wheel_column(name: str) -> str:
    if name not in WHEEL_COLUMNS or name == "time_s":
        raise ValueError(f"no column of a wheel file, expected one of {', '.join(WHEEL_COLUMNS[1:])}")
    return name


class WheelTopic(FileModel):
    """A topic with wheel channels."""

    topic: str
    wheel: str | None = None
    fields: dict[Annotated[str, AfterValidator(_wheel_column)], AnyReading] = Field(default_factory=dict)


class PoseTopic(FileModel):
    """A topic with poses; the path of its pose, or of x_m, y_m and yaw_rad."""

    topic: str
    fields: dict[Literal["x_m", "y_m", "yaw_rad"], AnyReading] = Field(default_factory=dict)
    pose: str | None = None


class CameraTopic(FileModel):
    """A topic with images or video, and how many bits samples make use of that come as 16."""

    topic: str
    bit_depth: BitDepth | None = None


class SoundTopic(FileModel):
    """A topic with sound, and how its samples are written."""

    topic: str
    field: str | None = None
    format: SoundFormat | None = None
    sample_rate_Hz: Annotated[Whole, Field(ge=1000, le=768_000)] | None = None
    channels: Annotated[Whole, Field(ge=1, le=64)] | None = None


class TopicMap(FileModel):
    """Which topic is which."""

    name: str | None = None
    site: str = ""
    max_gap_s: Positive = 0.5
    wheel: Annotated[tuple[WheelTopic, ...], BeforeValidator(lambda v: [v] if isinstance(v, dict) else v)] = ()
    pose: PoseTopic | None = None
    camera: CameraTopic | None = None
    sound: SoundTopic | None = None


@dataclass(frozen=True)
class Recognised:
    """A topic map that is complete, and what had to be taken for granted for it, in words."""

    topics: TopicMap
    assumed: tuple[str, ...]
    guessed_wrenches: frozenset[str] = frozenset()
    """Topics whose force z was taken as load without anybody saying so: its sign is that of the sensor's axis."""


def load_topic_map(path: Path) -> TopicMap:
    """Read a topic map; raises `InputError` on an unknown key, a wrong value or a column that is none of a wheel's."""
    return checked(TopicMap, load_toml(path), path)


def complete(given: TopicMap, topics: Mapping[str, Topic], samples: Mapping[str, Any], path: Path) -> Recognised:
    """Fill in what a map's topics leave to their types.

    Parameters
    ----------
    given
        The map.
    topics
        The bag's topics by name.
    samples
        A decoded message of each topic, where there is one.
    path
        The bag, for errors.

    Raises
    ------
    InputError
        The map names a topic that the bag does not have, or gives no fields for one whose type does not say enough.
    """
    assumed: list[str] = []
    for part in (*given.wheel, given.pose, given.camera, given.sound):
        if part is not None and part.topic not in topics:
            raise InputError(path, f"no topic {part.topic}", expected="one of " + listing(topics))
    wheel: list[WheelTopic] = []
    for source in given.wheel:
        found = [source] if source.fields else _wheel_by_type(topics[source.topic], samples, source.wheel, assumed)
        if not found:
            kind = topics[source.topic].message_type
            raise InputError(path, f"{source.topic} is {kind}", expected="fields for it in the topic map")
        wheel += found
    pose = given.pose
    if pose is not None and not pose.fields:
        kind = short_type(topics[pose.topic])
        if kind not in _POSES:
            raise InputError(path, f"{pose.topic} is {kind}", expected="fields x_m, y_m and yaw_rad in the topic map")
        pose = pose.model_copy(update={"pose": _POSES[kind]})
    sound = given.sound
    if sound is not None:
        where, form = _SOUNDS.get(short_type(topics[sound.topic]), ("data", "pcm16"))
        sound = sound.model_copy(update={"field": sound.field or where, "format": sound.format or form})
    return Recognised(given.model_copy(update={"wheel": tuple(wheel), "pose": pose, "sound": sound}), tuple(assumed))


def recognise(topics: Mapping[str, Topic], samples: Mapping[str, Any], path: Path) -> Recognised:
    """Make a map of the topics' names and types alone; parameters as of `complete`.

    Raises
    ------
    InputError
        Not one topic is recognised.
    """
    assumed: list[str] = []
    wheel: list[WheelTopic] = []
    for topic in topics.values():
        wheel += _wheel_by_name(topic) or _wheel_by_type(topic, samples, None, assumed, guess=True)
    wheel = _one_travel_speed(wheel, topics, assumed)
    pose = _one([t for t in topics.values() if short_type(t) in _POSES], "pose", assumed, list(_POSES))
    camera = _one(_pictures(topics, samples, assumed), "camera", assumed, _IMAGES)
    heard = [t for t in topics.values() if _is_sound(t)]
    sound = _one(heard, "sound", assumed, [])
    answer = TopicMap(
        wheel=tuple(wheel),
        pose=None if pose is None else PoseTopic(topic=pose.name),
        camera=None if camera is None else CameraTopic(topic=camera.name),
        sound=None if sound is None else SoundTopic(topic=sound.name),
    )
    if not (wheel or pose or camera or sound):
        raise InputError(
            path,
            "no topic that is known by its name or type; there are " + listing(topics),
            expected="a topic map (TOML) with [wheel] topic and fields, [pose], [camera] or [sound] topic",
        )
    completed = complete(answer, topics, samples, path)
    wrenches = frozenset(
        s.topic for s in wheel if "load_N" in s.fields and s.fields["load_N"].field.endswith("force.z")
    )
    return replace(completed, assumed=(*assumed, *completed.assumed), guessed_wrenches=wrenches)


def short_type(topic: Topic) -> str:
    """Give the name of a message type without its package: Image of sensor_msgs/msg/Image or foxglove.Image."""
    return re.split(r"[/.]", topic.message_type)[-1]


def listing(topics: Mapping[str, Topic]) -> str:
    """Name the topics of a bag with their types, in one line."""
    shown = [f"{name} ({topic.message_type or 'no type'})" for name, topic in sorted(topics.items())]
    return ", ".join(shown[:20]) + (f" and {len(shown) - 20} more" if len(shown) > 20 else "") if shown else "none"


def _is_sound(topic: Topic) -> bool:
    kind = short_type(topic)
    by_name = any(word in topic.name.casefold() for word in ("audio", "sound", "mic"))
    return kind in _SOUNDS and ("Audio" in kind or by_name)


def _pictures(topics: Mapping[str, Topic], samples: Mapping[str, Any], assumed: list[str]) -> list[Topic]:
    """Give the topics of images, without those of distances, which are named."""
    found: list[Topic] = []
    for topic in topics.values():
        if short_type(topic) in _IMAGES:
            if reason := no_picture(topic.name, samples.get(topic.name)):
                assumed.append(f"{topic.name}: {reason}: left out")
            else:
                found.append(topic)
    return found


def _one(found: list[Topic], stream: str, assumed: list[str], order: list[str]) -> Topic | None:
    """Pick the one topic of a stream: the first by its type's place in the order, if no other is as good."""
    if not found:
        return None
    rank = {topic.name: order.index(kind) if (kind := short_type(topic)) in order else len(order) for topic in found}
    best = [topic for topic in found if rank[topic.name] == min(rank.values())]
    names = ", ".join(sorted(topic.name for topic in found))
    if len(best) > 1:
        assumed.append(f"more than one topic could be the {stream} ({names}): none is used; name one in a topic map")
        return None
    if len(found) > 1:
        assumed.append(f"{stream} is taken from {best[0].name}, of {names}")
    return best[0]


def _wheel_by_name(topic: Topic) -> list[WheelTopic]:
    match = _WHEEL_TOPIC.fullmatch(topic.name)
    if match is None or (topic.encoding != "json" and short_type(topic) not in _NUMBERS):
        return []
    columns = {name.casefold(): name for name in WHEEL_COLUMNS if name != "time_s"}
    column = columns.get(match["column"].casefold())
    if column is None:
        return []
    return [WheelTopic(topic=topic.name, wheel=match["wheel"], fields={column: Reading(field="data")})]


def _wheel_by_type(
    topic: Topic, samples: Mapping[str, Any], wheel: str | None, assumed: list[str], *, guess: bool = False
) -> list[WheelTopic]:
    """Read a topic by its type; where nobody named it (`guess`), only if its name does not speak against it."""
    kind, name = short_type(topic), topic.name.casefold()
    if kind == "JointState":
        return _joints(topic, samples.get(topic.name), wheel)
    if kind in _SPEEDS and not (guess and ("cmd" in name or "command" in name)):
        return [WheelTopic(topic=topic.name, wheel=wheel, fields={"travel_speed_m_s": Reading(field=_SPEEDS[kind])})]
    if kind in ("WrenchStamped", "Wrench") and not (guess and "wheel" not in name):
        stem = "wrench." if kind == "WrenchStamped" else ""
        fields = {"drawbar_pull_N": "force.x", "load_N": "force.z", "torque_Nm": "torque.y"}
        assumed.append(f"{topic.name}: force x taken as drawbar pull, force z as load, torque y as torque")
        if guess:
            match = _WHEEL_TOPIC.fullmatch(topic.name)
            wheel = match["wheel"] if match else None
        return [
            WheelTopic(topic=topic.name, wheel=wheel, fields={c: Reading(field=stem + f) for c, f in fields.items()})
        ]
    return []


def _joints(topic: Topic, sample: Any, wheel: str | None) -> list[WheelTopic]:
    """Take the joints that are wheels: those with `wheel` in their name, or the only one."""
    names = [str(name) for name in getattr(sample, "name", ())]
    chosen = names if len(names) == 1 else [name for name in names if "wheel" in name.casefold()]
    parts = {"wheel_speed_rad_s": "velocity", "wheel_angle_rad": "position", "torque_Nm": "effort"}
    parts = {column: part for column, part in parts.items() if len(getattr(sample, part, ())) == len(names)}
    answer: list[WheelTopic] = []
    for joint in chosen:
        called = wheel if len(chosen) == 1 else re.sub(r"_?(wheel)?_?joint$|_wheel$", "", joint) or joint
        fields = {column: Reading(field=f"{part}[{joint}]") for column, part in parts.items()}
        if fields:
            answer.append(WheelTopic(topic=topic.name, wheel=called, fields=fields))
    return answer


def _one_travel_speed(wheel: list[WheelTopic], topics: Mapping[str, Topic], assumed: list[str]) -> list[WheelTopic]:
    """Keep one source of travel speed that was guessed by type, and none where one was named."""
    guessed = [s for s in wheel if "travel_speed_m_s" in s.fields and short_type(topics[s.topic]) in _SPEEDS]
    named = [s for s in wheel if "travel_speed_m_s" in s.fields and s not in guessed]
    keep = None
    if guessed and not named:
        keep = min(guessed, key=lambda source: list(_SPEEDS).index(short_type(topics[source.topic])))
        if len(guessed) > 1:
            assumed.append(f"travel speed is taken from {keep.topic}, of {', '.join(s.topic for s in guessed)}")
    return [source for source in wheel if source not in guessed or source is keep]
