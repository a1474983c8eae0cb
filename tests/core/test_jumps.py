"""Positions that no ground vehicle can reach."""

import numpy as np
import pytest
from bevameter.framework.core.errors import InputError
from bevameter.framework.core.recording.readers import read_recording
from bevameter.framework.core.track.jumps import reached

N = 200
T = 0.05 * np.arange(N)
X, Y = 500_000.0 + T, 4.0e6 - 0.5 * T


def written(tmp_path, x, y):
    rows = np.column_stack([T, x, y, np.zeros(N)])
    np.savetxt(tmp_path / "pose.csv", rows, "%.10g", ",", header="time_s,x_m,y_m,yaw_rad", comments="")
    return tmp_path


def moved(values, rows, to):
    values = values.copy()
    values[rows] = to
    return values


@pytest.mark.parametrize(
    ("rows", "x", "y"),
    [([100], 0.0, 0.0), ([100], 1e10, 0.0), ([100], 1e300, -1e300), ([0], 0.0, 0.0), ([N - 1], 503_000.0, 4e6),
     (range(12), 0.0, 0.0), ([20, 21, 90, 180], 1.7e308, -1.7e308)],
)  # fmt: skip
def test_a_lost_fix_is_left_out_and_named(tmp_path, rows, x, y):
    rows = list(rows)
    recording = read_recording(written(tmp_path, moved(X, rows, x), moved(Y, rows, y)))
    kept = np.delete(np.arange(N), rows)
    np.testing.assert_array_equal(recording.pose.time_s, np.round(T[kept], 10))
    (note,) = recording.problems
    assert f"pose.csv: {len(rows)} of {N} places left out" in note
    assert f"first row {rows[0] + 2}, column x_m: x_m {x:.6g}, y_m {y:.6g}" in note


def test_rows_without_a_pose_are_still_counted(tmp_path):
    recording = read_recording(written(tmp_path, moved(moved(X, [3], np.nan), [100], 0.0), Y))
    assert len(recording.pose.time_s) == N - 2
    assert "first row 102, column x_m" in recording.problems[-1]


@pytest.mark.parametrize(("x", "row"), [(moved(X, slice(80, None), 0.0), 82), (X + 5e3 * (T > 5.0), 103)])
def test_a_frame_that_changes_within_a_drive_is_refused(tmp_path, x, row):
    with pytest.raises(InputError, match=rf"pose.csv, row {row}, column x_m: a jump of .* in 0.05 s.*50 m/s"):
        read_recording(written(tmp_path, x, Y))


@pytest.mark.parametrize("x", [1e10, 1e300])
def test_places_on_no_map_are_refused(tmp_path, x):
    with pytest.raises(InputError, match=r"pose.csv, row 2, column x_m: x_m 1e\+\d+, .*within 1e\+08 m"):
        read_recording(written(tmp_path, np.full(N, x), Y))


def test_positions_in_wheel_rows_are_checked_as_well(tmp_path):
    table = np.column_stack([T, np.full(N, 100.0), moved(X, [50], 0.0), Y])
    file = tmp_path / "wheel.csv"
    np.savetxt(file, table, "%.10g", ",", header="time_s,load_N,x_m,y_m", comments="")
    recording = read_recording(file)
    assert len(recording.pose.time_s) == N - 1
    assert "wheel.csv: 1 of 200 places left out" in recording.problems[0]
    assert "2.5 s, column x_m: x_m 0" in recording.problems[0]


def test_places_in_wheel_rows_that_jump_for_good_cost_the_places_only(tmp_path):
    table = np.column_stack([T, np.full(N, 100.0), np.where(np.arange(N) < N // 2, X, X + 5e4), Y])
    file = tmp_path / "wheel.csv"
    np.savetxt(file, table, "%.10g", ",", header="time_s,load_N,x_m,y_m", comments="")
    recording = read_recording(file)
    assert recording.pose is None
    assert len(recording.wheel) == N
    assert "no place of the vehicle is taken from its wheels' rows: " in recording.problems[0]


def test_possible_motion_is_not_refused():
    """Driving fast, with times of receipt that bunch up, a clock of whole seconds, a rest, a correction, a long gap."""
    x = 30.0 * np.arange(0.0, 20.0, 0.1)
    bunched = np.repeat(np.arange(0.0, 20.0, 0.2), 2) + np.tile([0.0, 1e-3], 100)
    still = np.zeros_like(x)
    assert reached(bunched, x, still).all()
    assert reached(np.floor(np.arange(0.0, 20.0, 0.1)), x, still).all()
    assert reached(np.arange(200.0), np.where(np.arange(200) < 100, 0.0, 4.0), still).all()
    assert reached(np.array([0.0, 1.0, 3600.0, 3601.0]), np.array([0.0, 1.0, 5e4, 5e4]), np.zeros(4)).all()
