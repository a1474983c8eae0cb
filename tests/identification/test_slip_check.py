"""The recorded slip against the two speeds."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from bevameter import Recording, Vehicle, Wheel, WheelTable, explain, identify
from bevameter.identification.mechanics.soil import Soil
from bevameter.identification.mechanics.textbook import equilibrium
from bevameter.identification.rows.kinematics import slip_disagreement, speeds_in_another_unit
from bevameter.identification.rows.select import felt_rows

WHEEL = Wheel(radius_m=0.15, width_m=0.12)


def recorded(rng, radius_m=0.15, noise=0.0, rows=200, braking=False) -> WheelTable:
    """Rows whose slip was worked out with a radius of its own."""
    rim = 0.5 + 0.2 * rng.random(rows)
    slip = (-0.3 if braking else 0.1) + 0.2 * rng.random(rows)
    ratio = np.where(slip >= 0.0, 1.0 - slip, 1.0 / (1.0 + slip))
    columns = {
        "time_s": 0.1 * np.arange(rows),
        "slip": slip + noise * rng.normal(size=rows),
        "wheel_speed_rad_s": rim,
        "travel_speed_m_s": ratio * rim * radius_m,
    }
    return WheelTable(columns, None, None, Path("wheel.csv"))


@pytest.mark.parametrize("radius_m", [0.135, 0.165])
def test_a_radius_that_is_stated_wrongly_is_told(rng, radius_m):
    told = slip_disagreement(recorded(rng, radius_m, noise=0.02), WHEEL)
    side = "above" if radius_m > 0.15 else "below"
    assert f"{side} what the two speeds give with a radius of 0.15 m (median of 200 rows)" in told
    found = float(told.split("; ")[1].split(" m would")[0])
    assert found == pytest.approx(radius_m, abs=0.002)


def test_a_braking_wheel_tells_its_radius_too(rng):
    assert "0.165 m would make them agree" in slip_disagreement(recorded(rng, 0.165, braking=True), WHEEL)


def test_what_no_radius_mends_is_told_without_one(rng):
    """A slip of another definition, a wheel that spins on the spot."""
    other = recorded(rng)
    other.columns["slip"][:] = other["slip"] / (1.0 - other["slip"])
    spinning = recorded(rng)
    spinning.columns["travel_speed_m_s"][:] = 0.0
    for table in (other, spinning):
        told = slip_disagreement(table, WHEEL)
        assert "the recorded slip is" in told
        assert "would make them agree" not in told


def test_noise_few_rows_and_missing_speeds_tell_nothing(rng):
    assert slip_disagreement(recorded(rng), WHEEL) is None
    assert slip_disagreement(recorded(rng, noise=0.2), WHEEL) is None
    assert slip_disagreement(recorded(rng, 0.165, rows=15), WHEEL) is None
    one_speed = recorded(rng, 0.165)
    one_speed = WheelTable({name: one_speed[name] for name in ("time_s", "slip", "travel_speed_m_s")}, None, None, "")
    assert slip_disagreement(one_speed, WHEEL) is None
    standing = recorded(rng, 0.165)
    standing.columns["wheel_speed_rad_s"][:] = 0.0
    standing.columns["travel_speed_m_s"][:] = 0.0
    assert slip_disagreement(standing, WHEEL) is None


def test_of_several_wheels_the_one_is_told_whose_slip_disagrees(rng):
    good, bad = recorded(rng), recorded(rng, 0.165)
    both = {name: np.concatenate([good[name], bad[name]]) for name in good.columns}
    both["load_N"] = np.full(400, 80.0)
    table = WheelTable(both, np.repeat(["left", "right"], 200), None, Path("wheel.csv"))
    vehicle = Vehicle(wheels=tuple(Wheel(name=name, radius_m=0.15, width_m=0.12) for name in ("left", "right")))
    problems = felt_rows(Recording("test", Path("wheel.csv"), vehicle, None, "", "0" * 64, wheel=table)).problems
    assert [problem.split(":")[0] for problem in problems] == ["wheel right"]


def test_identify_and_explain_say_so(rng):
    table = recorded(rng, 0.165)
    load = 80.0 + 60.0 * rng.random(len(table))
    state = equilibrium(WHEEL, Soil(c_Pa=300.0, phi_rad=0.55, k_m=0.012, stiffness_Pa=9e4, n=0.9), load, table["slip"])
    torque = state.torque_Nm + 0.05 * rng.normal(size=len(table))
    sinkage = state.sinkage_m + 2e-4 * rng.normal(size=len(table))
    columns = {**table.columns, "load_N": load, "torque_Nm": torque, "sinkage_m": sinkage}
    drive = WheelTable(columns, None, None, Path("wheel.csv"))
    recording = Recording("test", Path("wheel.csv"), Vehicle(wheels=(WHEEL,)), None, "", "0" * 64, wheel=drive)
    said = "0.165 m would make them agree"
    assert any(said in note for note in identify(recording).problems)
    # What was filled in from the speeds agrees with them, and says nothing of what was recorded.
    table.columns["slip"][rng.random(len(table)) < 0.6] = np.nan
    drive = replace(drive, columns={**columns, "slip": table["slip"]})
    assert any(said in note for note in identify(replace(recording, wheel=drive)).problems)
    assert any(said in note for note in explain(recording, catalogue=()).notes)


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
def test_a_speed_in_another_unit_is_told(rng, name, unit, factor, braking):
    table = without_slip(recorded(rng, braking=braking))
    assert speeds_in_another_unit(table, WHEEL) is None
    other = WheelTable({**table.columns, name: factor * table[name]}, None, None, table.source)
    assert f"{name} in {unit}" in speeds_in_another_unit(other, WHEEL)


def test_wheels_that_dig_in_or_stand_and_recorded_slips_are_in_no_other_unit(rng):
    digging = without_slip(recorded(rng))
    digging.columns["travel_speed_m_s"] *= np.linspace(1.0, 0.02, 200)
    assert speeds_in_another_unit(digging, WHEEL) is None
    stuck = without_slip(recorded(rng))
    stuck.columns["travel_speed_m_s"][:] = 0.0
    assert speeds_in_another_unit(stuck, WHEEL) is None
    told = recorded(rng)
    told.columns["wheel_speed_rad_s"] *= 9.55
    assert speeds_in_another_unit(told, WHEEL) is None


def test_rows_that_nearly_stand_do_not_hide_the_unit(rng):
    table = without_slip(recorded(rng))
    table.columns["wheel_speed_rad_s"] *= 180.0 / np.pi
    table.columns["wheel_speed_rad_s"][7], table.columns["travel_speed_m_s"][7] = 1e-5, 1e-6
    told = speeds_in_another_unit(table, WHEEL)
    assert "slips about 0.9" in told
    assert "degrees per second" in told


def test_the_unit_is_noted(rng):
    table = without_slip(recorded(rng))
    table.columns["wheel_speed_rad_s"] *= 9.55
    table.columns["load_N"] = np.full(200, 80.0)
    vehicle = Vehicle(wheels=(WHEEL,))
    problems = felt_rows(Recording("test", Path("wheel.csv"), vehicle, None, "", "0" * 64, wheel=table)).problems
    assert any("revolutions per minute" in problem for problem in problems)
