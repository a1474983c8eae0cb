"""Load, pull and torque of a vehicle that senses none of them, against mechanics of another derivation."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from bevameter.framework.core.errors import InputError
from bevameter.framework.core.findings import codes
from bevameter.framework.core.recording.types import Pose, Recording, WheelTable
from bevameter.framework.core.vehicle import Motor, Vehicle, Wheel, load_vehicle
from bevameter.identification.rows.motor import torque_of_current, with_torque
from bevameter.identification.rows.select import select_wheel_rows
from bevameter.identification.rows.weight import with_loads
from robot_bag import GRAVITY, MASS_KG, NAMES, PLACES, VEHICLE_TOML, drive


@pytest.fixture(scope="module")
def driven():
    return drive(20.0)


@pytest.fixture
def recording(driven, tmp_path):
    path = tmp_path / "vehicle.toml"
    path.write_text(VEHICLE_TOML, encoding="utf-8")
    n = len(driven.time_s)
    columns = {
        "time_s": np.repeat(driven.time_s, 4), "torque_Nm": driven.torque_Nm.ravel(), "slip": np.repeat(driven.slip, 4),
        "travel_speed_m_s": np.repeat(driven.speed_m_s, 4), "pitch_rad": np.repeat(driven.pitch_rad, 4),
    }  # fmt: skip
    table = WheelTable(columns, np.tile(np.array(NAMES, dtype=object), n), None, Path("wheel.csv"))
    return Recording("r", Path("wheel.csv"), load_vehicle(path), None, "", "0" * 64, wheel=table)


def test_load_and_pull_are_those_of_the_wheels_in_equilibrium(driven, recording):
    rows = select_wheel_rows(recording)
    assert {"load_computed", "pull_computed"} <= set(codes(rows.findings))
    for number, name in enumerate(NAMES):
        own = rows.table.select(rows.table.wheel == name)
        at = np.searchsorted(driven.time_s, own["time_s"] - 1e-6)
        # by moments about the axles; the pull by the wheels' stresses
        np.testing.assert_allclose(own["load_N"], driven.load_N[at, number], atol=0.6)
        assert np.abs(own["drawbar_pull_N"] - driven.pull_N[at, number]).max() < 2.0
    assert np.ptp(driven.pull_N[:, 0]) > 30.0


def test_without_the_slope_the_load_is_in_doubt(recording):
    columns = {name: values for name, values in recording.wheel.columns.items() if name != "pitch_rad"}
    table = WheelTable(columns, recording.wheel.wheel, None, recording.wheel.source)
    rows = select_wheel_rows(Recording("r", Path("w.csv"), recording.vehicle, None, "", "0" * 64, wheel=table))
    found = [each for each in rows.findings if each.code == "load_without_slope"]
    assert [each.severity for each in found] == ["warning"]
    assert "drawbar_pull_N" not in rows.table


def test_roll_moves_load_to_the_lower_side(recording):
    """By moments about the line of the left wheels: W_right / W = 1/2 + h tan(roll) / b."""
    roll, height, track = 0.1, recording.vehicle.centre_of_mass_m[2], np.ptp(PLACES[:, 1])
    level = {**recording.wheel.columns, "pitch_rad": np.zeros(len(recording.wheel))}
    level["travel_speed_m_s"] = np.full(len(recording.wheel), 0.2)
    table = WheelTable(
        {**level, "roll_rad": np.full(len(recording.wheel), roll)}, recording.wheel.wheel, None, Path("w")
    )
    rows = select_wheel_rows(Recording("r", Path("w"), recording.vehicle, None, "", "0" * 64, wheel=table)).table
    right = sum(rows["load_N"][rows.wheel == name].mean() for name in ("front_right", "rear_right"))
    expected = MASS_KG * GRAVITY * np.cos(roll) * (0.5 + height * np.tan(roll) / track)
    assert right == pytest.approx(expected, rel=1e-6)


def test_a_bend_moves_load_to_its_outer_side(recording):
    """By moments about the line of the right wheels: W_left / W = 1/2 - h a / (g b), accelerated to the left by a."""
    time_s, speed, rate = np.unique(recording.wheel["time_s"]), 0.4, 0.6
    height, track = recording.vehicle.centre_of_mass_m[2], np.ptp(PLACES[:, 1])
    level = {**recording.wheel.columns, "pitch_rad": np.zeros(len(recording.wheel))}
    level["travel_speed_m_s"] = np.full(len(recording.wheel), speed)
    table, yaw = (
        WheelTable(level, recording.wheel.wheel, None, Path("w")),
        np.mod(rate * time_s + np.pi, 2 * np.pi) - np.pi,
    )
    pose = Pose(time_s, speed / rate * np.sin(yaw), speed / rate * (1.0 - np.cos(yaw)), yaw)
    loaded, _, found = with_loads(table, recording.vehicle, pose)
    left = sum(loaded["load_N"][loaded.wheel == name] for name in ("front_left", "rear_left"))
    expected = MASS_KG * GRAVITY * (0.5 - height * speed * rate / (GRAVITY * track))
    np.testing.assert_allclose(left[100:-100], expected, rtol=1e-6)
    assert "yaw_rad" in found.values["transfer"]


def test_friction_of_the_motor_is_what_a_free_spin_takes():
    time_s = np.arange(0.0, 20.0, 0.1)
    spins = time_s < 5.0
    rate, current = np.where(spins, 3.0, 1.0), np.where(spins, 0.5, 4.0)
    columns = {"time_s": time_s, "wheel_speed_rad_s": rate, "current_A": current}
    table = WheelTable(columns, None, None, Path("wheel.csv"))
    motor = Motor(torque_constant_Nm_A=0.05, gear_ratio=40.0, efficiency=0.8, free_spin_s=(0.5, 4.5))
    vehicle = Vehicle(wheels=(Wheel(radius_m=0.15, width_m=0.12),), motor=motor)
    made, found = with_torque(table, vehicle)
    np.testing.assert_allclose(made["torque_Nm"], np.where(spins, 0.0, 3.5 * 1.6), atol=1e-12)
    assert found.values["friction_Nm"] == pytest.approx(0.5 * 1.6)
    late = vehicle.model_copy(update={"motor": motor.model_copy(update={"free_spin_s": (30.0, 40.0)})})
    with pytest.raises(InputError, match=r"wheel\.csv: 0 rows in which wheels turn from 30 s to 40 s .*free_spin_s"):
        with_torque(table, late)


@pytest.mark.parametrize(
    ("keys", "said"),
    [
        ("friction_Nm = 1.0\nfree_spin_s = [1.0, 2.0]", "friction_Nm and free_spin_s"),
        ("free_spin_s = [2.0, 1.0]", "a start before the end"),
    ],
)
def test_a_free_spin_that_cannot_be_is_one_error(keys, said, tmp_path):
    path = tmp_path / "vehicle.toml"
    path.write_text(f"{VEHICLE_TOML}\n[motor]\ntorque_constant_Nm_A = 0.05\n{keys}\n")
    with pytest.raises(InputError, match=said):
        load_vehicle(path)


def test_torque_of_current_loses_in_the_gear_whichever_way_power_flows():
    motor = Motor(torque_constant_Nm_A=0.05, gear_ratio=40.0, efficiency=0.8, friction_Nm=1.0)
    torque = torque_of_current(np.array([3.0, -3.0, -3.0, 0.0]), np.array([2.0, 2.0, -2.0, 2.0]), motor)
    np.testing.assert_allclose(torque, [6.0 * 0.8 - 1.0, -6.0 / 0.8 - 1.0, -6.0 * 0.8 + 1.0, -1.0])
