"""A recording as an MCAP file that a robot's recorder writes, whole or bit by bit."""

from __future__ import annotations

import os
import time
from collections.abc import Iterator
from multiprocessing.connection import Connection
from pathlib import Path
from typing import BinaryIO

import cv2
import numpy as np
import soundfile
from bevameter import Recording, read_recording
from bevameter.framework.core.recording.sound import SoundFileStream
from mcap.writer import CompressionType
from mcap.writer import Writer as McapWriter
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

START_NS = 1_700_000_000 * 10**9
SOUND_SAMPLES = 1000
AUDIO = {"audio_common_msgs/msg/AudioData": "uint8[] data", "audio_common_msgs/msg/AudioInfo":
         "uint8 channels\nuint32 sample_rate\nstring sample_format\nuint32 bitrate\nstring coding_format"}  # fmt: skip
TYPES = get_typestore(Stores.ROS2_HUMBLE)
for _name, _text in AUDIO.items():
    TYPES.register(get_types_from_msg(_text, _name))


def make(kind: str, **fields):
    return TYPES.types[kind](**fields)


def ns(time_s: float) -> int:
    return START_NS + round(time_s * 1e9)


def header(time_s: float, frame: str):
    stamp = make("builtin_interfaces/msg/Time", sec=ns(time_s) // 10**9, nanosec=ns(time_s) % 10**9)
    return make("std_msgs/msg/Header", stamp=stamp, frame_id=frame)


def messages(recording: Recording) -> Iterator[tuple[float, str, str, object]]:
    """Give time of recording [s], topic, type and message: in the order of the recorder, a few ms late."""
    found = [*_numbers(recording), *_sound(recording)]
    found += [(time_s + 0.015, *rest) for time_s, *rest in _images(recording)]
    return iter(sorted(found, key=lambda each: each[0]))


def _numbers(recording: Recording) -> Iterator[tuple[float, str, str, object]]:
    pose, wheel, number = recording.pose, recording.wheel, "std_msgs/msg/Float64"
    for time_s, x, y, yaw in zip(pose.time_s, pose.x_m, pose.y_m, pose.yaw_rad, strict=True):
        turn = make("geometry_msgs/msg/Quaternion", x=0.0, y=0.0, z=np.sin(yaw / 2), w=np.cos(yaw / 2))
        place = make("geometry_msgs/msg/Pose", position=make("geometry_msgs/msg/Point", x=x, y=y, z=0.0),
                     orientation=turn)  # fmt: skip
        kind = "geometry_msgs/msg/PoseStamped"
        yield time_s + 0.004, "/pose", kind, make(kind, header=header(time_s, "map"), pose=place)
    names = [name for name in ("load_N", "torque_Nm", "sinkage_m", "slip", "travel_speed_m_s") if name in wheel]
    for row, time_s in enumerate(wheel["time_s"].tolist()):
        for name in names:
            yield time_s, f"/wheel/{name}", number, make(number, data=float(wheel[name][row]))


def _images(recording: Recording) -> Iterator[tuple[float, str, str, object]]:
    kind = "sensor_msgs/msg/CompressedImage"
    for frame in recording.camera.frames():
        if frame.image is not None:
            data = cv2.imencode(".jpg", frame.image)[1].ravel()
            image = make(kind, header=header(frame.time_s, "camera"), format="jpeg", data=data)
            yield frame.time_s, "/camera/image/compressed", kind, image


def _sound(recording: Recording) -> Iterator[tuple[float, str, str, object]]:
    stream = recording.sound
    if not isinstance(stream, SoundFileStream):
        return
    samples, rate = soundfile.read(stream.path, dtype="int16", always_2d=True)
    info = "audio_common_msgs/msg/AudioInfo"
    yield (
        stream.start_s,
        "/audio_info",
        info,
        make(info, channels=samples.shape[1], sample_rate=rate, sample_format="S16LE", bitrate=0, coding_format="wave"),
    )
    kind = "audio_common_msgs/msg/AudioData"
    for first in range(0, len(samples), SOUND_SAMPLES):
        data = np.ascontiguousarray(samples[first : first + SOUND_SAMPLES]).view(np.uint8).ravel()
        yield stream.start_s + first / rate, "/audio", kind, make(kind, data=data)


def write(file: BinaryIO, given: Iterator[tuple[float, str, str, object]]) -> None:
    """Write messages as MCAP, in chunks of 100 kB."""
    writer = McapWriter(file, chunk_size=100_000, compression=CompressionType.ZSTD)
    writer.start("ros2")
    channels = {}
    for time_s, topic, kind, message in given:
        if topic not in channels:
            text = TYPES.generate_msgdef(kind, ros_version=2)[0].encode()
            channels[topic] = writer.register_channel(topic, "cdr", writer.register_schema(kind, "ros2msg", text))
        writer.add_message(channels[topic], ns(time_s), bytes(TYPES.serialize_cdr(message, kind)), ns(time_s))
    writer.finish()


def write_mcap(path: Path, folder: Path) -> Path:
    """Write a recording's folder as an MCAP file."""
    with path.open("wb") as file:
        write(file, messages(read_recording(folder)))
    return path


def grow(connection: Connection, whole: Path, path: Path | int, piece: int, pause_s: float) -> None:
    """Write a file again, in pieces that end anywhere, into a file or a pipe; say when the first one is written."""
    data = whole.read_bytes()
    with open(path, "wb", buffering=0) as file:
        for first in range(0, len(data), piece):
            file.write(data[first : first + piece])
            if first == 0:
                connection.send("begun")
            time.sleep(pause_s)
    os.sync()
