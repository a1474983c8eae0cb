"""A drive whose database, disk, clock, places or senses fail."""

from __future__ import annotations

import sqlite3
import threading

import numpy as np
import pytest
from bevameter import InputError, LiveTraverse, TerrainDatabase
from bevameter.database import schema
from bevameter.framework.live import checkpoints
from bevameter.framework.live.clock import DriveClock
from bevameter.framework.live.events import Trouble
from bevameter.vision.sense import Vision
from live_drives import begun, rover


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


def test_a_drive_whose_block_cannot_store_it_is_resumed_at_once(tmp_path, monkeypatch):
    """In the same process."""
    monkeypatch.setattr(schema, "BUSY_TIMEOUT_S", 0.1)
    path = tmp_path / "t.db"
    TerrainDatabase(path).make()
    holder = sqlite3.connect(path, isolation_level=None)
    live = LiveTraverse(path, rover(), site="field")
    for time_s in (0.0, 1.0):
        live.pose(time_s, time_s, 0.0, 0.0)
    holder.execute("BEGIN IMMEDIATE")
    with pytest.raises(InputError, match="locked"), live:
        pass
    holder.close()
    with LiveTraverse(path, rover(), site="field", resume=live.journal) as again:
        assert again.close().distance_m == pytest.approx(1.0)  # for its summary; the block closes it no second time


def test_a_journal_that_is_damaged_is_refused(tmp_path):
    live = LiveTraverse(tmp_path / "t.db", rover(), site="field")
    for number in range(500):
        live.pose(0.1 * number, 0.1 * number, 0.0, 0.0)
    live.__exit__(KeyboardInterrupt, None, None)
    data = live.journal.read_bytes()
    at = data.index(b"c 0.npy") + 2000
    live.journal.write_bytes(data[:at] + bytes(100) + data[at + 100 :])
    for _ in range(2):  # the first try leaves it closed
        with pytest.raises(InputError, match=f"{live.journal}: damaged: .*c 0.npy"):
            LiveTraverse(tmp_path / "t.db", rover(), site="field", resume=live.journal)
    live.journal.write_bytes(data)
    with LiveTraverse(tmp_path / "t.db", rover(), site="field", resume=live.journal) as again:
        assert again.close().distance_m == pytest.approx(49.8)  # the last pose waited for late ones


def test_a_full_disk_loses_nothing_that_fits_into_memory(tmp_path, monkeypatch):
    told = []
    live = LiveTraverse(tmp_path / "t.db", rover(), site="field")
    live.subscribe(told.append)
    written, write = live._drive._checkpoints, live._drive.journal.write

    def full(parts, state):
        raise InputError(live.journal, "database or disk is full")

    live.pose(0.0, 0.0, 0.0, 0.0)
    written.take()
    monkeypatch.setattr(live._drive.journal, "write", full)
    for time_s in range(1, 4):
        live.pose(time_s, time_s, 0.0, 0.0)
        written.take()
    assert "all is kept in memory" in live.problems[-1]
    monkeypatch.setattr(live._drive.journal, "write", write)
    live.pose(4.0, 4.0, 0.0, 0.0)
    written.take()
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


def test_a_clock_that_was_set_back_is_known_to_a_drive_that_is_resumed(tmp_path):
    """The wheels' samples are needed from long before; time stamps go on as they were."""
    live = LiveTraverse(tmp_path / "t.db", rover(), site="field")
    stamps = [*np.arange(1000.0, 1010.0, 0.1), *np.arange(20.0, 40.0, 0.1)]
    for number, stamp_s in enumerate(stamps[:200]):
        live.pose(stamp_s, 0.1 * number, 0.0, 0.0)
        if number < 20:
            live.wheel(stamp_s, load_N=500.0)
    live.__exit__(KeyboardInterrupt, None, None)
    again = LiveTraverse(tmp_path / "t.db", rover(), site="field", resume=live.journal)
    assert again.needed_s == pytest.approx(1001.9)
    for number, stamp_s in enumerate(stamps[200:], start=200):
        again.pose(stamp_s, 0.1 * number, 0.0, 0.0)
    assert again.problems == ("the clock jumped back by 989.9 s at 1009.9 s; times go on from there",)
    assert again.close().distance_m == pytest.approx(29.9)


def test_a_sensor_whose_samples_are_late_moves_no_clock():
    """It falls eight seconds behind, catches up at twice the speed, and has its own times again."""
    clock, made = DriveClock(), {}
    for step in range(400):
        time_s = 0.1 * step
        clock.on_one_clock("pose", time_s, None)
        assert clock.newest_s == pytest.approx(time_s)
        late_s = float(np.interp(time_s, [10.0, 10.1, 20.0, 28.0], [0.0, 8.0, 8.0, 0.0]))
        for shifted_s, stamp_s in clock.on_one_clock("wheel", time_s - late_s, time_s - late_s):
            made[stamp_s] = shifted_s - stamp_s
    shifts = np.array([made[stamp_s] for stamp_s in sorted(made)])
    assert np.abs(shifts).max() <= 8.0
    assert shifts[-1] == 0.0
    assert len(clock.jumps) == 1


def test_sensors_with_clocks_of_their_own_end_up_on_one(tmp_path):
    """Each is put on it once, not again and again."""
    live = LiveTraverse(tmp_path / "t.db", rover(), site="field")
    for time_s in np.arange(0.0, 30.0, 0.1).tolist():
        live.pose(time_s, time_s, 0.0, 0.0)
        live.wheel(1e6 + time_s, load_N=500.0)
        live.imu(1e9 + time_s, wx=0.0, wy=0.0, wz=0.0, ax=0.0, ay=0.0, az=9.81)
    assert [problem.split(" at ")[0] for problem in live.problems if "clock" in problem] == [
        "wheel has a clock of its own", "imu has a clock of its own"
    ]  # fmt: skip
    summary = live.close()
    assert summary.distance_m == pytest.approx(29.9)
    assert summary.duration_s == pytest.approx(29.9)


def test_a_checkpoint_that_fails_is_told_and_the_next_is_taken(tmp_path, monkeypatch):
    monkeypatch.setattr(checkpoints, "PERIOD_S", 0.02)
    live, told = LiveTraverse(tmp_path / "t.db", rover(), site="field"), threading.Event()
    settle, failures = live._drive._checkpoints._settle, iter(["out of order"])
    live.subscribe(lambda event: told.set() if "out of order" in event.text else None)

    def fails_once():
        for text in failures:
            raise RuntimeError(text)
        settle()

    monkeypatch.setattr(live._drive._checkpoints, "_settle", fails_once)
    assert told.wait(5.0)
    for time_s in (0.0, 1.0):
        live.pose(time_s, time_s, 0.0, 0.0)
    assert live.close().distance_m == pytest.approx(1.0)
    assert live.problems == ()


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


def test_a_camera_that_is_lost_and_back_is_told(live_recording, small_models, tmp_path):
    live = begun(live_recording, small_models, tmp_path / "t.db")
    images = iter([frame.image for frame in live_recording.camera.frames(lambda time_s: time_s < 1.0)])
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


def test_a_sense_that_fails_stops_nobody(live_recording, small_models, tmp_path, monkeypatch):
    def observe(self, *given):
        yield from ()
        raise RuntimeError("out of order")

    monkeypatch.setattr(Vision, "observe", observe)
    live = begun(live_recording, small_models, tmp_path / "t.db")
    image = np.zeros((480, 640, 3), np.uint8)
    for tenth in range(100):
        live.pose(0.1 * tenth, 0.1 * tenth, 0.0, 0.0)
        live.image(0.1 * tenth, image)
    assert live.problems == ("camera: it observed no more: RuntimeError: out of order",)
    assert live.trust()["vision"].reasons == ("RuntimeError: out of order",)
    assert live.close().distance_m == pytest.approx(9.9)
