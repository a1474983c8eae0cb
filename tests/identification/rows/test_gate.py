"""Which rows the gate lets through, and how a drive is cut into stretches."""

from __future__ import annotations

import numpy as np
import pytest
from bevameter.identification.rows.gate import find_stretches, quasi_static
from slow_drive import WHEEL, drive, with_columns


@pytest.mark.parametrize("row", [0, 150, -1])
def test_one_gross_error_closes_no_gate_at_any_row(rng, row):
    table = drive(rng)
    sinkage = table["sinkage_m"].copy()
    sinkage[row] = 0.3
    assert (quasi_static(with_columns(table, sinkage_m=sinkage), WHEEL) == "").all()


def test_acceleration_closes_the_gate_only_while_it_lasts(rng):
    table = drive(rng)
    speed = 0.05 + 0.35 * np.clip((table["time_s"] - 14.0) / 0.5, 0.0, 1.0)
    reasons = quasi_static(with_columns(table, travel_speed_m_s=speed), WHEEL)
    closed = table["time_s"][reasons != ""]
    assert closed.min() > 13.0
    assert closed.max() < 16.0
    assert "accelerating" in reasons[reasons != ""][0]


def test_short_closures_do_not_cut_a_stretch_and_short_stretches_are_not_used():
    time_s = np.arange(200) / 10.0
    reasons = np.full(200, "", dtype=object)
    reasons[50:53] = "slip was not observed"
    reasons[120:150] = "accelerating"
    stretches = find_stretches(time_s, reasons, np.empty(0))
    assert [(stretch.reason or "used").split(" (")[0] for stretch in stretches] == ["used", "accelerating", "too short"]
    assert len(stretches[0].rows) == 117


def test_a_gap_in_time_ends_a_stretch_and_is_not_counted_as_driving():
    time_s = np.arange(200) / 10.0
    time_s[34:] += 3600.0
    time_s[100:] += 0.3
    before, after = find_stretches(time_s, np.full(200, "", dtype=object), np.empty(0))
    assert before.reason == "too short (3.3 s, 34 rows)"
    assert after.reason == ""
    assert (before.end_s, after.start_s, after.end_s) == pytest.approx((3.3, 3603.4, 3620.2))


def test_a_wheel_that_spins_on_a_slope_down_which_it_slides_does_not_roll_backwards(rng):
    table = drive(rng)
    sliding = with_columns(table, travel_speed_m_s=-table["travel_speed_m_s"], wheel_speed_rad_s=np.ones(len(table)))
    assert "rolling backwards" not in quasi_static(sliding, WHEEL)
