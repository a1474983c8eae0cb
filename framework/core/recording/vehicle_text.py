"""A vehicle file as text, to be completed: what a recording says of its vehicle, and what is left to be measured.

A number that the recording does not say stands in a comment, as an example; reading the file names the first one that
is needed.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from ..files import toml_string
from ..vehicle import Camera
from .bag_frames import Frames
from .types import Recording, WheelTable
from .wheel_names import place_of, same_part

_HEAD = """\
# The vehicle of {name}, as far as the recording says it: measure what stands in comments, and remove their `# `.
# For common robots: bevameter vehicle --list

# name = "my robot"
"""
_WEIGHT = """\
# Needed where no load is sensed: {needed}.
# mass_kg = 60.0                       # weigh: with payload [kg]
# centre_of_mass_m = [0.0, 0.0, 0.3]   # measure: x forward, y left, as positions; z above the ground [m]
"""
_LUGS = """\
# grouser_height_m = 0.01              # measure: of the lugs of each wheel, where there are any [m]
# grouser_count = 24
"""
_CASTOR = """\
# Carries a share of the weight; where there is no such castor, remove this.
"""
_MOTOR = """\
# Torque of the motors' current, where none is sensed:
# [motor]
# torque_constant_Nm_A = 0.06          # data sheet of the motor
# gear_ratio = 50.0                    # turns of the motor for one of the wheel
# efficiency = 0.8                     # of the gear
# friction_Nm = 1.5                    # measure: torque at the wheel, as a free spin shows it
"""
_MOUNT = """\
height_m = 0.9                         # measure: above the ground [m]
pitch_rad = 0.4                        # measure: how far the camera looks below the horizon [rad]
# forward_m = 0.4                      # measure: ahead of where positions count from [m]
# left_m = 0.0
"""
_CAMERA = """\
matrix = [[420.0, 0.0, 319.5], [0.0, 420.0, 239.5], [0.0, 0.0, 1.0]]   # calibrate: OpenCV's [px]
distortion = [0.0, 0.0, 0.0, 0.0]      # calibrate: k1, k2, p1, p2
width_px = 640                         # of the images
height_px = 480
"""


OF_A_WHEEL = (
    "load_N", "torque_Nm", "sinkage_m", "slip", "drawbar_pull_N", "wheel_speed_rad_s", "wheel_angle_rad", "current_A",
)  # fmt: skip
"""Channels that a wheel has, and not the vehicle as a whole."""


def has_wheels(table: WheelTable | None) -> bool:
    """Say whether a table has channels of a wheel, and not only the vehicle's speed, say."""
    return table is not None and any(table.observed(name).size for name in OF_A_WHEEL)


def vehicle_text(
    recording: Recording | None,
    *,
    joints: Mapping[str, str] | None = None,
    castors: Mapping[str, str] | None = None,
    frames: Frames | None = None,
    camera: bool = False,
    intrinsics: bool = False,
) -> str:
    """Write the vehicle file.

    Parameters
    ----------
    recording
        What was read; None where it cannot be.
    joints
        The joint, or what else names it, of each wheel that has a name.
    castors
        The joint or frame of each castor.
    frames
        The frames of the robot's parts.
    camera, intrinsics
        Whether there are images, and whether the recording states the camera's matrix.
    """
    joints, castors, frames = joints or {}, castors or {}, frames or Frames()
    table = None if recording is None else recording.wheel
    geometry = None if recording is None or recording.vehicle is None else recording.vehicle.camera
    wheels = bool(joints) or has_wheels(table) or not camera
    name = "a recording" if recording is None else toml_string(recording.name)
    parts = [_HEAD.format(name=name)]
    weighed = table is not None and bool(table.observed("load_N").size)
    if wheels and not weighed:
        several = len(joints) > 1
        parts.append(_WEIGHT.format(needed="mass_kg and the wheels' positions" if several else "mass_kg, or load_N"))
    if wheels:
        of_each = [_wheel(each, joint, frames) for each, joint in joints.items()]
        parts += of_each if len(joints) > 1 else [_wheel(weighed=weighed)]
        parts[-1] += _LUGS
        parts += [_CASTOR + _wheel(each, part, frames, castor=True) for each, part in castors.items() if not weighed]
    if table is not None and "current_A" in table and "torque_Nm" not in table:
        parts.append(_MOTOR)
    if geometry is not None:
        parts.append(_camera(geometry))
    elif camera:
        block = f"[camera_mount]\n{_MOUNT}" if intrinsics else f"[camera]\n{_CAMERA}{_MOUNT}"
        parts.append(_commented(block, header=wheels))
    return "\n".join(parts)


def _wheel(
    name: str | None = None, joint: str = "", frames: Frames | None = None, *,
    weighed: bool = True, castor: bool = False,
) -> str:  # fmt: skip
    """One wheel: its name, and place and radius where frames say them."""
    lines = ["[wheel]"] if name is None else ["[[wheels]]", f"name = {toml_string(name)}"]
    lines += ["driven = false"] if castor else []
    frame = next((each for each in frames or () if each == joint or same_part(joint, each)), None)
    place = None if frame is None or frames is None or frames.base is None else frames.pose(frame, frames.base)
    ground = None if frame is None or frames is None or frames.ground is None else frames.pose(frame, frames.ground)
    if ground is not None and ground[2, 3] > 0.0:
        lines.append(f"radius_m = {_number(ground[2, 3])}    # height of {toml_string(str(frame))} over the ground")
    else:
        lines.append("# radius_m = 0.15                      # measure: half of the diameter, loaded [m]")
    lines.append("# width_m = 0.12                       # measure: of the tread [m]")
    if place is not None:
        lines.append(f"position_m = [{_number(place[0, 3])}, {_number(place[1, 3])}]    # of {toml_string(str(frame))}")
    elif name is not None:
        x, y = (sign * example for sign, example in zip(place_of(joint), (0.3, 0.25), strict=True))
        lines.append(f"# position_m = [{x:g}, {y:g}]".ljust(39) + "# measure: x forward, y left [m]")
    elif not weighed:
        lines.append("# load_N = 147.0                       # weigh: on level ground, where it is not sensed [N]")
    return "\n".join([*lines, ""])


def _camera(camera: Camera) -> str:
    """The camera's geometry as it was found."""
    matrix = ", ".join(f"[{', '.join(map(_number, row))}]" for row in camera.matrix)
    lines = [
        "# As CameraInfo and the frames have it; without this table it is taken from there again.",
        "[camera]",
        f"matrix = [{matrix}]",
        f"distortion = [{', '.join(repr(float(each)) for each in camera.distortion)}]",
        f"width_px = {camera.width_px}",
        f"height_px = {camera.height_px}",
        f"height_m = {_number(camera.height_m)}",
        f"pitch_rad = {_number(camera.pitch_rad)}    # {math.degrees(camera.pitch_rad):.1f} deg below the horizon",
        f"forward_m = {_number(camera.forward_m)}",
        f"left_m = {_number(camera.left_m)}",
        "",
    ]
    return "\n".join(lines)


def _number(value: float) -> str:
    return repr(float(np.round(value, 6)))


def _commented(block: str, *, header: bool) -> str:
    """Put numbers into comments, and the table's header where the file is to be read without it."""
    return "".join(
        line if line.startswith("# ") or (line.startswith("[") and not header) else f"# {line}"
        for line in block.splitlines(keepends=True)
    )
