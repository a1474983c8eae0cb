"""The frames of a robot's parts, from the static transforms of a bag (tf2_msgs/TFMessage on ``/tf_static``)."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from .bag_messages import DecodeError, field, fields_of, number

GROUND_FRAMES = ("base_footprint",)
BASE_FRAMES = ("base_link", "base", "chassis")


class Frames:
    """Static transforms between frames."""

    def __init__(self) -> None:
        self._edges: dict[str, dict[str, np.ndarray]] = {}

    def __contains__(self, frame: str) -> bool:
        return _name(frame) in self._edges

    def __iter__(self) -> Iterator[str]:
        return iter(self._edges)

    def add(self, content: Any) -> None:
        """Add the transforms of a message, ROS's or Foxglove's; raises `DecodeError` where one is no transform."""
        for each in field(content, "transforms") if "transforms" in fields_of(content) else [content]:
            ros = "transform" in fields_of(each)
            names = ("header.frame_id" if ros else "parent_frame_id", "child_frame_id")
            parent, child = (_name(str(field(each, name))) for name in names)
            of_it = field(each, "transform") if ros else each
            turn = [number(of_it, f"rotation.{axis}") for axis in "xyzw"]
            if not np.linalg.norm(turn) > 0.5:
                raise DecodeError(f"the rotation from {parent} to {child} is no quaternion")
            pose = np.eye(4)
            pose[:3, :3] = Rotation.from_quat(turn).as_matrix()
            pose[:3, 3] = [number(of_it, f"translation.{axis}") for axis in "xyz"]
            self._edges.setdefault(parent, {})[child] = pose
            self._edges.setdefault(child, {})[parent] = np.linalg.inv(pose)

    def pose(self, frame: str, within: str) -> np.ndarray | None:
        """Give the pose (4, 4) of a frame within another, [m]; None where no transforms join them."""
        start, end = _name(within), _name(frame)
        poses, waiting = {start: np.eye(4)}, deque([start])
        while waiting and end not in poses:
            at = waiting.popleft()
            for other, step in self._edges.get(at, {}).items():
                if other not in poses:
                    poses[other] = poses[at] @ step
                    waiting.append(other)
        return poses.get(end)

    @property
    def base(self) -> str | None:
        """The frame of the vehicle's reference point, x forward and y left; None where no transform names it."""
        return next((name for name in (*BASE_FRAMES, *GROUND_FRAMES) if name in self), None)

    @property
    def ground(self) -> str | None:
        """The frame on the ground beneath the vehicle; None where no transform names it."""
        return next((name for name in GROUND_FRAMES if name in self), None)


def _name(frame: str) -> str:
    """Leave out the slash that ROS 1 puts before a frame."""
    return frame.lstrip("/")
