"""`docs/examples/ros2_node.py` with a stand-in for ROS: messages of a recorded drive give the drive."""

from __future__ import annotations

import importlib.util
import math
import sys
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import ClassVar

import numpy as np
import pytest
from bevameter import TerrainDatabase, read_recording

EXAMPLE = Path(__file__).resolve().parents[2] / "docs" / "examples" / "ros2_node.py"


class Node:
    """What the example uses of `rclpy.node.Node`: parameters, subscriptions, a timer, a publisher."""

    values: ClassVar[dict[str, str]] = {}

    def __init__(self, name):
        self.callbacks, self.timers, self.published = {}, [], []

    def declare_parameter(self, name, default):
        self.values.setdefault(name, default)

    def get_parameter(self, name):
        return SimpleNamespace(value=self.values[name])

    def create_publisher(self, kind, topic, depth):
        return SimpleNamespace(publish=self.published.append)

    def create_subscription(self, kind, topic, callback, qos):
        self.callbacks[topic] = callback

    def create_timer(self, period_s, callback):
        self.timers.append(callback)

    def get_logger(self):
        return SimpleNamespace(warning=self.published.append)


@pytest.fixture
def example(monkeypatch):
    """The example's module, on a stand-in for ROS."""
    names = ("Odometry", "Image", "Imu", "JointState", "String", "ExternalShutdownException")
    kinds = {name: type(name, (SimpleNamespace,), {}) for name in names}
    for name in ("rclpy", "rclpy.executors", "rclpy.node", "rclpy.qos", "nav_msgs", "nav_msgs.msg", "sensor_msgs",
                 "sensor_msgs.msg", "std_msgs", "std_msgs.msg"):  # fmt: skip
        module = ModuleType(name)
        module.__dict__.update(kinds, Node=Node, qos_profile_sensor_data=None)
        monkeypatch.setitem(sys.modules, name, module)
    spec = importlib.util.spec_from_file_location("ros2_node", EXAMPLE)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def header(time_s):
    return SimpleNamespace(stamp=SimpleNamespace(sec=int(time_s), nanosec=round(1e9 * (time_s % 1))))


def xyz(x=0.0, y=0.0, z=0.0, **more):
    return SimpleNamespace(x=x, y=y, z=z, **more)


def odometry(time_s, x, y, yaw, speed):
    turn = xyz(z=math.sin(yaw / 2), w=math.cos(yaw / 2))
    pose = SimpleNamespace(pose=SimpleNamespace(position=xyz(x, y), orientation=turn))
    return SimpleNamespace(
        header=header(time_s), pose=pose, twist=SimpleNamespace(twist=SimpleNamespace(linear=xyz(speed)))
    )


def test_messages_of_a_drive_are_handed_over(example, short_drive, tmp_path, monkeypatch):
    recording = read_recording(short_drive)
    monkeypatch.setattr(Node, "values", {
        "database": str(tmp_path / "t.db"), "vehicle": str(short_drive / "vehicle.toml"), "site": recording.site,
    })  # fmt: skip
    node = example.Terrain()
    assert set(node.callbacks) == {"odom", "joint_states", "image", "imu"}
    frames = {round(frame.time_s, 1): frame for frame in recording.camera.frames(lambda time_s: time_s < 3.0)}
    pose, wheel = recording.pose, recording.wheel
    for row, time_s in enumerate(np.arange(0.0, 4.0, 0.1).tolist()):
        x, y, yaw = (float(np.interp(time_s, pose.time_s, each)) for each in (pose.x_m, pose.y_m, pose.yaw_rad))
        node.callbacks["odom"](odometry(time_s, x, y, yaw, float(wheel["travel_speed_m_s"][row])))
        node.callbacks["joint_states"](SimpleNamespace(
            header=header(time_s), name=["arm", "wheel"], velocity=[0.0, float(wheel["wheel_speed_rad_s"][row])],
            effort=[0.0, float(wheel["torque_Nm"][row])],
        ))  # fmt: skip
        node.callbacks["imu"](SimpleNamespace(
            header=header(time_s), angular_velocity=xyz(), linear_acceleration=xyz(z=9.81)
        ))  # fmt: skip
        frame = frames.get(round(time_s, 1))
        if frame is not None and frame.image is not None:
            rgb = np.ascontiguousarray(frame.image[:, :, ::-1])
            node.callbacks["image"](SimpleNamespace(
                header=header(frame.time_s), encoding="rgb8", height=480, width=640, step=1920, data=rgb.tobytes()
            ))  # fmt: skip
    node.callbacks["image"](SimpleNamespace(header=header(4.0), encoding="16UC1"))
    node.callbacks["joint_states"](SimpleNamespace(header=header(4.0), name=["wheel"], velocity=[], effort=[]))
    node.callbacks["odom"](odometry(4.0, math.nan, 0.0, 0.0, 0.0))
    assert node.published[-1] == "pose, x: nan (expected a finite number)"
    for timer in node.timers:
        timer()
    summary = node.live.close()
    assert node.published[-1].data.split(",")[0] in ("unknown", "sand")
    there = pose.time_s <= 3.9
    assert summary.distance_m == pytest.approx(np.hypot(*np.ptp([pose.x_m[there], pose.y_m[there]], axis=1)), abs=0.02)
    assert summary.senses[0].said
    with TerrainDatabase(tmp_path / "t.db") as database:
        (drive,) = database.drives()
    assert drive.vehicle_name == "one-wheeled vehicle"
    assert len(drive.terrain) > 10
