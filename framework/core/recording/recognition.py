"""Which topic of a bag is which stream: by a topic map, and by names and types of topics where it says nothing.

A topic is recognised

- by its name, ``/wheel/load_N`` or ``/wheel/front_left/load_N``, if it is a number (std_msgs/Float64, Float32); so is
  the current of a wheel's motor, ``/front_left/current``;
- by its type, ROS's or Foxglove's: Odometry, PoseStamped, PoseInFrame, NavSatFix and LocationFix are the pose, Odometry
  and TwistStamped the travel speed, Imu and Odometry the attitude; a WrenchStamped whose name has `wheel` in it is the
  wheel's (force x is the pull, force z the load, its sign made positive, torque y the torque); the joints of a
  JointState that are named after the vehicle's wheels, or have `wheel` in their names, are wheels; images (Image,
  CompressedImage, RawImage) and video (CompressedVideo, FFMPEGPacket) are the camera, and audio is the sound.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..errors import InputError
from ..vehicle import Wheel
from .bag_files import Topic
from .bag_images import no_picture
from .bag_places import is_oriented
from .robots import matches, of_one_robot
from .topic_map import (
    AttitudeTopic,
    CameraTopic,
    PoseTopic,
    Reading,
    SoundFormat,
    SoundTopic,
    TopicMap,
    VibrationTopic,
    WheelTopic,
)
from .types import WHEEL_COLUMNS
from .wheel_names import has_wheels, of_joints, wheel_called

_NUMBERS = {"Float64", "Float32", "Float64Stamped", "Float32Stamped", "Int32", "Int64", "UInt8", "UInt16", "UInt32"}
_POSES = {
    "Odometry": "pose.pose", "PoseStamped": "pose", "PoseWithCovarianceStamped": "pose.pose", "PoseInFrame": "pose",
    "NavSatFix": "", "LocationFix": "",
}  # fmt: skip
_SPEEDS = {"Odometry": "twist.twist.linear.x", "TwistStamped": "twist.linear.x", "Twist": "linear.x"}
_ATTITUDES = {
    "Imu": "orientation", "Odometry": "pose.pose.orientation", "PoseStamped": "pose.orientation",
    "PoseWithCovarianceStamped": "pose.pose.orientation", "PoseInFrame": "pose.orientation",
}  # fmt: skip
_FIXES = [kind for kind, pose in _POSES.items() if not pose]
TRANSFORMS = ("TFMessage", "tfMessage", "FrameTransforms", "FrameTransform")
_NO_PICTURE = re.compile("depth|disparity|confidence|infra|thermal")
_IMAGES = ["CompressedImage", "Image", "RawImage", "FFMPEGPacket", "CompressedVideo"]
_SOUNDS: dict[str, tuple[str, SoundFormat]] = {
    "AudioData": ("data", "pcm16"), "AudioDataStamped": ("audio.data", "pcm16"),
    "AudioStamped": ("audio.data", "pcm16"), "Audio": ("data", "pcm16"), "RawAudio": ("data", "pcm16"),
    "UInt8MultiArray": ("data", "pcm16"), "Int16MultiArray": ("data", "pcm16"), "Int32MultiArray": ("data", "pcm32"),
    "Float32MultiArray": ("data", "float32"),
}  # fmt: skip
_WHEEL_TOPIC = re.compile(r"/?(?:.*/)?wheels?(?:/(?P<wheel>[^/]+))?/(?P<column>[^/]+)")
_OF_A_WHEEL = re.compile(r"/?(?:.*/)?(?P<wheel>[^/]+)/(?P<column>[^/]+)")
_OF_WHEELS = ("wheel", "diff_drive", "encoder", "base_controller")
"""Words in the name of an odometry that is probably made from the wheels: others come before it."""
_COLUMNS = {**{name.casefold(): name for name in WHEEL_COLUMNS[1:]}, "current_a": "current_A", "current": "current_A"}


@dataclass(frozen=True)
class Recognised:
    """A topic map that is complete; in words what had to be taken for granted for it, and what was chosen."""

    topics: TopicMap
    assumed: tuple[str, ...]
    chosen: tuple[str, ...] = ()
    guessed_wrenches: frozenset[str] = frozenset()
    """Topics whose force z was taken as load without anybody saying so: its sign is that of the sensor's axis."""
    speeds: tuple[WheelTopic, ...] = ()
    """Topics that may give the travel speed, best first, where nothing else is stated to give it."""
    frames: frozenset[str] = frozenset()
    """Topics of static transforms."""
    fixes: frozenset[str] = frozenset()
    """The topic of a satellite receiver, where there is one."""

    @property
    def about(self) -> frozenset[str]:
        """Topics that say something about the streams, and are none of them."""
        return self.frames | self.fixes


@dataclass
class _Bag:
    """What recognition goes by: topics, a decoded message of each where there is one, wheels, and remarks in words."""

    topics: Mapping[str, Topic]
    samples: Mapping[str, Any]
    wheels: Sequence[Wheel]
    assumed: list[str]
    chosen: list[str]


def recognise(
    given: TopicMap | None,
    topics: Mapping[str, Topic],
    samples: Mapping[str, Any],
    path: Path,
    wheels: Sequence[Wheel] = (),
) -> Recognised:
    """Complete a map by the topics' names and types; without one go by these alone.

    Parameters
    ----------
    given
        The map, or None.
    topics
        The bag's topics by name.
    samples
        A decoded message of each topic, where there is one.
    path
        The bag, for errors.
    wheels
        The vehicle's, after which joints are named; empty where nobody described them.

    Raises
    ------
    InputError
        The map names a topic that the bag does not have, or gives no fields for one whose type does not say enough; not
        one topic is recognised.
    """
    stated = given or TopicMap()
    named = [part.topic for part in stated.parts]
    absent = [name for name in named if name not in topics]
    absent += [pattern for pattern in stated.ignore if not any(matches(name, [pattern]) for name in topics)]
    if absent:
        raise InputError(path, f"no topic {absent[0]}", expected="one of " + listing(topics))
    kinds = {name: short_type(topic) for name, topic in topics.items()}
    joints = [name for name, kind in kinds.items() if kind == "JointState" and has_wheels(samples.get(name), wheels)]
    stated, chosen, doubts = of_one_robot(stated, kinds, joints)
    kept = {name: topic for name, topic in topics.items() if not matches(name, stated.ignore)}
    bag = _Bag(kept, samples, wheels, [*doubts], [*chosen])
    wheel = _stated_wheels(stated, bag, path)
    guessed, speeds = _guessed_wheels({source.topic for source in stated.wheel}, wheel, bag)
    pose = stated.pose or _pose(bag)
    attitude = stated.attitude or _attitude(bag)
    camera = stated.camera or _camera(bag)
    sound = stated.sound or _sound(bag)
    if not (wheel or guessed or speeds or pose or camera or sound):
        raise InputError(
            path,
            "no topic that is known by its name or type; there are " + listing(topics),
            expected="a topic map (TOML) with [wheel] topic and fields, [pose], [camera] or [sound] topic",
        )
    complete = stated.model_copy(
        update={
            "wheel": (*wheel, *guessed),
            "pose": _with_pose(pose, topics, path),
            "attitude": _with_orientation(attitude, topics, path),
            "camera": camera,
            "sound": _with_format(sound, topics),
            "vibration": stated.vibration or _vibration(bag, attitude),
        }
    )
    wrenches = frozenset(s.topic for s in guessed if "load_N" in s.fields and s.fields["load_N"].field.endswith("e.z"))
    # Foxglove's transforms have no topic of those that stay.
    frames = frozenset(
        name for name, topic in bag.topics.items()
        if short_type(topic) in TRANSFORMS and (name.endswith("static") or short_type(topic).startswith("Frame"))
    )  # fmt: skip
    receivers = [n for n, t in bag.topics.items() if short_type(t) in _FIXES]
    if pose is not None and pose.topic in receivers:
        receivers = [pose.topic]
    fixes = frozenset(receivers if len(receivers) == 1 else ())
    return Recognised(complete, tuple(bag.assumed), tuple(bag.chosen), wrenches, speeds, frames, fixes)


def short_type(topic: Topic) -> str:
    """Give the name of a message type without its package: Image of sensor_msgs/msg/Image or foxglove.Image."""
    return re.split(r"[/.]", topic.message_type)[-1]


def listing(topics: Mapping[str, Topic]) -> str:
    """Name the topics of a bag with their types, in one line."""
    shown = [f"{name} ({topic.message_type or 'no type'})" for name, topic in sorted(topics.items())]
    return ", ".join(shown[:20]) + (f" and {len(shown) - 20} more" if len(shown) > 20 else "") if shown else "none"


def _stated_wheels(stated: TopicMap, bag: _Bag, path: Path) -> list[WheelTopic]:
    wheel: list[WheelTopic] = []
    for source in stated.wheel:
        found = [source] if source.fields else _by_type(bag.topics[source.topic], bag, source.wheel)
        if not found:
            kind = bag.topics[source.topic].message_type
            raise InputError(path, f"{source.topic} is {kind}", expected="fields for it in the topic map")
        wheel += found
    return wheel


def _guessed_wheels(
    mapped: set[str], stated: Sequence[WheelTopic], bag: _Bag
) -> tuple[list[WheelTopic], tuple[WheelTopic, ...]]:
    """Guess wheel channels of the topics that the map does not mention, without those that it states otherwise; give
    them, and what may be the travel speed.
    """
    found: list[WheelTopic] = []
    for topic in bag.topics.values():
        if topic.name not in mapped:
            found += _by_name(topic, bag) or _by_type(topic, bag, None, guess=True)
    guessed, speeds = [], []
    for source in found:
        fields = {
            column: read
            for column, read in source.fields.items()
            if not any(column in other.fields and _may_be_one(other, source) for other in stated)
        }
        if fields:
            source = source.model_copy(update={"fields": fields})
            by_type = "travel_speed_m_s" in fields and short_type(bag.topics[source.topic]) in _SPEEDS
            (speeds if by_type else guessed).append(source)
    if any("travel_speed_m_s" in source.fields for source in guessed):
        return guessed, ()
    kinds = list(_SPEEDS)
    speeds.sort(key=lambda s: (_is_of_wheels(s.topic), kinds.index(short_type(bag.topics[s.topic]))))
    if len(speeds) > 1:
        bag.chosen.append(f"travel speed is taken from {speeds[0].topic}, of {', '.join(s.topic for s in speeds)}")
    return guessed, tuple(speeds)


def _may_be_one(one: WheelTopic, other: WheelTopic) -> bool:
    """Say whether two sources are of one wheel; without a name each is of every wheel."""
    return one.wheel is None or other.wheel is None or one.wheel == other.wheel


def _is_of_wheels(name: str) -> bool:
    return any(word in name.casefold() for word in _OF_WHEELS)


def _pose(bag: _Bag) -> PoseTopic | None:
    topic = _one([t for t in bag.topics.values() if short_type(t) in _POSES], "pose", bag, list(_POSES))
    return None if topic is None else PoseTopic(topic=topic.name)


def _camera(bag: _Bag) -> CameraTopic | None:
    topic = _one(_pictures(bag), "camera", bag, _IMAGES)
    return None if topic is None else CameraTopic(topic=topic.name)


def _pictures(bag: _Bag) -> list[Topic]:
    """Give the topics of images, without those of distances, of other light and of encodings that are not read."""
    found: list[Topic] = []
    for topic in bag.topics.values():
        if short_type(topic) not in _IMAGES:
            continue
        if reason := no_picture(topic.name, bag.samples.get(topic.name)):
            bag.assumed.append(f"{topic.name}: {reason}: left out")
        elif _NO_PICTURE.search(topic.name.casefold()):
            bag.chosen.append(f"{topic.name}: by its name no camera of visible light; a topic map can name it as one")
        else:
            found.append(topic)
    return found


def _attitude(bag: _Bag) -> AttitudeTopic | None:
    """Guess what gives pitch and roll: an inertial sensor that knows its orientation comes before odometry."""
    able = [
        topic
        for topic in bag.topics.values()
        if short_type(topic) in _ATTITUDES and (short_type(topic) != "Imu" or is_oriented(bag.samples.get(topic.name)))
    ]
    kinds = list(_ATTITUDES)
    able.sort(key=lambda topic: (kinds.index(short_type(topic)), _is_of_wheels(topic.name), topic.name))
    same = [topic.name for topic in able if short_type(topic) == short_type(able[0])]
    if len(same) > 1:
        bag.chosen.append(f"pitch and roll are taken from {same[0]}, of {', '.join(same)}")
    return AttitudeTopic(topic=able[0].name) if able else None


def _vibration(bag: _Bag, attitude: AttitudeTopic | None) -> VibrationTopic | None:
    """Guess the inertial sensor that hears the ground: that of the attitude, if it is one, else the first by name."""
    found = sorted(topic.name for topic in bag.topics.values() if short_type(topic) == "Imu")
    if not found:
        return None
    topic = attitude.topic if attitude is not None and attitude.topic in found else found[0]
    if len(found) > 1:
        bag.chosen.append(f"vibration is taken from {topic}, of {', '.join(found)}")
    return VibrationTopic(topic=topic)


def _sound(bag: _Bag) -> SoundTopic | None:
    topic = _one([topic for topic in bag.topics.values() if _is_sound(topic)], "sound", bag, [])
    return None if topic is None else SoundTopic(topic=topic.name)


def _is_sound(topic: Topic) -> bool:
    kind = short_type(topic)
    by_name = any(word in topic.name.casefold() for word in ("audio", "sound", "mic"))
    return kind in _SOUNDS and ("Audio" in kind or by_name)


def _one(found: list[Topic], stream: str, bag: _Bag, order: list[str]) -> Topic | None:
    """Pick the one topic of a stream: the first by its type's place in the order, if no other is as good."""
    if not found:
        return None
    rank = {topic.name: order.index(kind) if (kind := short_type(topic)) in order else len(order) for topic in found}
    best = [topic for topic in found if rank[topic.name] == min(rank.values())]
    if stream == "pose" and any(not _is_of_wheels(topic.name) for topic in best):
        best = [topic for topic in best if not _is_of_wheels(topic.name)]
    names = ", ".join(sorted(topic.name for topic in found))
    if len(best) > 1:
        bag.assumed.append(
            f"more than one topic could be the {stream} ({names}): none is used; name one in a topic map"
        )
        return None
    if len(found) > 1:
        bag.chosen.append(f"{stream} is taken from {best[0].name}, of {names}")
    return best[0]


def _with_pose(pose: PoseTopic | None, topics: Mapping[str, Topic], path: Path) -> PoseTopic | None:
    if pose is None or pose.fields:
        return pose
    kind = short_type(topics[pose.topic])
    if kind not in _POSES:
        raise InputError(path, f"{pose.topic} is {kind}", expected="fields x_m, y_m and yaw_rad in the topic map")
    return pose.model_copy(update={"pose": _POSES[kind]})


def _with_orientation(
    attitude: AttitudeTopic | None, topics: Mapping[str, Topic], path: Path
) -> AttitudeTopic | None:  # fmt: skip
    if attitude is None or attitude.orientation:
        return attitude
    kind = short_type(topics[attitude.topic])
    if kind not in _ATTITUDES:
        raise InputError(path, f"{attitude.topic} is {kind}", expected="orientation under [attitude] in the topic map")
    return attitude.model_copy(update={"orientation": _ATTITUDES[kind]})


def _with_format(sound: SoundTopic | None, topics: Mapping[str, Topic]) -> SoundTopic | None:
    if sound is None:
        return None
    where, form = _SOUNDS.get(short_type(topics[sound.topic]), ("data", "pcm16"))
    return sound.model_copy(update={"field": sound.field or where, "format": sound.format or form})


def _by_name(topic: Topic, bag: _Bag) -> list[WheelTopic]:
    if topic.encoding != "json" and short_type(topic) not in _NUMBERS:
        return []
    match = _WHEEL_TOPIC.fullmatch(topic.name)
    called = None
    if match is not None:
        called = _called(match["wheel"], bag) if match["wheel"] else None
    elif bag.wheels and (match := _OF_A_WHEEL.fullmatch(topic.name)):
        called = wheel_called(match["wheel"], bag.wheels)
        match = match if called else None
    column = _COLUMNS.get(match["column"].casefold()) if match else None
    if column is None:
        return []
    return [WheelTopic(topic=topic.name, wheel=called, fields={column: Reading(field="data")})]


def _called(name: str, bag: _Bag) -> str:
    """Give the vehicle's name of a wheel; as it is where the vehicle has no such wheel."""
    return (wheel_called(name, bag.wheels) if len(bag.wheels) > 1 else None) or name


def _by_type(topic: Topic, bag: _Bag, wheel: str | None, *, guess: bool = False) -> list[WheelTopic]:
    """Read a topic by its type; where nobody named it (`guess`), only if its name does not speak against it."""
    kind, name = short_type(topic), topic.name.casefold()
    if kind == "JointState":
        found, unknown = of_joints(topic.name, bag.samples.get(topic.name), bag.wheels, wheel)
        bag.assumed += [unknown] if unknown else []
        return found
    if kind in _SPEEDS and not (guess and ("cmd" in name or "command" in name)):
        if guess and kind != "Odometry" and re.search("gps|gnss|fix", name):
            bag.assumed.append(f"{topic.name}: a receiver's velocity, east and north, is not used as travel speed")
            return []
        return [WheelTopic(topic=topic.name, wheel=wheel, fields={"travel_speed_m_s": Reading(field=_SPEEDS[kind])})]
    if kind in ("WrenchStamped", "Wrench") and not (guess and "wheel" not in name):
        stem = "wrench." if kind == "WrenchStamped" else ""
        fields = {"drawbar_pull_N": "force.x", "load_N": "force.z", "torque_Nm": "torque.y"}
        bag.assumed.append(f"{topic.name}: force x taken as drawbar pull, force z as load, torque y as torque")
        if guess:
            match = _WHEEL_TOPIC.fullmatch(topic.name)
            wheel = _called(match["wheel"], bag) if match and match["wheel"] else None
        return [
            WheelTopic(topic=topic.name, wheel=wheel, fields={c: Reading(field=stem + f) for c, f in fields.items()})
        ]
    return []
