"""The main job while driving: what a drive that is handed over sample by sample gives, against `run_traverse`."""

from __future__ import annotations

import random
import sqlite3
import threading
import time
from dataclasses import dataclass, field, replace

import numpy as np
import pytest
from bevameter import InputError, LiveTraverse, TerrainDatabase, Vehicle, Wheel, read_recording, run_traverse
from bevameter.database import schema
from bevameter.database.posterior import class_soils
from bevameter.database.snapshot import Snapshot
from bevameter.framework.default_models import Models
from bevameter.framework.live.events import GroundChanged, Trouble
from bevameter.framework.live.journal import unfinished
from bevameter.framework.live.log import WheelRow
from bevameter.framework.live.soil import SoilWatch
from bevameter.framework.live.track import LiveTrack
from bevameter.vision.sense import Vision
from forked import forked, heard
from live_drive import drive_on, out_of_order, replay, samples, streams
from live_drives import assert_same


@pytest.fixture(scope="module")
def recording(short_drive):
    return read_recording(short_drive)


@pytest.fixture(scope="module")
def stored(recording, small_models, tmp_path_factory):
    """The drive that `run_traverse` stores, and its summary."""
    path = tmp_path_factory.mktemp("run") / "t.db"
    summary = run_traverse(recording, path, models=small_models)
    with TerrainDatabase(path) as database:
        return database.drives()[0], summary


def begun(recording, models, path, **options) -> LiveTraverse:
    return LiveTraverse(
        path, recording.vehicle, models=models, site=recording.site, name=recording.name,
        start_time=recording.start_time, lossless=True, horizon_s=0.05, **options,
    )  # fmt: skip


@dataclass
class Seen:
    """What a drive said of itself while it went on."""

    events: list = field(default_factory=list)
    ahead: list = field(default_factory=list)
    trust: list = field(default_factory=list)
    soils: list = field(default_factory=list)
    snapshot: Snapshot | None = None


def wait_for_soil(live, most_s=2.0):
    """Leave the threads the time that they have where a drive is not replayed as fast as possible."""
    until = time.monotonic() + most_s
    while time.monotonic() < until:
        soil, ground = live.soil(), live.under_wheels()
        if (
            soil is not None
            and ground is not None
            and min(soil.time_s, ground.time_s) > live._drive.intake.clock_s - 4.0
        ):
            return
        time.sleep(0.02)


@pytest.fixture(scope="module")
def driven(recording, small_models, tmp_path_factory):
    """The drive that `LiveTraverse` stores, its summary, and what it said on the way; samples come up to 40 ms late."""
    path, seen = tmp_path_factory.mktemp("live") / "t.db", Seen()
    live = begun(recording, small_models, path)
    live.subscribe(seen.events.append)
    for number, hand_over in enumerate(out_of_order(samples(recording), 0.04)):
        hand_over(live)
        if number % 200 == 199:
            wait_for_soil(live)
            seen.ahead.append(live.ahead())
            seen.trust.append(live.trust())
            seen.soils.append(live.soil())
            live.snapshot()
    assert live.problems == ()
    summary = live.close(recording.digest)
    seen.snapshot = live.snapshot()
    with TerrainDatabase(path) as database:
        return database.drives()[0], summary, seen, database.snapshot()


@pytest.fixture(scope="module")
def replayed(driven):
    return driven[:2]


def test_a_replay_gives_the_observations_of_a_run(stored, replayed):
    (one, summary), (other, again) = stored, replayed
    assert len(one.terrain) > 300
    assert other.id == one.id
    assert_same(one, other)
    for a, b in zip(summary.senses, again.senses, strict=True):
        assert (a.absent, a.items, dict(a.said), dict(a.closed)) == (b.absent, b.items, dict(b.said), dict(b.closed))
    assert again.problems == summary.problems
    assert again.track_m == pytest.approx(summary.track_m)


def test_changes_of_the_ground_are_told_where_they_are(driven):
    _, _, seen, _ = driven
    changes = [each for each in seen.events if isinstance(each, GroundChanged)]
    assert [each.after for each in changes] == ["sand", "loam", "grass"]
    assert [each.before for each in changes] == ["", "sand", "loam"]
    assert [each.time_s for each in changes] == pytest.approx([0.0, 32.0, 64.0], abs=3.0)  # a metre
    assert all(each.probability >= 2.0 / 3.0 for each in changes)


def test_the_ground_ahead_is_known_and_each_sense_is_trusted_or_not(driven):
    _, _, seen, _ = driven
    known = [(~belief.unknown).mean() for belief in seen.ahead if len(belief)]
    assert np.median(known) > 0.2
    assert {name for belief in seen.ahead for name in belief.labels()} >= {"sand", "loam"}
    said = [trust["audio"] for trust in seen.trust]
    assert any(each.is_trusted for each in said)
    assert any(not each.is_trusted and each.reasons for each in said)


def test_the_soil_in_progress_is_told_with_its_interval_and_what_would_help(driven):
    drive, _, seen, _ = driven
    found = [soil for soil in seen.soils if soil is not None and soil.n >= 100]
    assert {soil.class_name for soil in found} == {"sand", "loam"}
    for soil in found:
        final = next(each for each in drive.soils if each.estimate is not None and max(
            each.class_probabilities, key=each.class_probabilities.get) == soil.class_name)  # fmt: skip
        phi, whole = soil.parameters["phi_rad"], final.estimate.parameters["phi_rad"]
        assert phi.low < whole.high
        assert whole.low < phi.high
    fast = [soil for soil in seen.soils if soil is not None and soil.reason.startswith("too fast")]
    assert all(soil.advice.startswith("drive more slowly") for soil in fast)
    assert fast


def test_the_snapshot_on_the_way_is_that_of_the_database_in_the_end(driven):
    """But for looks that are laid elsewhere, and weighed otherwise, once the whole drive is known."""
    _, _, seen, stored = driven
    here, there = seen.snapshot, stored
    common, a, b = np.intersect1d(here.cells.key, there.cells.key, return_indices=True)
    assert len(common) > 0.97 * len(there.cells.key)
    assert here.class_names == there.class_names
    both = np.isfinite(here.cells.probability[a]).all(axis=1) & np.isfinite(there.cells.probability[b]).all(axis=1)
    same = here.cells.probability[a][both].argmax(axis=1) == there.cells.probability[b][both].argmax(axis=1)
    assert same.mean() > 0.98


@pytest.mark.parametrize(("share", "departs"), [(1.0, False), (2.5, True)])
def test_a_soil_that_is_not_that_of_its_class_is_told(recording, stored, share, departs):
    """Sand that bears 1 / `share` of what is stored of it."""
    sand = next(each for each in stored[0].soils if each.estimate is not None)
    c, tan_phi = share * sand.estimate.mean_c_tan_phi
    known = replace(sand, estimate=replace(sand.estimate, mean_c_tan_phi=np.array([c, tan_phi])))
    places = [replace(known, start_s=1e3 * number, end_s=1e3 * number + 20.0) for number in range(8)]
    told = []
    watch = SoilWatch(recording.vehicle, class_soils(places), told.append)
    watch.begin()
    watch.begin_stretch(0.0, "sand")
    names = [name for name in recording.wheel.columns if name != "time_s"]
    for row, time_s in enumerate(recording.wheel["time_s"][:100].tolist()):
        watch.put(time_s, WheelRow("", {name: float(recording.wheel[name][row]) for name in names}))
    watch.end()
    assert [each.class_name for each in told] == ["sand"] * departs
    if departs:
        assert told[0].strength_share == pytest.approx(1.0 / share, abs=0.15)
    assert watch.now.n > 40


@pytest.fixture(scope="module")
def resumed(recording, small_models, tmp_path_factory):
    """The drive that was left on its way, and resumed."""
    path = tmp_path_factory.mktemp("resumed") / "t.db"
    live = begun(recording, small_models, path)
    replay(recording, live, to_s=34.0)
    live.__exit__(KeyboardInterrupt, KeyboardInterrupt(), None)
    again = begun(recording, small_models, path, resume=live.journal)
    assert 30.0 < again.needed_s < 34.0
    replay(recording, again, from_s=again.needed_s)
    again.close(recording.digest)
    assert not live.journal.exists()
    with TerrainDatabase(path) as database:
        return database.drives()[0]


def test_a_drive_that_was_left_and_resumed_is_that_of_a_run(stored, resumed):
    assert resumed.id == stored[0].id
    assert_same(stored[0], resumed)


def test_journals_of_other_drives_are_named_and_not_mixed_up(tmp_path):
    path = tmp_path / "t.db"
    first = LiveTraverse(path, rover(), site="field")
    first.__exit__(KeyboardInterrupt, KeyboardInterrupt(), None)
    assert unfinished(path) == (first.journal,)
    second = LiveTraverse(path, rover(), site="field")
    assert str(first.journal) in second.problems[0]
    with pytest.raises(InputError, match="locked"):
        LiveTraverse(path, rover(), site="field", resume=second.journal)
    with pytest.raises(InputError, match="a drive of another cell_size_m"):
        LiveTraverse(path, rover(), site="field", resume=first.journal, cell_size_m=0.4)
    with pytest.raises(InputError, match="no such file"):
        LiveTraverse(path, rover(), site="field", resume=tmp_path / "none")


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(2))
def test_a_drive_that_is_killed_again_and_again_is_that_of_a_run_in_the_end(
    stored, short_drive, small_models, tmp_path, seed
):
    path, rng, kills = tmp_path / "t.db", random.Random(seed), 0
    while True:
        process, connection = forked(drive_on, short_drive, small_models, path)
        assert heard(connection) == "begins"
        if connection.poll(rng.uniform(1.0, 4.0) if kills < 3 else 120.0):
            assert heard(connection) == "stored"
            break
        process.kill()
        process.join()
        kills += 1
    assert kills
    assert unfinished(path) == ()
    with TerrainDatabase(path) as database:
        (drive,) = database.drives()
    assert drive.id == stored[0].id
    assert_same(stored[0], drive)


def test_a_database_that_is_locked_is_written_when_it_is_free(tmp_path, monkeypatch):
    monkeypatch.setattr(schema, "BUSY_TIMEOUT_S", 0.1)
    path = tmp_path / "t.db"
    TerrainDatabase(path).make()
    live = LiveTraverse(path, rover(), site="field")
    for time_s in (0.0, 1.0):
        live.pose(time_s, time_s, 0.0, 0.0)
    holder = sqlite3.connect(path, isolation_level=None)
    holder.execute("BEGIN IMMEDIATE")
    with pytest.raises(InputError, match=f"locked; the drive is kept in {live.journal}"):
        live.close()
    assert live.journal.exists()
    holder.close()
    live.close()
    assert not live.journal.exists()
    with TerrainDatabase(path) as database:
        assert len(database.drives()) == 1


def test_a_full_disk_loses_nothing_that_fits_into_memory(tmp_path, monkeypatch):
    told = []
    live = LiveTraverse(tmp_path / "t.db", rover(), site="field")
    live.subscribe(told.append)
    checkpoints, write = live._drive._checkpoints, live._drive.journal.write

    def full(parts, state):
        raise InputError(live.journal, "database or disk is full")

    live.pose(0.0, 0.0, 0.0, 0.0)
    checkpoints.take()
    monkeypatch.setattr(live._drive.journal, "write", full)
    for time_s in range(1, 4):
        live.pose(time_s, time_s, 0.0, 0.0)
        checkpoints.take()
    assert "all is kept in memory" in live.problems[-1]
    monkeypatch.setattr(live._drive.journal, "write", write)
    live.pose(4.0, 4.0, 0.0, 0.0)
    checkpoints.take()
    assert live.problems == ()
    assert live.close().distance_m == pytest.approx(4.0)
    assert [type(each) for each in told] == [Trouble, Trouble]  # events are told in a thread, which has ended
    assert told[1].text == "checkpoints are written again"


def stamped(tmp_path, stamps) -> tuple[LiveTraverse, float]:
    """A drive at 1 m/s whose poses have such times; give it, and how far it went."""
    live = LiveTraverse(tmp_path / "t.db", rover(), site="field")
    for number, stamp_s in enumerate(stamps):
        live.pose(stamp_s, 0.1 * number, 0.0, 0.0)
    return live, live.close().distance_m


def test_a_clock_that_is_set_back_costs_nothing(tmp_path):
    live, way = stamped(tmp_path, [*np.arange(1000.0, 1010.0, 0.1), *np.arange(20.0, 30.0, 0.1)])
    assert way == pytest.approx(19.9)
    assert live.problems == ("the clock jumped back by 989.9 s at 1009.9 s; times go on from there",)


def test_a_pause_is_no_jump_and_a_wrong_stamp_leaves_no_trace(tmp_path):
    stamps = np.concatenate([np.arange(0.0, 10.0, 0.1), np.arange(60.0, 70.0, 0.1)])
    stamps[[30, 150]] = 1e6, -50.0
    live, way = stamped(tmp_path, stamps)
    assert way == pytest.approx(19.9)
    assert live.problems == ("2 samples with times far from all others were left out",)


def test_places_that_no_vehicle_gets_to_are_left_out_and_a_new_place_is_believed(tmp_path):
    live = LiveTraverse(tmp_path / "t.db", rover(), site="field")
    for number in range(100):
        live.pose(0.1 * number, 0.1 * number + (500.0 if number == 40 else 0.0), 0.0, 0.0)
    assert live.problems == ("1 places were left out, no ground vehicle gets there",)
    assert live.close().distance_m == pytest.approx(9.9)


def test_all_sensors_pause_together_and_lose_nothing(tmp_path):
    live = LiveTraverse(tmp_path / "t.db", rover(), site="field")
    for number, stamp_s in enumerate([*np.arange(0.0, 10.0, 0.1), *np.arange(60.0, 60.15, 0.1)]):
        live.pose(stamp_s, 0.1 * number, 0.0, 0.0)
        live.wheel(stamp_s, load_N=500.0, slip=0.1)
        live.wheel(stamp_s + 0.05, load_N=500.0, slip=0.1)
    assert live.close().distance_m == pytest.approx(10.1)
    assert live.problems == ()


def test_a_camera_that_is_lost_and_back_is_told(recording, small_models, tmp_path):
    live = begun(recording, small_models, tmp_path / "t.db")
    images = iter([frame.image for frame in recording.camera.frames(lambda time_s: time_s < 1.0)])
    said = []
    for tenth in range(80):
        live.pose(0.1 * tenth, 0.1 * tenth, 0.0, 0.0)
        live.wheel(0.1 * tenth, travel_speed_m_s=1.0)
        if tenth < 10 or tenth >= 60:
            live.image(0.1 * tenth, next(images, None))
        said.append(live.trust()["vision"].reasons)
    live.__exit__(KeyboardInterrupt, KeyboardInterrupt(), None)
    lost = [bool(reasons) and reasons[0].startswith("nothing came for") for reasons in said]
    assert lost == [False] * 20 + [True] * 40 + [False] * 20


def test_wheels_and_inertial_sensor_make_the_tables_of_a_recording(tmp_path):
    names = ("left", "right")
    wheels = tuple(
        Wheel(radius_m=0.2, width_m=0.1, name=name, position_m=(0.0, y))
        for name, y in zip(names, (0.5, -0.5), strict=True)
    )
    live = LiveTraverse(tmp_path / "t.db", Vehicle(wheels=wheels), site="field")
    t = np.arange(0.0, 8.0, 0.01)
    for time_s in t.tolist():
        live.imu(time_s, wx=0.0, wy=0.1, wz=0.0, ax=np.sin(40.0 * time_s), ay=0.0, az=9.81)
        for name in names:
            live.wheel(time_s, wheel=name, load_N=500.0 + time_s, wheel_speed_rad_s=5.0, travel_speed_m_s=0.9)
    live._drive.end()
    made = live._drive._made(None)
    assert made.wheel.wheel[:4].tolist() == ["left", "right", "left", "right"]
    np.testing.assert_allclose(made.wheel["load_N"], np.repeat(500.0 + t, 2))
    np.testing.assert_allclose(made.wheel["slip"], 0.1)
    np.testing.assert_allclose(made.vibration.time_s, t, atol=1e-9)
    np.testing.assert_allclose(made.vibration.channels[:, 3], np.sin(40.0 * t), atol=1e-6)
    assert set(made.vibration.wheel_names) == {"speed_left", "speed_right"}


def test_a_sense_that_fails_stops_nobody(recording, small_models, tmp_path, monkeypatch):
    def observe(self, *given):
        yield from ()
        raise RuntimeError("out of order")

    monkeypatch.setattr(Vision, "observe", observe)
    live = begun(recording, small_models, tmp_path / "t.db")
    image = np.zeros((480, 640, 3), np.uint8)
    for tenth in range(100):
        live.pose(0.1 * tenth, 0.1 * tenth, 0.0, 0.0)
        live.image(0.1 * tenth, image)
    assert live.problems == ("camera: it observed no more: RuntimeError: out of order",)
    assert live.trust()["vision"].reasons == ("RuntimeError: out of order",)
    assert live.close().distance_m == pytest.approx(9.9)


def test_sensors_hand_over_from_threads_of_their_own(recording, tmp_path):
    live = begun(recording, Models({}, {}), tmp_path / "t.db")
    began, faults = time.monotonic(), []

    def hand_over(stream):
        try:
            for time_s, sample in stream:
                if time_s > 20.0:
                    return
                time.sleep(max(began + time_s / 20.0 - time.monotonic(), 0.0))
                sample(live)
        except Exception as error:
            faults.append(error)

    threads = [threading.Thread(target=hand_over, args=(each,)) for each in streams(recording, 0.0)]
    for each in threads:
        each.start()
    while any(each.is_alive() for each in threads):
        live.ahead(), live.trust(), live.soil(), live.snapshot(), live.problems
    assert faults == []
    made = live.close()
    assert made.duration_s == pytest.approx(20.0, abs=0.1)


def test_nothing_is_not_stored(tmp_path):
    live = LiveTraverse(tmp_path / "t.db", rover(), site="field")
    with pytest.raises(InputError, match="no sample came"):
        live.close()
    assert list(tmp_path.iterdir()) == []
    with pytest.raises(InputError, match="horizon_s"):
        LiveTraverse(tmp_path / "t.db", rover(), site="field", horizon_s=-1.0)


def rover(**parts) -> Vehicle:
    return Vehicle(wheels=(Wheel(radius_m=0.2, width_m=0.1),), **parts)


def test_samples_that_come_too_late_are_left_out_and_counted(tmp_path):
    live = LiveTraverse(tmp_path / "t.db", rover(), site="field", horizon_s=0.5)
    for time_s in (0.0, 0.2, 0.1, 2.0, 1.6, 3.0, 1.2, 4.0):
        live.pose(time_s, time_s, 0.0, 0.0)
    assert live.problems == ("1 samples of pose came more than 0.5 s late and were left out",)
    summary = live.close()
    assert summary.distance_m == pytest.approx(4.0)
    assert "1 samples of pose" in summary.problems[0]


@pytest.mark.parametrize(
    ("hand_over", "said"),
    [
        (lambda live: live.pose(0.0, float("nan"), 0.0, 0.0), "pose, x: nan"),
        (lambda live: live.image(0.0, np.zeros((4, 4))), "image: float64 of shape \\(4, 4\\)"),
        (lambda live: live.sound(0.0, np.zeros(8), 8.5), "sound: 8.5 Hz"),
        (lambda live: live.wheel(0.0, weight_N=1.0), "wheel: channel weight_N"),
        (lambda live: live.wheel(0.0, load_N="much"), "wheel, load_N: 'much'"),
        (lambda live: live.wheel(0.0, wheel="fifth", load_N=1.0), "wheel: 'fifth' .expected one of wheel"),
    ],
)
def test_what_is_no_sample_is_refused(tmp_path, hand_over, said):
    with LiveTraverse(tmp_path / "t.db", rover(), site="field") as live:
        with pytest.raises(InputError, match=said):
            hand_over(live)
        live.pose(0.0, 0.0, 0.0, 0.0)
        live.pose(1.0, 1.0, 0.0, 0.0)
    with pytest.raises(InputError, match="closed"):
        live.pose(2.0, 0.0, 0.0, 0.0)


def test_places_wait_for_the_pose_that_follows_but_not_for_ever():
    track = LiveTrack()
    for time_s in np.arange(11) / 10:
        track.go_on(time_s)
        track.add_pose(time_s, 2 * time_s, 0.0, 0.0)
    track.add_speed(0.0, 2.0)
    track.add_speed(1.2, 2.0)
    assert track.covers(0.65)
    assert not track.covers(1.1)
    assert np.isnan(track.place_at(np.array([1.1]))[0]).all()
    track.go_on(2.5)  # no pose for more than a second: a hole
    assert track.covers(1.1)
    assert np.isnan(track.place_at(np.array([1.1]))[0]).all()
    track.add_pose(2.6, 5.2, 0.0, 0.0)
    assert track.place_at(np.array([0.65, 1.1]))[0] == pytest.approx([1.3, np.nan], nan_ok=True)
