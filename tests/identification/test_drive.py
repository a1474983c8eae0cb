"""Quantities that effects need of each sample, where some were not observed."""

from __future__ import annotations

import numpy as np
import pytest
from bevameter import Wheel
from bevameter.framework.core.recording.types import WheelTable
from bevameter.identification.effects.drive import drive_of, order_of, rate_of_change

TIME_S = np.arange(400) / 10.0
SPEED = 0.3 + 0.1 * np.sin(0.5 * TIME_S)
PLACE = 0.3 * TIME_S - 0.2 * (np.cos(0.5 * TIME_S) - 1.0)


def laid_out(**columns: np.ndarray):
    count = len(TIME_S)
    table = WheelTable(
        {"time_s": TIME_S, "load_N": np.full(count, 80.0), "slip": np.full(count, 0.2), **columns}, None, None, "test"
    )
    return drive_of(table, Wheel(radius_m=0.1, width_m=0.1), order_of(table)[1])


def test_a_gap_in_speed_loses_the_acceleration_of_its_own_rows_only():
    """Twelve rows of 1,469 without a speed once kept inertia from being tried."""
    speed = SPEED.copy()
    speed[[50, *range(200, 212)]] = np.nan
    rate = rate_of_change(speed, TIME_S, np.zeros(len(TIME_S), dtype=int))
    np.testing.assert_array_equal(np.isnan(rate), np.isnan(speed))
    inner = np.isfinite(rate)
    assert np.abs(rate - 0.05 * np.cos(0.5 * TIME_S))[inner].max() < 1e-3


def test_places_that_were_not_observed_lie_between_those_that_were():
    place = PLACE.copy()
    place[[0, 1, 60, *range(200, 212), 399]] = np.nan
    drive = laid_out(x_m=place, travel_speed_m_s=SPEED)
    assert np.abs(drive.place_m - PLACE).max() < 0.02, "ends by the mean speed"
    assert np.abs(drive.place_m - PLACE)[2:399].max() < 0.01
    seen = np.isfinite(place)
    np.testing.assert_array_equal(drive.place_m[seen], place[seen])


@pytest.mark.parametrize("known", [0, 1, 150])
def test_positions_are_not_interpolated_where_most_are_missing(known):
    place = np.where(np.arange(len(TIME_S)) < known, PLACE, np.nan)
    drive = laid_out(x_m=place, travel_speed_m_s=SPEED)
    assert np.isfinite(drive.place_m).sum() == known


def test_a_run_is_a_stretch_of_time_or_as_trials_state_it():
    columns = {"load_N": np.full(4, 80.0), "slip": np.array([0.1, 0.2, 0.1, 0.2])}
    labels = np.array(["b", "b", "a", "a"])
    for time, expected in ({}, [0, 0, 1, 1]), ({"time_s": np.array([0.0, 0.1, 0.2, 0.3])}, [0, 0, 1, 1]):
        table = WheelTable(columns | time, None, labels, "test")
        order, stretch = order_of(table)
        run = drive_of(table.select(order), Wheel(radius_m=0.1, width_m=0.1), stretch).run
        np.testing.assert_array_equal(run, expected)
    table = WheelTable(columns, None, None, "test")
    assert not drive_of(table, Wheel(radius_m=0.1, width_m=0.1), order_of(table)[1]).run.any()
