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
from bevameter.framework.inspection import inspect_recording
from every_bag import KINDS, RATE, SECONDS, START_NS, write_bag
from mcap.writer import Writer as McapWriter

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


def write_json(path, topics, step_ns=10**8):
    """Write topics, each (name, type, messages), as JSON in an MCAP file."""
    with path.open("wb") as file:
        writer = McapWriter(file)
        writer.start()
        for name, kind, messages in topics:
            schema = writer.register_schema(kind, "jsonschema", b'{"type": "object"}')
            channel = writer.register_channel(name, "json", schema)
            for i, message in enumerate(messages):
                writer.add_message(channel, i * step_ns, json.dumps(message).encode(), i * step_ns)
        writer.finish()
    return path


def test_foxglove_s_poses_fixes_and_transforms_are_read(tmp_path):
    level = {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}
    poses = [
        {"frame_id": "map", "pose": {"position": {"x": 2.0 * i, "y": 0.0, "z": 0.0}, "orientation": level}}
        for i in range(20)
    ]
    fixes = [{"latitude": 47.0, "longitude": 15.0 + 2.635e-5 * i, "altitude": 300.0} for i in range(20)]
    step = {"parent_frame_id": "base_footprint", "child_frame_id": "base_link", "rotation": level,
            "translation": {"x": 0.0, "y": 0.0, "z": 0.2}}  # fmt: skip
    path = write_json(
        tmp_path / "f.mcap",
        [("/pose", "foxglove.PoseInFrame", poses), ("/gps", "foxglove.LocationFix", fixes),
         ("/tf", "foxglove.FrameTransforms", [{"transforms": [step]}])],
    )  # fmt: skip
    recording = read_recording(path)
    np.testing.assert_allclose(recording.pose.x_m, 2.0 * np.arange(20))
    assert (recording.frame, recording.problems) == ("map", ())
    assert recording.origin.latitude_deg == pytest.approx(47.0, abs=1e-5)
    assert recording.origin.heading_deg == pytest.approx(0.0, abs=0.1)  # x points east, y north
    feeds = {each.name: each.feeds for each in inspect_recording(path).contents.sources}
    assert feeds == {"/pose": "pose; pitch_rad, roll_rad", "/gps": "origin on Earth", "/tf": "mounting of sensors"}


def test_a_topic_map_states_units(tmp_path):
    path = write_json(tmp_path / "u.mcap", [("/drive", "Drive", [{"rpm": 30.0, "mA": 1500.0, "tick": 2.0}] * 5)])
    text = (
        '[wheel]\ntopic = "/drive"\n[wheel.fields]\nwheel_speed_rad_s = { field = "rpm", unit = "rpm", scale = -1.0 }\n'
    )
    (tmp_path / "t.toml").write_text(text + 'current_A = { field = "mA", unit = "mA" }\n')
    table = read_recording(path, topics=tmp_path / "t.toml").wheel
    assert table["wheel_speed_rad_s"] == pytest.approx(np.full(5, -np.pi))
    assert table["current_A"] == pytest.approx(np.full(5, 1.5))
    (tmp_path / "t.toml").write_text(text.replace('"rpm",', '"Nm",'))
    with pytest.raises(InputError, match=r"wheel_speed_rad_s in 'Nm', expected one of rad/s, .*rpm"):
        read_recording(path, topics=tmp_path / "t.toml")


def test_encoders_give_the_wheels_speed(tmp_path):
    """4096 ticks a turn, counted while the wheel turns at 3 rad/s."""
    ticks = [{"data": [int(3.0 * 0.02 * i / (2 * np.pi) * 4096)]} for i in range(200)]
    path = write_json(tmp_path / "e.mcap", [("/ticks", "Ticks", ticks)], step_ns=2 * 10**7)
    (tmp_path / "t.toml").write_text(
        '[wheel]\ntopic = "/ticks"\nfields = { wheel_angle_rad = { field = "data[0]", scale = 0.001533980788 } }\n'
    )
    table = read_recording(path, topics=tmp_path / "t.toml").wheel
    np.testing.assert_allclose(table["wheel_speed_rad_s"], 3.0, rtol=0.02)


def test_topics_that_nothing_names_say_how_a_map_names_them(tmp_path):
    turning = {"x": 0.0, "y": 0.0, "z": 0.1}
    turning = {
        "orientation_covariance": [-1.0] + 8 * [0.0],
        "angular_velocity": turning,
        "linear_acceleration": turning,
    }
    path = write_json(
        tmp_path / "n.mcap",
        [("/wheel/load_N", "Number", [{"data": 50.0}] * 5), ("/imu", "sensor_msgs/Imu", [turning] * 5),
         ("/motor_currents", "Numbers", [{"data": [1.0, 2.0]}] * 5), ("/text", "Text", [{"data": "on"}] * 5)],
        step_ns=10**7,
    )  # fmt: skip
    remarks = {each.name: each.remark for each in inspect_recording(path).contents.sources}
    assert remarks["/motor_currents"] == (
        '2 numbers without names: in a topic map [[wheel]] topic = "/motor_currents", wheel = "NAME", '
        'fields = { current_A = "data[0]" }'
    )
    assert "a topic map can name its fields" in remarks["/text"]
    assert "without an orientation, which pitch and roll need" in remarks["/imu"]


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
