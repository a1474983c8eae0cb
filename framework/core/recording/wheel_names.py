"""Which wheel of a vehicle a joint or a topic is: `front_left_wheel_joint`, `fl`, `wheel_1`."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..vehicle import Wheel
from .topic_map import Reading, WheelTopic

_WHEEL = {"wheel", "wheels", "joint", "joints", "link", "drive", "driven", "motor", "hub", "axle", "tyre", "tire"}
_STEERS = {"steer", "steering", "steered", "caster", "castor", "suspension", "swivel", "rocker", "bogie"}
_AXLES = {
    **dict.fromkeys(("front", "fwd", "forward", "fore", "f"), "front"),
    **dict.fromkeys(("middle", "mid", "center", "centre", "m"), "middle"),
    **dict.fromkeys(("rear", "back", "hind", "aft", "b"), "rear"),
}  # fmt: skip
_SIDES = {**dict.fromkeys(("left", "l"), "left"), **dict.fromkeys(("right", "r"), "right")}
_SHORT = {
    axle + side: (axles, sides)
    for axle, axles in (("f", "front"), ("m", "middle"), ("r", "rear"), ("b", "rear"))
    for side, sides in (("l", "left"), ("r", "right"))
}
_SHORT |= {"lf": ("front", "left"), "rf": ("front", "right"), "lm": ("middle", "left"), "rm": ("middle", "right"),
           "lr": ("rear", "left"), "lb": ("rear", "left"), "rb": ("rear", "right")}  # fmt: skip

JOINT_PARTS = {"wheel_speed_rad_s": "velocity", "wheel_angle_rad": "position", "torque_Nm": "effort"}
"""Lists of a JointState, by the channel that each is of a wheel's joint."""


@dataclass(frozen=True)
class _Key:
    """What a name says: axle, side and numbers; whether it steers, and whether every part of it is known."""

    axle: str = ""
    side: str = ""
    numbers: tuple[int, ...] = ()
    steers: bool = False
    wheel: bool = False
    all_known: bool = True

    @property
    def place(self) -> tuple[str, str]:
        return self.axle, self.side


def _key(name: str) -> _Key:
    axle = side = ""
    numbers, steers, wheel, all_known = [], False, False, True
    parts = re.findall(r"[a-z]+|\d+", re.sub(r"(?<=[a-z])(?=[A-Z])", "_", name).casefold())
    for part in parts:
        if part.isdigit():
            numbers.append(int(part))
        elif part in _STEERS:
            steers = True
        elif part in _WHEEL:
            wheel |= part.startswith("wheel")
        elif part in _SHORT and not (axle or side):
            axle, side = _SHORT[part]
        elif part in _AXLES:
            axle = axle or _AXLES[part]
        elif part in _SIDES:
            side = side or _SIDES[part]
        else:
            all_known = False
    return _Key(axle, side, tuple(numbers), steers, wheel, all_known)


def _stem(name: str) -> str:
    """Leave of a name what tells wheels apart."""
    parts = re.findall(r"[a-z]+|\d+", re.sub(r"(?<=[a-z])(?=[A-Z])", "_", name).casefold())
    return "_".join(part for part in parts if part not in _WHEEL)


def _places(wheels: Sequence[Wheel]) -> list[tuple[str, str]]:
    """Axle and side of each wheel by where it is; empty where that does not say."""
    place = np.array([wheel.position_m for wheel in wheels])
    axles = np.unique(np.round(place[:, 0], 3))
    names = {1: ("",), 2: ("rear", "front"), 3: ("rear", "middle", "front")}.get(len(axles), ("",) * len(axles))
    of_axle = dict(zip(axles.tolist(), names, strict=True))
    sides = np.where(place[:, 1] > 0, "left", np.where(place[:, 1] < 0, "right", ""))
    return [(of_axle[float(np.round(x, 3))], str(side)) for (x, _), side in zip(place, sides, strict=True)]


def wheel_of(joint: str) -> str:
    """Name a wheel after its joint, where nobody described the vehicle: front_left of front_left_wheel_joint."""
    return re.sub(r"_?(wheel)?_?joint$|_wheel$", "", joint) or joint


def of_a_joint(column: str) -> tuple[str, str] | None:
    """Give the wheel and the channel of a table's column that is named as PlotJuggler names a field of a JointState,
    ``/joint_states/front_left_wheel_joint/velocity``; None where it is none.
    """
    _, *path = column.split("/")
    parts = {part: channel for channel, part in JOINT_PARTS.items()}
    if len(path) < 2 or path[-1] not in parts or not drives(path[-2]):
        return None
    return wheel_of(path[-2]), parts[path[-1]]


def same_part(joint: str, frame: str) -> bool:
    """Say whether a frame is of the wheel of a joint, by their names without `wheel`, `joint`, `link` and the like."""
    return bool(_stem(joint)) and _stem(joint) == _stem(frame) and drives(frame)


def place_of(name: str) -> tuple[int, int]:
    """Give where a name says that a wheel is: 1 in front, -1 in the rear; 1 left, -1 right; 0 where it does not say."""
    key = _key(name)
    return {"front": 1, "rear": -1}.get(key.axle, 0), {"left": 1, "right": -1}.get(key.side, 0)


def castors(names: Iterable[str]) -> dict[str, str]:
    """Give the castors among names of joints and frames, each by a short name: their wheels, where these are named."""
    found = [name for name in names if re.search("cast[eo]r", name.casefold())]
    wheels = [name for name in found if "wheel" in name.casefold()] or found
    called = {re.sub(r"(?i)_?(wheel|link|joint|frame|swivel|rotation)", "", name).strip("_/"): name for name in wheels}
    return {short or name: name for short, name in called.items()}


def drives(name: str) -> bool:
    """Say whether a joint's name is that of a wheel that is driven: one with `wheel` in it that does not steer."""
    return "wheel" in name.casefold() and not _key(name).steers


def has_wheels(sample: Any, wheels: Sequence[Wheel]) -> bool:
    """Say whether a JointState has joints of several wheels, or of the vehicle's."""
    names = [str(name) for name in getattr(sample, "name", ())]
    found = [name for name in names if drives(name) or (len(wheels) > 1 and wheel_called(name, wheels))]
    return len(found) > 1


def wheel_called(name: str, wheels: Sequence[Wheel]) -> str | None:
    """Give the name of the wheel that a joint or topic's part is named after, or None.

    Names are compared without `wheel`, `joint`, `motor` and the like; then by the axle and the side that they name
    (`front_left`, `fl`, `lf`, `leftFront`), which a wheel's own name says, or else its place in the vehicle. A joint
    that steers is no wheel, nor is one without `wheel` in its name that has other words in it.
    """
    key, stem = _key(name), _stem(name)
    if key.steers or not stem:
        return None
    same = [wheel.name for wheel in wheels if name == wheel.name or stem == _stem(wheel.name)]
    if len(same) == 1:
        return same[0]
    if not (key.wheel or key.all_known) or not (key.axle or key.side):
        return None
    named = [_key(wheel.name) for wheel in wheels]
    for candidates in ([each.place for each in named], _places(wheels)):
        found = [wheel.name for wheel, place in zip(wheels, candidates, strict=True) if place == key.place]
        if len(found) == 1:
            return found[0]
    return None


def _unknown_joints(topic: str, names: list[str], parts: list[tuple[str, str]], wheels: Sequence[Wheel]) -> str:
    """Say that no joint is known as a wheel, and what to write in a topic map."""
    of = wheels[0].name if len(wheels) > 1 else "NAME"
    fields = ", ".join(f'{column} = "{part}[{names[0]}]"' for column, part in parts)
    listed = ", ".join(names[:12]) + (f" and {len(names) - 12} more" if len(names) > 12 else "")
    lacks = "has `wheel` in its name"
    if len(wheels) > 1:
        lacks = f"is named after one wheel of the vehicle ({', '.join(wheel.name for wheel in wheels)})"
    return (
        f"{topic}: of the joints {listed} none {lacks}; name them in a topic map, for each wheel "
        f'[[wheel]] topic = "{topic}" wheel = "{of}" fields = {{ {fields} }}'
    )


def of_joints(
    topic: str, sample: Any, wheels: Sequence[Wheel], wheel: str | None
) -> tuple[list[WheelTopic], str]:  # fmt: skip
    """Take the joints that are wheels: those named after the vehicle's, else with `wheel` in their name, or the only
    one, which is the `wheel`; and say what to write where none is, else nothing.
    """
    names = [str(name) for name in getattr(sample, "name", ())]
    parts = {column: part for column, part in JOINT_PARTS.items() if len(getattr(sample, part, ())) == len(names)}
    if not names or not parts:
        return [], ""
    if len(names) == 1:
        called: dict[str, str | None] = {names[0]: wheel}
    elif len(wheels) > 1:
        matched = {name: wheel_called(name, wheels) for name in names}
        called = {n: w for n, w in matched.items() if w and list(matched.values()).count(w) == 1}
    else:
        called = {name: wheel_of(name) for name in names if drives(name)}
        called = {name: wheel for name in called} if len(called) == 1 else called
    answer = []
    for name, of in called.items():
        fields = {column: Reading(field=f"{part}[{name}]") for column, part in parts.items()}
        answer.append(WheelTopic(topic=topic, wheel=of, fields=fields))
    return answer, "" if called else _unknown_joints(topic, names, list(parts.items()), wheels)
