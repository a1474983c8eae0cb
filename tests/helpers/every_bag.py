"""A drive of four seconds as a bag of every kind that is read."""

import cv2
import numpy as np
from mcap.writer import CompressionType
from mcap.writer import Writer as McapWriter
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

START_NS = 1_700_000_000 * 10**9
RATE = 8000
SECONDS = 4
AUDIO = {"audio_common_msgs/msg/AudioData": "uint8[] data", "audio_common_msgs/msg/AudioInfo":
         "uint8 channels\nuint32 sample_rate\nstring sample_format\nuint32 bitrate\nstring coding_format"}  # fmt: skip


def typestore(store):
    store = get_typestore(store)
    for name, text in AUDIO.items():
        store.register(get_types_from_msg(text, name))
    return store


class Drive:
    """Four seconds of wheel, odometry, camera and sound, as (topic, type, time [ns], message) of a typestore."""

    def __init__(self, rng, ros1):
        self.types = typestore(Stores.ROS1_NOETIC if ros1 else Stores.ROS2_HUMBLE)
        self.ros1 = ros1
        self.sound = (0.3 * np.sin(2 * np.pi * 440 * np.arange(SECONDS * RATE) / RATE)).astype(np.float32)
        smooth = cv2.GaussianBlur(rng.integers(0, 255, (48, 64, 3)).astype(np.uint8), (0, 0), 2)
        self.image = smooth

    def make(self, kind, **fields):
        return self.types.types[kind](**fields)

    def header(self, time_ns):
        stamp = self.make("builtin_interfaces/msg/Time", sec=time_ns // 10**9, nanosec=time_ns % 10**9)
        extra = {"seq": 0} if self.ros1 else {}
        return self.make("std_msgs/msg/Header", stamp=stamp, frame_id="f", **extra)

    def messages(self):
        vector = "geometry_msgs/msg/Vector3"
        for i in range(SECONDS * 50):
            time = START_NS + i * 20_000_000
            angle = 0.02 * i
            yield "/wheel/joints", "sensor_msgs/msg/JointState", time, self.make(
                "sensor_msgs/msg/JointState", header=self.header(time), name=["front_wheel"],
                position=np.array([angle]), velocity=np.array([1.0 + 0.01 * i]), effort=np.array([2.0]),
            )  # fmt: skip
            if i % 5 == 0:
                force = self.make(vector, x=3.0, y=0.0, z=100.0 + i)
                torque = self.make(vector, x=0.0, y=9.0, z=0.0)
                wrench = self.make("geometry_msgs/msg/Wrench", force=force, torque=torque)
                yield (
                    "/hub",
                    "geometry_msgs/msg/WrenchStamped",
                    time,
                    self.make("geometry_msgs/msg/WrenchStamped", header=self.header(time), wrench=wrench),
                )
                yield "/wheel/sinkage_m", "std_msgs/msg/Float64", time, self.make("std_msgs/msg/Float64", data=0.01)
                yield "/odom", "nav_msgs/msg/Odometry", time, self.odometry(time, i)
            if i % 10 == 0:
                ok, data = cv2.imencode(".png", self.image)
                assert ok
                yield (
                    "/camera/compressed",
                    "sensor_msgs/msg/CompressedImage",
                    time,
                    self.make(
                        "sensor_msgs/msg/CompressedImage", header=self.header(time), format="png", data=data.ravel()
                    ),
                )
            if i % 4 == 0:
                part = self.sound[i * RATE // 50 : (i + 4) * RATE // 50]
                pcm = np.round(part * 32768).astype("<i2").view(np.uint8)
                yield (
                    "/audio",
                    "audio_common_msgs/msg/AudioData",
                    time,
                    self.make("audio_common_msgs/msg/AudioData", data=pcm),
                )
            if i == 0:
                yield "/audio_info", "audio_common_msgs/msg/AudioInfo", time, self.make(
                    "audio_common_msgs/msg/AudioInfo", channels=1, sample_rate=RATE, sample_format="S16LE", bitrate=0,
                    coding_format="wave",
                )  # fmt: skip

    def odometry(self, time, i):
        make, geometry = self.make, "geometry_msgs/msg/"
        turn = make(geometry + "Quaternion", x=0.0, y=0.0, z=np.sin(0.15), w=np.cos(0.15))
        place = make(geometry + "Point", x=0.01 * i, y=1.0, z=0.0)
        zero = make(geometry + "Vector3", x=0.0, y=0.0, z=0.0)
        twist = make(geometry + "Twist", linear=make(geometry + "Vector3", x=0.4, y=0.0, z=0.0), angular=zero)
        covariance = np.zeros(36)
        return make(
            "nav_msgs/msg/Odometry", header=self.header(time), child_frame_id="b",
            pose=make(geometry + "PoseWithCovariance", pose=make(geometry + "Pose", position=place, orientation=turn),
                      covariance=covariance),
            twist=make(geometry + "TwistWithCovariance", twist=twist, covariance=covariance),
        )  # fmt: skip

    def encode(self, kind, message):
        return (self.types.serialize_ros1 if self.ros1 else self.types.serialize_cdr)(message, kind)

    def write(self, writer):
        connections = {}
        for topic, kind, time, message in self.messages():
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind, typestore=self.types)
            writer.write(connections[topic], time, self.encode(kind, message))

    def write_mcap(self, path, compression=CompressionType.ZSTD):
        with path.open("wb") as file:
            writer = McapWriter(file, chunk_size=20_000, compression=compression)
            writer.start("ros2")
            channels = {}
            for topic, kind, time, message in self.messages():
                if topic not in channels:
                    text = self.types.generate_msgdef(kind, ros_version=2)[0].encode()
                    schema = writer.register_schema(kind, "ros2msg", text)
                    channels[topic] = writer.register_channel(topic, "cdr", schema)
                writer.add_message(channels[topic], time, bytes(self.encode(kind, message)), time)
            writer.finish()


KINDS = ["ros1", "ros1_lz4", "ros1_bz2", "ros2_sqlite", "ros2_mcap", "ros2_zstd", "ros2_zstd_file", "mcap", "mcap_lz4"]


def write_bag(kind, folder, rng):
    drive = Drive(rng, ros1=kind.startswith("ros1"))
    path = folder / (f"{kind}.bag" if drive.ros1 else f"{kind}.mcap" if kind.startswith("mcap") else kind)
    if drive.ros1:
        writer = Writer1(path)
        writer.chunk_threshold = 20_000
        if kind != "ros1":
            writer.set_compression(Writer1.CompressionFormat[kind.removeprefix("ros1_").upper()])
        with writer:
            drive.write(writer)
    elif kind.startswith("mcap"):
        drive.write_mcap(path, CompressionType.LZ4 if kind == "mcap_lz4" else CompressionType.ZSTD)
    else:
        plugin = StoragePlugin.MCAP if kind == "ros2_mcap" else StoragePlugin.SQLITE3
        writer = Writer2(path, version=9, storage_plugin=plugin)
        if kind.startswith("ros2_zstd"):
            mode = CompressionMode.FILE if kind.endswith("file") else CompressionMode.MESSAGE
            writer.set_compression(mode, CompressionFormat.ZSTD)
        with writer:
            drive.write(writer)
    return drive, path
