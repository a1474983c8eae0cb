"""What stands in a bag's messages: decoding, and numbers by the path of their field.

A definition of a message type that comes with a bag is made into code by rosbags. So only its lines of the form ``type
name`` are handed on: constants, default values and comments, in which a hostile bag could hide code, carry nothing that
decoding needs.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Mapping
from functools import lru_cache
from typing import Any

import numpy as np
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from .bag_files import Message, Topic

MAX_STAMP_OFFSET_NS = 10 * 10**9
"""A message's own time stamp counts where it lies this close to the time of recording; another clock does not [ns]."""

_FIELD_LINE = re.compile(r"\s*([A-Za-z][\w/]*(?:<=\d+)?(?:\[(?:<=)?\d*\])?)\s+([A-Za-z]\w*)\s*(?:#.*)?")
_TYPE_LINE = re.compile(r"MSG: +([A-Za-z]\w*(?:/[A-Za-z]\w*){1,2})\s*")
_TYPE_NAME = re.compile(r"[A-Za-z]\w*/msg/[A-Za-z]\w*")
_PATH_PART = re.compile(r"([A-Za-z_]\w*)((?:\[[^\[\]]*\])*)")


class DecodeError(ValueError):
    """A message that cannot be decoded, or has no such field; the text says why."""


def decode(message: Message) -> Any:
    """Decode a message into an object (ROS) or a mapping (JSON).

    Raises
    ------
    DecodeError
        The message is damaged, or its type unknown.
    """
    topic = message.topic
    if topic.encoding == "json":
        try:
            return json.loads(message.data)
        except ValueError as error:
            raise DecodeError(f"no JSON: {error}") from error
    if topic.encoding not in ("ros1", "cdr"):
        raise DecodeError(f"encoding {topic.encoding!r} is not known; ros1, cdr and json are")
    store = _store(topic)
    try:
        if topic.encoding == "ros1":
            return store.deserialize_ros1(message.data, topic.message_type)
        return store.deserialize_cdr(message.data, topic.message_type)
    except Exception as error:  # whatever generated code raises on bytes that are too few
        raise DecodeError(f"a damaged {topic.message_type}: {error or type(error).__name__}") from error


@lru_cache(maxsize=256)
def _store(topic: Topic) -> Typestore:
    """Give the types that decode a topic: those that its bag defines, or the standard ones of ROS."""
    if not _TYPE_NAME.fullmatch(topic.message_type):
        raise DecodeError(f"{topic.message_type!r} is no type of message")
    if topic.definition:
        store = get_typestore(Stores.EMPTY)
        try:
            types = get_types_from_msg(_fields_only(topic.definition), topic.message_type)
            store.register({name: fields for name, fields in types.items() if name not in store.fielddefs})
        except Exception as error:
            raise DecodeError(f"the definition of {topic.message_type} cannot be read: {error}") from error
        return store
    store = get_typestore(Stores.ROS1_NOETIC if topic.encoding == "ros1" else Stores.LATEST)
    if topic.message_type not in store.fielddefs:
        raise DecodeError(f"the bag does not define {topic.message_type}, and it is no standard type")
    return store


def _fields_only(definition: str) -> str:
    """Leave of a message definition its fields, the names of its parts and the lines between them."""
    lines: list[str] = []
    for line in definition.splitlines():
        if re.fullmatch(r"=+\s*", line):
            lines.append("=" * 80)
        elif part := _TYPE_LINE.fullmatch(line):
            lines.append(f"MSG: {part[1]}")
        elif field := _FIELD_LINE.match(line):
            rest = line[field.end() :].lstrip()
            if not rest.startswith("="):  # a constant
                lines.append(f"{field[1]} {field[2]}")
    return "\n".join(lines) + "\n"


def field(content: Any, path: str) -> Any:
    """Give what stands at a path such as ``wrench.force.z``, ``data[0]`` or ``velocity[left_wheel]``.

    A name in brackets is looked up in the message's list `name`, as in sensor_msgs/JointState.

    Raises
    ------
    DecodeError
        There is no such field.
    """
    value = content
    for part in path.split("."):
        match = _PATH_PART.fullmatch(part)
        if match is None:
            raise DecodeError(f"{path!r} is no path of a field")
        name = match[1]
        if isinstance(value, Mapping) and name in value:
            value = value[name]
        elif name in getattr(value, "__dataclass_fields__", ()):
            value = getattr(value, name)
        else:
            raise DecodeError(f"no field {name!r} in {', '.join(fields_of(value)) or type(value).__name__}")
        for index in re.findall(r"\[([^\[\]]*)\]", match[2]):
            value = _item(content, value, index)
    return value


def _item(content: Any, value: Any, index: str) -> Any:
    if not index.lstrip("-").isdigit():
        names = [str(name) for name in field(content, "name")]
        if index not in names:
            raise DecodeError(f"no {index!r} among {', '.join(names)}")
        index = str(names.index(index))
    try:
        return value[int(index)]
    except (LookupError, TypeError) as error:
        raise DecodeError(f"no item {index}: {error}") from error


def fields_of(content: Any) -> tuple[str, ...]:
    """Give the names of a message's fields."""
    if isinstance(content, Mapping):
        return tuple(str(name) for name in content)
    return tuple(name for name in getattr(content, "__dataclass_fields__", ()) if name != "__msgtype__")


def number(content: Any, path: str) -> float:
    """Give the number at a path, NaN for a null; raises `DecodeError` where there is none."""
    value = field(content, path)
    if value is None:
        return math.nan
    if isinstance(value, bool | int | float | np.number):
        return float(value)
    raise DecodeError(f"{path} is no number but {type(value).__name__}")


def stamp_ns(message: Message, content: Any) -> int:
    """Give a message's own time stamp [ns] where it has one on the recorder's clock, else the time of recording.

    A stamp of zero is one that nobody filled in.
    """
    try:
        stamp = field(content, "timestamp" if "timestamp" in fields_of(content) else "header.stamp")
        second = field(stamp, "sec" if "sec" in fields_of(stamp) else "secs")
        part = next(name for name in ("nanosec", "nsec", "nsecs") if name in fields_of(stamp))
        own = int(second) * 10**9 + int(field(stamp, part))
    except (DecodeError, StopIteration, TypeError, ValueError):
        return message.time_ns
    return own if own > 0 and abs(own - message.time_ns) <= MAX_STAMP_OFFSET_NS else message.time_ns
