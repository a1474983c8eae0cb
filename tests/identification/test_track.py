"""Place of a wheel along its track, for tracks of any direction, with gaps and noisy positions."""

from __future__ import annotations

import numpy as np
import pytest
from bevameter import Wheel
from bevameter.framework.core.recording.types import WheelTable
from bevameter.framework.core.track.place import coordinate
from bevameter.identification.effects.drive import drive_of, order_of, select_rows
from bevameter.identification.explain.lanes import lanes

ROWS = 400
ALONG_M = np.linspace(0.0, 10.0, ROWS)
AROUND = 2.0 * np.pi * np.arange(ROWS) / 200.0
TWICE = 1.0 + (np.arange(ROWS) >= 200)


def laid_out(x_m, y_m, passes=None, time_s=None):
    columns = {
        "time_s": 0.1 * np.arange(ROWS) if time_s is None else time_s, "load_N": np.full(ROWS, 80.0),
        "slip": np.full(ROWS, 0.2), "x_m": x_m, "y_m": y_m, **({} if passes is None else {"pass": passes}),
    }  # fmt: skip
    table = WheelTable(columns, None, None, "test")
    return drive_of(table, Wheel(radius_m=0.1, width_m=0.1), order_of(table)[1])


def around(radius_m, passes=TWICE):
    return laid_out(radius_m * np.cos(AROUND), radius_m * np.sin(AROUND), passes)


def test_where_the_track_turns_the_place_is_the_distance_travelled():
    drive = around(4.0, np.ones(ROWS))
    assert drive.axis is None
    assert coordinate(drive.axis) == "distance_m"
    np.testing.assert_allclose(drive.place_m, 4.0 * AROUND, atol=5e-3)


@pytest.mark.parametrize(("x", "y", "name"), [(1.0, 0.05, "x_m"), (-0.05, 1.0, "y_m"), (-0.6, -0.8, "distance_m")])
def test_where_it_is_straight_the_place_is_that_along_it(x, y, name):
    x_m, y_m = 5e5 + x * ALONG_M, 4e6 + y * ALONG_M
    drive = laid_out(x_m, y_m)
    assert coordinate(drive.axis) == name
    expected = {"x_m": x_m, "y_m": y_m, "distance_m": ALONG_M}[name]
    np.testing.assert_allclose(drive.place_m, expected, atol=1e-6)
    late = np.where(np.arange(ROWS) < 60, np.nan, x_m)
    np.testing.assert_array_equal(np.isfinite(laid_out(late, y_m).place_m), np.arange(ROWS) >= 60 * (name != "y_m"))


@pytest.mark.parametrize("slope", [0.0, 0.02, 0.08, 0.2])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_gap_in_time_starts_no_other_lane(rng, slope, sign):
    time_s = 0.1 * np.arange(ROWS) + 30.0 * (np.arange(ROWS) >= 200)
    noise = 0.02 * rng.normal(size=ROWS)
    drive = laid_out(sign * ALONG_M + noise, slope * ALONG_M, time_s=time_s)
    assert len(np.unique(drive.stretch)) == 2
    assert len(np.unique(lanes(drive, 0.1))) == 1
    # To and fro on fresh ground is on other ground, whichever way it was first.
    there_and_back = np.concatenate([ALONG_M[:200], ALONG_M[200:0:-1]])[:ROWS]
    assert len(np.unique(lanes(laid_out(sign * there_and_back, 0.0 * ALONG_M, np.ones(ROWS), time_s), 0.1))) == 2


@pytest.mark.parametrize("along_y", [False, True])
def test_legs_that_a_drive_turns_between_are_one_track_that_turns(along_y):
    """With positions along y and a jitter in x the drives across were once taken for jumps."""
    leg, across = np.arange(0.0, 10.0, 0.05), np.arange(0.0, 2.0, 0.05)
    way = [(leg, 0.0 * leg), (10.0 + 0.0 * across, across), (leg[::-1], 2.0 + 0.0 * leg)]
    there, aside = (np.resize(np.concatenate([each[i] for each in way]), ROWS) for i in (0, 1))
    jitter = 0.0005 * np.random.default_rng(1).normal(size=(2, ROWS))
    x_m, y_m = ((aside, there) if along_y else (there, aside)) + jitter
    drive = laid_out(x_m, y_m)
    assert len(np.unique(drive.stretch)) == 1
    assert drive.axis is None


@pytest.mark.parametrize(("apart_m", "turns"), [(0.3, True), (0.04, False), (0.0, False)])
def test_long_parallel_lanes_in_one_drive_are_a_track_that_turns(rng, apart_m, turns):
    """The way back is on fresh ground at some distance, and on the same ground in the rut."""
    leg = np.abs((np.linspace(0.0, 3.0, ROWS) + 1.0) % 2.0 - 1.0)
    aside = apart_m * np.floor(np.linspace(0.0, 2.999, ROWS))
    noise = 0.005 * rng.normal(size=(2, ROWS))
    drive = laid_out(20.0 * leg + noise[0], aside + noise[1])
    assert (drive.axis is None) is turns
    assert np.nanmax(drive.place_m) == pytest.approx(60.0 if turns else 20.0, rel=0.02)


def test_missing_positions_of_a_loop_are_not_interpolated():
    lost = (np.arange(ROWS) >= 100) & (np.arange(ROWS) < 160)
    x_m = np.where(lost, np.nan, 4.0 * np.cos(AROUND))
    drive = laid_out(x_m, 4.0 * np.sin(AROUND), np.ones(ROWS))
    np.testing.assert_array_equal(np.isnan(drive.place_m), lost)


def test_a_later_pass_of_a_loop_lies_where_the_one_before_it_was():
    same = around(4.0 + 0.02 * (TWICE > 1.0)).place_m
    np.testing.assert_allclose(same[200:], same[:200], atol=5e-3)
    reverse = np.where(TWICE > 1.0, -AROUND, AROUND)
    back = laid_out(4.0 * np.cos(reverse), 4.0 * np.sin(reverse), TWICE).place_m
    assert np.ptp(back) == pytest.approx(8.0 * np.pi, rel=0.02)
    for apart_m in (0.5, 1.0):
        other = around(4.0 + apart_m * (TWICE > 1.0)).place_m
        assert (other[200:] > other[199]).all(), "another track is not the same ground"


def test_each_run_on_one_circle_has_its_own_first_pass():
    four = 2.0 * np.pi * np.arange(ROWS) / 100.0
    noise = 0.001 * np.random.default_rng(1).normal(size=(2, ROWS))
    passes = 1.0 + (np.arange(ROWS) // 100) % 2
    place = laid_out(4.0 * np.cos(four) + noise[0], 4.0 * np.sin(four) + noise[1], passes).place_m
    for start in (0, 200):
        np.testing.assert_allclose(place[start + 103 : start + 197], place[start + 3 : start + 97], atol=0.05)


@pytest.mark.parametrize("names", [["front", "rear"], ["vorne", "hinten"]])
@pytest.mark.parametrize("every", [10, 100, ROWS])
def test_a_wheel_behind_another_is_on_its_ground(names, every):
    """Rows are sorted by wheel, then time; the passes of both wheels interleave, also where the clock has gaps."""
    angle, lap = np.concatenate([AROUND, AROUND - 0.2]), np.tile(TWICE, 2)
    wheel = np.repeat(names, ROWS)
    passes = 2.0 * lap - (wheel == names[0])
    columns = {
        "time_s": np.tile(0.1 * np.arange(ROWS) + 3.0 * (np.arange(ROWS) // every), 2),
        "load_N": np.full(2 * ROWS, 80.0),
        "slip": 0.1 * passes, "x_m": 4.0 * np.cos(angle), "y_m": 4.0 * np.sin(angle), "pass": passes,
    }  # fmt: skip
    table = WheelTable(columns, wheel, None, "test")
    order, stretch = order_of(table)
    drive = drive_of(table.select(order), Wheel(radius_m=0.1, width_m=0.1), stretch)
    turned = angle[order]
    for number in (1.0, 2.0, 3.0, 4.0):
        # Ground behind the start is fresh until the lap is closed.
        rows = (drive.pass_number == number) & (turned > 2.0 * np.pi * (number > 2.0)) & (turned > 0.0)
        np.testing.assert_allclose(drive.place_m[rows], 4.0 * np.mod(turned[rows], 2.0 * np.pi), atol=0.1)
        if number > 1.0:
            # Cells at the border of two stretches belong to both.
            other = np.abs(drive.slip_before[rows] - 0.1 * (number - 1.0)) > 0.02
            assert other.mean() < 0.1


def test_where_a_figure_of_eight_crosses_itself_a_later_pass_stays_on_its_branch():
    noise = 0.01 * np.random.default_rng(2).normal(size=(2, ROWS))
    drive = laid_out(4.0 * np.sin(AROUND) + noise[0], 2.0 * np.sin(2.0 * AROUND) + noise[1], TWICE)
    np.testing.assert_allclose(drive.place_m[203:397], drive.place_m[3:197], atol=0.1)


def test_noise_of_positions_adds_no_distance():
    rng = np.random.default_rng(3)
    x_m, y_m = 4.0 * np.cos(AROUND), 4.0 * np.sin(AROUND)
    drive = laid_out(x_m + 0.05 * rng.normal(size=ROWS), y_m + 0.05 * rng.normal(size=ROWS), np.ones(ROWS))
    assert np.ptp(drive.place_m) == pytest.approx(4.0 * AROUND[-1], rel=0.1)
    straight = laid_out(0.3 * ALONG_M + 0.02 * rng.normal(size=ROWS), 0.02 * rng.normal(size=ROWS))
    assert coordinate(straight.axis) == "x_m"
    stationary = laid_out(0.01 * rng.normal(size=ROWS), 0.01 * rng.normal(size=ROWS))
    assert coordinate(stationary.axis) == "x_m"
    alone = laid_out(ALONG_M, np.where(np.arange(ROWS) == 200, 30.0, 0.0))
    assert coordinate(alone.axis) == "x_m"


@pytest.mark.parametrize(("rows", "away_m"), [(1, 0.8), (1, 3.0), (3, 3.0), (5, 3.0), (5, 5e5)])
def test_outliers_of_position_are_no_other_place(away_m, rows):
    wrong = np.add.outer([50, 130, 270, 333], np.arange(rows)).ravel()
    straight = ALONG_M.copy()
    straight[wrong] += away_m
    for y_m in (0.0 * ALONG_M, np.full(ROWS, np.nan)):
        np.testing.assert_allclose(laid_out(straight, y_m).place_m, ALONG_M, atol=1e-9)
    x_m = 4.0 * np.cos(AROUND)
    x_m[wrong] += away_m
    drive = laid_out(x_m, 4.0 * np.sin(AROUND), TWICE)
    assert len(np.unique(drive.stretch)) == 2
    np.testing.assert_allclose(drive.place_m, 4.0 * np.mod(AROUND, 2.0 * np.pi), atol=0.15)


@pytest.mark.parametrize("row", [205, 300, 399])
def test_a_pass_whose_number_one_row_lacks_is_one_pass(row):
    passes = np.where(np.arange(ROWS) == row, np.nan, TWICE)
    np.testing.assert_allclose(around(4.0, passes).place_m, around(4.0).place_m)
    lost = np.where((np.arange(ROWS) >= 195) & (np.arange(ROWS) < 205), np.nan, TWICE)
    assert len(np.unique(around(4.0, lost).stretch)) == 2


@pytest.mark.parametrize("where", [100, 300])
@pytest.mark.parametrize("noise_m", [0.0, 0.01])
def test_a_wheel_at_rest_on_a_later_pass_adds_no_distance(rng, where, noise_m):
    angle = np.insert(AROUND[:-40], where, np.full(40, AROUND[where]))
    passes = np.insert(TWICE[:-40], where, np.full(40, TWICE[where]))
    x_m, y_m = 4.0 * np.array([np.cos(angle), np.sin(angle)]) + noise_m * rng.normal(size=(2, ROWS))
    assert np.ptp(laid_out(x_m, y_m, passes).place_m) < 8.0 * np.pi + 0.5


@pytest.mark.parametrize("restarts", [True, False])
def test_runs_are_in_recorded_order_for_any_names(restarts):
    run = np.repeat(["r9", "r10", "r11", "again"], 100)
    columns = {
        "time_s": np.tile(np.arange(100.0), 4) if restarts else np.arange(400.0),
        "load_N": np.full(ROWS, 80.0), "slip": np.full(ROWS, 0.2), "pass": np.repeat([1.0, 2.0, 3.0, 4.0], 100),
    }  # fmt: skip
    order, stretch = order_of(WheelTable(columns, None, run, "test"))
    np.testing.assert_array_equal(order, np.arange(ROWS))
    np.testing.assert_array_equal(stretch, np.repeat(np.arange(4), 100))


@pytest.mark.parametrize("lost", [0, 1, 5])
@pytest.mark.parametrize("every", [2, 10])
def test_positions_of_a_slower_receiver_are_put_between_its_updates(rng, every, lost):
    """Without interpolation a wheel at 20 Hz with positions at 1 Hz would stop and jump."""
    held = np.arange(ROWS) // every * every
    drive = around(4.0)
    x_m, y_m = drive.x_m[held], drive.y_m[held]
    x_m[rng.choice(200, lost, replace=False)] = np.nan
    slower = laid_out(x_m, y_m, TWICE)
    near = np.abs(np.mod(slower.place_m - drive.place_m + 4.0 * np.pi, 8.0 * np.pi) - 4.0 * np.pi)
    # A chord cuts its corner, where a pass begins the position is as old as the last update, and an update that was
    # lost is dated a row late.
    assert near.max() < (0.35 if lost else 0.2)
    slow = laid_out(*np.repeat([ALONG_M[::4], 0.0 * ALONG_M[::4]], 4, axis=1))
    np.testing.assert_allclose(slow.place_m, ALONG_M, atol=1e-9)


@pytest.mark.parametrize("began", [0, 100, 200])
def test_a_wheel_at_rest_between_updates_does_not_move(began):
    """With positions at 1 Hz a wheel at rest was once moved by up to a second's travel."""
    way = 0.05 * np.clip(np.arange(ROWS) - began, 0, 200)
    held = way[np.arange(ROWS) // 20 * 20]
    np.testing.assert_allclose(laid_out(held, 0.0 * held).place_m, way, atol=1e-9)


def test_a_wheel_at_rest_most_of_the_time_has_a_track_that_turns():
    around = np.clip(np.arange(ROWS) - 250, 0, 100) * 0.03
    noise = 0.01 * np.random.default_rng(5).normal(size=(2, ROWS))
    drive = laid_out(4.0 * np.cos(around) + noise[0], 4.0 * np.sin(around) + noise[1], np.ones(ROWS))
    assert drive.axis is None
    assert drive.place_m[345] - drive.place_m[255] == pytest.approx(4.0 * 0.03 * 90.0, rel=0.05)


def test_selected_rows_keep_the_axis_of_their_drive():
    drive = laid_out(np.minimum(ALONG_M, 5.0), np.maximum(ALONG_M - 5.0, 0.0))
    assert drive.axis is None
    assert select_rows(drive, np.arange(150)).axis is None


def test_lanes_side_by_side_are_straight_and_a_later_pass_lies_on_its_own():
    along, number = np.tile(np.linspace(0.0, 3.0, 50), 8), np.repeat(np.arange(8), 50)
    passes, y_m = 1.0 + number // 2 % 2, 0.5 * (number % 2) + 2.0 * (number // 4)
    drive = laid_out(along, y_m, passes)
    np.testing.assert_array_equal(drive.place_m, along)
    lane = lanes(drive, 0.1)
    assert len(np.unique(lane)) == 4
    assert all(len(np.unique(lane[y_m == each])) == 1 for each in np.unique(y_m))


@pytest.mark.parametrize("fresh", [True, False])
@pytest.mark.parametrize("apart_m", [0.06, 0.09, 0.3])
def test_adjoining_lanes_are_as_many_as_were_driven(fresh, apart_m):
    """Six lanes less than a wheel's width apart were once taken for one."""
    number = np.repeat(np.arange(6), 60)
    along = np.tile(np.linspace(0.0, 3.0, 60), 6)
    columns = {
        "time_s": np.arange(360.0), "load_N": np.full(360, 80.0), "slip": np.full(360, 0.2),
        "x_m": np.where(number % 2 == 1, 3.0 - along, along), "y_m": apart_m * number,
        **({"pass": np.ones(360)} if fresh else {}),
    }  # fmt: skip
    columns["time_s"] = columns["time_s"] + 100.0 * number
    columns["y_m"][number == 3] = np.nan
    table = WheelTable(columns, None, None, "test")
    drive = drive_of(table, Wheel(radius_m=0.1, width_m=0.1), order_of(table)[1])
    assert len(np.unique(lanes(drive, 0.1))) == 6


@pytest.mark.parametrize("every", [100, ROWS])
def test_wheels_side_by_side_are_each_on_a_lane_of_their_own(every):
    clock = np.tile(0.1 * np.arange(ROWS) + 3.0 * (np.arange(ROWS) // every), 2)
    columns = {
        "time_s": clock, "load_N": np.full(2 * ROWS, 80.0), "slip": np.full(2 * ROWS, 0.2), "x_m": np.tile(ALONG_M, 2),
    }  # fmt: skip
    table = WheelTable(columns, np.repeat(["left", "right"], ROWS), None, "test")
    order, stretch = order_of(table)
    table = table.select(order)
    lane = lanes(drive_of(table, Wheel(radius_m=0.1, width_m=0.1), stretch), 0.1, table.wheel)
    assert {len(np.unique(lane[table.wheel == name])) for name in ("left", "right")} == {1}
    assert len(np.unique(lane)) == 2


def test_runs_without_a_clock_through_the_same_places_are_each_on_ground_of_their_own():
    columns = {"load_N": np.full(ROWS, 80.0), "slip": np.full(ROWS, 0.2), "x_m": np.tile(np.linspace(0.0, 3.0, 100), 4)}
    table = WheelTable(columns, None, None, "test")
    lane = lanes(drive_of(table, Wheel(radius_m=0.1, width_m=0.1), order_of(table)[1]), 0.1)
    assert len(np.unique(lane)) == 4
    np.testing.assert_allclose(np.bincount(lane), 100, atol=12)


def test_a_field_drive_that_weaves_and_pauses_is_one_lane():
    along = np.linspace(0.0, 40.0, ROWS)
    time_s = 0.1 * np.arange(ROWS) + 30.0 * (np.arange(ROWS) // 10)
    assert len(np.unique(lanes(laid_out(along, 0.3 * np.sin(along / 6.0), time_s=time_s), 0.1))) == 1


def test_a_later_pass_is_on_the_nearest_lane_however_its_positions_are_off():
    number = np.repeat(np.arange(8), 50)
    off = 0.2 * np.random.default_rng(4).normal(size=8)[number] * (number > 0)
    drive = laid_out(np.tile(np.linspace(0.0, 3.0, 50), 8), off, 1.0 + number)
    assert len(np.unique(lanes(drive, 0.1))) == 1
