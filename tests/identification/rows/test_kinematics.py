"""Recorded slip and wheel angle against the speeds of rim and travel."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from bevameter import Recording, Vehicle, Wheel, WheelTable, explain, identify
from bevameter.framework.core.findings import codes
from bevameter.identification.estimate.words import sentences
from bevameter.identification.mechanics.soil import Soil
from bevameter.identification.mechanics.textbook import equilibrium
from bevameter.identification.rows.kinematics import angle_disagreement, slip_disagreement
from bevameter.identification.rows.select import select_wheel_rows

WHEEL = Wheel(radius_m=0.15, width_m=0.12)
TURN = 2.0 * np.pi


def recorded(rng, speed=2.0, step_s=0.1, rows=400, noise=0.02) -> WheelTable:
    """A wheel that turns now faster, now slower; its angle is that of an encoder of 1024 counts."""
    time_s = step_s * np.arange(rows)
    rate = speed * (1.0 + 0.4 * np.sin(12.0 * time_s / time_s[-1]))
    angle = np.concatenate([[0.0], np.cumsum(0.5 * (rate[1:] + rate[:-1]) * step_s)])
    slip = np.full(rows, 0.2)
    columns = {
        "time_s": time_s, "slip": slip, "wheel_speed_rad_s": rate * (1.0 + noise * rng.normal(size=rows)),
        "travel_speed_m_s": 0.8 * 0.15 * rate, "wheel_angle_rad": np.floor(angle * 1024 / TURN) * TURN / 1024,
    }  # fmt: skip
    return WheelTable(columns, None, None, Path("wheel.csv"))


def changed(table: WheelTable, **columns) -> WheelTable:
    return replace(table, columns={**table.columns, **columns})


@pytest.mark.parametrize("anew", [False, True])
@pytest.mark.parametrize("step_s", [0.005, 0.1, 0.5])
@pytest.mark.parametrize(("per_radian", "unit"), [(360.0 / TURN, "degrees"), (1.0 / TURN, "turns")])
def test_an_angle_in_another_unit_is_named(rng, per_radian, unit, step_s, anew):
    table = recorded(rng, step_s=step_s, rows=600)
    angle = table["wheel_angle_rad"] % TURN if anew else table["wheel_angle_rad"]
    found = angle_disagreement(changed(table, wheel_angle_rad=per_radian * angle), WHEEL).values
    assert found["factor"] == pytest.approx(per_radian, rel=0.01)
    assert (found["channel"], found["unit"]) == ("wheel_angle_rad", unit)


def test_a_speed_in_turns_a_minute_is_named(rng):
    table = recorded(rng)
    faster = changed(table, wheel_speed_rad_s=60.0 / TURN * table["wheel_speed_rad_s"])
    found = angle_disagreement(faster, WHEEL).values
    assert found["factor"] == pytest.approx(TURN / 60.0, rel=0.01)
    assert (found["channel"], found["unit"]) == ("wheel_speed_rad_s", "turns a minute")


def test_a_factor_of_no_unit_is_named_as_it_is(rng):
    """The angle of a motor before its gear."""
    table = recorded(rng)
    found = angle_disagreement(changed(table, wheel_angle_rad=31.0 * table["wheel_angle_rad"]), WHEEL).values
    assert found["factor"] == pytest.approx(31.0, rel=0.01)
    assert found["unit"] is None


def test_travel_and_slip_show_it_where_the_wheel_has_no_speed(rng):
    table = recorded(rng)
    degrees = changed(table, wheel_angle_rad=np.degrees(table["wheel_angle_rad"]))
    without = replace(degrees, columns={k: v for k, v in degrees.columns.items() if k != "wheel_speed_rad_s"})
    found = angle_disagreement(without, WHEEL).values
    assert found["factor"] == pytest.approx(180.0 / np.pi, rel=0.01)
    assert found["speed"] == "travel_speed_m_s and slip"
    for missing in ("travel_speed_m_s", "slip"):
        fewer = {k: v for k, v in without.columns.items() if k != missing}
        assert angle_disagreement(replace(without, columns=fewer), WHEEL) is None


@pytest.mark.parametrize("speed", [0.05, 1.0, 4.0, 8.0, 15.0])
@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("noise", [0.0, 0.1])
@pytest.mark.parametrize("step_s", [0.01, 0.1, 0.4, 1.0])
def test_an_angle_in_radians_agrees_however_it_is_counted(rng, speed, sign, noise, step_s):
    """Continuous, wrapped to a turn or to [-pi, pi], reversed; also with more than a turn between rows."""
    table = recorded(rng, speed, step_s, noise=noise)
    angle = sign * table["wheel_angle_rad"]
    for counted in (angle, angle % TURN, (angle + np.pi) % TURN - np.pi):
        assert angle_disagreement(changed(table, wheel_angle_rad=counted), WHEEL) is None


@pytest.mark.parametrize("steps", [1, 2, 4, 8])
@pytest.mark.parametrize("speed", [0.05, 0.5, 2.0, 7.0])
def test_an_encoder_of_few_steps_agrees(rng, steps, speed):
    table = recorded(rng, speed)
    coarse = np.floor(table["wheel_angle_rad"] * steps / TURN) * TURN / steps
    assert angle_disagreement(changed(table, wheel_angle_rad=coarse), WHEEL) is None


def test_stationary_wheels_few_rows_and_trials_are_not_judged(rng):
    table = recorded(rng)
    degrees = changed(table, wheel_angle_rad=np.degrees(table["wheel_angle_rad"]))
    assert angle_disagreement(degrees, WHEEL)
    assert angle_disagreement(degrees.select(np.arange(15)), WHEEL) is None
    assert angle_disagreement(changed(degrees, wheel_speed_rad_s=np.zeros(400)), WHEEL) is None
    assert angle_disagreement(changed(degrees, time_s=np.zeros(400)), WHEEL) is None
    assert angle_disagreement(changed(degrees, wheel_angle_rad=rng.normal(size=400)), WHEEL) is None
    assert angle_disagreement(changed(degrees, time_s=60.0 * np.arange(400), slip=rng.random(400)), WHEEL) is None


def test_gaps_and_runs_do_not_matter(rng):
    """The angle begins anew where a run does, and rows are lost."""
    table = recorded(rng)
    kept = table.select(np.flatnonzero(rng.random(400) < 0.9))
    unseen = kept["wheel_speed_rad_s"].copy()
    unseen[50:60] = np.nan
    angle = np.where(kept["time_s"] < 20.0, kept["wheel_angle_rad"], kept["wheel_angle_rad"] - 1e4)
    runs = replace(kept, run=np.where(kept["time_s"] < 20.0, "a", "b"))
    runs = changed(runs, wheel_angle_rad=angle, wheel_speed_rad_s=unseen)
    assert angle_disagreement(runs, WHEEL) is None
    assert angle_disagreement(changed(runs, wheel_angle_rad=np.degrees(angle)), WHEEL).values["unit"] == "degrees"


def test_an_angle_in_another_unit_is_a_finding_of_the_recording(rng):
    table = recorded(rng)
    columns = {"load_N": np.full(400, 60.0), "wheel_angle_rad": np.degrees(table["wheel_angle_rad"])}
    opened = Recording(
        "test", table.source, Vehicle(wheels=(WHEEL,)), None, "", "0" * 64, wheel=changed(table, **columns)
    )
    assert codes(select_wheel_rows(opened).findings) == ["angle_disagrees"]


@pytest.mark.filterwarnings("error")
def test_a_wheel_without_recorded_rotation_is_not_judged(rng):
    table = recorded(rng)
    assert angle_disagreement(table.select(np.arange(1)), WHEEL) is None
    unseen = np.full(len(table), np.nan)
    assert angle_disagreement(changed(table, wheel_speed_rad_s=unseen), WHEEL) is None
    locked = {name: values for name, values in table.columns.items() if name != "wheel_speed_rad_s"}
    locked |= {"slip": np.ones(len(table)), "travel_speed_m_s": np.zeros(len(table))}
    assert angle_disagreement(replace(table, columns=locked), WHEEL) is None


def with_radius(rng, radius_m=0.15, noise=0.0, rows=200, braking=False) -> WheelTable:
    """Rows whose slip was computed with the radius `radius_m`."""
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
def test_a_radius_that_is_stated_wrongly_is_named(rng, radius_m):
    found = slip_disagreement(with_radius(rng, radius_m, noise=0.02), WHEEL).values
    assert (found["difference"] > 0.0) == (radius_m > 0.15)
    assert (found["radius_m"], found["n"]) == (0.15, 200)
    assert found["agreeing_radius_m"] == pytest.approx(radius_m, abs=0.002)


def test_a_braking_wheel_shows_its_radius_too(rng):
    found = slip_disagreement(with_radius(rng, 0.165, braking=True), WHEEL)
    assert found.values["agreeing_radius_m"] == pytest.approx(0.165)


def test_a_disagreement_that_no_radius_explains_is_named_without_one(rng):
    """A slip of another definition, and a wheel that spins in place."""
    other = with_radius(rng)
    other.columns["slip"][:] = other["slip"] / (1.0 - other["slip"])
    spinning = with_radius(rng)
    spinning.columns["travel_speed_m_s"][:] = 0.0
    for table in (other, spinning):
        assert slip_disagreement(table, WHEEL).values["agreeing_radius_m"] is None


def test_noise_few_rows_and_missing_speeds_are_not_judged(rng):
    assert slip_disagreement(with_radius(rng), WHEEL) is None
    assert slip_disagreement(with_radius(rng, noise=0.2), WHEEL) is None
    assert slip_disagreement(with_radius(rng, 0.165, rows=15), WHEEL) is None
    one_speed = with_radius(rng, 0.165)
    one_speed = WheelTable({name: one_speed[name] for name in ("time_s", "slip", "travel_speed_m_s")}, None, None, "")
    assert slip_disagreement(one_speed, WHEEL) is None
    stationary = with_radius(rng, 0.165)
    stationary.columns["wheel_speed_rad_s"][:] = 0.0
    stationary.columns["travel_speed_m_s"][:] = 0.0
    assert slip_disagreement(stationary, WHEEL) is None


def test_of_several_wheels_the_one_is_named_whose_slip_disagrees(rng):
    good, bad = with_radius(rng), with_radius(rng, 0.165)
    both = {name: np.concatenate([good[name], bad[name]]) for name in good.columns}
    both["load_N"] = np.full(400, 80.0)
    table = WheelTable(both, np.repeat(["left", "right"], 200), None, Path("wheel.csv"))
    vehicle = Vehicle(wheels=tuple(Wheel(name=name, radius_m=0.15, width_m=0.12) for name in ("left", "right")))
    findings = select_wheel_rows(
        Recording("test", Path("wheel.csv"), vehicle, None, "", "0" * 64, wheel=table)
    ).findings
    assert [(each.code, each.values["of_wheel"]) for each in findings] == [("slip_disagrees", "wheel right")]


@pytest.fixture
def drive_with_another_radius(rng) -> Recording:
    table = with_radius(rng, 0.165, rows=60)
    load = 80.0 + 60.0 * rng.random(len(table))
    state = equilibrium(WHEEL, Soil(c_Pa=300.0, phi_rad=0.55, k_m=0.012, stiffness_Pa=9e4, n=0.9), load, table["slip"])
    torque = state.torque_Nm + 0.05 * rng.normal(size=len(table))
    sinkage = state.sinkage_m + 2e-4 * rng.normal(size=len(table))
    drive = changed(table, load_N=load, torque_Nm=torque, sinkage_m=sinkage)
    return Recording("test", drive.source, Vehicle(wheels=(WHEEL,)), None, "", "0" * 64, wheel=drive)


def test_identify_reports_a_slip_of_another_radius(drive_with_another_radius):
    assert "slip_disagrees" in codes(identify(drive_with_another_radius).findings)


def test_explain_reports_a_slip_of_another_radius(drive_with_another_radius):
    found = select_wheel_rows(drive_with_another_radius).findings
    assert set(sentences(found)) <= set(explain(drive_with_another_radius, catalogue=()).notes)


def test_slips_computed_from_the_speeds_do_not_hide_another_radius(rng, drive_with_another_radius):
    """They agree with the speeds, and say nothing of what was recorded."""
    drive = drive_with_another_radius.wheel
    fewer = changed(drive, slip=np.where(rng.random(len(drive)) < 0.6, np.nan, drive["slip"]))
    found = select_wheel_rows(replace(drive_with_another_radius, wheel=fewer)).findings
    assert "slip_disagrees" in codes(found)
