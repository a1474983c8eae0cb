"""Channels that cannot be what their names say are refused, left out or doubted, and others are not."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from bevameter import InputError, Vehicle, Wheel, WheelTable, identify
from slow_drive import SAND, VEHICLE, drive, recording, with_columns


def test_a_torque_that_brakes_a_driven_wheel_is_refused(rng):
    table = drive(rng)
    with pytest.raises(InputError, match=r"column torque_Nm: -.*100 % of the rows with a slip above 0.1 below 0"):
        identify(recording(with_columns(table, torque_Nm=-table["torque_Nm"])))


def test_a_wheel_without_torque_or_braked_is_not_refused(rng):
    table = drive(rng)
    identify(recording(with_columns(table, torque_Nm=-0.1 + 0.01 * rng.normal(size=len(table)))))
    braked = with_columns(table, torque_Nm=-table["torque_Nm"], slip=-table["slip"])
    assert "braked" in identify(recording(braked)).segments[0].reason


def test_a_load_cell_that_reads_nothing_is_refused(rng):
    table = drive(rng)
    with pytest.raises(InputError, match=r"column load_N: 0 at most \(expected the wheel's load, positive\)"):
        identify(recording(with_columns(table, load_N=np.zeros(len(table)))))


def test_a_stretch_in_most_of_which_the_load_cell_reads_nothing_is_not_used(rng):
    table = drive(rng)
    load = np.where(np.arange(len(table)) % 4 == 0, table["load_N"], 0.0)
    result = identify(recording(with_columns(table, load_N=load)))
    assert {segment.reason for segment in result.segments} == {"load_N is 0 or less in most rows"}


def test_a_sinkage_whose_zero_is_a_little_off_is_not_refused(rng):
    table = drive(rng)
    identify(recording(with_columns(table, sinkage_m=table["sinkage_m"] - np.median(table["sinkage_m"]) - 1e-3)))


@pytest.mark.parametrize(("name", "stuck"), [("torque_Nm", 5.0), ("sinkage_m", 0.02)])
def test_an_answer_that_never_changes_is_left_out_and_said_so(rng, name, stuck):
    table = drive(rng)
    result = identify(recording(with_columns(table, **{name: np.full(len(table), stuck)})))
    assert any(f"{name} never changes" in problem for problem in result.problems)
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
    assert "wheel left: torque_Nm never changes: it is left out, as of a sensor that is stuck or absent" in (
        result.problems
    )
    assert result.overall is not None
    assert "torque_Nm" in result.overall.channels
    phi = result.overall.parameters["phi_rad"]
    assert phi.low <= SAND.phi_rad <= phi.high


def test_a_sinkage_in_millimetres_is_refused(rng):
    table = drive(rng)
    with pytest.raises(InputError, match=r"column sinkage_m: .* m \(median\) .*the wheel's diameter, 0\.3 m"):
        identify(recording(with_columns(table, sinkage_m=1e3 * table["sinkage_m"])))


@pytest.mark.parametrize(
    ("name", "unit", "said"),
    [
        ("load_N", 1e-3, r"columns load_N and torque_Nm: 0\.\d+ N and .* Nm .*no soil bears more than"),
        ("torque_Nm", 1e3, "columns load_N and torque_Nm"),
    ],
)
def test_a_load_that_no_soil_lets_a_wheel_turn_against_is_refused(rng, name, unit, said):
    table = drive(rng)
    with pytest.raises(InputError, match=said):
        identify(recording(with_columns(table, **{name: unit * table[name]})))


def test_a_load_in_kilonewtons_shows_by_its_pull_and_one_in_kilograms_does_not(rng):
    table = with_columns(drive(rng), drawbar_pull_N=0.3 * drive(rng)["load_N"])
    without = WheelTable(
        {name: values for name, values in table.columns.items() if name != "torque_Nm"}, None, None, table.source
    )
    with pytest.raises(InputError, match="columns load_N and drawbar_pull_N"):
        identify(recording(with_columns(without, load_N=1e-3 * table["load_N"])))
    assert identify(recording(with_columns(without, load_N=table["load_N"] / 9.81))).segments


def test_a_wheel_that_is_mostly_in_the_air_is_not_refused(rng):
    """Its load is then nearly nothing beside what a pull's sensor reads."""
    table = drive(rng)
    load = table["load_N"].copy()
    load[: int(0.8 * len(load))] = 0.01
    assert identify(recording(with_columns(table, load_N=load))).segments


@pytest.mark.parametrize(("unit", "said"), [(1e3, True), (1.0, False)])
def test_a_clock_in_milliseconds_is_doubted(rng, unit, said):
    table = drive(rng)
    result = identify(recording(with_columns(table, time_s=unit * table["time_s"])))
    assert any("rows lie 100 s apart" in problem for problem in result.problems) == said


def mirrored_slip(rng, braked=1.0):
    """A drive at slips that are driven ones but for their sign in a share of the rows, the last."""
    table = drive(rng)
    first = int((1.0 - braked) * len(table))
    return with_columns(table, slip=np.where(np.arange(len(table)) < first, table["slip"], -table["slip"]))


def test_a_torque_that_drives_a_braked_wheel_is_refused(rng):
    said = (
        r"columns torque_Nm and slip: .* 100 % of the rows with a slip below -0.2 above 0 \(expected .* both negative"
    )
    with pytest.raises(InputError, match=said):
        identify(recording(mirrored_slip(rng)))


def test_where_the_lesser_part_of_a_drive_is_so_a_note_says_it(rng):
    result = identify(recording(mirrored_slip(rng, braked=0.3)))
    assert any("as if a braked wheel were driven" in problem for problem in result.problems)


def test_a_wheel_that_slips_a_little_backwards_by_the_radius_of_its_lugs_is_not_refused(rng):
    table = drive(rng)
    result = identify(recording(with_columns(table, slip=np.full(len(table), -0.12))))
    assert not any("torque_Nm" in problem for problem in result.problems)


@pytest.mark.parametrize(
    ("lugs", "said"),
    [
        ({"grouser_count": 24}, "the vehicle states 24 lugs without their height"),
        ({"grouser_height_m": 0.012}, "the vehicle states lugs of 12 mm without their number"),
        ({"grouser_height_m": 0.012, "grouser_count": 24}, ""),
        ({}, ""),
    ],
)
def test_lugs_that_are_stated_by_half_are_named(lugs, said, rng):
    vehicle = Vehicle(wheels=(Wheel(radius_m=0.15, width_m=0.12, **lugs),), noise=VEHICLE.noise)
    problems = [each for each in identify(recording(drive(rng), vehicle)).problems if "states" in each]
    assert len(problems) == bool(said)
    assert all(each.startswith(said) for each in problems)
