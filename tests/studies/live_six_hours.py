"""A drive of six hours with faults, killed at random and resumed, against a run on its recording.

    python tests/studies/live_six_hours.py --hours 6 --kills 5 --out six_hours.json --write

The vehicle goes round a field: half a minute slowly on sand and on loam every ten minutes, else faster. The material is
that of the scenario `short`, over and over, as fast as it is taken: poses and wheel rows at 10 Hz, sound at 22 kHz, an
image every 4 s. Of each hour the camera is lost for ten minutes, the microphone for five, the poses for half a minute.
The process is killed (SIGKILL) at random moments of the first half and resumed from its journal; in the second half it
is left alone, and its memory is watched. The database is locked by another program when the drive is closed. With
`--jump S` the clock is set back by a minute after each S seconds: a run sorts such times, so that it is given the
recording without the jumps.
"""

from __future__ import annotations

import argparse
import json
import math
import multiprocessing
import random
import sqlite3
import sys
import tempfile
import time
from bisect import bisect_right
from collections.abc import Iterator
from dataclasses import replace
from multiprocessing.connection import Connection
from pathlib import Path

import numpy as np
import soundfile
from bevameter import InputError, LiveTraverse, Recording, TerrainDatabase, read_recording, run_traverse
from bevameter.database import schema
from bevameter.framework.core.recording.sound import block_hop, sound_block
from bevameter.framework.core.recording.types import Frame, Pose, SoundBlock, Wanted, WheelTable, always
from bevameter.framework.default_models import Models, find_models
from bevameter.framework.live import checkpoints
from bevameter.framework.live.journal import unfinished
from bevameter.framework.scenario.write import write_scenario
from measured import write

MODELS = ("vision-synthetic", "audio-synthetic")
STEP_S, IMAGE_S, SOUND_SAMPLES = 0.1, 4.0, 22050
PERIOD_S, HOUR_S = 600.0, 3600.0
SLOW_S = 58.0
"""Of each period: on sand up to 26 s, on loam from 32 s on."""
RADIUS_M, FAST_M_S = 30.0, 2.0
CAMERA_LOST, MICROPHONE_LOST, POSE_LOST = (1200.0, 1800.0), (2400.0, 2700.0), (3000.0, 3030.0)
"""Of each hour [s]."""


class Endless:
    """Samples at any time [s] of a drive that is made of a short one."""

    def __init__(self, short: Recording, hours: float):
        assert short.wheel is not None
        assert short.sound is not None
        assert short.camera is not None
        self.short, self.seconds = short, hours * HOUR_S
        self.names = [name for name in short.wheel.columns if name != "time_s"]
        frames = [each for each in short.camera.frames() if each.image is not None]
        self.images, self._image_s = [each.image for each in frames], [each.time_s for each in frames]
        self.sound, self.rate = soundfile.read(short.sound.path, dtype="float32", always_2d=True)  # type: ignore[attr-defined]
        self.steps = round(self.seconds / STEP_S)
        speed = np.array([self._speed(STEP_S * step) for step in range(self.steps)])
        self.way = np.concatenate([[0.0], np.cumsum(speed) * STEP_S])

    def _at(self, time_s: float) -> float:
        """Give the moment of the short drive that a moment is like [s]."""
        within = time_s % PERIOD_S
        return within if within < SLOW_S else 64.0 + (within - SLOW_S) % 5.0

    def _speed(self, time_s: float) -> float:
        wheel = self.short.wheel
        assert wheel is not None
        if time_s % PERIOD_S >= SLOW_S:
            return FAST_M_S
        return float(wheel["travel_speed_m_s"][round(self._at(time_s) / STEP_S)])

    def pose(self, step: int) -> tuple[float, float, float] | None:
        if lost(STEP_S * step, POSE_LOST):
            return None
        angle = self.way[step] / RADIUS_M
        return RADIUS_M * math.cos(angle), RADIUS_M * math.sin(angle), angle + math.pi / 2

    def row(self, step: int) -> dict[str, float]:
        wheel, time_s = self.short.wheel, STEP_S * step
        assert wheel is not None
        own = {name: float(wheel[name][round(self._at(time_s) / STEP_S)]) for name in self.names}
        return own | {"travel_speed_m_s": self._speed(time_s)}

    def image(self, time_s: float) -> np.ndarray:
        return self.images[max(bisect_right(self._image_s, self._at(time_s)) - 1, 0)]

    def block(self, number: int) -> np.ndarray:
        """Give the samples of a second."""
        first = round(self._at(float(number)) * self.rate) % (len(self.sound) - SOUND_SAMPLES)
        return self.sound[first : first + SOUND_SAMPLES]


def lost(time_s: float, span: tuple[float, float]) -> bool:
    """Say whether a sensor is lost at a time [s]."""
    return span[0] <= time_s % HOUR_S < span[1]


class Images:
    """The recorded camera."""

    def __init__(self, made: Endless):
        self._made = made
        times = np.arange(0.05, made.seconds, IMAGE_S).tolist()
        self.times = [each for each in times if not lost(each, CAMERA_LOST)]

    def __len__(self) -> int:
        return len(self.times)

    def frames(self, wanted: Wanted = always) -> Iterator[Frame]:
        for time_s in self.times:
            if wanted(time_s):
                yield Frame(time_s, self._made.image(time_s))


class Sound:
    """The recorded sound; after a gap blocks begin anew."""

    start_s = 0.0

    def __init__(self, made: Endless):
        self._made, self.sample_rate = made, made.rate
        self.seconds = [each for each in range(int(made.seconds)) if not lost(each, MICROPHONE_LOST)]

    @property
    def duration_s(self) -> float:
        return self._made.seconds

    def blocks(self, block_s: float, hop_s: float) -> Iterator[SoundBlock]:
        size, hop = block_hop(block_s, hop_s, self.sample_rate)
        held, base_s, given, last = np.empty((0, self._made.sound.shape[1]), np.float32), 0.0, 0, -2
        for second in self.seconds:
            if second != last + 1:
                held, base_s, given = held[:0], float(second), 0
            held, last = np.concatenate([held, self._made.block(second)]), second
            while len(held) >= size:
                yield sound_block(base_s + given / self.sample_rate, held[:size])
                given, held = given + hop, held[hop:]


def recording_of(made: Endless) -> Recording:
    """Give the drive as a recorder has it."""
    poses = [(STEP_S * step, *pose) for step in range(made.steps) if (pose := made.pose(step)) is not None]
    rows = [made.row(step) for step in range(made.steps)]
    columns = {name: np.array([row[name] for row in rows]) for name in rows[0]}
    columns["time_s"] = np.array([STEP_S * step for step in range(made.steps)])
    wheel = WheelTable(columns, None, None, made.short.source)
    return replace(
        made.short, digest="6" * 64, labels=None, vibration=None, wheel=wheel, pose=Pose(*np.array(poses).T),
        camera=Images(made), sound=Sound(made),
    )  # fmt: skip


def begun(made: Endless, models: Models, database: Path, **options) -> LiveTraverse:
    short = made.short
    assert short.vehicle is not None
    return LiveTraverse(
        database, short.vehicle, models=models, site=short.site, name=short.name, start_time=short.start_time,
        lossless=True, **options,
    )  # fmt: skip


def hand_over(made: Endless, live: LiveTraverse, connection: Connection, jump: float) -> None:
    """Hand over all samples from `needed_s` on, and say how far it is."""
    steps_of_image, steps_of_sound = round(IMAGE_S / STEP_S), round(1.0 / STEP_S)
    from_step = max(math.floor(max(live.needed_s, 0.0) / STEP_S) - 1, 0)
    for step in range(from_step, made.steps):
        time_s = STEP_S * step
        stamp_s = time_s - (60.0 * (time_s // jump) if jump else 0.0)
        if time_s >= live.needed_s:
            if (pose := made.pose(step)) is not None:
                live.pose(stamp_s, *pose)
            live.wheel(stamp_s, **made.row(step))
        if step % steps_of_image == 0 and (at := time_s + 0.05) >= live.needed_s and not lost(at, CAMERA_LOST):
            live.image(stamp_s + 0.05, made.image(at))
        second = step // steps_of_sound
        if step % steps_of_sound == 0 and time_s >= live.needed_s and not lost(second, MICROPHONE_LOST):
            live.sound(stamp_s, made.block(second), made.rate)
        if step % 600 == 0:
            connection.send(("at", time_s, resident_bytes()))


def drive(connection: Connection, folder: Path, database: Path, hours: float, jump: float) -> None:
    """Drive on, from where the drive was cut off if it was; the database is locked when the drive is first closed."""
    checkpoints.PERIOD_S, schema.BUSY_TIMEOUT_S = 0.5, 0.1  # the feed is much faster than the time that it is of
    made, left = Endless(read_recording(folder), hours), unfinished(database)
    models = find_models(MODELS, database)
    live = begun(made, models, database, resume=left[0] if left else None)
    hand_over(made, live, connection, jump)
    connection.send(("driven", made.seconds, resident_bytes()))
    holder = sqlite3.connect(database, isolation_level=None)
    holder.execute("BEGIN IMMEDIATE")
    try:
        live.close("6" * 64)
    except InputError as error:
        connection.send(("locked", str(error), 0))
    holder.close()
    began = time.monotonic()
    summary = live.close("6" * 64)
    connection.send(("stored", list(summary.problems), time.monotonic() - began))


def resident_bytes() -> int:
    status = Path("/proc/self/status").read_text(encoding="ascii")
    return next(int(line.split()[1]) * 1024 for line in status.splitlines() if line.startswith("VmRSS"))


def driven(folder: Path, database: Path, hours: float, kills: int, seed: int, jump: float) -> dict:
    """Drive in a process of its own, killed `kills` times in the first half."""
    TerrainDatabase(database).make()
    rng, began = random.Random(seed), time.monotonic()
    kills_s = sorted(rng.uniform(0.0, 0.5 * hours * HOUR_S) for _ in range(kills))
    memory: list[tuple[float, int]] = []
    said: dict = {"kills_s": [round(each) for each in kills_s], "locked": ""}
    while True:
        here, there = multiprocessing.Pipe()
        process = multiprocessing.get_context("spawn").Process(
            target=drive, args=(there, folder, database, hours, jump)
        )
        process.start()
        there.close()
        memory.clear()
        while True:
            try:
                kind, value, more = here.recv()
            except EOFError:
                process.join()
                raise RuntimeError(f"the drive ended with {process.exitcode}") from None
            if kind in ("at", "driven"):
                memory.append((value, more))
                print(f"{value:.0f} s, {more / 2**20:.0f} MiB, {time.monotonic() - began:.0f} s taken", file=sys.stderr)
            if kind == "at" and kills_s and value >= kills_s[0]:
                time.sleep(rng.uniform(0.0, 1.0))
                kills_s.pop(0)
                process.kill()
                process.join()
                break
            if kind == "locked":
                said["locked"] = value
            if kind == "stored":
                process.join()
                half = [used for at, used in memory if at >= 0.5 * hours * HOUR_S]
                said |= {"problems": value, "seconds": round(time.monotonic() - began), "retry_s": round(more, 1)}
                said |= {"MiB_at_half": half[0] / 2**20, "MiB_most_after": max(half) / 2**20}
                return said


def compare(one: Path, other: Path) -> dict:
    """Compare what two databases hold of the drive."""
    found = []
    for path in (one, other):
        with TerrainDatabase(path) as database:
            (drive,) = database.drives()
            found.append(drive)
    a, b = found
    rows = [np.lexsort((each.terrain.cell_y, each.terrain.cell_x)) for each in found]
    cells = [set(zip(each.terrain.cell_x.tolist(), each.terrain.cell_y.tolist(), strict=True)) for each in found]
    answer: dict = {"cells": [len(each) for each in cells], "cells_in_both": len(cells[0] & cells[1])}
    answer["soils"] = [sum(each.estimate is not None for each in drive.soils) for drive in found]
    if cells[0] == cells[1]:
        evidence = [each.terrain.evidence for each in found]
        p, q = (each.probabilities[row] for each, row in zip(evidence, rows, strict=True))
        answer["cells_of_one_class"] = int((p.argmax(axis=1) == q.argmax(axis=1)).sum())
        answer["greatest_difference_of_probability"] = float(np.abs(p - q).max())
        apart = np.abs(a.terrain.time_s[rows[0]] - b.terrain.time_s[rows[1]])
        answer["greatest_difference_of_time_s"] = float(apart.max())
        answer["cells_last_seen_at_another_time"] = int((apart > 1e-9).sum())
        answer["such_times_s"] = sorted({
            round(float(time_s), 2) for one, row in zip(found, rows, strict=True)
            for time_s in one.terrain.time_s[row][apart > 1e-9]
        })[:20]  # fmt: skip
    soils = [[each.estimate for each in drive.soils if each.estimate is not None] for drive in found]
    if len(soils[0]) == len(soils[1]):
        apart = [np.abs(x.mean_c_tan_phi / y.mean_c_tan_phi - 1.0).max() for x, y in zip(*soils, strict=True)]
        answer["greatest_difference_of_c_and_tan_phi_share"] = float(max(apart, default=0.0))
    answer["same_drive"] = a.id == b.id
    return answer


def main() -> None:
    """Drive, run, compare."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--hours", type=float, default=6.0)
    parser.add_argument("--kills", type=int, default=5)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument(
        "--jump", type=float, default=0.0, metavar="S", help="set the clock back by a minute after each so many seconds"
    )
    parser.add_argument("--out", type=Path, help="write the figures as JSON")
    parser.add_argument("--write", action="store_true", help="write docs/measured/live-six-hours.json")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = write_scenario("short", Path(name) / "short", seed=4)
        live, run = Path(name) / "live.db", Path(name) / "run.db"
        figures = driven(folder, live, given.hours, given.kills, given.seed, given.jump)
        began = time.monotonic()
        models = find_models(MODELS, run)
        made = Endless(read_recording(folder), given.hours)
        run_traverse(recording_of(made), run, models=models)
        figures |= {"run_seconds": round(time.monotonic() - began), **compare(run, live)}
    text = json.dumps(figures, indent=1)
    print(text)
    if given.write:
        (run_cells, cells), (run_soils, soils) = figures["cells"], figures["soils"]
        rows = (
            ("time taken [min]", *(f"{figures[each] / 60:.0f}" for each in ("seconds", "run_seconds"))),
            ("cells stored", str(cells), str(run_cells)),
            ("soils stored", str(soils), str(run_soils)),
            ("killed and resumed", str(given.kills), ""),
            (
                "memory after half of the time, and most after it [MiB]",
                f"{figures['MiB_at_half']:.0f}, {figures['MiB_most_after']:.0f}",
                "",
            ),
        )
        data = f"Simulated; one drive of {given.hours:g} hours"
        write("live-six-hours", ("figure", "drive", "run on its recording"), rows, data=data)
    if given.out is not None:
        given.out.write_text(text + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
