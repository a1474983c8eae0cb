"""Recordings that are handed over sample by sample, as a robot does it."""

from __future__ import annotations

import heapq
import math
from collections.abc import Callable, Iterable, Iterator
from multiprocessing.connection import Connection
from pathlib import Path

import numpy as np
import soundfile
from bevameter import LiveTraverse, Recording, read_recording
from bevameter.framework.core.recording.sound import SoundFileStream
from bevameter.framework.live import checkpoints
from bevameter.framework.live.journal import unfinished

SOUND_SAMPLES = 1000

Handing = Callable[[LiveTraverse], None]


def samples(recording: Recording, from_s: float = -math.inf) -> Iterator[tuple[float, Handing]]:
    """Give samples of a recording in order of time, each with what hands it over; no image before `from_s` [s]."""
    return heapq.merge(*streams(recording, from_s), key=lambda each: each[0])


def streams(recording: Recording, from_s: float) -> Iterator[Iterator[tuple[float, Handing]]]:
    """Give the samples of each sensor."""
    if recording.pose is not None:
        yield _poses(recording)
    if recording.wheel is not None:
        yield _wheel(recording)
    if recording.camera is not None:
        yield _images(recording, from_s)
    if isinstance(recording.sound, SoundFileStream):
        yield _sound(recording.sound)


def _poses(recording: Recording) -> Iterator[tuple[float, Handing]]:
    pose = recording.pose
    for row in zip(pose.time_s.tolist(), pose.x_m.tolist(), pose.y_m.tolist(), pose.yaw_rad.tolist(), strict=True):
        yield row[0], lambda live, row=row: live.pose(*row)


def _wheel(recording: Recording) -> Iterator[tuple[float, Handing]]:
    table = recording.wheel
    names = [name for name in table.columns if name != "time_s"]
    for row, time_s in enumerate(table["time_s"].tolist()):
        channels = {name: float(table[name][row]) for name in names}
        if table.wheel is not None:
            channels["wheel"] = str(table.wheel[row])
        yield time_s, lambda live, t=time_s, channels=channels: live.wheel(t, **channels)


def _images(recording: Recording, from_s: float) -> Iterator[tuple[float, Handing]]:
    for frame in recording.camera.frames(lambda time_s: time_s >= from_s):
        yield frame.time_s, lambda live, frame=frame: live.image(frame.time_s, frame.image, problem=frame.problem)


def _sound(stream: SoundFileStream) -> Iterator[tuple[float, Handing]]:
    """A block has come when its last sample has."""
    samples, rate = soundfile.read(stream.path, dtype="float32", always_2d=True)
    for first in range(0, len(samples), SOUND_SAMPLES):
        block = samples[first : first + SOUND_SAMPLES]
        start_s = stream.start_s + first / rate
        yield start_s + len(block) / rate, lambda live, t=start_s, block=block: live.sound(t, block, rate)


def replay(recording: Recording, live: LiveTraverse, from_s: float = -math.inf, to_s: float = math.inf) -> None:
    """Hand over the samples of a stretch of time."""
    for time_s, hand_over in samples(recording, from_s):
        if from_s <= time_s < to_s:
            hand_over(live)


def out_of_order(given: Iterable[tuple[float, Handing]], most_s: float, seed: int = 0) -> Iterator[Handing]:
    """Give samples, each up to `most_s` [s] later than it was taken."""
    rng, waiting = np.random.default_rng(seed), []
    for number, (time_s, hand_over) in enumerate(given):
        while waiting and waiting[0][0] < time_s:
            yield heapq.heappop(waiting)[2]
        heapq.heappush(waiting, (time_s + rng.uniform(0.0, most_s), number, hand_over))
    while waiting:
        yield heapq.heappop(waiting)[2]


def drive_on(connection: Connection, folder: Path, models: Path, database: Path) -> None:
    """Replay a recording into a database, from where the drive was cut off if it was; say when it begins and ends."""
    checkpoints.PERIOD_S = 0.3
    recording, left = read_recording(folder), unfinished(database)
    live = LiveTraverse(
        database, recording.vehicle, models=models, site=recording.site, name=recording.name,
        start_time=recording.start_time, lossless=True, resume=left[0] if left else None,
    )  # fmt: skip
    connection.send("begins")
    replay(recording, live, from_s=live.needed_s)
    live.close(recording.digest)
    connection.send("stored")
