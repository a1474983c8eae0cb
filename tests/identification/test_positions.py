"""Positions of receivers: outliers at the ends, gaps where a wheel is set down, blanks between fixes."""

from __future__ import annotations

import numpy as np
import pytest
from bevameter import Wheel
from bevameter.framework.core.recording.types import WheelTable
from bevameter.identification.effects.drive import drive_of, order_of

ROWS = 400
ALONG_M = np.linspace(0.0, 10.0, ROWS)


def laid_out(x_m, passes=None, time_s=None, wheel=None, y_m=None):
    columns = {
        "time_s": 0.1 * np.arange(len(x_m)) if time_s is None else time_s,
        "load_N": np.full(len(x_m), 80.0), "slip": np.full(len(x_m), 0.2), "x_m": x_m,
        **({} if y_m is None else {"y_m": y_m}), **({} if passes is None else {"pass": passes}),
    }  # fmt: skip
    table = WheelTable(columns, wheel, None, "test")
    order, stretch = order_of(table)
    return drive_of(table.select(order), Wheel(radius_m=0.1, width_m=0.1), stretch)


@pytest.mark.parametrize("rows", [1, 5, 40])
@pytest.mark.parametrize("away_m", [100.0, -5e5])
@pytest.mark.parametrize("end", ["first", "last"])
def test_a_fix_that_is_off_the_track_at_either_end_is_wrong(rows, away_m, end):
    """The receiver repeats one position before its first fix, or after its last."""
    there = np.arange(ROWS) < rows if end == "first" else np.arange(ROWS) >= ROWS - rows
    drive = laid_out(np.where(there, away_m, ALONG_M))
    assert len(np.unique(drive.stretch)) == 1
    np.testing.assert_allclose(drive.place_m, ALONG_M, atol=1e-6)


@pytest.mark.parametrize("rows", [1, 20])
def test_a_fix_that_is_held_off_the_track_for_a_while_is_wrong(rows):
    wrong = np.abs(np.arange(ROWS) - 150) < rows
    drive = laid_out(np.where(wrong, 0.0, 5e5 + ALONG_M))
    assert len(np.unique(drive.stretch)) == 1
    np.testing.assert_allclose(drive.place_m, 5e5 + ALONG_M, atol=1e-6)


def test_a_wheel_that_is_set_down_while_positions_are_lost_begins_a_new_stretch():
    x_m = np.where(np.arange(ROWS) < 200, ALONG_M, ALONG_M - 5.0)
    x_m[197:203] = np.nan
    drive = laid_out(x_m)
    assert len(np.unique(drive.stretch)) == 2
    seen = np.isfinite(x_m)
    np.testing.assert_allclose(drive.place_m[seen], x_m[seen])


@pytest.mark.parametrize("jitter_m", [0.0, 1e-4])
def test_a_wheel_that_starts_from_creep_or_rest_is_in_one_stretch(jitter_m):
    speed = np.where(np.arange(ROWS) < 250, 0.0 if jitter_m else 0.001, 0.05)
    x_m = np.cumsum(speed) + jitter_m * np.random.default_rng(3).normal(size=ROWS)
    assert len(np.unique(laid_out(x_m).stretch)) == 1


def test_forces_between_the_fixes_of_a_slower_receiver_are_where_the_wheel_was():
    fix = np.arange(ROWS) % 50 == 25
    drive = laid_out(np.where(fix, ALONG_M, np.nan))
    np.testing.assert_allclose(drive.place_m, ALONG_M, atol=1e-9)


def test_two_tracks_with_a_pause_of_the_clock_have_no_place_in_common():
    """On a curve the second piece of the left wheel was once given the places of the right wheel's first."""
    around = np.pi * np.arange(ROWS) / ROWS
    time_s = 0.1 * np.arange(ROWS) + 30.0 * (np.arange(ROWS) >= 200)
    radius = np.repeat([4.0, 5.0], ROWS)
    drive = laid_out(
        radius * np.cos(np.tile(around, 2)), np.ones(2 * ROWS), np.tile(time_s, 2),
        np.repeat(["left", "right"], ROWS), radius * np.sin(np.tile(around, 2)),
    )  # fmt: skip
    inside = np.hypot(drive.x_m, drive.y_m) < 4.5
    assert drive.place_m[~inside].min() > drive.place_m[inside].max() or (
        drive.place_m[~inside].max() < drive.place_m[inside].min()
    )


def test_a_pass_stated_before_a_pause_of_the_clock_is_the_pass_after_it():
    time_s = 0.1 * np.arange(ROWS) + 30.0 * (np.arange(ROWS) >= 200)
    stated = np.where(np.arange(ROWS) < 3, 2.0, np.nan)
    np.testing.assert_array_equal(laid_out(ALONG_M, stated, time_s).pass_number, 2.0)


@pytest.mark.parametrize("names", [("front", "rear"), ("rear_first", "z_front")])
@pytest.mark.parametrize("late_s", [0.0, 0.1, 2.0])
def test_a_rear_wheel_finds_the_slip_of_the_front_one_whichever_began_first(names, late_s):
    front, rear = names
    slip = np.where(ALONG_M < 5.0, 0.1, 0.5)
    clock = 0.1 * np.arange(ROWS)
    is_front = np.repeat([front < rear, front > rear], ROWS)
    columns = {
        "time_s": np.where(is_front, np.tile(clock, 2) + late_s, np.tile(clock, 2)), "load_N": np.full(2 * ROWS, 80.0),
        "slip": np.where(is_front, np.tile(slip, 2), 0.3), "x_m": np.tile(ALONG_M, 2),
        "pass": np.where(is_front, 1.0, 2.0),
    }  # fmt: skip
    table = WheelTable(columns, np.where(is_front, front, rear), None, "test")
    order, stretch = order_of(table)
    drive = drive_of(table.select(order), Wheel(radius_m=0.1, width_m=0.1), stretch)
    behind = (drive.pass_number == 2.0) & (np.abs(drive.x_m - 5.0) > 0.5)
    np.testing.assert_allclose(drive.slip_before[behind], np.where(drive.x_m < 5.0, 0.1, 0.5)[behind])
