"""Wheel channels of synthetic traverses obey the full stress equations where it is slow, and not where it is fast."""

from __future__ import annotations

from dataclasses import asdict, replace

import numpy as np
import pytest
from bevameter.framework.core.soil import PLAUSIBLE
from bevameter.framework.scenario.plan import Plan, make_plan
from bevameter.framework.scenario.presets import PRESETS
from bevameter.framework.scenario.soils import SOILS
from bevameter.framework.scenario.wheels import RUT_STIFFENING, VARIATION, WheelRows, wheel_rows
from bevameter.identification.mechanics.soil import Soil
from bevameter.identification.mechanics.textbook import equilibrium


@pytest.fixture(scope="module")
def drive() -> tuple[Plan, WheelRows]:
    plan = make_plan(PRESETS["demo"], 5)
    return plan, wheel_rows(plan)


def _slow(plan: Plan, rows: WheelRows, number: int, *, passes: int | None = None) -> np.ndarray:
    """Rows (n,) of a stretch's slow phase in which each wheel is on its ground; of one pass where it is given."""
    stretch = plan.stretches[number]
    time = rows.true["time_s"]
    slow = (time > stretch.start_s + 5.0) & (time < stretch.slow_until_s - 5.0)
    return slow if passes is None else slow & (rows.true["pass"] == passes)


def test_slow_rows_are_in_equilibrium_with_the_true_soil(drive: tuple[Plan, WheelRows]) -> None:
    plan, rows = drive
    wheel = plan.preset.vehicle.wheels[0]
    tested = 0
    for number, stretch in enumerate(plan.stretches):
        for passes, firmer in ((1, 1.0), (2, RUT_STIFFENING)):
            here = _slow(plan, rows, number, passes=passes)
            if stretch.soil is None or not here.any():
                continue
            assert here.sum() >= 400
            soil = Soil(**asdict(replace(stretch.soil, stiffness_Pa=firmer * stretch.soil.stiffness_Pa)))
            state = equilibrium(wheel, soil, rows.true["load_N"][here], rows.true["slip"][here])
            for name, model in (("torque_Nm", state.torque_Nm), ("sinkage_m", state.sinkage_m)):
                off = rows.true[name][here] / model - 1.0
                # Only the soil's variation within the place is between them.
                assert np.sqrt(np.mean(off**2)) < 1.5 * VARIATION, (stretch.terrain, passes, name)
            tested += 1
    assert tested == 12


def test_fast_rows_are_not(drive: tuple[Plan, WheelRows]) -> None:
    plan, rows = drive
    time, noise = rows.true["time_s"], plan.preset.vehicle.noise
    wheel = plan.preset.vehicle.wheels[0]
    for stretch in plan.stretches:
        here = (time > stretch.slow_until_s + 1.0) & (time < stretch.end_s - 1.0) & (rows.true["pass"] == 1)
        if stretch.soil is None:
            continue
        state = equilibrium(wheel, Soil(**asdict(stretch.soil)), rows.true["load_N"][here], rows.true["slip"][here])
        off = rows.true["torque_Nm"][here] - state.torque_Nm
        assert np.sqrt(np.mean(off**2)) > 2.0 * noise["torque_Nm"], stretch.terrain
        assert rows.true["travel_speed_m_s"][here].max() > 2.5


def test_noise_is_that_of_the_vehicle_file(drive: tuple[Plan, WheelRows]) -> None:
    plan, rows = drive
    slow = np.any([_slow(plan, rows, number) for number in range(len(plan.stretches))], axis=0)
    soft = rows.true["sinkage_m"] > 0
    for name, sd in plan.preset.vehicle.noise.items():
        error = (rows.recorded[name] - rows.true[name])[slow & soft]
        assert np.nanstd(error) == pytest.approx(sd, rel=0.12), name
        assert abs(np.nanmean(error)) < 4.0 * sd / np.sqrt(len(error)) + 0.1 * sd, name


def test_slow_phases_sweep_slip_and_load_slowly(drive: tuple[Plan, WheelRows]) -> None:
    plan, rows = drive
    for number, stretch in enumerate(plan.stretches):
        here = _slow(plan, rows, number)
        if stretch.soil is None or not here.any():
            continue
        slip, load, speed = (rows.true[name][here] for name in ("slip", "load_N", "travel_speed_m_s"))
        assert slip.min() < 0.08
        assert slip.max() > 0.45
        assert load.max() / load.min() > 1.8
        assert speed.min() > 0.05
        assert speed.max() < 0.3
        assert np.abs(np.gradient(speed, 0.1)).max() < 0.1


def test_slip_is_that_of_the_recorded_speeds(drive: tuple[Plan, WheelRows]) -> None:
    plan, rows = drive
    rim = rows.recorded["wheel_speed_rad_s"] * plan.preset.vehicle.wheels[0].radius_m
    driving = rim >= rows.recorded["travel_speed_m_s"]
    slip = 1.0 - rows.recorded["travel_speed_m_s"] / rim
    np.testing.assert_allclose(rows.recorded["slip"][driving], slip[driving], atol=1e-12)
    turned = np.diff(rows.true["wheel_angle_rad"]).sum()
    assert turned == pytest.approx(np.trapezoid(rows.true["wheel_speed_rad_s"], rows.true["time_s"]), rel=2e-3)


def test_hard_ground_has_no_sinkage(drive: tuple[Plan, WheelRows]) -> None:
    plan, rows = drive
    ahead = np.array([plan.preset.vehicle.wheel(name).position_m[0] for name in rows.wheel.tolist()])
    middle = plan.at(plan.way_m, rows.true["time_s"])
    hard = plan.stretch_at(middle + ahead) == 2
    assert plan.stretches[2].terrain == "asphalt"
    assert np.all(rows.true["sinkage_m"][hard] == 0)
    assert np.all(rows.true["slip"][hard & (plan.stretch_at(middle) == 2)] < 0.08)
    assert np.all(rows.true["sinkage_m"][~hard] > 0.002)


def test_lost_values_are_where_the_fault_is(drive: tuple[Plan, WheelRows]) -> None:
    plan, rows = drive
    lost = np.isnan(rows.recorded["torque_Nm"])
    np.testing.assert_array_equal(lost, plan.fault("wheel_nan", rows.true["time_s"]))
    assert lost.sum() == 30 * len(plan.preset.vehicle.wheels)
    assert not np.isnan(rows.recorded["load_N"]).any()


def test_places_of_one_class_differ_and_are_plausible() -> None:
    for terrain, kind in SOILS.items():
        drawn = [kind.draw(np.random.default_rng(seed), 0.2) for seed in range(200)]
        c, tan_phi = np.array([soil.c_Pa for soil in drawn]), np.tan([soil.phi_rad for soil in drawn])
        assert np.std(np.log(c)) == pytest.approx(kind.spread[0], rel=0.2), terrain
        assert np.mean(tan_phi) == pytest.approx(np.tan(kind.phi_rad), rel=0.03), terrain
        for name, (low, high) in PLAUSIBLE.items():
            assert all(low <= getattr(soil, name) <= high for soil in drawn), (terrain, name)


def test_rear_wheels_sink_less_in_the_rut() -> None:
    plan = make_plan(replace(PRESETS["rover4"], loads_N=(700.0,) * 4), 0, 30.0)
    rows = wheel_rows(plan)
    depth = {name: rows.true["sinkage_m"][rows.wheel == name].mean() for name in np.unique(rows.wheel)}
    assert max(depth["rear_left"], depth["rear_right"]) < 0.9 * min(depth["front_left"], depth["front_right"])


def test_the_demo_runs_on_four_wheels_in_two_axles(drive: tuple[Plan, WheelRows]) -> None:
    plan, rows = drive
    names, count = np.unique(rows.wheel, return_counts=True)
    assert names.tolist() == ["front_left", "front_right", "rear_left", "rear_right"]
    assert set(count.tolist()) == {3000}
    rear = np.char.startswith(rows.wheel, "rear")
    np.testing.assert_array_equal(rows.true["pass"], np.where(rear, 2.0, 1.0))
    assert plan.preset.loads_N == PRESETS["rover4"].loads_N
    assert np.isfinite(rows.recorded["drawbar_pull_N"]).all()


def test_longer_drives_go_on_over_new_places() -> None:
    plan = make_plan(PRESETS["short"], 0, 150.0)
    assert plan.duration_s == pytest.approx(150.0)
    assert [stretch.terrain for stretch in plan.stretches[:6]] == ["sand", "loam", "grass"] * 2
    assert plan.stretches[0].soil != plan.stretches[3].soil
    assert sum(fault.kind == "wind" for fault in plan.faults) == 2
    assert np.all(np.diff(plan.way_m) > 0)
    assert np.abs(np.gradient(plan.speed_m_s, plan.time_s)).max() < 4.0
