"""Places along the track, and the cells under the wheels."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from bevameter.framework.core.errors import InputError
from bevameter.framework.core.recording.types import Pose, Recording, WheelTable
from bevameter.framework.core.track.way import DEAD_RECKONING, RECORDED, Track, cells_under_wheels, track_of
from bevameter.framework.core.vehicle import Vehicle, Wheel


def recording(*, wheel=None, run=None, pose=None, vehicle=None):
    table = None if wheel is None else WheelTable(wheel, None, run, Path("wheel.csv"))
    return Recording("drive", Path("drive"), vehicle, None, "", "0" * 64, wheel=table, pose=pose)


def straight(n=101, speed=1.0):
    t = np.arange(n) * 0.1
    return Pose(t, speed * t, np.zeros(n), np.zeros(n))


def test_pose_gives_places_and_speed():
    track = track_of(recording(pose=straight(speed=2.0)))
    assert track is not None
    assert track.origin == RECORDED
    assert track.distance_m == pytest.approx(20.0)
    np.testing.assert_allclose(track.speed_m_s, 2.0, rtol=1e-9)
    x, y, yaw = track.place_at(np.array([[5.05, 100.0]]))
    assert x[0, 0] == pytest.approx(10.1)
    assert np.isnan(x[0, 1])
    assert np.isnan(track.speed_at(np.array([-3.0]))[0])
    assert y[0, 0] == 0.0
    assert yaw[0, 0] == 0.0


def test_the_speed_is_that_of_the_wheels_where_there_are_poses_too():
    wheel = {"time_s": np.array([0.0, 10.0]), "travel_speed_m_s": np.array([1.5, 1.5])}
    track = track_of(recording(pose=straight(speed=2.0), wheel=wheel))
    np.testing.assert_allclose(track.speed_m_s, 1.5)


def test_places_of_wheel_rows_serve_where_there_is_no_pose():
    t = np.arange(50) * 0.1
    wheel = {"time_s": t, "x_m": t, "y_m": t}
    track = track_of(recording(wheel=wheel))
    assert track.origin == RECORDED
    np.testing.assert_allclose(track.yaw_rad[1:-1], np.pi / 4, atol=1e-6)


def test_travel_speed_is_added_up_where_there_are_no_places():
    wheel = {"time_s": np.array([0.0, 1.0, 2.0, 3.0]), "travel_speed_m_s": np.array([0.0, 1.0, np.nan, 1.0])}
    track = track_of(recording(wheel=wheel))
    assert track.origin == DEAD_RECKONING
    assert track.distance_m == pytest.approx(0.5 + 2.0)
    assert not track.y_m.any()


def test_a_travel_speed_that_no_vehicle_has_places_nothing():
    wheel = {"time_s": np.arange(4.0), "travel_speed_m_s": np.array([0.0, 1.0, 1e10, 1.0])}
    with pytest.raises(InputError, match=r"2 s, column travel_speed_m_s: 1e\+10 m/s .expected no more than 50 m/s"):
        track_of(recording(wheel=wheel))


def test_steady_trials_and_recordings_without_speeds_have_no_track():
    runs = np.array(["a", "a", "b"])
    wheel = {"time_s": np.arange(3.0), "travel_speed_m_s": np.ones(3)}
    assert track_of(recording(wheel=wheel, run=runs)) is None
    assert track_of(recording()) is None
    assert track_of(recording(wheel={"time_s": np.arange(3.0), "load_N": np.ones(3)})) is None


def test_heading_is_followed_over_a_full_turn():
    t = np.arange(200) * 0.1
    angle = t
    pose = Pose(t, np.cos(angle), np.sin(angle), np.angle(np.exp(1j * (angle + np.pi / 2))))
    yaw = track_of(recording(pose=pose)).place_at(np.linspace(0.0, 19.0, 57))[2]
    np.testing.assert_allclose(yaw, np.linspace(0.0, 19.0, 57) + np.pi / 2, atol=1e-9)


def curve(time_s, *, without=(np.inf, np.inf), stood=(np.inf, np.inf)):
    """Poses at 1 m/s on a circle, none within one stretch of time, and on the same spot in another."""
    time_s = time_s[(time_s <= without[0]) | (time_s >= without[1])]
    way = time_s - np.clip(time_s - stood[0], 0.0, stood[1] - stood[0]) if np.isfinite(stood[0]) else time_s
    return Pose(time_s, 10 * np.sin(way / 10), 10 - 10 * np.cos(way / 10), way / 10)


def test_gaps_in_the_poses_are_not_interpolated():
    track = track_of(recording(pose=curve(np.arange(0.0, 100.0, 0.05), without=(30.0, 60.0))))
    np.testing.assert_allclose(track.holes_s, [[30.0, 60.0]])
    assert "no places for 30.0 s from 30.0 s to 60.0 s" in track.problems[0]
    times = np.array([[29.99, 30.01], [59.99, 60.01]])
    np.testing.assert_array_equal(np.isnan(track.place_at(times)[0]), [[False, True], [True, False]])
    np.testing.assert_array_equal(np.isnan(track.speed_at(times)), [[False, True], [True, False]])
    window, cells = cells_under_wheels(track, None, np.array([20.0, 40.0]), np.array([21.0, 41.0]), 0.5)
    assert len(cells) > 0
    assert not window.any()


def test_several_gaps_are_summarised():
    time_s = np.arange(0.0, 100.0, 0.05)
    track = track_of(recording(pose=curve(time_s[(time_s < 10.01) | (time_s >= 11.99)], without=(30.0, 60.0))))
    assert "no places for 32.0 s, in 2 holes, the longest from 30.0 s to 60.0 s" in track.problems[0]


@pytest.mark.parametrize("lost", [(0.0, 0.0), (4.5, 6.5)])
def test_slow_poses_with_two_lost_are_no_gap(lost):
    pose = curve(np.arange(0.0, 30.0) + 0.05 * np.sin(np.arange(30.0)), without=lost)
    track = track_of(recording(pose=pose))
    assert not track.problems
    x, y, _ = track.place_at(np.linspace(0.0, 29.0, 300))
    assert np.abs(np.hypot(x, y - 10.0) - 10.0).max() < 0.15


def test_poses_that_come_only_while_the_vehicle_moves_leave_no_gap():
    pose = curve(np.arange(0.0, 100.0, 0.05), without=(30.0, 60.0), stood=(30.0, 60.0))
    assert not track_of(recording(pose=pose)).problems
    turning = {"time_s": np.array([0.0, 100.0]), "travel_speed_m_s": np.array([1.0, 1.0])}
    assert track_of(recording(pose=pose, wheel=turning)).problems


def test_samples_are_evenly_spaced_along_the_track_also_at_standstill():
    t = np.arange(0.0, 30.0, 0.1)
    x = np.where(t < 10, t, np.where(t < 20, 10.0, t - 10.0))
    track = track_of(recording(pose=Pose(t, x, np.zeros_like(x), np.zeros_like(x))))
    times = track.every(0.5)
    assert np.all(np.diff(times) >= 0)
    steps = np.diff(np.interp(times, t, x))
    np.testing.assert_allclose(steps[:-1], 0.5, atol=1e-6)


def test_cells_under_four_wheels_lie_on_both_sides_of_the_track():
    places = {"fl": (0.5, 1.0), "fr": (0.5, -1.0), "rl": (-0.5, 1.0), "rr": (-0.5, -1.0)}
    wheels = tuple(Wheel(radius_m=0.2, width_m=0.1, name=name, position_m=place) for name, place in places.items())
    track = track_of(recording(pose=straight()))
    window, cells = cells_under_wheels(track, Vehicle(wheels=wheels), np.array([0.0, 5.0]), np.array([1.0, 6.0]), 0.5)
    assert set(np.unique(cells[:, 1])) == {-2, 2}
    first = cells[window == 0]
    assert first[:, 0].min() == -1  # rear wheels, 0.5 m behind the start
    assert first[:, 0].max() == 2  # front wheels, just before 1.5 m
    assert len(np.unique(np.column_stack([window, cells]), axis=0)) == len(cells)


def test_a_fast_window_leaves_no_gap_between_cells():
    track = track_of(recording(pose=straight(speed=8.0)))
    _, cells = cells_under_wheels(track, None, np.array([2.0]), np.array([3.0]), 0.25)
    assert np.array_equal(np.unique(cells[:, 0]), np.arange(64, 96))


def test_windows_outside_the_track_cover_nothing():
    window, cells = cells_under_wheels(
        track_of(recording(pose=straight())), None, np.array([50.0]), np.array([51.0]), 0.5
    )
    assert len(window) == len(cells) == 0


def test_cells_of_a_window_do_not_depend_on_the_others():
    """One of a minute beside others of half a second, as after a gap."""
    time_s = np.arange(0.0, 120.0, 0.1)
    angle = 0.05 * time_s
    track = Track(
        time_s, 30 * np.cos(angle), 30 * np.sin(angle), angle + np.pi / 2, np.full(len(time_s), 1.5), RECORDED,
        np.empty((0, 2)),
    )  # fmt: skip
    start_s = np.arange(0.0, 60.0, 0.5)
    end_s = start_s + 0.5
    window, cells = cells_under_wheels(track, None, np.append(start_s, 60.0), np.append(end_s, 119.0), 0.5)
    among_others = cells[window < len(start_s)]
    np.testing.assert_array_equal(among_others, cells_under_wheels(track, None, start_s, end_s, 0.5)[1])
