"""A drive as ROS 1 bag, ROS 2 bag and MCAP file, through the command line, against the same drive in a folder."""

from __future__ import annotations

import csv
import json
import shutil
from pathlib import Path

import numpy as np
import pytest
import soundfile
from bevameter.framework.cli.main import app
from bevameter.framework.core.recording.readers import read_recording
from mcap.writer import Writer as McapWriter
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from typer.testing import CliRunner

SECONDS = 14.0
START_NS = 1_748_768_400 * 10**9  # what recording.toml of the scenario says
KINDS = ("ros1", "ros2", "mcap")
AUDIO = {"audio_common_msgs/msg/AudioData": "uint8[] data", "audio_common_msgs/msg/AudioInfo":
         "uint8 channels\nuint32 sample_rate\nstring sample_format\nuint32 bitrate\nstring coding_format"}  # fmt: skip
NUMBER, POSE, IMAGE = "std_msgs/msg/Float64", "geometry_msgs/msg/PoseStamped", "sensor_msgs/msg/CompressedImage"


def columns(path: Path) -> dict[str, list[str]]:
    with path.open(newline="", encoding="utf-8") as file:
        rows = [row for row in csv.DictReader(file) if float(row["time_s"]) < SECONDS]
    return {name: [row[name] for row in rows] for name in rows[0]}


def write_columns(path: Path, table: dict[str, list[str]]) -> None:
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(table)
        writer.writerows(zip(*table.values(), strict=True))


@pytest.fixture(scope="module")
def folder(short_drive, tmp_path_factory):
    """The first seconds of the short drive."""
    target = tmp_path_factory.mktemp("first") / "drive"
    (target / "camera").mkdir(parents=True)
    for name in ("wheel.csv", "pose.csv", "camera/camera.csv"):
        write_columns(target / name, columns(short_drive / name))
    for name in columns(target / "camera" / "camera.csv")["file"]:
        shutil.copy(short_drive / "camera" / name, target / "camera" / name)
    samples, rate = soundfile.read(short_drive / "sound.flac", dtype="int16", frames=int((SECONDS - 0.35) * 22050))
    soundfile.write(target / "sound.flac", samples, rate)
    shutil.copy(short_drive / "vehicle.toml", target)
    about = "site = 'synthetic short 4'\nstart_time = 2025-06-01T09:00:00Z\n[sound]\nstart_s = 0.35\n"
    (target / "recording.toml").write_text(about)
    return target


class Messages:
    """The drive's content as messages: (topic, type, time [ns], message)."""

    def __init__(self, folder: Path, ros1: bool):
        self.folder, self.ros1 = folder, ros1
        self.types = get_typestore(Stores.ROS1_NOETIC if ros1 else Stores.ROS2_HUMBLE)
        for name, text in AUDIO.items():
            self.types.register(get_types_from_msg(text, name))

    def make(self, kind, **fields):
        return self.types.types[kind](**fields)

    def header(self, time):
        stamp = self.make("builtin_interfaces/msg/Time", sec=time // 10**9, nanosec=time % 10**9)
        return self.make("std_msgs/msg/Header", stamp=stamp, frame_id="f", **({"seq": 0} if self.ros1 else {}))

    def all(self):
        return sorted([*self.wheel(), *self.pose(), *self.camera(), *self.sound()], key=lambda message: message[2])

    def wheel(self):
        table = columns(self.folder / "wheel.csv")
        for name in table.keys() - {"time_s"}:
            for time, text in zip(table["time_s"], table[name], strict=True):
                yield f"/wheel/{name}", NUMBER, nanoseconds(time), self.make(NUMBER, data=float(text or "nan"))

    def pose(self):
        table = columns(self.folder / "pose.csv")
        for time, x, y, yaw in zip(*(table[name] for name in ("time_s", "x_m", "y_m", "yaw_rad")), strict=True):
            half = float(yaw) / 2
            place = self.make("geometry_msgs/msg/Point", x=float(x), y=float(y), z=0.0)
            turn = self.make("geometry_msgs/msg/Quaternion", x=0.0, y=0.0, z=np.sin(half), w=np.cos(half))
            pose = self.make("geometry_msgs/msg/Pose", position=place, orientation=turn)
            yield "/pose", POSE, nanoseconds(time), self.make(POSE, header=self.header(nanoseconds(time)), pose=pose)

    def camera(self):
        table = columns(self.folder / "camera" / "camera.csv")
        for time, name in zip(table["time_s"], table["file"], strict=True):
            data = np.frombuffer((self.folder / "camera" / name).read_bytes(), np.uint8)
            header = self.header(nanoseconds(time))
            yield "/camera", IMAGE, nanoseconds(time), self.make(IMAGE, header=header, format="jpeg", data=data)

    def sound(self):
        samples, rate = soundfile.read(self.folder / "sound.flac", dtype="int16")
        kind = "audio_common_msgs/msg/AudioInfo"
        fields = {"channels": 1, "sample_rate": rate, "sample_format": "S16LE", "bitrate": 0, "coding_format": "wave"}
        yield "/audio_info", kind, START_NS, self.make(kind, **fields)
        for first in range(0, len(samples), 2048):
            data = np.ascontiguousarray(samples[first : first + 2048]).astype("<i2").view(np.uint8)
            kind = "audio_common_msgs/msg/AudioData"
            yield "/audio", kind, nanoseconds(0.35 + first / rate), self.make(kind, data=data)

    def encode(self, kind, message) -> bytes:
        return bytes((self.types.serialize_ros1 if self.ros1 else self.types.serialize_cdr)(message, kind))


def nanoseconds(seconds: str | float) -> int:
    return START_NS + round(float(seconds) * 1e9)


def write_bag(kind: str, source: Path, folder: Path) -> Path:
    """Write the drive as a bag, with vehicle.toml in the same folder."""
    messages = Messages(source, ros1=kind == "ros1")
    path = folder / {"ros1": "drive.bag", "ros2": "drive", "mcap": "drive.mcap"}[kind]
    if kind == "mcap":
        with path.open("wb") as file:
            writer = McapWriter(file, chunk_size=200_000)
            writer.start("ros2")
            channels: dict[str, int] = {}
            for topic, name, time, message in messages.all():
                if topic not in channels:
                    text = messages.types.generate_msgdef(name, ros_version=2)[0].encode()
                    channels[topic] = writer.register_channel(
                        topic, "cdr", writer.register_schema(name, "ros2msg", text)
                    )
                writer.add_message(channels[topic], time, messages.encode(name, message), time)
            writer.finish()
    else:
        with Writer1(path) if kind == "ros1" else Writer2(path, version=9) as writer:
            connections = {}
            for topic, name, time, message in messages.all():
                if topic not in connections:
                    connections[topic] = writer.add_connection(topic, name, typestore=messages.types)
                writer.write(connections[topic], time, messages.encode(name, message))
    shutil.copy(source / "vehicle.toml", folder)
    return path


def ran(recording: Path, models: Path, folder: Path, *more: str) -> tuple[dict, str]:
    """Run over a recording; give the summary and what was printed."""
    page = folder / f"{recording.stem}.json"
    arguments = ["--quiet", "run", str(recording), "--db", str(folder / "t.db"), "--models", str(models)]
    arguments += ["--json", str(page)]
    result = CliRunner().invoke(app, [*arguments, *more])
    assert result.exit_code == 0, result.output
    assert result.stderr == ""
    return json.loads(page.read_text(encoding="utf-8")), result.stdout


@pytest.fixture(scope="module")
def of_folder(folder, small_models, tmp_path_factory):
    return ran(folder, small_models, tmp_path_factory.mktemp("of_folder"))[0]


@pytest.mark.parametrize("kind", KINDS)
def test_a_bag_gives_what_the_folder_gives(kind, folder, of_folder, small_models, tmp_path):
    page, said = ran(write_bag(kind, folder, tmp_path), small_models, tmp_path)
    assert "not usable" not in said
    assert page["problems"] == []
    assert page["distance_m"] == pytest.approx(of_folder["distance_m"], rel=1e-6)
    assert page["places"] == "recorded"
    assert page["cells"] == of_folder["cells"]
    assert page["track_m"] == pytest.approx(of_folder["track_m"])
    for sense, same in zip(page["senses"], of_folder["senses"], strict=True):
        assert (sense["sense"], sense["absent"], sense["items"]) == (same["sense"], same["absent"], same["items"])
        assert (sense["sense"] == "vibration sensor") == bool(sense["absent"])
        assert sense["trusted_share"] == pytest.approx(same["trusted_share"])
        assert sense["said"] == pytest.approx(same["said"])
    assert len(page["soils"]) == len(of_folder["soils"]) == 1
    for name, quantity in of_folder["soils"][0]["parameters"].items():
        assert page["soils"][0]["parameters"][name]["value"] == pytest.approx(quantity["value"], rel=1e-3)


@pytest.mark.parametrize("kind", KINDS)
def test_soil_is_identified_from_a_bag(kind, folder, tmp_path):
    pages = []
    for recording in (folder, write_bag(kind, folder, tmp_path)):
        out = tmp_path / f"{len(pages)}.json"
        result = CliRunner().invoke(app, ["identify", str(recording), "--json", str(out)])
        assert result.exit_code == 0, result.output
        pages.append(json.loads(out.read_text(encoding="utf-8")))
    ours, same = pages
    assert ours["n"] == same["n"] > 100
    assert ours["channels"] == same["channels"]
    for name in ("c_Pa", "phi_rad"):
        for end in ("value", "low", "high"):
            assert ours["overall"][name][end] == pytest.approx(same["overall"][name][end], rel=1e-3, abs=1e-6)


def cut(path: Path, share: float) -> Path:
    """Cut the bag's storage file off after a share of its length."""
    file = path if path.is_file() else next(path.glob("*.db3"))
    data = file.read_bytes()
    file.write_bytes(data[: int(share * len(data))])
    return file


def test_of_an_mcap_file_that_was_cut_off_the_rest_is_used_and_the_loss_is_reported(folder, small_models, tmp_path):
    path = write_bag("mcap", folder, tmp_path)
    cut(path, 0.6)
    page, said = ran(path, small_models, tmp_path)
    assert any("cut off or damaged" in problem for problem in page["problems"])
    assert "not usable" in said
    assert "mcap recover" in said
    assert 0.3 * SECONDS < page["duration_s"] < SECONDS
    assert page["cells"].get("sand", 0) > 10
    assert all(sense["items"] > 0 for sense in page["senses"][:2])


@pytest.mark.parametrize(("kind", "share"), [(kind, 0.0005) for kind in KINDS] + [("ros1", 0.6), ("ros2", 0.6)])
def test_of_a_bag_that_cannot_be_read_one_line_is_reported(kind, share, folder, tmp_path):
    path = write_bag(kind, folder, tmp_path)
    file = cut(path, share)
    result = CliRunner().invoke(app, ["run", str(path), "--db", str(tmp_path / "t.db")])
    assert result.exit_code == 2
    assert len(result.stderr.splitlines()) == 1
    assert file.name in result.stderr
    assert {"ros1": "rosbag reindex", "ros2": "sqlite3 FILE .recover", "mcap": "mcap recover"}[kind] in result.stderr
    assert not (tmp_path / "t.db").exists()


@pytest.mark.slow
def test_a_topic_map_renames_and_scales(folder, small_models, tmp_path):
    """A map overrides what it names, and what it does not name is recognised, but for what it ignores."""
    path = write_bag("mcap", folder, tmp_path)
    topics = tmp_path / "topics.toml"
    wheel = "".join(
        f'[[wheel]]\ntopic = "/wheel/{name}"\n[wheel.fields]\n{name} = {{ field = "data", scale = {scale} }}\n'
        for name, scale in (("load_N", 0.5), ("slip", 1.0), ("torque_Nm", 1.0))
    )
    pose = '[pose]\ntopic = "/pose"\nframe = "map"\n'  # else its places are kept apart from the site's
    topics.write_text(f'name = "mapped"\nsite = "pit"\n{wheel}{pose}[sound]\ntopic = "/audio"\n')
    recording = read_recording(path, topics=topics)
    loads = np.sort(recording.wheel.observed("load_N"))
    np.testing.assert_allclose(loads, 0.5 * np.sort(read_recording(path).wheel.observed("load_N")))
    assert "sinkage_m" in recording.wheel
    page, _ = ran(path, small_models, tmp_path, "--topics", str(topics))
    assert (page["recording"], page["site"]) == ("mapped", "pit")
    assert [page["senses"][sense]["absent"] for sense in (0, 1)] == ["", ""]
    topics.write_text('ignore = ["/camera"]\n')
    assert read_recording(path, topics=topics).camera is None
    topics.write_text('[camera]\ntopic = "/front"\n')
    result = CliRunner().invoke(app, ["run", str(path), "--db", str(tmp_path / "n.db"), "--topics", str(topics)])
    assert result.exit_code == 2
    assert "no topic /front" in result.stderr
    assert "/camera" in result.stderr
