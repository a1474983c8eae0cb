"""Bags written by rosbags and mcap, read whole and truncated."""

import base64
import json

import cv2
import numpy as np
import pytest
from bevameter.framework.core.errors import InputError
from bevameter.framework.core.recording import bag_files
from bevameter.framework.core.recording.readers import read_recording
from bevameter.framework.core.vehicle import Vehicle, Wheel
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


MAP = """
name = "loop"
site = "yard"

[[wheel]]
topic = "/wheel/joints"
[wheel.fields]
wheel_speed_rad_s = "velocity[front_wheel]"
wheel_angle_rad = { field = "position[0]" }

[[wheel]]
topic = "/hub"
[wheel.fields]
load_N = "wrench.force.z"
torque_Nm = { field = "wrench.torque.y", scale = -1.0, offset = 1.0 }

[[wheel]]
topic = "/odom"

[pose]
topic = "/odom"

[camera]
topic = "/camera/compressed"

[sound]
topic = "/audio"
sample_rate_Hz = 8000
"""


@pytest.fixture
def topic_map(tmp_path):
    path = tmp_path / "topics.toml"
    path.write_text(MAP)
    return path


@pytest.mark.parametrize("kind", KINDS)
def test_a_bag_is_read_as_it_was_written(kind, tmp_path, rng, topic_map):
    drive, path = write_bag(kind, tmp_path, rng)
    vehicle = Vehicle(wheels=(Wheel(radius_m=0.5, width_m=0.1),))
    recording = read_recording(path, topics=topic_map, vehicle=vehicle)
    assert recording.problems == ()
    assert (recording.name, recording.site) == ("loop", "yard")
    assert recording.start_time.timestamp() == START_NS / 1e9
    wheel = recording.wheel
    n = SECONDS * 50
    np.testing.assert_allclose(wheel["time_s"], np.arange(n) * 0.02, atol=1e-6)
    np.testing.assert_allclose(wheel["wheel_speed_rad_s"], 1.0 + 0.01 * np.arange(n))
    np.testing.assert_allclose(wheel["wheel_angle_rad"], 0.02 * np.arange(n))
    np.testing.assert_allclose(wheel["load_N"][: n - 4], 100.0 + np.arange(n - 4), rtol=1e-9)  # interpolated from 10 Hz
    np.testing.assert_allclose(wheel["torque_Nm"], -8.0)
    np.testing.assert_allclose(wheel["slip"][0], 1.0 - 0.4 / 0.5)  # derived: V = 0.4 m/s, r omega = 0.5 m/s
    np.testing.assert_allclose(recording.pose.x_m, 0.05 * np.arange(n // 5))
    np.testing.assert_allclose(recording.pose.yaw_rad, 0.3)
    frames = list(recording.camera.frames())
    assert len(frames) == len(recording.camera) == SECONDS * 5
    assert all(np.array_equal(frame.image, drive.image) for frame in frames)
    np.testing.assert_allclose([frame.time_s for frame in frames], np.arange(SECONDS * 5) * 0.2, atol=1e-6)
    blocks = list(recording.sound.blocks(0.5, 0.25))
    assert recording.sound.sample_rate == RATE
    assert recording.sound.duration_s == SECONDS
    assert len(blocks) == 15
    np.testing.assert_allclose(blocks[3].samples, drive.sound[3 * RATE // 4 : 5 * RATE // 4], atol=1e-4)
    assert read_recording(path, topics=topic_map).digest == recording.digest


@pytest.mark.parametrize("kind", ["ros1", "ros2_sqlite", "mcap"])
def test_topics_are_recognised_without_a_map(kind, tmp_path, rng):
    _, path = write_bag(kind, tmp_path, rng)
    recording = read_recording(path)
    wheel = recording.wheel
    assert wheel.wheel is None
    assert {"wheel_speed_rad_s", "wheel_angle_rad", "torque_Nm", "sinkage_m", "travel_speed_m_s"} <= set(wheel.columns)
    assert len(recording.camera) == SECONDS * 5
    assert len(recording.pose.time_s) == SECONDS * 10
    assert recording.sound.sample_rate == RATE


def cut(path, share):
    """Cut the file, or a ROS 2 bag's storage file, off after a share of its length."""
    file = path if path.is_file() else next(p for p in path.iterdir() if p.suffix in (".db3", ".mcap"))
    data = file.read_bytes()
    file.write_bytes(data[: int(len(data) * share)])
    return file


@pytest.mark.parametrize("kind", ["mcap", "mcap_lz4"])
@pytest.mark.parametrize("share", [0.5, 0.9])
def test_the_readable_part_of_a_truncated_bag_is_used(kind, share, tmp_path, rng, topic_map):
    drive, path = write_bag(kind, tmp_path, rng)
    cut(path, share)
    recording = read_recording(path, topics=topic_map)
    assert any("cut off or damaged" in problem for problem in recording.problems)
    n = len(recording.wheel)
    assert 0.3 * share * SECONDS * 50 < n <= SECONDS * 50
    np.testing.assert_allclose(recording.wheel["wheel_speed_rad_s"], 1.0 + 0.01 * np.arange(n))
    frames = list(recording.camera.frames())
    assert frames
    assert all(np.array_equal(frame.image, drive.image) for frame in frames)
    blocks = list(recording.sound.blocks(0.25, 0.25))
    np.testing.assert_allclose(blocks[0].samples, drive.sound[: RATE // 4], atol=1e-4)


@pytest.mark.parametrize(
    ("kind", "repair"),
    [
        ("ros1", "rosbag reindex"),
        ("ros1_lz4", "rosbag reindex"),
        ("ros2_sqlite", "sqlite3 FILE .recover"),
        ("ros2_mcap", "mcap recover"),  # its writer makes one chunk of it all
    ],
)
@pytest.mark.parametrize("share", [0.5, 0.9])
def test_the_repair_of_an_unreadable_truncated_bag_is_named(kind, repair, share, tmp_path, rng):
    _, path = write_bag(kind, tmp_path, rng)
    file = cut(path, share)
    with pytest.raises(InputError, match=rf"cut off or damaged .*try `{repair}`") as refused:
        read_recording(path)
    assert file.name in str(refused.value)


def test_what_was_read_before_the_damage_is_used(tmp_path, rng, topic_map):
    _, path = write_bag("ros1_bz2", tmp_path, rng)
    data = path.read_bytes()
    half = len(data) // 2
    path.write_bytes(data[:half] + bytes(2000) + data[half + 2000 :])
    recording = read_recording(path, topics=topic_map)
    assert any("read up to" in problem and "rosbag reindex" in problem for problem in recording.problems)
    n = len(recording.wheel)
    assert 10 < n < SECONDS * 50
    np.testing.assert_allclose(recording.wheel["wheel_speed_rad_s"], 1.0 + 0.01 * np.arange(n))


@pytest.mark.parametrize("kind", ["ros1_lz4", "ros1_bz2", "ros2_zstd", "mcap", "mcap_lz4"])
def test_a_bomb_is_not_unpacked(kind, tmp_path, rng, monkeypatch):
    _, path = write_bag(kind, tmp_path, rng)
    monkeypatch.setattr(bag_files, "MAX_CHUNK_BYTES", 60)
    with pytest.raises(InputError, match=r"(more than|exceeds limit) 60"):
        read_recording(path)


def test_a_storage_file_that_fills_the_disk_is_not_unpacked(tmp_path, rng, monkeypatch):
    _, path = write_bag("ros2_zstd_file", tmp_path, rng)
    monkeypatch.setattr(bag_files, "MAX_STORAGE_BYTES", 1000)
    with pytest.raises(InputError, match="more than this computer has room for"):
        read_recording(path)


@pytest.mark.parametrize("name", ["with space", "50 % #1"])
def test_a_bag_whose_folder_has_special_characters_in_its_name_is_read(name, tmp_path, rng):
    (tmp_path / name).mkdir()
    _, path = write_bag("ros2_sqlite", tmp_path, rng)
    path = path.rename(tmp_path / name / "bag")
    assert len(read_recording(path).wheel) == SECONDS * 50


def test_a_ros2_bag_without_its_metadata_is_read(tmp_path, rng, topic_map):
    _, path = write_bag("ros2_sqlite", tmp_path, rng)
    (path / "metadata.yaml").unlink()
    recording = read_recording(path, topics=topic_map)
    assert len(recording.wheel) == SECONDS * 50
    assert any("metadata.yaml" in problem for problem in recording.problems)


@pytest.mark.parametrize("kind", ["ros1", "ros2_sqlite", "mcap"])
@pytest.mark.parametrize("share", [0.0, 0.002])
def test_a_bag_without_a_readable_message_is_an_error(kind, share, tmp_path, rng):
    _, path = write_bag(kind, tmp_path, rng)
    file = cut(path, share)
    with pytest.raises(InputError, match=file.name.split(".")[0]):
        read_recording(path)


def test_json_messages_of_mcap_are_read(tmp_path, rng):
    path = tmp_path / "j.mcap"
    image = rng.integers(0, 255, (8, 8, 3)).astype(np.uint8)
    png = base64.b64encode(cv2.imencode(".png", image)[1].tobytes()).decode()
    with path.open("wb") as file:
        writer = McapWriter(file)
        writer.start()
        schema = writer.register_schema("Number", "jsonschema", b'{"type": "object"}')
        picture = writer.register_schema("foxglove.CompressedImage", "jsonschema", b'{"type": "object"}')
        load = writer.register_channel("/wheel/load_N", "json", schema)
        camera = writer.register_channel("/camera", "json", picture)
        for i in range(10):
            writer.add_message(load, i * 10**8, json.dumps({"data": 50 + i}).encode(), i * 10**8)
        writer.add_message(camera, 10**8, json.dumps({"data": png, "format": "png"}).encode(), 10**8)
        writer.add_message(camera, 2 * 10**8, json.dumps({"data": "%%", "format": "png"}).encode(), 2 * 10**8)
        writer.finish()
    recording = read_recording(path)
    np.testing.assert_array_equal(recording.wheel["load_N"], 50.0 + np.arange(10))
    assert recording.start_time is None  # a clock that started with the computer
    good, bad = recording.camera.frames()
    np.testing.assert_array_equal(good.image, image)
    assert bad.image is None
    assert "base64" in bad.problem


def test_code_hidden_in_a_message_definition_is_not_run(tmp_path):
    path = tmp_path / "evil.mcap"
    evil = 'float64 data\nstring X="\\"; raise SystemExit(1) #"\nint32 y __import__("os").abort()\n'
    with path.open("wb") as file:
        writer = McapWriter(file)
        writer.start()
        schema = writer.register_schema("a_msgs/msg/Float64", "ros2msg", evil.encode())
        channel = writer.register_channel("/wheel/load_N", "cdr", schema)
        payload = b"\0\1\0\0" + np.array([7.0]).tobytes() + np.array([1], "<i4").tobytes()
        writer.add_message(channel, 0, payload, 0)
        writer.add_message(channel, 10**8, payload, 10**8)
        writer.finish()
    np.testing.assert_array_equal(read_recording(path).wheel["load_N"], 7.0)


@pytest.mark.parametrize("name", ["x.bag", "x.mcap", "x.db3"])
def test_a_file_of_another_kind_is_named(name, tmp_path):
    path = tmp_path / name
    path.write_text("not a bag at all")
    with pytest.raises(InputError, match=f"{name}: begins with"):
        read_recording(path)


def test_a_database_of_another_program_is_no_bag(tmp_path):
    import sqlite3

    path = tmp_path / "x.db3"
    database = sqlite3.connect(path)
    database.execute("CREATE TABLE notes (text TEXT)")
    database.commit()
    database.close()
    with pytest.raises(InputError, match="missing tables"):
        read_recording(path)
