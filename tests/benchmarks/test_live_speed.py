"""How long a drive's snapshot, its belief and its soil take while it goes on.

python -m pytest tests/benchmarks/test_live_speed.py --benchmark-only
"""

from __future__ import annotations

import sys
import time

import numpy as np
import pytest
import soundfile
from bevameter import ClassEvidence, LiveTraverse, TerrainDatabase, read_recording
from bevameter.database.observations import Drive, TerrainObservations
from bevameter.framework.core.pooling import cells_of
from bevameter.framework.live import checkpoints
from bevameter.framework.live.ground import GroundByNow
from bevameter.framework.live.observing import Observing
from bevameter.framework.live.site import SiteByNow
from bevameter.framework.live.soil import SoilWatch
from bevameter.framework.sense_map import SenseMap

CELLS = 100_000
CLASSES = ("gravel", "loam", "sand")
SNAPSHOT_ALLOWED_S = 0.020
"""A new snapshot over so many cells, of which a drive has seen some hundreds since the last."""


def evidence(rng: np.random.Generator, n: int) -> ClassEvidence:
    return ClassEvidence(
        CLASSES, rng.dirichlet((1.0, 1.0, 1.0), n), rng.uniform(0.3, 1.0, n), np.zeros(n, bool), ((),) * n
    )


@pytest.fixture(scope="module")
def seen() -> SenseMap:
    """What a camera saw of 100,000 cells."""
    rng, seen = np.random.default_rng(0), SenseMap("camera")
    x, y = np.meshgrid(np.arange(500), np.arange(CELLS // 500))
    cells = np.column_stack([x.ravel(), y.ravel()])
    seen.add(cells, evidence(rng, CELLS), np.zeros(CELLS))
    seen.settle()
    return seen


def test_a_new_snapshot_over_100000_cells_takes_20_ms_at_most(benchmark, seen, tmp_path):
    drive = Drive("ab" * 32, "live", "field", "rover", None, {}, "m", TerrainObservations.nothing(0.5))
    site = SiteByNow(TerrainDatabase(tmp_path / "t.db"), drive, CLASSES)
    ground = GroundByNow([seen], 0.5)
    whole = np.column_stack([np.arange(CELLS) % 500, np.arange(CELLS) // 500])
    assert len(site.take_up(ground.belief(whole)).cells.key) == CELLS
    rng = np.random.default_rng(1)

    def half_a_second():
        """Five frames at 2 m/s, a hundred looks each."""
        cells = cells_of(rng.uniform(100.0, 104.0, 500), rng.uniform(50.0, 54.0, 500), 0.5)
        seen.add(cells, evidence(rng, 500), np.full(500, 1.0))
        return (np.unique(cells, axis=0),), {}

    snapshot = benchmark.pedantic(lambda cells: site.take_up(ground.belief(cells)), setup=half_a_second, rounds=40)
    assert len(snapshot.cells.key) == CELLS
    assert snapshot.at(102.0, 52.0).class_names == CLASSES
    if benchmark.enabled:
        assert benchmark.stats.stats.median < SNAPSHOT_ALLOWED_S


DRIVEN_S = 20.0
WHEEL_HZ, POSE_HZ, IMAGE_HZ, BLOCK = 50.0, 50.0, 10.0, 1024
LOAD_ALLOWED = 1.2
"""Processor time over time: 60 % of each of two cores."""
IMAGE_ALLOWED_S, WHEEL_ALLOWED_S = 0.100, 0.050


@pytest.mark.slow
def test_a_drive_in_real_time(benchmark, short_drive, small_models, tmp_path, monkeypatch):
    """Wheel and poses at 50 Hz, a camera of 640 x 480 at 10 Hz and sound at 22 kHz, at 2 m/s over 20 s.

    While the estimator searches for another soil, samples wait to be part of it (`SoilByNow.waiting`), and it is said
    how many: ``wheel`` is the time to what is said after a sample, ``in_estimate`` the time to an estimate that no
    sample waits for.
    """
    taken: dict[tuple[str, float], float] = {}
    image_s, wheel_s, in_estimate_s = [], [], []
    waiting: list[float] = []
    said_before: list[float] = []
    add, say = Observing._add, SoilWatch._say

    def added(self, observation):
        add(self, observation)
        if self.record.name == "vision":
            image_s.append(time.perf_counter() - taken["image", float(observation.time_s[0])])

    def said(self, time_s, *rest):
        say(self, time_s, *rest)
        now = time.perf_counter()
        if not said_before or time_s > said_before[-1]:
            said_before.append(time_s)
            waiting.append(time_s)
            wheel_s.append(now - taken["wheel", time_s])
        if self.now.waiting == 0:
            in_estimate_s.extend(now - taken["wheel", each] for each in waiting)
            waiting.clear()

    monkeypatch.setattr(Observing, "_add", added)
    monkeypatch.setattr(SoilWatch, "_say", said)
    recording = read_recording(short_drive)
    live = LiveTraverse(tmp_path / "t.db", recording.vehicle, models=small_models, site=recording.site)

    def drive():
        began, busy = time.perf_counter(), time.process_time()
        for time_s, name, hand_over in in_real_time(recording):
            time.sleep(max(began + time_s - time.perf_counter(), 0.0))
            taken[name, time_s] = time.perf_counter()
            hand_over(live)
        return (time.process_time() - busy) / (time.perf_counter() - began)

    load = benchmark.pedantic(drive, rounds=1)
    problems = live.problems
    live.__exit__(KeyboardInterrupt, KeyboardInterrupt(), None)
    figures = {
        "load": load,
        "image_p50_ms": 1e3 * np.quantile(image_s, 0.5),
        "image_p99_ms": 1e3 * np.quantile(image_s, 0.99),
        "wheel_p50_ms": 1e3 * np.quantile(wheel_s, 0.5),
        "wheel_p99_ms": 1e3 * np.quantile(wheel_s, 0.99),
        "in_estimate_p50_ms": 1e3 * np.quantile(in_estimate_s, 0.5),
        "in_estimate_p99_ms": 1e3 * np.quantile(in_estimate_s, 0.99),
        "in_estimate_most_ms": 1e3 * max(in_estimate_s),
    }
    benchmark.extra_info |= {name: round(float(value), 3) for name, value in figures.items()}
    assert len(image_s) > 4 * DRIVEN_S  # every other one: the vehicle has to have moved a quarter of a metre
    if benchmark.enabled:  # tests in parallel would distort the time
        assert problems == ()
        assert load < LOAD_ALLOWED
        assert figures["image_p99_ms"] < 1e3 * IMAGE_ALLOWED_S
        assert figures["wheel_p99_ms"] < 1e3 * WHEEL_ALLOWED_S


def in_real_time(recording):
    """Samples of a drive at 2 m/s in order of time, each with its sensor's name and what hands it over."""
    wheel, frames = recording.wheel, [frame.image for frame in recording.camera.frames(lambda time_s: time_s < 10.0)]
    frames = [image for image in frames if image is not None]
    sound, rate = soundfile.read(recording.sound.path, dtype="float32")
    names = [name for name in wheel.columns if name != "time_s"]
    poses = np.arange(0.0, DRIVEN_S, 1.0 / POSE_HZ).tolist()
    given = [(at, "pose", lambda live, t=at: live.pose(t, 2.0 * t, 0.0, 0.0)) for at in poses]
    for at in np.arange(0.0, DRIVEN_S, 1.0 / WHEEL_HZ).tolist():
        row = {name: float(np.interp(at, wheel["time_s"], wheel[name])) for name in names}
        given.append((at, "wheel", lambda live, t=at, row=row: live.wheel(t, **(row | {"travel_speed_m_s": 0.26}))))
    for number, at in enumerate(np.arange(0.05, DRIVEN_S, 1.0 / IMAGE_HZ).tolist()):
        image = frames[number % len(frames)]
        given.append((at, "image", lambda live, t=at, image=image: live.image(t, image)))
    for first in range(0, int(DRIVEN_S * rate) - BLOCK, BLOCK):
        block = sound[first : first + BLOCK]
        given.append((
            (first + BLOCK) / rate, "sound", lambda live, t=first / rate, block=block: live.sound(t, block, rate)
        ))  # fmt: skip
    return sorted(given, key=lambda each: each[0])


def resident_bytes() -> int:
    with open("/proc/self/status", encoding="ascii") as status:
        return next(int(line.split()[1]) * 1024 for line in status if line.startswith("VmRSS"))


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="reads the memory that is in use from /proc")
def test_memory_does_not_grow_with_the_drive(short_drive, tmp_path, monkeypatch):
    """An hour's poses and wheel rows at 25 Hz, round and round a field, as fast as they are taken."""
    monkeypatch.setattr(checkpoints, "PERIOD_S", 0.1)
    recording = read_recording(short_drive)
    live = LiveTraverse(tmp_path / "t.db", recording.vehicle, site="field")
    names = [name for name in recording.wheel.columns if name not in ("time_s", "travel_speed_m_s")]
    first = {name: float(recording.wheel[name][0]) for name in names}
    used = []
    for number in range(90_000):
        time_s, angle = 0.04 * number, 0.002 * number
        live.pose(time_s, 20.0 * np.cos(angle), 20.0 * np.sin(angle), angle + np.pi / 2)
        live.wheel(time_s, travel_speed_m_s=1.0, **first)
        if number % 10_000 == 9_999:
            used.append(resident_bytes())
    live.__exit__(KeyboardInterrupt, KeyboardInterrupt(), None)
    assert max(used[3:]) - used[2] < 20 * 2**20  # the rows of 40 minutes as Python keeps them are 100 MiB
