"""What effects ask of each sample, where some of it was not observed."""

from __future__ import annotations

import numpy as np
import pytest
from bevameter import Wheel
from bevameter.framework.core.recording.types import WheelTable
from bevameter.identification.effects.drive import drive_of, order_of, rate_of_change
from bevameter.identification.mismatch.fit.lanes import lanes

TIME_S = np.arange(400) / 10.0
SPEED = 0.3 + 0.1 * np.sin(0.5 * TIME_S)
PLACE = 0.3 * TIME_S - 0.2 * (np.cos(0.5 * TIME_S) - 1.0)


def laid_out(**columns: np.ndarray):
    count = len(TIME_S)
    table = WheelTable(
        {"time_s": TIME_S, "load_N": np.full(count, 80.0), "slip": np.full(count, 0.2), **columns}, None, None, "made"
    )
    return drive_of(table, Wheel(radius_m=0.1, width_m=0.1), order_of(table)[1])


def test_a_gap_costs_the_acceleration_of_its_own_rows_alone():
    """Inertia of 128 nats was not even tried, for twelve rows of 1,469 had no speed."""
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
def test_where_most_was_not_observed_nothing_is_made_up(known):
    place = np.where(np.arange(len(TIME_S)) < known, PLACE, np.nan)
    drive = laid_out(x_m=place, travel_speed_m_s=SPEED)
    assert np.isfinite(drive.place_m).sum() == known


def test_where_the_track_turns_its_place_is_the_way_gone():
    around = 0.3 * TIME_S / 4.0
    drive = laid_out(x_m=4.0 * np.cos(around), y_m=4.0 * np.sin(around))
    assert drive.axis is None
    np.testing.assert_allclose(drive.place_m, 0.3 * TIME_S, rtol=1e-5)


def test_where_it_is_straight_the_place_is_that_along_it():
    straight = laid_out(x_m=PLACE, y_m=0.01 * np.sin(TIME_S))
    np.testing.assert_array_equal(straight.place_m, PLACE)
    oblique = laid_out(x_m=5e5 - 0.6 * PLACE, y_m=4e6 + 0.8 * PLACE)
    np.testing.assert_allclose(oblique.axis, [-0.6, 0.8], rtol=1e-6)
    np.testing.assert_allclose(oblique.place_m, PLACE - PLACE[0], atol=1e-6)


def test_lanes_side_by_side_are_straight_and_a_later_pass_lies_on_its_own():
    along, number = np.tile(np.linspace(0.0, 3.0, 50), 8), np.repeat(np.arange(8), 50)
    passes, y_m = 1.0 + number // 2 % 2, 0.5 * (number % 2) + 2.0 * (number // 4)
    drive = laid_out(x_m=along, y_m=y_m, **{"pass": passes})
    np.testing.assert_array_equal(drive.place_m, along)
    lane = lanes(drive, 0.1)
    assert len(np.unique(lane)) == 4
    assert all(len(np.unique(lane[y_m == each])) == 1 for each in np.unique(y_m))
    unknown = laid_out(x_m=along, **{"pass": passes})
    assert len(np.unique(lanes(unknown, 0.1))) == 4, "each first pass starts over: another one, or the same once more"


def test_a_later_pass_of_a_loop_lies_where_the_first_one_was():
    around, passes = 2.0 * np.pi * np.arange(400) / 200.0, 1.0 + (np.arange(400) >= 200)

    def twice_around(wider_m: float):
        radius = 4.0 + wider_m * (passes > 1.0)
        return laid_out(x_m=radius * np.cos(around), y_m=radius * np.sin(around), **{"pass": passes}).place_m

    same, other = twice_around(0.02), twice_around(1.0)
    np.testing.assert_allclose(same[200:], same[:200], atol=1e-9)
    assert (other[200:] > other[199]).all(), "another track is not the same ground"
