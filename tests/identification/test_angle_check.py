"""The angle of the wheel against the speed with which it turns."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from bevameter import Recording, Vehicle, Wheel, WheelTable
from bevameter.identification.rows.angle import angle_disagreement
from bevameter.identification.rows.select import felt_rows

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
def test_an_angle_in_another_unit_is_told(rng, per_radian, unit, step_s, anew):
    table = recorded(rng, step_s=step_s, rows=600)
    angle = table["wheel_angle_rad"] % TURN if anew else table["wheel_angle_rad"]
    told = angle_disagreement(changed(table, wheel_angle_rad=per_radian * angle), WHEEL)
    assert float(told.split("goes on ")[1].split(" times")[0]) == pytest.approx(per_radian, rel=0.01)
    assert f"wheel_angle_rad is probably in {unit}" in told


def test_a_speed_in_turns_a_minute_is_told(rng):
    table = recorded(rng)
    told = angle_disagreement(changed(table, wheel_speed_rad_s=60.0 / TURN * table["wheel_speed_rad_s"]), WHEEL)
    assert "goes on 0.105 times" in told
    assert "wheel_speed_rad_s is probably in turns a minute" in told


def test_a_factor_of_no_unit_is_told_as_it_is(rng):
    """The angle of a motor before its gear."""
    table = recorded(rng)
    told = angle_disagreement(changed(table, wheel_angle_rad=31.0 * table["wheel_angle_rad"]), WHEEL)
    assert "goes on 31 times" in told
    assert "check its unit, that of the speed, and whether a gear lies between" in told


def test_travel_and_slip_tell_it_where_the_wheel_has_no_speed(rng):
    table = recorded(rng)
    degrees = changed(table, wheel_angle_rad=np.degrees(table["wheel_angle_rad"]))
    without = replace(degrees, columns={k: v for k, v in degrees.columns.items() if k != "wheel_speed_rad_s"})
    assert "57.3 times as fast as the wheel's speed by travel and slip says" in angle_disagreement(without, WHEEL)
    for missing in ("travel_speed_m_s", "slip"):
        fewer = {k: v for k, v in without.columns.items() if k != missing}
        assert angle_disagreement(replace(without, columns=fewer), WHEEL) is None


@pytest.mark.parametrize("speed", [0.05, 1.0, 4.0, 8.0, 15.0])
@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("noise", [0.0, 0.1])
@pytest.mark.parametrize("step_s", [0.01, 0.1, 0.4, 1.0])
def test_an_angle_in_radians_agrees_however_it_is_counted(rng, speed, sign, noise, step_s):
    """Going on, anew with each turn, from -pi to pi, backwards; also where a row is more than a turn."""
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


def test_standing_wheels_few_rows_and_trials_tell_nothing(rng):
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
    assert "degrees" in angle_disagreement(changed(runs, wheel_angle_rad=np.degrees(angle)), WHEEL)


def test_a_recording_says_so(rng):
    table = recorded(rng)
    columns = {"load_N": np.full(400, 60.0), "wheel_angle_rad": np.degrees(table["wheel_angle_rad"])}
    opened = Recording(
        "test", table.source, Vehicle(wheels=(WHEEL,)), None, "", "0" * 64, wheel=changed(table, **columns)
    )
    assert any("probably in degrees" in problem for problem in felt_rows(opened).problems)


@pytest.mark.filterwarnings("error")
def test_a_wheel_whose_turning_nobody_saw_is_not_judged(rng):
    table = recorded(rng)
    assert angle_disagreement(table.select(np.arange(1)), WHEEL) is None
    unseen = np.full(len(table), np.nan)
    assert angle_disagreement(changed(table, wheel_speed_rad_s=unseen), WHEEL) is None
    locked = {name: values for name, values in table.columns.items() if name != "wheel_speed_rad_s"}
    locked |= {"slip": np.ones(len(table)), "travel_speed_m_s": np.zeros(len(table))}
    assert angle_disagreement(replace(table, columns=locked), WHEEL) is None
