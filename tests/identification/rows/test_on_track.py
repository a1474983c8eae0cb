"""Positions, passes and grounds of the wheels of a vehicle."""

import numpy as np
from bevameter.framework.core.recording.types import WheelTable
from bevameter.framework.core.track.grounds import CHANGE_MARGIN_M, Ground
from bevameter.framework.core.track.way import track_of
from bevameter.identification.effects.drive import GROUND
from bevameter.identification.rows.on_track import passes_at, with_grounds, with_places
from ground_drive import LOAM, SAND, SPEED_M_S, ground_drive

AHEAD_M = 0.4


def placed():
    drive = ground_drive({"sand": SAND, "loam": LOAM}, places=(AHEAD_M, -AHEAD_M))
    track = track_of(drive)
    table = with_places(drive.wheel, drive.vehicle, track)
    return drive, track, table


def test_wheels_are_ahead_of_and_behind_the_reference_point():
    _, _, table = placed()
    for name, forward in (("w0", AHEAD_M), ("w1", -AHEAD_M)):
        rows = table.wheel == name
        np.testing.assert_allclose(table["x_m"][rows], SPEED_M_S * table["time_s"][rows] + forward, atol=1e-9)


def test_the_rear_wheel_runs_in_the_rut_of_the_front_one_from_where_that_began():
    _, _, table = placed()
    front, rear = table.wheel == "w0", table.wheel == "w1"
    assert (table["pass"][front] == 1.0).all()
    in_rut = table["x_m"][rear] > AHEAD_M + 0.1
    assert (table["pass"][rear][in_rut] == 2.0).all()
    assert (table["pass"][rear][table["x_m"][rear] < AHEAD_M - 0.1] == 1.0).all()


def test_a_wheel_without_rows_makes_a_rut_too():
    drive, track, table = placed()
    rear = with_places(drive.wheel.select(drive.wheel.wheel == "w1"), drive.vehicle, track)
    np.testing.assert_array_equal(rear["pass"], table["pass"][table.wheel == "w1"])


def test_passes_follow_from_places_that_were_recorded():
    drive, track, table = placed()
    recorded = WheelTable({**drive.wheel.columns, "x_m": table["x_m"], "y_m": table["y_m"]}, table.wheel, None, "test")
    np.testing.assert_array_equal(with_places(recorded, drive.vehicle, track)["pass"], table["pass"])


def test_a_wheel_that_comes_back_runs_over_its_track_once_more():
    out = np.arange(0.0, 20.0, 0.1)
    x_m = np.concatenate([out, out[::-1]])
    time_s, way_m = np.arange(len(x_m)) * 0.1, 0.1 * np.arange(len(x_m))
    place, names = np.column_stack([x_m, np.zeros_like(x_m)]), np.full(len(x_m), "w")
    passes = passes_at(place, time_s, way_m, names, 0.1)
    assert (passes[: len(out)] == 1.0).all()
    assert (passes[len(out) + 40 :] == 2.0).all()
    aside = place.copy()
    aside[len(out) :, 1] = 0.5
    assert (passes_at(aside, time_s, way_m, names, 0.1) == 1.0).all()


def test_unknown_places_have_no_pass():
    place = np.column_stack([np.arange(5.0), [0.0, np.nan, 0.0, 0.0, 0.0]])
    passes = passes_at(place, np.arange(5.0), np.arange(5.0), np.full(5, "w"), 0.1)
    assert np.isnan(passes[1])
    assert (passes[[0, 2, 3, 4]] == 1.0).all()


def test_a_wheel_reaches_a_border_before_the_reference_point_or_after_it():
    drive, track, table = placed()
    grounds = (Ground("sand", 0.0, 20.0), Ground("loam", 20.0, 40.0))
    number = with_grounds(table, drive.vehicle, track, grounds)[GROUND]
    border = 20.0 * SPEED_M_S
    np.testing.assert_array_equal(number == 0.0, table["x_m"] <= border - CHANGE_MARGIN_M)
    np.testing.assert_array_equal(number == 1.0, table["x_m"] >= border + CHANGE_MARGIN_M)


def test_without_a_track_borders_are_compared_in_time():
    drive, _, table = placed()
    number = with_grounds(table, drive.vehicle, None, (Ground("a", 0.0, 20.0), Ground("b", 20.0, 40.0)))[GROUND]
    np.testing.assert_array_equal(number == 1.0, table["time_s"] >= 20.0)


def test_rows_outside_of_what_is_labelled_are_on_no_ground():
    drive, track, table = placed()
    number = with_grounds(table, drive.vehicle, track, (Ground("sand", 5.0, 15.0),))[GROUND]
    start, end = 5.0 * SPEED_M_S + CHANGE_MARGIN_M, 15.0 * SPEED_M_S - CHANGE_MARGIN_M
    within, beyond = ((start - by < table["x_m"]) & (table["x_m"] < end + by) for by in (-0.01, 0.01))
    assert (number[within] == 0.0).all()
    assert np.isnan(number[~beyond]).all()
