"""Channels in another unit than their column's are refused or doubted, and others are not."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from bevameter import InputError, Recording, Vehicle, WheelTable
from bevameter.framework.core.findings import Finding, codes
from bevameter.identification.rows.select import select_wheel_rows
from bevameter.identification.rows.units import speeds_in_another_unit
from slow_drive import WHEEL, drive, recording, with_columns
from steady_trials import trials, without


def found(table, **noise) -> list[Finding]:
    return list(select_wheel_rows(recording(table, Vehicle(wheels=(WHEEL,), noise=noise))).findings)


def test_forces_in_newtons_are_not_doubted(rng):
    table = trials(rng)
    assert found(table) == []
    assert found(without(table, "torque_Nm")) == []


@pytest.mark.parametrize(
    ("left_out", "channel"), [("sinkage_m", "torque_Nm"), ("torque_Nm", "drawbar_pull_N")], ids=["torque", "pull"]
)
def test_a_load_in_kilograms_is_named(left_out, channel, rng):
    table = without(trials(rng), left_out)
    (note,) = found(with_columns(table, load_N=table["load_N"] / 9.81))
    assert (note.code, note.values["channel"]) == ("load_unit", channel)
    assert note.values["ratio"] == pytest.approx(9.81 * note.values["ratio_if_kg"])


@pytest.mark.parametrize("left_out", ["sinkage_m", "torque_Nm"])
@pytest.mark.parametrize(("per", "unit"), [("load", "load"), (1e3, "kN")], ids=["coefficient", "kN"])
def test_a_pull_that_is_no_newtons_is_named(left_out, per, unit, rng):
    table = without(trials(rng), left_out)
    pull = table["drawbar_pull_N"] / (table["load_N"] if per == "load" else per)
    (note,) = found(with_columns(table, drawbar_pull_N=pull))
    assert (note.code, note.values["units"]) == ("pull_unit", [unit])


def test_the_noise_stated_in_newtons_is_not_blamed_for_a_pull_over_the_load(rng):
    table = trials(rng)
    table = with_columns(table, drawbar_pull_N=table["drawbar_pull_N"] / table["load_N"])
    assert codes(found(table, drawbar_pull_N=10.0)) == ["pull_unit"]


def test_a_vehicle_that_rolls_freely_pulls_nothing_and_is_not_doubted(rng):
    table = trials(rng)
    assert found(with_columns(table, drawbar_pull_N=0.2 * rng.normal(size=len(table)))) == []


def test_a_load_of_a_newton_is_no_pull_over_the_load(rng):
    table = trials(rng)
    scaled = {name: table[name] / 90.0 for name in ("load_N", "torque_Nm", "drawbar_pull_N")}
    assert found(with_columns(table, **scaled)) == []


def test_a_load_is_not_judged_by_a_braked_wheel(rng):
    table = trials(rng, slips=(-0.8, -0.6, -0.4, -0.2))
    assert found(with_columns(table, load_N=table["load_N"] / 9.81)) == []
    assert np.all(table["slip"] < 0.0)


def speeds(rng, rows=200, braking=False) -> WheelTable:
    """Rows with slip and the speeds that it is of."""
    rim = 0.5 + 0.2 * rng.random(rows)
    slip = (-0.3 if braking else 0.1) + 0.2 * rng.random(rows)
    ratio = np.where(slip >= 0.0, 1.0 - slip, 1.0 / (1.0 + slip))
    columns = {
        "time_s": 0.1 * np.arange(rows),
        "slip": slip,
        "wheel_speed_rad_s": rim,
        "travel_speed_m_s": ratio * rim * WHEEL.radius_m,
    }
    return WheelTable(columns, None, None, Path("wheel.csv"))


def without_slip(table: WheelTable) -> WheelTable:
    columns = {name: values for name, values in table.columns.items() if name != "slip"}
    return WheelTable(columns, None, None, table.source)


@pytest.mark.parametrize(
    ("name", "unit", "factor"),
    [
        ("wheel_speed_rad_s", "revolutions per minute", 30.0 / np.pi), ("travel_speed_m_s", "km/h", 3.6),
        ("wheel_speed_rad_s", "degrees per second", 180.0 / np.pi), ("travel_speed_m_s", "cm/s", 100.0),
        ("wheel_speed_rad_s", "revolutions per second", 0.5 / np.pi), ("travel_speed_m_s", "mm/s", 1000.0),
    ],
)  # fmt: skip
@pytest.mark.parametrize("braking", [False, True])
def test_a_speed_in_another_unit_is_named(rng, name, unit, factor, braking):
    table = without_slip(speeds(rng, braking=braking))
    assert speeds_in_another_unit(table, WHEEL) is None
    other = WheelTable({**table.columns, name: factor * table[name]}, None, None, table.source)
    assert {"channel": name, "unit": unit} in speeds_in_another_unit(other, WHEEL).values["likely"]


def test_wheels_that_dig_in_or_stand_and_recorded_slips_are_in_no_other_unit(rng):
    digging = without_slip(speeds(rng))
    digging.columns["travel_speed_m_s"] *= np.linspace(1.0, 0.02, 200)
    assert speeds_in_another_unit(digging, WHEEL) is None
    stuck = without_slip(speeds(rng))
    stuck.columns["travel_speed_m_s"][:] = 0.0
    assert speeds_in_another_unit(stuck, WHEEL) is None
    with_slip = speeds(rng)
    with_slip.columns["wheel_speed_rad_s"] *= 9.55
    assert speeds_in_another_unit(with_slip, WHEEL) is None


def test_rows_that_nearly_stand_do_not_hide_the_unit(rng):
    table = without_slip(speeds(rng))
    table.columns["wheel_speed_rad_s"] *= 180.0 / np.pi
    table.columns["wheel_speed_rad_s"][7], table.columns["travel_speed_m_s"][7] = 1e-5, 1e-6
    found = speeds_in_another_unit(table, WHEEL).values
    assert found["slip"] > 0.9
    assert "degrees per second" in [each["unit"] for each in found["likely"]]


def test_the_unit_is_noted(rng):
    table = without_slip(speeds(rng))
    table.columns["wheel_speed_rad_s"] *= 9.55
    table.columns["load_N"] = np.full(200, 80.0)
    vehicle = Vehicle(wheels=(WHEEL,))
    findings = select_wheel_rows(
        Recording("test", Path("wheel.csv"), vehicle, None, "", "0" * 64, wheel=table)
    ).findings
    assert codes(findings) == ["speed_unit"]


def test_a_load_cell_that_reads_nothing_is_refused(rng):
    table = drive(rng)
    with pytest.raises(InputError, match=r"column load_N: 0 at most \(expected the wheel's load, positive\)"):
        select_wheel_rows(recording(with_columns(table, load_N=np.zeros(len(table)))))


def test_a_sinkage_in_millimetres_is_refused(rng):
    table = drive(rng)
    with pytest.raises(InputError, match=r"column sinkage_m: .* m \(median\) .*the wheel's diameter, 0\.3 m"):
        select_wheel_rows(recording(with_columns(table, sinkage_m=1e3 * table["sinkage_m"])))


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
        select_wheel_rows(recording(with_columns(table, **{name: unit * table[name]})))


def test_a_load_in_kilonewtons_shows_by_its_pull_and_one_in_kilograms_does_not(rng):
    table = with_columns(drive(rng), drawbar_pull_N=0.3 * drive(rng)["load_N"])
    without = WheelTable(
        {name: values for name, values in table.columns.items() if name != "torque_Nm"}, None, None, table.source
    )
    with pytest.raises(InputError, match="columns load_N and drawbar_pull_N"):
        select_wheel_rows(recording(with_columns(without, load_N=1e-3 * table["load_N"])))
    assert select_wheel_rows(recording(with_columns(without, load_N=table["load_N"] / 9.81))).used


def test_a_wheel_that_is_mostly_in_the_air_is_not_refused(rng):
    """Its median load is then negligible against the reading of the pull sensor."""
    table = drive(rng)
    load = table["load_N"].copy()
    load[: int(0.8 * len(load))] = 0.01
    assert select_wheel_rows(recording(with_columns(table, load_N=load))).used


@pytest.mark.parametrize(("unit", "doubted"), [(1e3, True), (1.0, False)])
def test_a_clock_in_milliseconds_is_doubted(rng, unit, doubted):
    table = drive(rng)
    rows = select_wheel_rows(recording(with_columns(table, time_s=unit * table["time_s"])))
    assert ("time_unit" in codes(rows.findings)) == doubted
