import csv
import gzip

import numpy as np
import pytest
from bevameter.framework.core.errors import InputError
from bevameter.framework.core.recording.clock import interpolate, nearest
from bevameter.framework.core.recording.readers import read_recording
from bevameter.framework.core.recording.vibration import read_vibration_run


def write_run(path, time, **channels):
    rows = np.column_stack([time, *channels.values()])
    text = ",".join(["time", *channels]) + "\n" + "\n".join(",".join(map(repr, row)) for row in rows.tolist()) + "\n"
    path.write_bytes(gzip.compress(text.encode()) if path.suffix == ".gz" else text.encode())
    return path


def test_channels_come_on_one_clock(tmp_path, rng):
    time = np.arange(500) / 100
    noise = rng.normal(size=500)
    imu = write_run(tmp_path / "imu_01.csv.gz", time, wx=noise, az=noise + 9.81)
    pro = write_run(tmp_path / "pro_01.csv.gz", np.arange(0, 4.0, 0.15), curL=np.arange(0, 4.0, 0.15) * 2)
    run = read_vibration_run(imu, pro)
    assert (run.names, run.wheel_names) == (("wx", "az"), ("curL",))
    np.testing.assert_allclose(run.time_s, time)
    np.testing.assert_array_equal(run.channels[:, 0], noise)
    inside = run.time_s <= 3.9
    np.testing.assert_allclose(run.wheel[inside, 0], 2 * run.time_s[inside])
    assert np.isnan(run.wheel[run.time_s > 4.4]).all()
    assert any("pro_01.csv.gz" in problem and "without a value" in problem for problem in run.problems)


def test_a_zero_wheel_speed_is_reported(tmp_path, rng):
    imu = write_run(tmp_path / "imu_01.csv", np.arange(200) / 100, wx=rng.normal(size=200))
    pro = write_run(tmp_path / "pro_01.csv", np.arange(14) * 0.15, curL=np.ones(14), velL=np.zeros(14))
    recording = read_recording(imu)  # joins pro_01.csv of the same folder
    assert recording.vibration.wheel_names == ("curL", "velL")
    assert recording.problems == (f"{pro.name}, column velL: zero in every row; the wheel speed was not recorded",)


@pytest.mark.parametrize(("gravity", "said"), [(1.01, True), (9.81, False), (1.62, False), (0.0, False)])
def test_accelerations_in_g_are_reported(gravity, said, tmp_path, rng):
    path = write_run(tmp_path / "imu.csv", np.arange(0, 3, 0.01), **{
        name: 0.1 * rng.standard_normal(300) + offset
        for name, offset in zip(("wx", "ax", "ay", "az"), (0.0, 0.6 * gravity, 0.0, 0.8 * gravity), strict=True)
    })  # fmt: skip
    problems = read_vibration_run(path).problems
    assert bool(problems) == said
    assert not said or problems[0].startswith("imu.csv: ax, ay, az average 1.0 in size, as gravity does in g")


def test_a_faster_recording_is_low_passed_before_decimation(tmp_path):
    time = np.arange(4000) / 400
    slow, fast = np.sin(2 * np.pi * 10 * time), np.sin(2 * np.pi * 90 * time)  # 90 Hz would alias to 10 Hz
    run = read_vibration_run(write_run(tmp_path / "x.csv", time, a=slow, b=fast))
    middle = slice(50, -50)
    np.testing.assert_allclose(run.channels[middle, 0], np.sin(2 * np.pi * 10 * run.time_s[middle]), atol=0.02)
    assert np.abs(run.channels[middle, 1]).max() < 0.02


def test_gaps_stay_gaps_and_slow_recordings_are_reported(tmp_path):
    time = np.concatenate([np.arange(100), np.arange(200, 300)]) / 100
    run = read_vibration_run(write_run(tmp_path / "x.csv", time, a=np.ones(200)))
    gone = np.isnan(run.channels[:, 0])
    assert gone[103:197].all()
    assert not gone[:100].any()
    assert not gone[200:].any()
    slow = read_vibration_run(write_run(tmp_path / "y.csv", np.arange(50) / 25, a=np.ones(50)))
    assert slow.problems == ("y.csv: recorded at 25 Hz, nothing above 12.5 Hz is in it",)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("time,wx\n0,1\n", "1 sample"),
        ("t,wx\n0,1\n1,2\n", "no column of time; there are t, wx"),
        ("time,note\n0,a\n1,b\n", "no column of numbers besides time"),
        ("time,wx\n0,1\n0.2,1\n0.1,1\n", "row 4, column time: time does not go on, 0.2 s and then 0.1 s"),
        ("time,wx\n0,1\n0.1,inf\n", "row 3, column wx: inf"),
        ("time,wx\n0,1\n,2\n", "row 3, column time: no value"),
        ("time,wx\n0,1\n1e9,2\n", "time spans 1e.09 s"),
        ("", "an empty file"),
    ],
)
def test_what_is_wrong_is_named(text, says, tmp_path):
    path = tmp_path / "x.csv"
    path.write_text(text)
    with pytest.raises(InputError, match=says):
        read_vibration_run(path)


def test_a_wheel_file_of_another_clock_is_refused(tmp_path):
    imu = write_run(tmp_path / "i.csv", np.arange(100) / 100, a=np.ones(100))
    drives = write_run(tmp_path / "p.csv", 50 + np.arange(100) / 100, curL=np.ones(100))
    with pytest.raises(InputError, match="time from 50 s"):
        read_vibration_run(imu, drives)


def test_a_folder_carries_a_vibration_run(tmp_path, rng):
    write_run(tmp_path / "vibration.csv", np.arange(100) / 100, az=rng.normal(size=100))
    write_run(tmp_path / "drives.csv", np.arange(10) / 10, curL=np.ones(10))
    (tmp_path / "recording.toml").write_text('[vibration]\nwheel_file = "drives.csv"\n')
    recording = read_recording(tmp_path)
    assert recording.wheel is None
    assert recording.vibration.wheel_names == ("curL",)


def test_a_misspelt_wheel_file_is_not_taken_for_vibration(tmp_path):
    (tmp_path / "wheel.csv").write_text("time_s,load_rpm\n0,1\n1,2\n")
    with pytest.raises(InputError, match="load_rpm"):
        read_recording(tmp_path / "wheel.csv")


def test_interpolation_bridges_no_gap():
    time, values = np.array([0.0, 1.0, 2.0, 5.0]), np.array([0.0, 1.0, np.nan, 5.0])
    at = np.array([-0.4, 0.0, 0.5, 1.0, 1.4, 3.0, 4.8, 5.0, 6.0])
    expected = [0.0, 0.0, 0.5, 1.0, np.nan, np.nan, np.nan, 5.0, np.nan]
    np.testing.assert_allclose(interpolate(time, values, at, 1.0), expected)
    assert np.isnan(interpolate(time, np.full(4, np.nan), at, 1.0)).all()
    np.testing.assert_allclose(nearest(time, values, np.array([0.4, 0.6, 3.0]), 1.0), [0.0, 1.0, np.nan])


def test_all_runs_of_a_real_vehicle(shared_data):
    folder = shared_data / "vehicle-vibration"
    with (folder / "index.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 48
    for row in rows:
        recording = read_recording(folder / row["file"])
        run = recording.vibration
        assert run.names == ("wx", "wy", "wz", "ax", "ay", "az")
        assert run.wheel_names == ("curL", "curR", "velL", "velR")
        assert run.time_s[-1] == pytest.approx(float(row["seconds"]), abs=0.02)
        assert not np.isnan(run.channels).any()
        assert np.isnan(run.wheel).any(axis=1).mean() < 0.05
        mean_speed = np.abs(run.wheel[:, 2:].mean(axis=1))
        assert np.nanmax(mean_speed) == pytest.approx(float(row["max_abs_vel"]), abs=0.01)
        assert any("mean wheel speed is zero" in p for p in recording.problems) == (float(row["max_abs_vel"]) == 0.0)
