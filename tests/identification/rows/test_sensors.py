"""Sensors that are stuck, and stated noise that cannot be a sensor's or that the readings contradict."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from bevameter import InputError, Vehicle, Wheel, WheelTable, identify
from bevameter.framework.core.findings import Finding, codes
from bevameter.identification.rows.select import select_wheel_rows
from slow_drive import SAND, VEHICLE, WHEEL, drive, recording, with_columns
from steady_trials import trials


def found(table, **noise) -> list[Finding]:
    findings = select_wheel_rows(recording(table, Vehicle(wheels=(WHEEL,), noise=noise))).findings
    return [each for each in findings if each.code == "stated_noise"]


@pytest.mark.parametrize(
    ("name", "stated", "message"),
    [
        ("sinkage_m", 0.5, r"sinkage_m of wheel.csv ranges from 0\.\d+ to 0\.\d+"),
        ("torque_Nm", 1e9, "torque_Nm of wheel.csv ranges from"),
        ("drawbar_pull_N", 1e4, "drawbar_pull_N of wheel.csv ranges from"),
        ("load_N", 1e3, r"load_N of wheel.csv is 12\d at most"),
        ("slip", 1.0, r"slip of wheel.csv lies in \[-1, 1\]"),
    ],
)
def test_a_stated_noise_above_the_range_of_its_channel_is_refused(name, stated, message, rng):
    with pytest.raises(InputError, match=rf"vehicle 'vehicle', key noise\.{name}: .*standard deviation: {message}"):
        found(trials(rng), **{name: stated})


def test_identify_refuses_a_stated_noise_above_the_range_of_its_channel(rng):
    vehicle = Vehicle(wheels=(WHEEL,), noise={**VEHICLE.noise, "sinkage_m": 0.5})
    with pytest.raises(InputError, match=r"key noise\.sinkage_m: 0\.5 "):
        identify(recording(drive(rng), vehicle))


@pytest.mark.parametrize("timed", [True, False])
def test_a_stated_noise_far_below_the_scatter_is_noted(timed, rng):
    (note,) = found(drive(rng) if timed else trials(rng), torque_Nm=1e-9)
    assert (note.values["channel"], note.values["stated"]) == ("torque_Nm", 1e-9)
    assert note.values["shown"] > 0.01


def test_a_stated_noise_within_a_factor_of_ten_is_accepted(rng):
    table = drive(rng)
    for factor in (0.1, 1.0, 10.0):
        assert found(table, **{name: factor * each for name, each in VEHICLE.noise.items()}) == []


def test_a_stated_noise_is_not_judged_by_a_channel_that_is_held_stuck_or_missing(rng):
    table = trials(rng)
    held = {"load_N": np.full(len(table), 90.0), "sinkage_m": np.full(len(table), 0.02)}
    assert found(with_columns(table, **held), load_N=20.0, sinkage_m=0.5, x_m=1e6, wheel_speed_rad_s=1e6) == []
    assert found(table.select(table["slip"] == 0.05), sinkage_m=0.5) == []


@pytest.mark.parametrize(("name", "stuck"), [("torque_Nm", 5.0), ("sinkage_m", 0.02)])
def test_an_answer_that_never_changes_is_left_out_and_reported(rng, name, stuck):
    table = drive(rng)
    result = identify(recording(with_columns(table, **{name: np.full(len(table), stuck)})))
    assert [each.values for each in result.findings if each.code == "stuck_channel"] == [{"channel": name}]
    assert result.overall is not None
    assert name not in result.overall.channels
    phi = result.overall.parameters["phi_rad"]
    assert phi.low <= SAND.phi_rad <= phi.high


def test_of_two_wheels_only_the_one_whose_sensor_is_stuck_loses_it(rng):
    table = drive(rng)
    both = {name: np.concatenate([values, values]) for name, values in table.columns.items()}
    both["torque_Nm"][: len(table)] = 5.0
    wheels = tuple(Wheel(radius_m=0.15, width_m=0.12, name=name) for name in ("left", "right"))
    names = np.repeat(["left", "right"], len(table))
    result = identify(
        recording(WheelTable(both, names, None, Path("wheel.csv")), Vehicle(wheels=wheels, noise=VEHICLE.noise))
    )
    (stuck,) = [each for each in result.findings if each.code == "stuck_channel"]
    assert stuck.values == {"channel": "torque_Nm", "of_wheel": "wheel left"}
    assert result.overall is not None
    assert "torque_Nm" in result.overall.channels
    phi = result.overall.parameters["phi_rad"]
    assert phi.low <= SAND.phi_rad <= phi.high


@pytest.mark.parametrize(
    ("lugs", "expected"),
    [
        ({"grouser_count": 24}, ["grouser_height_missing"]),
        ({"grouser_height_m": 0.012}, ["grouser_count_missing"]),
        ({"grouser_height_m": 0.012, "grouser_count": 24}, []),
        ({}, []),
    ],
)
def test_lugs_without_a_height_or_a_count_are_named(lugs, expected, rng):
    vehicle = Vehicle(wheels=(Wheel(radius_m=0.15, width_m=0.12, **lugs),), noise=VEHICLE.noise)
    assert codes(select_wheel_rows(recording(drive(rng), vehicle)).findings) == expected


def test_rows_in_which_a_sensor_hangs_are_left_out_of_it(rng):
    table = drive(rng)
    torque, sinkage = table["torque_Nm"].copy(), table["sinkage_m"]
    torque[40:60] = torque[40]
    rounded = with_columns(table, torque_Nm=torque, sinkage_m=np.round(sinkage / 0.002) * 0.002)
    selected = select_wheel_rows(recording(rounded))
    (hung,) = [each for each in selected.findings if each.code == "stuck_rows"]
    assert hung.values == {"channel": "torque_Nm", "n": 20}
    np.testing.assert_array_equal(np.flatnonzero(np.isnan(selected.table["torque_Nm"])), np.arange(40, 60))
    assert np.isfinite(selected.table["sinkage_m"]).all(), "a coarse step repeats values by chance"
