"""MCAP files that are followed while they grow, against `run_traverse` on the finished file."""

from __future__ import annotations

import math
import os
import threading

import numpy as np
import pytest
from bevameter import InputError, TerrainDatabase, Vehicle, Wheel, read_recording, run_traverse
from bevameter.framework.core.recording.bag_files import BagFile
from bevameter.framework.core.recording.bag_increments import BagIncrements, look_at
from bevameter.framework.core.vehicle import load_vehicle
from bevameter.framework.default_models import Models
from bevameter.framework.live.following import Following
from bevameter.framework.live.log import WheelRow, table_of_rows, wheel_of
from every_bag import Drive
from forked import forked, heard
from live_drives import assert_same
from mcap_drive import grow, header, make, write, write_mcap
from robot_bag import VEHICLE_TOML, RobotBag, drive

VEHICLE = Vehicle(wheels=(Wheel(radius_m=0.2, width_m=0.1),))


def samples_of(path, vehicle):
    """All samples of a bag by stream, the recording, and what makes them."""
    bag = BagFile(path)
    messages = bag.messages()
    beginning = look_at(messages, path, bag.problems, vehicle, None)
    increments, found = BagIncrements(beginning), {}
    for message in [*beginning.held, *messages]:
        for sample in increments.take(message):
            found.setdefault(sample.stream, []).append(sample)
    for sample in increments.end():
        found.setdefault(sample.stream, []).append(sample)
    return found, read_recording(path, vehicle=vehicle), increments


@pytest.mark.parametrize(
    "kind",
    [{}, {"effort": False, "mirrored": (1.0, -1.0, 1.0, -1.0), "sinkage": True}, {"odometry": "wheels"}],
    ids=["effort", "mirrored", "odometry of the wheels"],
)
def test_rows_of_wheels_are_those_of_the_whole_bag(kind, tmp_path):
    """Topics of several rates, the attitude interpolated, mirrored joints, and an odometry that is no travel speed."""
    (tmp_path / "vehicle.toml").write_text(VEHICLE_TOML)
    vehicle = load_vehicle(tmp_path / "vehicle.toml")
    path = RobotBag(drive(15.0), **kind).write(tmp_path / "bag")
    found, recording, increments = samples_of(path, vehicle)
    rows = sorted(((each.time_s, WheelRow(*each.values)) for each in found["wheel"]), key=lambda row: row[0])
    table, whole = wheel_of([dict(columns_of(rows))], vehicle), recording.wheel
    assert set(table.columns) == set(whole.columns)
    order = [np.lexsort((each.wheel.astype(str), each["time_s"])) for each in (table, whole)]
    for name in whole.columns:
        a, b = (each[name][rows] for each, rows in zip((table, whole), order, strict=True))
        np.testing.assert_allclose(a, b, rtol=0, atol=1e-9, equal_nan=True)
    assert len(found["pose"]) == len(recording.pose.time_s)
    assert increments.digest == recording.digest
    assert increments.problems == ()


def columns_of(rows):
    table = table_of_rows(rows)
    return {**table.columns, "wheel": table.wheel.astype(str)}


def test_images_and_sound_are_those_of_the_whole_bag(rng, tmp_path):
    Drive(rng, ros1=False).write_mcap(tmp_path / "drive.mcap")
    found, recording, _ = samples_of(tmp_path / "drive.mcap", VEHICLE)
    frames = list(recording.camera.frames())
    assert [each.time_s for each in found["image"]] == [each.time_s for each in frames]
    assert all(np.array_equal(a.values[0], b.image) for a, b in zip(found["image"], frames, strict=True))
    sound = np.concatenate([each.values[0] for each in found["sound"]])
    blocks = np.concatenate([each.samples for each in recording.sound.blocks(0.1, 0.1)])
    np.testing.assert_array_equal(sound[: len(blocks), 0], blocks)


@pytest.fixture
def whole(rng, tmp_path):
    """A drive of four seconds, in chunks of 20 kB; beside it the topic map that makes its wrench a wheel's."""
    path = tmp_path / "whole.mcap"
    (tmp_path / "topics.toml").write_text('name = "drive"\n[wheel]\ntopic = "/hub"\n')
    Drive(rng, ros1=False).write_mcap(path)
    return path


def followed(path, database, *, vehicle=VEHICLE, models=None, idle_s=math.inf):
    """Follow a file into a database; give what did so, and the summary."""
    following = Following(path, vehicle=vehicle, topics=map_beside(path), idle_s=idle_s)
    live = following.begin(database, models=models or Models({}, {}), site="field")
    following.hand_over(live)
    return following, following.close(live)


def map_beside(path):
    return path.parent / "topics.toml" if (path.parent / "topics.toml").is_file() else None


def run(path, database, *, vehicle=VEHICLE, models=None):
    recording = read_recording(path, vehicle=vehicle, topics=map_beside(path))
    return run_traverse(recording, database, models=models or Models({}, {}), site="field")


def stored_by_run(path, database, **options):
    run(path, database, **options)
    return drive_in(database)


def drive_in(path):
    with TerrainDatabase(path) as database:
        (found,) = database.drives()
    return found


@pytest.mark.parametrize("is_pipe", [False, True], ids=["file", "pipe"])
def test_a_file_that_another_process_writes_is_a_run_on_it(whole, is_pipe, tmp_path):
    """Written in pieces of 3001 bytes, so that records are cut anywhere."""
    path = tmp_path / "growing.mcap"
    os.mkfifo(path) if is_pipe else path.touch()
    process, connection = forked(grow, whole, path, 3001, 0.02)
    following, summary = followed(path, tmp_path / "live.db")
    assert heard(connection) == "begun"
    process.join(10.0)
    assert process.exitcode == 0  # of a pipe, too, all was read
    assert following.is_whole
    assert summary.problems == run(whole, tmp_path / "run.db").problems
    same = drive_in(tmp_path / "run.db")
    assert drive_in(tmp_path / "live.db").id == same.id
    assert len(same.soils)
    assert_same(drive_in(tmp_path / "live.db"), same)
    assert run(whole, tmp_path / "live.db").known


def test_a_file_that_was_cut_off_is_followed_as_far_as_it_goes(whole, tmp_path):
    """In the middle of a record: nothing more comes."""
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(whole.read_bytes()[: whole.stat().st_size * 2 // 3])
    following, summary = followed(cut, tmp_path / "live.db", idle_s=0.2)
    assert not following.is_whole
    said = next(problem for problem in summary.problems if problem.startswith("cut.mcap: cut off or damaged"))
    assert said.endswith("try `mcap recover`")
    assert 1.0 < summary.duration_s < 3.9
    same = stored_by_run(cut, tmp_path / "run.db")
    assert_same(drive_in(tmp_path / "live.db"), same)
    assert drive_in(tmp_path / "live.db").id == same.id


def test_a_damaged_chunk_ends_the_drive_and_is_said(whole, tmp_path):
    damaged = tmp_path / "damaged.mcap"
    data = bytearray(whole.read_bytes())
    at = len(data) * 2 // 3
    data[at : at + 64] = bytes(64)
    damaged.write_bytes(data)
    _, summary = followed(damaged, tmp_path / "live.db", idle_s=0.2)
    assert any("cut off or damaged" in problem for problem in summary.problems)
    assert_same(drive_in(tmp_path / "live.db"), stored_by_run(damaged, tmp_path / "run.db"))


@pytest.mark.parametrize(
    ("content", "said"),
    [(b"", "no message in it|End"), (b"my diary, and more of it", "not a valid MCAP|magic"), (None, "no such file")],
    ids=["empty", "other", "missing"],
)
def test_what_is_no_mcap_file_is_refused(content, said, tmp_path):
    path = tmp_path / "x.mcap"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(InputError, match=said):
        Following(path, vehicle=VEHICLE, idle_s=0.1)


def test_a_file_that_became_shorter_keeps_the_drive_in_its_journal(whole, tmp_path, monkeypatch):
    monkeypatch.setattr("bevameter.framework.core.recording.bag_increments.LOOK_S", 0.5)
    path = tmp_path / "x.mcap"
    path.write_bytes(whole.read_bytes()[: whole.stat().st_size * 2 // 3])
    following = Following(path, vehicle=VEHICLE, topics=map_beside(path))
    live = following.begin(tmp_path / "live.db", models=Models({}, {}), site="field")
    threading.Timer(0.5, path.write_bytes, [b""]).start()
    with pytest.raises(InputError, match="became shorter"):
        following.hand_over(live)
    live.__exit__(KeyboardInterrupt, None, None)
    assert live.journal.exists()
    again = Following(whole, vehicle=VEHICLE, topics=map_beside(whole))
    resumed = again.begin(tmp_path / "live.db", models=Models({}, {}), site="field", resume=live.journal)
    again.hand_over(resumed)
    again.close(resumed)
    assert_same(drive_in(tmp_path / "live.db"), stored_by_run(whole, tmp_path / "run.db"))


def test_a_drive_whose_clock_was_set_back_is_resumed_where_it_was(tmp_path):
    """By the drive's clock, which goes on: time stamps are earlier after the jump."""
    whole, cut = tmp_path / "whole.mcap", tmp_path / "cut.mcap"
    stamps = np.concatenate([np.arange(20.0, 40.0, 0.05), np.arange(5.0, 15.0, 0.05)])
    kind, given = "geometry_msgs/msg/PoseStamped", []
    turn = make("geometry_msgs/msg/Quaternion", x=0.0, y=0.0, z=0.0, w=1.0)
    for number, time_s in enumerate(stamps.tolist()):
        place = make("geometry_msgs/msg/Point", x=0.01 * number, y=0.0, z=0.0)
        pose = make("geometry_msgs/msg/Pose", position=place, orientation=turn)
        given.append((time_s, "/pose", kind, make(kind, header=header(time_s, "map"), pose=pose)))
    for path, count in ((whole, len(given)), (cut, 500)):
        with path.open("wb") as file:
            write(file, iter(given[:count]))
    following = Following(cut, vehicle=VEHICLE, idle_s=0.1)
    live = following.begin(tmp_path / "t.db", models=Models({}, {}), site="field")
    following.hand_over(live)
    assert live.clock_s == pytest.approx(24.9)
    live.__exit__(KeyboardInterrupt, None, None)
    again = Following(whole, vehicle=VEHICLE)
    resumed = again.begin(tmp_path / "t.db", models=Models({}, {}), site="field", resume=live.journal)
    again.hand_over(resumed)
    summary = again.close(resumed)
    assert summary.distance_m == pytest.approx(0.01 * (len(stamps) - 1))
    assert sum("the clock jumped back" in problem for problem in summary.problems) == 1


def test_memory_holds_no_more_than_the_first_seconds(whole, tmp_path, monkeypatch):
    """What was looked at is let go of as it is handed over."""
    monkeypatch.setattr("bevameter.framework.core.recording.bag_increments.LOOK_S", 0.5)
    following = Following(whole, vehicle=VEHICLE, topics=map_beside(whole))
    assert 40 < len(following._beginning.held) < 100  # of 391
    live = following.begin(tmp_path / "live.db", models=Models({}, {}), site="field")
    following.hand_over(live)
    assert following._beginning.held == []
    increments = following._increments
    assert max(len(each) for each in increments._wheels) < 120  # two seconds and a half at 50 Hz
    assert not increments._gathered.poses
    following.close(live)
    assert drive_in(tmp_path / "live.db").id == stored_by_run(whole, tmp_path / "run.db").id


@pytest.mark.slow
def test_a_drive_of_a_minute_is_that_of_a_run(short_drive, small_models, tmp_path):
    """Camera, sound and a soil; the file is complete before, and so read as fast as the senses go."""
    path = write_mcap(tmp_path / "short.mcap", short_drive)
    vehicle = load_vehicle(short_drive / "vehicle.toml")
    _, summary = followed(path, tmp_path / "live.db", vehicle=vehicle, models=small_models)
    same = stored_by_run(path, tmp_path / "run.db", vehicle=vehicle, models=small_models)
    assert len(same.terrain) > 300
    assert drive_in(tmp_path / "live.db").id == same.id
    assert_same(drive_in(tmp_path / "live.db"), same)
    assert not any("dropped" in problem for problem in summary.problems)
