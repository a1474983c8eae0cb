"""A ROS 2 node that maps terrain while the robot drives: odometry, joints, camera and inertial sensor go to Bevameter.

    ros2 run ... or: python ros2_node.py --ros-args -p database:=terrain.db -p vehicle:=vehicle.toml -p site:=quarry
        -r odom:=/odometry/filtered -r joint_states:=/joint_states -r image:=/camera/image_raw -r imu:=/imu/data

Names of joints are those of the wheels in vehicle.toml; other joints are left out. Positions are to be in a frame that
stays, such as a map's. Storing the drive takes as long as a run does: under `ros2 launch` set `sigterm_timeout` and
`sigkill_timeout` to minutes, or the drive is left in its journal, which the node names when it begins again.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import rclpy
from bevameter import InputError, LiveTraverse
from bevameter.framework.live.events import SoilDeparts
from nav_msgs.msg import Odometry
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import Image, Imu, JointState
from std_msgs.msg import String


class Terrain(Node):
    """Hands messages over, and publishes what is known of the ground as text."""

    def __init__(self) -> None:
        super().__init__("terrain")
        for name, default in (("database", "terrain.db"), ("vehicle", "vehicle.toml"), ("site", "")):
            self.declare_parameter(name, default)
        database, vehicle, site = (self.get_parameter(name).value for name in ("database", "vehicle", "site"))
        self.live = LiveTraverse(database, vehicle, site=site, shared_speed=True)
        self.wheels = {wheel.name for wheel in self.live.vehicle.wheels}
        self.speed_m_s = math.nan
        for problem in self.live.problems:
            self.get_logger().warning(problem)
        self.ground = self.create_publisher(String, "ground", 10)
        self.live.subscribe(self.tell)
        for kind, topic, callback in (
            (Odometry, "odom", self.on_odometry),
            (JointState, "joint_states", self.on_joints),
            (Image, "image", self.on_image),
            (Imu, "imu", self.on_imu),
        ):
            self.create_subscription(kind, topic, partial(self.take, callback), qos_profile_sensor_data)
        self.create_timer(0.5, self.publish)

    def take(self, callback: Callable[[Any], None], message: Any) -> None:
        """Hand over a message; one that cannot be used, such as a pose of NaN, ends nothing."""
        try:
            callback(message)
        except (InputError, ValueError) as error:
            self.get_logger().warning(str(error))

    def on_odometry(self, message: Odometry) -> None:
        """Hand over the pose; keep the speed for the wheels."""
        place, turn = message.pose.pose.position, message.pose.pose.orientation
        yaw = math.atan2(2 * (turn.w * turn.z + turn.x * turn.y), 1 - 2 * (turn.y**2 + turn.z**2))
        self.speed_m_s = message.twist.twist.linear.x
        self.live.pose(seconds(message), place.x, place.y, yaw)

    def on_joints(self, message: JointState) -> None:
        """Hand over speed and torque of each wheel."""
        unknown = [math.nan] * len(message.name)  # drivers may leave out speeds or torques
        channels = message.name, message.velocity or unknown, message.effort or unknown
        for name, speed, torque in zip(*channels, strict=True):
            if name in self.wheels:
                self.live.wheel(
                    seconds(message), wheel=name, wheel_speed_rad_s=speed, torque_Nm=torque,
                    travel_speed_m_s=self.speed_m_s,
                )  # fmt: skip

    def on_image(self, message: Image) -> None:
        """Hand over an image of three channels, or grey."""
        channels = {"bgr8": 3, "rgb8": 3, "mono8": 1}.get(message.encoding)
        if channels is None:
            self.live.image(seconds(message), None, problem=f"encoding {message.encoding}")
            return
        rows = np.frombuffer(bytes(message.data), np.uint8).reshape(message.height, message.step)
        image = rows[:, : message.width * channels].reshape(message.height, message.width, channels)
        image = np.repeat(image, 3, axis=2) if channels == 1 else image
        self.live.image(seconds(message), image[:, :, ::-1] if message.encoding == "rgb8" else image)

    def on_imu(self, message: Imu) -> None:
        """Hand over what shakes the frame."""
        turn, push = message.angular_velocity, message.linear_acceleration
        self.live.imu(seconds(message), wx=turn.x, wy=turn.y, wz=turn.z, ax=push.x, ay=push.y, az=push.z)

    def tell(self, event: object) -> None:
        """Warn of ground that is weaker than its class."""
        if isinstance(event, SoilDeparts) and event.strength_share < 1.0:
            self.get_logger().warning(f"{event.class_name} bears {event.strength_share:.0%} of what it does: slow down")

    def publish(self) -> None:
        """Publish the class under the wheels, and what soil is measured there."""
        ground, soil = self.live.under_wheels(), self.live.soil()
        name = ground.class_name if ground is not None and ground.class_name else "unknown"
        phi = soil.parameters.get("phi_rad") if soil is not None else None
        said = "" if phi is None else f", phi {math.degrees(phi.low):.0f} to {math.degrees(phi.high):.0f} deg"
        self.ground.publish(String(data=name + said))


def seconds(message: Odometry | JointState | Image | Imu) -> float:
    """Give the time of a message [s]."""
    return message.header.stamp.sec + 1e-9 * message.header.stamp.nanosec


def main() -> None:
    """Spin until Ctrl-C, then store the drive."""
    rclpy.init()
    node = Terrain()
    try:
        rclpy.spin(node)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        try:
            summary = node.live.close()
            print(f"{summary.distance_m:.0f} m, {summary.observations_new} observations stored")
        except InputError as error:  # no sample came, or the database cannot be written
            print(error)


if __name__ == "__main__":
    main()
