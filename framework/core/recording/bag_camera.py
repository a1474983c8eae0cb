"""The camera of a bag as a pinhole over the ground: intrinsics of CameraInfo, mounting of the frames or the vehicle."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import PurePosixPath
from typing import Any

import numpy as np
from pydantic import ValidationError

from ..vehicle import Camera, CameraMount, Vehicle
from .bag_files import Topic
from .bag_frames import Frames
from .bag_messages import DecodeError, field, fields_of, number
from .recognition import short_type

_AHEAD_RAD = math.radians(5.0)
"""A camera that looks further aside, or is further tilted, is none that looks ahead."""


def camera_of(info: Any, frame: str, frames: Frames, mount: CameraMount | None, *, rectified: bool) -> Camera:
    """Make the camera's geometry.

    Parameters
    ----------
    info
        A decoded CameraInfo.
    frame
        Frame of the images, x right, y down, z along the view.
    frames
        Static transforms.
    mount
        Where the camera is, as the vehicle states it; taken from the frames where None.
    rectified
        Whether the images are: they have no distortion then, and the intrinsics of the projection.

    Raises
    ------
    DecodeError
        What lacks, or what the camera is that a pinhole ahead is not; the text says so.
    """
    matrix = _matrix(info, rectified)
    placed = mount if mount is not None else _mount(frame, frames)
    try:
        return Camera(
            matrix=tuple(map(tuple, matrix.tolist())),  # pyright: ignore[reportArgumentType]
            width_px=int(number(info, "width")),
            height_px=int(number(info, "height")),
            distortion=() if rectified else _distortion(info),
            **placed.model_dump(),
        )
    except ValidationError as error:
        fault = error.errors()[0]
        said = fault["msg"].removeprefix("Value error, ")
        where = "".join(f"{part}: " for part in fault["loc"])
        raise DecodeError(f"{where}{said}; state [camera] with matrix in vehicle.toml") from None


def _matrix(info: Any, rectified: bool) -> np.ndarray:
    """Intrinsic matrix (3, 3) [px]; ROS 1 names it K, and that of rectified images P."""
    for name in ("p", "P") if rectified else ("k", "K"):
        try:
            values = np.asarray(field(info, name), dtype=float)
        except DecodeError:
            continue
        matrix = values.reshape(3, -1)[:, :3]
        if not matrix[0, 0] > 0.0:
            raise DecodeError("CameraInfo has no focal length: the camera is not calibrated")
        return matrix
    raise DecodeError("CameraInfo has no matrix")


def _distortion(info: Any) -> tuple[float, ...]:
    """Distortion as OpenCV's first five coefficients."""
    model = str(field(info, "distortion_model"))
    name = "d" if "d" in getattr(info, "__dataclass_fields__", ("d",)) else "D"
    values = [float(value) for value in np.asarray(field(info, name), dtype=float)]
    if not any(values):
        return ()
    if model not in ("plumb_bob", "rational_polynomial", "") or any(values[5:]):
        raise DecodeError(f"distortion {model} with {len(values)} coefficients is not known: rectify the images")
    return tuple((values[:5] + 4 * [0.0])[: max(4, min(len(values), 5))])


def _mount(frame: str, frames: Frames) -> CameraMount:
    """Where a camera is over the ground, and how far it looks down, from the frames."""
    stated = "state [camera_mount] with height_m and pitch_rad in vehicle.toml"
    if frames.ground is None:
        raise DecodeError(f"no frame base_footprint in /tf_static, the ground beneath the vehicle: {stated}")
    pose = frames.pose(frame, frames.ground)
    if pose is None:
        raise DecodeError(f"/tf_static does not say where {frame} is: {stated}")
    right, view = pose[:3, 0], pose[:3, 2]
    aside, tilt = math.atan2(view[1], math.hypot(view[0], view[2])), math.asin(float(np.clip(right[2], -1.0, 1.0)))
    if view[0] < 0.0 or abs(aside) > _AHEAD_RAD or abs(tilt) > _AHEAD_RAD:
        raise DecodeError(
            f"{frame} looks {math.degrees(math.atan2(view[1], view[0])):.0f} deg to the left and is tilted by "
            f"{math.degrees(tilt):.0f} deg: only a camera that looks ahead is used"
        )
    base = frames.pose(frames.base or frames.ground, frames.ground)
    assert base is not None
    down = math.asin(float(np.clip(-view[2], -1.0, 1.0)))
    if not (down > 0.0 and pose[2, 3] > 0.0):
        seen = f"{math.degrees(down):.1f} deg below the horizon at {pose[2, 3]:.2f} m"
        raise DecodeError(f"{frame} looks {seen}: {stated}")
    return CameraMount(
        height_m=float(pose[2, 3]), pitch_rad=down, forward_m=float(pose[0, 3] - base[0, 3]),
        left_m=float(pose[1, 3] - base[1, 3]),
    )  # fmt: skip


def camera_info(topic: str, topics: Mapping[str, Topic], samples: Mapping[str, Any]) -> str | None:
    """Give the CameraInfo topic of an images' topic: the one nearest to it by name, or the only one there is."""
    found = [name for name, each in topics.items() if short_type(each) == "CameraInfo" and name in samples]
    near = [name for name in found if PurePosixPath(name).parent in PurePosixPath(topic).parents]
    if not (near or len(found) == 1):
        return None
    return max(near or found, key=lambda each: len(PurePosixPath(each).parts))


def with_camera(
    vehicle: Vehicle | None,
    topic: str,
    topics: Mapping[str, Topic],
    samples: Mapping[str, Any],
    frames: Frames,
) -> tuple[Vehicle | None, tuple[str, ...]]:
    """Give the vehicle with the camera's geometry by the bag's CameraInfo and frames, where it does not state that, and
    say in words what that is taken from, or why it is not.

    Parameters
    ----------
    vehicle
        As described; None where nobody did.
    topic
        The images' topic.
    topics, samples
        The bag's topics, and a decoded message of each where there is one.
    frames
        Static transforms.
    """
    if vehicle is not None and vehicle.camera is not None:
        return vehicle, ()
    name = camera_info(topic, topics, samples)
    if topic not in samples or name is None:
        return vehicle, ()
    info, mount = samples[name], None if vehicle is None else vehicle.camera_mount
    try:
        image = samples[topic]
        of_image = field(image, "header.frame_id" if "header" in fields_of(image) else "frame_id")  # ROS, Foxglove
        frame = str(of_image or field(info, "header.frame_id"))
        camera = camera_of(info, frame, frames, mount, rectified="rect" in topic)
    except DecodeError as error:
        return vehicle, (f"{name}: the camera's geometry is not used: {error}",)
    placed = "vehicle.toml" if mount is not None else "/tf_static"
    text = (
        f"the camera's geometry is taken from {name} and {placed}: {camera.height_m:.2f} m above the ground, "
        f"{math.degrees(camera.pitch_rad):.1f} deg below the horizon"
    )
    if vehicle is None:
        return Vehicle(camera=camera), (text,)
    return vehicle.model_copy(update={"camera": camera, "camera_mount": None}), (text,)
