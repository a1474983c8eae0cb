"""Travel speed from places: right within what it says of itself, and never from the wheels."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from bevameter.framework.core.errors import InputError
from bevameter.framework.core.findings import codes
from bevameter.framework.core.recording.types import Pose, Recording, WheelTable
from bevameter.framework.core.vehicle import Vehicle, Wheel
from bevameter.identification.rows.select import select_wheel_rows
from bevameter.identification.rows.travel import slopes, with_travel_speed

RADIUS_M = 0.15
VEHICLE = Vehicle(wheels=(Wheel(radius_m=RADIUS_M, width_m=0.12),))
TIME_S = np.arange(0.0, 120.0, 0.05)
SPEED = 0.25 + 0.06 * np.sin(2.0 * np.pi * TIME_S / 20.0)
SLIP = 0.25 + 0.2 * np.sin(2.0 * np.pi * TIME_S / 13.0)
RATE = SPEED / (1.0 - SLIP) / RADIUS_M


def recording(every: int, sd_m: float, *, speed=SPEED, yaw: float = 0.6, **also) -> Recording:
    """Poses at every so many rows, which scatter by `sd_m`, along a straight line."""
    rng = np.random.default_rng(3)
    way = np.concatenate([[0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]) * 0.05)])[::every]
    x, y = (way * each + sd_m * rng.standard_normal(len(way)) for each in (np.cos(yaw), np.sin(yaw)))
    pose = Pose(TIME_S[::every], x, y, np.full(len(way), yaw))
    torque, rate = (values + sd * rng.standard_normal(len(TIME_S)) for values, sd in ((5.0 + SLIP, 0.1), (RATE, 0.01)))
    columns = {"time_s": TIME_S, "load_N": np.full(len(TIME_S), 150.0), "torque_Nm": torque, "wheel_speed_rad_s": rate}
    columns |= also
    return Recording(
        "r", Path("r"), VEHICLE, None, "", "0" * 64, wheel=WheelTable(columns, None, None, Path("w")), pose=pose
    )


@pytest.mark.parametrize(("every", "sd_m"), [(1, 0.001), (2, 0.005), (4, 0.02)])
def test_the_speed_is_right_within_its_standard_deviation(every, sd_m):
    drive = recording(every, sd_m)
    table, vehicle, found = with_travel_speed(drive.wheel, VEHICLE, drive.pose)
    assert found.code == "travel_speed_computed"
    assert found.values["place_sd_m"] == pytest.approx(sd_m, rel=0.2)
    off = (table["travel_speed_m_s"] - SPEED)[40:-40]
    assert np.sqrt(np.mean(off**2)) == pytest.approx(found.values["sd_m_s"], rel=0.35)
    # The wheel's own speed scatters, too.
    both = np.hypot(found.values["sd_m_s"], 0.01 * RADIUS_M)
    assert vehicle.noise["slip"] == pytest.approx(both / found.values["rim_m_s"], rel=0.05)
    selected = select_wheel_rows(drive)
    assert "travel_speed_computed" in codes(selected.findings)
    slip = selected.table["slip"]
    assert np.nanmedian(np.abs(slip - np.interp(selected.table["time_s"], TIME_S, SLIP))) < 2.0 * vehicle.noise["slip"]


def test_it_goes_backwards_where_the_vehicle_does():
    drive = recording(2, 0.001, speed=-SPEED)
    table, _, _ = with_travel_speed(drive.wheel, VEHICLE, drive.pose)
    np.testing.assert_allclose(table["travel_speed_m_s"][40:-40], -SPEED[40:-40], atol=0.02)


def test_on_a_slope_it_is_along_the_ground():
    drive = recording(2, 0.0, pitch_rad=np.full(len(TIME_S), 0.3))
    table, _, _ = with_travel_speed(drive.wheel, VEHICLE, drive.pose)
    np.testing.assert_allclose(table["travel_speed_m_s"][40:-40], SPEED[40:-40] / np.cos(0.3), rtol=0.01)


def test_places_made_from_the_wheels_are_refused():
    read = RATE + 0.01 * np.random.default_rng(4).standard_normal(len(TIME_S))
    drive = recording(2, 0.0, speed=1.02 * read * RADIUS_M, wheel_speed_rad_s=read)
    table, _, found = with_travel_speed(drive.wheel, VEHICLE, drive.pose)
    assert "travel_speed_m_s" not in table
    assert found.code == "travel_speed_of_wheels"
    with pytest.raises(InputError, match=r"no column slip; the poses are made from the wheels .*1\.02 times the mean"):
        select_wheel_rows(drive)


def test_places_that_scatter_too_much_are_refused():
    with pytest.raises(InputError, match=r"no column slip; the poses give no travel speed: .*scatter by 0\.\d+ m"):
        select_wheel_rows(recording(20, 0.6))


def test_what_was_recorded_stays():
    drive = recording(2, 0.001, travel_speed_m_s=SPEED + 0.01)
    table, vehicle, found = with_travel_speed(drive.wheel, VEHICLE, drive.pose)
    assert (table, vehicle, found) == (drive.wheel, VEHICLE, None)
    alone = replace(drive, pose=None)
    assert with_travel_speed(alone.wheel, VEHICLE, None)[2] is None


def test_slopes_are_those_of_least_squares(rng):
    time_s = np.sort(rng.uniform(0.0, 10.0, 60))
    values = rng.standard_normal(60)
    slope, error = slopes(time_s, values, 2.0)
    near = np.abs(time_s - time_s[30]) <= 1.0
    assert slope[30] == pytest.approx(np.polyfit(time_s[near], values[near], 1)[0])
    assert error[30] == pytest.approx(1.0 / np.sqrt(np.sum((time_s[near] - time_s[near].mean()) ** 2)))
