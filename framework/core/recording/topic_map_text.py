"""A topic map as text, to be edited: what was recognised in a bag, written down."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from ..files import toml_string
from .bag_gathering import Decided
from .opened_bag import OpenedBag
from .recognition import short_type
from .topic_map import Reading, WheelTopic
from .wheel_names import JOINT_PARTS

_HEAD = """\
# Which topic is which stream in {name}, as `bevameter inspect` recognised it: edit what is wrong.
# What is left out here is recognised by name and type. Numbers are SI; where a topic's are not, say
#   torque_Nm = {{ field = "effort[joint]", unit = "Nmm", scale = -1.0, offset = 0.0 }}    # scale times it, plus offset

# name = "first run"
# site = "sand pit"                # drives of one site, whose poses are in one frame, share a map
"""

_POSE = 'Odometry, PoseStamped ...; of another type with fields = { x_m = "...", y_m = "...", yaw_rad = "..." }'
_MOST_JOINTS = 12
"""Joints that are offered as wheels."""

_REMARKS = {
    "wheel_speed_rad_s": "rad/s, forward positive",
    "wheel_angle_rad": "rad",
    "torque_Nm": "N m at the wheel's axle, after the gear, positive where it drives",
    "load_N": "N, positive down",
    "drawbar_pull_N": "N, forward positive",
    "sinkage_m": "m, of the wheel's lowest point",
    "travel_speed_m_s": "m/s",
    "current_A": "A, of the wheel's motor",
}


def topic_map_text(opened: OpenedBag, decided: Decided) -> str:
    """Write the topic map that says what was recognised, with what is left to choose in comments.

    Parameters
    ----------
    opened
        The bag.
    decided
        What its messages say besides: the topic of the travel speed, loads and wheels whose sign is turned.
    """
    known, topics = opened.known, opened.known.topics
    used = {part.topic for part in topics.parts}
    others = [name for name in opened.samples.first if name not in used | known.about | {decided.speed}]
    lines = [_HEAD.format(name=toml_string(opened.bag.path.resolve().name))]
    lines += ["# Topics that are not to be used:", f"ignore = [{', '.join(map(toml_string, topics.ignore))}]", ""]
    if others:
        lines.append("# Not used, or only said to be what they are (camera_info, transforms):")
        lines += [
            f"#   {toml_string(name)} ({toml_string(short_type(opened.samples.topics[name]))})" for name in others
        ]
        lines.append("")
    for name in others:
        lines += _joints(name, opened.samples.content.get(name))
    for source in topics.wheel:
        lines += _wheel(decided.signed(source))
    if decided.speed:
        lines += [
            f"# The travel speed is taken from {toml_string(decided.speed)}. To fix that, or to take another:",
            "# [[wheel]]",
            f"# topic = {toml_string(decided.speed)}",
            '# fields = { travel_speed_m_s = "twist.twist.linear.x" }    # m/s, forward',
            "",
        ]
    lines += _stream("pose", topics.pose and topics.pose.topic, _POSE)
    lines += _stream("attitude", topics.attitude and topics.attitude.topic, "pitch and roll, by a quaternion, z up")
    lines += _stream("camera", topics.camera and topics.camera.topic, "images or video")
    lines += _stream(
        "vibration", topics.vibration and topics.vibration.topic, "an inertial sensor that hears the ground"
    )
    lines += _stream("sound", topics.sound and topics.sound.topic, "by its messages or an AudioInfo, where not stated:")
    lines += [] if topics.sound is None else ["# sample_rate_Hz = 16000", '# format = "pcm16"', "# channels = 1"]
    return "\n".join(lines).rstrip("\n") + "\n"


def _joints(topic: str, sample: Any) -> Iterable[str]:
    """Offer the joints of a topic of which none was recognised as a wheel's."""
    names = [str(name) for name in getattr(sample, "name", ())][:_MOST_JOINTS]
    parts = {column: part for column, part in JOINT_PARTS.items() if len(getattr(sample, part, ())) >= len(names) > 0}
    for joint in names if parts else ():
        fields = ", ".join(f"{column} = {toml_string(f'{part}[{joint}]')}" for column, part in parts.items())
        yield "# [[wheel]]                        # if it is a wheel's joint: the wheel as vehicle.toml calls it"
        yield f"# topic = {toml_string(topic)}"
        yield f"# wheel = {toml_string(joint)}"
        yield f"# fields = {{ {fields} }}"
        yield ""


def _wheel(source: WheelTopic) -> Iterable[str]:
    yield "[[wheel]]"
    yield f"topic = {toml_string(source.topic)}"
    if source.wheel is not None:
        yield f"wheel = {toml_string(source.wheel)}"
    yield "[wheel.fields]"
    for column, reading in source.fields.items():
        remark = f"    # {_REMARKS[column]}" if column in _REMARKS else ""
        yield f"{column} = {_reading(reading)}{remark}"
    yield ""


def _reading(reading: Reading) -> str:
    if reading.scale == 1.0 and reading.offset == 0.0:
        return toml_string(reading.field)
    return f"{{ field = {toml_string(reading.field)}, scale = {reading.scale!r}, offset = {reading.offset!r} }}"


def _stream(name: str, topic: str | None, remark: str) -> list[str]:
    if topic is None:
        return [f"# [{name}]", '# topic = "..."', ""]
    return [f"[{name}]", f"topic = {toml_string(topic)}    # {remark}", ""]
