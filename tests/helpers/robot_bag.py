"""A ROS 2 bag as a common robot records it: four driven wheels on slopes of a known soil."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from bevameter.framework.scenario.mechanics import Soil, equilibrium
from rosbags.rosbag2 import Writer
from rosbags.typesys import Stores, get_typestore

GRAVITY = 9.80665
START_NS = 1_700_000_000 * 10**9
NAMES = ("front_left", "front_right", "rear_left", "rear_right")
PLACES = np.array([[0.3, 0.25], [0.3, -0.25], [-0.3, 0.25], [-0.3, -0.25]])
RADIUS_M, WIDTH_M, MASS_KG, CENTRE = 0.15, 0.12, 60.0, (0.03, 0.0, 0.30)
SAND = Soil(c_Pa=1040.0, phi_rad=math.radians(28.0), k_m=0.015, stiffness_Pa=150e3, n=1.1)
STEP_S = 0.02

WHEELS_TOML = "".join(
    f'[[wheels]]\nname = "{name}"\nradius_m = {RADIUS_M}\nwidth_m = {WIDTH_M}\nposition_m = [{x}, {y}]\n'
    for name, (x, y) in zip(NAMES, PLACES.tolist(), strict=True)
)
VEHICLE_TOML = f'name = "robot"\nmass_kg = {MASS_KG}\ncentre_of_mass_m = {list(CENTRE)}\n{WHEELS_TOML}'


@dataclass
class Drive:
    """What the robot did, without noise: times (n,) [s], and of each wheel (n, 4)."""

    time_s: np.ndarray
    way_m: np.ndarray
    speed_m_s: np.ndarray
    pitch_rad: np.ndarray
    rim_m_s: np.ndarray
    slip: np.ndarray
    load_N: np.ndarray
    torque_Nm: np.ndarray
    sinkage_m: np.ndarray
    pull_N: np.ndarray
    acceleration_m_s2: np.ndarray


def loads(pitch_rad: np.ndarray, along_m_s2: np.ndarray) -> np.ndarray:
    """Loads of the wheels (n, 4) [N] of a rigid vehicle that is symmetric: by moments about either axle."""
    x, y, h = CENTRE
    assert y == 0.0
    half = 0.5 * np.ptp(PLACES[:, 0])
    normal, forward = MASS_KG * GRAVITY * np.cos(pitch_rad), MASS_KG * (GRAVITY * np.sin(pitch_rad) + along_m_s2)
    front = 0.5 * normal * (1.0 + x / half) - 0.5 * forward * h / half
    rear = normal - front
    return np.stack([front / 2, front / 2, rear / 2, rear / 2], axis=1)


def drive(seconds: float = 120.0, soil: Soil = SAND, slope_deg: float = 9.0, rut: float = 1.0) -> Drive:
    """Drive straight over waves of the ground at 0.2 to 0.35 m/s of the rim; all wheels turn alike, and so slip alike.

    The slip is that at which the wheels' pull carries the vehicle up the slope and accelerates it. `rut` is how much
    stiffer the ground is for the rear wheels.
    """
    climb = np.radians(np.linspace(-14.0, 16.0, 61))
    slips = np.linspace(-0.3, 0.9, 121)
    at = np.empty(len(climb))
    for row, pitch in enumerate(climb):
        load = loads(np.full(len(slips), pitch), np.zeros(len(slips)))
        wheels = [
            equilibrium(RADIUS_M, WIDTH_M, soil, load[:, each], slips, stiffness=firm)
            for each, firm in enumerate((1.0, 1.0, rut, rut))
        ]
        pull = sum(wheel.drawbar_pull_N for wheel in wheels)
        at[row] = np.interp(MASS_KG * GRAVITY * math.sin(pitch), np.maximum.accumulate(pull), slips)
    time = np.arange(0.0, seconds, STEP_S)
    rim = 0.27 + 0.06 * np.sin(2 * np.pi * time / 17.0)

    def slope(way: np.ndarray | float) -> np.ndarray:
        return np.radians(slope_deg) * (0.7 * np.sin(2 * np.pi * way / 5.0) + 0.3 * np.sin(2 * np.pi * way / 2.1))

    along = np.zeros(len(time))
    for _ in range(2):
        way, speed, slip = np.zeros(len(time)), np.zeros(len(time)), np.zeros(len(time))
        for row in range(len(time)):
            slip[row] = np.interp(slope(way[row]) + along[row] / GRAVITY, climb, at)
            speed[row] = rim[row] * (1.0 - slip[row]) if slip[row] >= 0 else rim[row] / (1.0 + slip[row])
            if row + 1 < len(time):
                way[row + 1] = way[row] + STEP_S * speed[row]
        along = np.gradient(speed, STEP_S)
    pitch = np.asarray(slope(way))
    load = loads(pitch, along)
    found = [
        equilibrium(RADIUS_M, WIDTH_M, soil, load[:, each], slip, stiffness=1.0 if each < 2 else rut)
        for each in range(4)
    ]
    torque, sinkage, pull = (
        np.stack([getattr(each, name) for each in found], axis=1)
        for name in ("torque_Nm", "sinkage_m", "drawbar_pull_N")
    )
    return Drive(time, way, speed, pitch, rim, slip, load, torque, sinkage, pull, along)


@dataclass
class RobotBag:
    """The topics of a bag.

    Parameters
    ----------
    driven
        What the robot did.
    effort
        Whether joint states carry the torque; else `/<wheel>/current` does, by `per_ampere` [N m/A] and `friction_Nm`.
    odometry
        ``"visual"``: of the ground; ``"wheels"``: the mean of the rims, as a base controller makes it.
    images
        JPEG files for the camera, one after the other, over and over.
    joints
        Names of the wheels' joints.
    sinkage
        Whether `/wheel/<name>/sinkage_m` is measured.
    start_deg
        Latitude and longitude of the start, and the direction driven, clockwise from north [deg].
    castor
        Whether the transforms have one.
    mirrored
        Signs of the joints' axes.
    wheel_frames
        Whether the transforms have the wheels' axles, too.
    robots
        Namespaces of robots that all do the same, such as ``/r1``.
    """

    driven: Drive
    effort: bool = True
    odometry: str = "visual"
    images: Sequence[bytes] = ()
    joints: Sequence[str] = tuple(f"{name}_wheel_joint" for name in NAMES)
    sinkage: bool = False
    gps: bool = True
    start_deg: tuple[float, float, float] = (47.0707, 15.4395, 90.0)
    wheels: bool = True
    wheel_frames: bool = False
    castor: bool = False
    mirrored: Sequence[float] = (1.0, 1.0, 1.0, 1.0)
    per_ampere: float = 0.06 * 50 * 0.8
    friction_Nm: float = 1.5
    optical: tuple[float, float, float] = (0.4, 0.9, math.radians(25.0))
    seed: int = 1
    robots: Sequence[str] = ("",)
    types: object = field(default_factory=lambda: get_typestore(Stores.ROS2_HUMBLE))

    def make(self, kind: str, **fields):
        return self.types.types[kind](**fields)

    def header(self, time_s: float, frame: str):
        time = self.ns(time_s)
        stamp = self.make("builtin_interfaces/msg/Time", sec=time // 10**9, nanosec=time % 10**9)
        return self.make("std_msgs/msg/Header", stamp=stamp, frame_id=frame)

    @staticmethod
    def ns(time_s: float) -> int:
        return START_NS + round(time_s * 1e9)

    def vector(self, x=0.0, y=0.0, z=0.0, kind="geometry_msgs/msg/Vector3"):
        return self.make(kind, x=float(x), y=float(y), z=float(z))

    def turn(self, roll=0.0, pitch=0.0, yaw=0.0):
        """Quaternion of fixed-axis angles: x forward, y left, z up; ROS's pitch is positive nose down."""
        cr, sr, cp, sp, cy, sy = (f(0.5 * a) for a in (roll, pitch, yaw) for f in (math.cos, math.sin))
        return self.make(
            "geometry_msgs/msg/Quaternion", x=sr * cp * cy - cr * sp * sy, y=cr * sp * cy + sr * cp * sy,
            z=cr * cp * sy - sr * sp * cy, w=cr * cp * cy + sr * sp * sy,
        )  # fmt: skip

    def messages(self) -> Iterator[tuple[str, str, float, object]]:
        rng, done = np.random.default_rng(self.seed), self.driven
        yield "/tf_static", "tf2_msgs/msg/TFMessage", 0.0, self.transforms()
        for row, time in enumerate(done.time_s.tolist()):
            if self.wheels:
                yield from self.of_wheels(rng, row, time)
            if row % 2 == 0:
                yield "/odom", "nav_msgs/msg/Odometry", time, self.odometry_at(rng, row, time)
                yield "/imu/data", "sensor_msgs/msg/Imu", time, self.imu_at(rng, row, time)
            if row % 10 == 0 and self.gps:
                yield "/fix", "sensor_msgs/msg/NavSatFix", time, self.fix_at(rng, row, time)
            if row % 25 == 0 and self.images:
                data = np.frombuffer(self.images[row // 25 % len(self.images)], np.uint8)
                yield "/camera/image/compressed", "sensor_msgs/msg/CompressedImage", time, self.make(
                    "sensor_msgs/msg/CompressedImage", header=self.header(time, "camera_optical"), format="jpeg",
                    data=data,
                )  # fmt: skip
                yield "/camera/camera_info", "sensor_msgs/msg/CameraInfo", time, self.camera_info(time)

    def of_wheels(self, rng, row: int, time: float):
        done = self.driven
        axis = np.array(self.mirrored)
        speed = axis * (done.rim_m_s[row] / RADIUS_M + 0.01 * rng.standard_normal(4))
        torque = axis * (done.torque_Nm[row] + 0.25 * rng.standard_normal(4))
        yield "/joint_states", "sensor_msgs/msg/JointState", time, self.make(
            "sensor_msgs/msg/JointState", header=self.header(time, ""), name=[*self.joints, "arm_joint"],
            position=np.append(axis * done.time_s[row], 0.3), velocity=np.append(speed, 0.0),
            effort=np.append(torque, 1.0) if self.effort else np.empty(0),
        )  # fmt: skip
        number = "std_msgs/msg/Float64"
        if not self.effort:
            current = (torque + self.friction_Nm * np.sign(speed)) / self.per_ampere
            for name, value in zip(NAMES, current.tolist(), strict=True):
                yield f"/{name}/current", number, time, self.make(number, data=value)
        if self.sinkage:
            for name, value in zip(NAMES, done.sinkage_m[row].tolist(), strict=True):
                yield (
                    f"/wheel/{name}/sinkage_m",
                    number,
                    time,
                    self.make(number, data=value + 0.0008 * rng.standard_normal()),
                )

    def odometry_at(self, rng, row: int, time: float):
        done = self.driven
        speed = done.speed_m_s[row] + 0.003 * rng.standard_normal()
        if self.odometry == "wheels":
            speed = done.rim_m_s[row]
        pose = self.make(
            "geometry_msgs/msg/Pose", position=self.vector(done.way_m[row], kind="geometry_msgs/msg/Point"),
            orientation=self.turn(pitch=-done.pitch_rad[row]),
        )  # fmt: skip
        twist = self.make("geometry_msgs/msg/Twist", linear=self.vector(speed), angular=self.vector())
        return self.make(
            "nav_msgs/msg/Odometry", header=self.header(time, "odom"), child_frame_id="base_link",
            pose=self.make("geometry_msgs/msg/PoseWithCovariance", pose=pose, covariance=np.zeros(36)),
            twist=self.make("geometry_msgs/msg/TwistWithCovariance", twist=twist, covariance=np.zeros(36)),
        )  # fmt: skip

    def imu_at(self, rng, row: int, time: float):
        done = self.driven
        pitch = done.pitch_rad[row] + 0.003 * rng.standard_normal()
        along = done.acceleration_m_s2[row] + GRAVITY * math.sin(pitch) + 0.05 * rng.standard_normal()
        return self.make(
            "sensor_msgs/msg/Imu", header=self.header(time, "imu_link"), orientation=self.turn(pitch=-pitch),
            orientation_covariance=np.zeros(9), angular_velocity=self.vector(), angular_velocity_covariance=np.zeros(9),
            linear_acceleration=self.vector(along, 0.0, GRAVITY * math.cos(pitch)),
            linear_acceleration_covariance=np.zeros(9),
        )  # fmt: skip

    def fix_at(self, rng, row: int, time: float):
        latitude, longitude, ahead = self.start_deg
        way = self.driven.way_m[row] + 0.02 * rng.standard_normal()
        east, north = way * math.sin(math.radians(ahead)), way * math.cos(math.radians(ahead))
        status = self.make("sensor_msgs/msg/NavSatStatus", status=2, service=1)
        return self.make(
            "sensor_msgs/msg/NavSatFix", header=self.header(time, "gps"), status=status, altitude=350.0,
            latitude=latitude + math.degrees(north / 6_369_000.0),
            longitude=longitude + math.degrees(east / (6_388_000.0 * math.cos(math.radians(latitude)))),
            position_covariance=np.zeros(9), position_covariance_type=2,
        )  # fmt: skip

    def camera_info(self, time: float):
        region = self.make(
            "sensor_msgs/msg/RegionOfInterest", x_offset=0, y_offset=0, height=0, width=0, do_rectify=False
        )
        return self.make(
            "sensor_msgs/msg/CameraInfo", header=self.header(time, "camera_optical"), height=480, width=640,
            distortion_model="plumb_bob", d=np.zeros(5), k=np.array([420.0, 0, 319.5, 0, 420, 239.5, 0, 0, 1]),
            r=np.eye(3).ravel(), p=np.eye(3, 4).ravel(), binning_x=0, binning_y=0, roi=region,
        )  # fmt: skip

    def transforms(self):
        """Link of the camera ahead and above, and its optical axes, z along the view and y down."""
        forward, height, down = self.optical
        base = 0.15
        parts = [
            ("base_footprint", "base_link", (0.0, 0.0, base), (0.0, 0.0, 0.0)),
            ("base_link", "camera_link", (forward, 0.0, height - base), (0.0, down, 0.0)),
            ("camera_link", "camera_optical", (0.0, 0.0, 0.0), (-math.pi / 2, 0.0, -math.pi / 2)),
        ]
        axles = [("base_link", f"{name}_wheel_link", (*place, 0.0), (0.0, 0.5, 0.0)) for name, place in zip(
            NAMES, PLACES.tolist(), strict=True)]  # fmt: skip
        parts += axles if self.wheel_frames else []
        castor = ("base_link", "rear_caster_swivel_link", (-0.4, 0.0, 0.0), (0.0, 0.0, 0.0))
        wheel = ("rear_caster_swivel_link", "rear_caster_wheel_link", (-0.05, 0.0, -0.1), (0.0, 0.0, 0.0))
        parts += [castor, wheel] if self.castor else []
        return self.make("tf2_msgs/msg/TFMessage", transforms=[
            self.make(
                "geometry_msgs/msg/TransformStamped", header=self.header(0.0, parent), child_frame_id=child,
                transform=self.make(
                    "geometry_msgs/msg/Transform", translation=self.vector(*at), rotation=self.turn(*turned)
                ),
            )
            for parent, child, at, turned in parts
        ])  # fmt: skip

    def write(self, path: Path, messages: dict[str, Iterable] | None = None) -> Path:
        """Write the bag; each robot's own messages where they are given."""
        given = messages or {robot: [*self.messages()] for robot in self.robots}
        with Writer(path, version=9) as writer:
            connections: dict[str, object] = {}
            for topic, kind, time, message in (
                (space + name, *rest) for space in given for name, *rest in given[space]
            ):
                if topic not in connections:
                    connections[topic] = writer.add_connection(topic, kind, typestore=self.types)
                writer.write(connections[topic], self.ns(time), self.types.serialize_cdr(message, kind))
        return path
