"""Stops, standstill and starts are left out of runs at constant slip, and nothing else is."""

from __future__ import annotations

import numpy as np
import pytest
from bevameter import Recording, Vehicle, Wheel, WheelTable, explain, identify
from bevameter.framework.core.findings import codes
from bevameter.identification.mechanics.soil import Soil
from bevameter.identification.mechanics.textbook import equilibrium
from bevameter.identification.rows.select import select_wheel_rows
from bevameter.identification.rows.settling import only_steady
from bevameter.identification.rows.standstill import stands, with_standstill
from bevameter.identification.rows.steady_runs import steady_runs
from bevameter.identification.rows.stops import without_stops

WHEEL = Wheel(radius_m=0.15, width_m=0.1)
ROWS, STEP_S = 50, 0.2
SLOWS, STANDS = 3, 6
LOADS_N, SLIPS = (60.0, 100.0, 140.0), (0.05, 0.1, 0.2, 0.3, 0.45, 0.6)


def at_end(length: int, course) -> np.ndarray:
    """Ones, then what `course` says over the last rows of each run."""
    one = np.ones(length)
    one[-len(course) :] = course
    return one


def runs(*, speeds=("wheel_speed_rad_s", "travel_speed_m_s"), lifted=False, slip="commanded", noise=0.0, slips=SLIPS):
    """Runs at constant slips and loads, on one soil, whose wheel slows down and stands at the end."""
    rng = np.random.default_rng(3)
    slows = at_end(ROWS, np.concatenate([np.linspace(1.0, 0.0, SLOWS + 2)[1:-1], np.zeros(STANDS)]))
    relaxes = at_end(ROWS, 0.05 + 0.95 * np.exp(-np.arange(1, SLOWS + STANDS + 1) / 1.5))
    lifts = at_end(ROWS, np.linspace(0.9, 0.0, STANDS)) if lifted else np.ones(ROWS)
    columns: dict[str, list[np.ndarray]] = {}
    labels = []
    for load_N in LOADS_N:
        for set_slip in slips:
            load = load_N * (1.0 + 0.01 * rng.normal(size=ROWS))
            driven = set_slip + 0.003 * rng.normal(size=ROWS)
            state = equilibrium(WHEEL, Soil(600.0, np.radians(31.0), 0.012, 6e5, 1.0), load, driven)
            channels = {
                "time_s": np.arange(ROWS) * STEP_S,
                "load_N": load * lifts,
                "slip": driven,
                "wheel_speed_rad_s": 0.4 * slows + noise * 0.4 * rng.normal(size=ROWS),
                "travel_speed_m_s": 0.06 * (1.0 - set_slip) * slows + noise * 0.06 * rng.normal(size=ROWS),
                "torque_Nm": state.torque_Nm * relaxes + 0.05 * rng.normal(size=ROWS),
                "sinkage_m": state.sinkage_m + 4e-5 * rng.normal(size=ROWS),
                "drawbar_pull_N": state.drawbar_pull_N * relaxes + 0.25 * rng.normal(size=ROWS),
            }
            for name, values in channels.items():
                columns.setdefault(name, []).append(values)
            labels.append(f"{load_N:.0f} N at {set_slip:g}")
    together = {name: np.concatenate(parts) for name, parts in columns.items()}
    if slip == "none":
        del together["slip"]
    for name in ("wheel_speed_rad_s", "travel_speed_m_s"):
        if name not in speeds:
            del together[name]
    return WheelTable(together, None, np.repeat(labels, ROWS), "rig.csv")


def recording(table: WheelTable) -> Recording:
    return Recording("rig", "rig.csv", Vehicle(wheels=(WHEEL,)), None, "", "0" * 64, wheel=table)


@pytest.mark.parametrize("noise", [0.0, 0.01])
@pytest.mark.parametrize("slip", ["commanded", "none"])
@pytest.mark.parametrize("speeds", [("wheel_speed_rad_s", "travel_speed_m_s"), ("wheel_speed_rad_s",)])
def test_a_wheel_is_at_standstill_where_its_speeds_are_zero(speeds, slip, noise):
    table = with_standstill(runs(speeds=speeds, slip=slip, noise=noise))
    still = stands(table).reshape(-1, ROWS)
    # Within the window of the median.
    assert still[:, -(STANDS - 2) :].all()
    assert not still[:, : -(STANDS + 1)].any()
    assert all(np.all(table[name][still.ravel()] == 0.0) for name in speeds)
    assert slip == "none" or np.isnan(table["slip"][still.ravel()]).all()


def test_neither_a_crawling_nor_a_dragged_wheel_is_at_standstill():
    time_s = np.arange(400) * 0.1
    speed = np.linspace(0.01, 1.0, 400)
    rolling = {"slip": np.full(400, 0.2), "wheel_speed_rad_s": speed / 0.12, "travel_speed_m_s": speed}
    crawls = WheelTable({"time_s": time_s, **rolling}, None, None, "drive.csv")
    assert not stands(with_standstill(crawls)).any()
    turns = np.where(time_s < 20.0, 0.4, 0.0)
    slip = np.where(time_s < 20.0, 0.2, -1.0)
    dragged = WheelTable({"time_s": time_s, "slip": slip, "wheel_speed_rad_s": turns}, None, None, "drive.csv")
    assert not stands(with_standstill(dragged)).any()
    travels = WheelTable({**dragged.columns, "travel_speed_m_s": np.full(400, 0.05)}, None, None, "drive.csv")
    assert not stands(with_standstill(travels)).any()


@pytest.mark.parametrize("lifted", [False, True])
@pytest.mark.parametrize("speeds", [("wheel_speed_rad_s", "travel_speed_m_s"), ("wheel_speed_rad_s",), ()])
def test_the_rows_of_a_stop_are_left_out(speeds, lifted):
    table, found, _ = without_stops(with_standstill(runs(speeds=speeds, lifted=lifted)))
    assert found.values["runs"] == 18
    kept = np.unique(table.run, return_counts=True)[1]
    assert np.all(np.abs(kept - (ROWS - SLOWS - STANDS)) <= 1)
    assert table["time_s"].max() <= (ROWS - SLOWS - STANDS) * STEP_S


def test_the_rows_in_which_a_wheel_starts_are_left_out():
    table = runs()
    begun = WheelTable(
        {name: values.reshape(-1, ROWS)[:, ::-1].ravel() for name, values in table.columns.items() if name != "time_s"}
        | {"time_s": table["time_s"]},
        None,
        table.run,
        "rig.csv",
    )
    fewer, found, started = without_stops(with_standstill(begun))
    assert found.values["n"] == len(begun) - len(fewer)
    assert started
    assert fewer["time_s"].min() >= (SLOWS + STANDS - 1) * STEP_S
    assert len(fewer) >= 18 * (ROWS - SLOWS - STANDS - 1)


@pytest.mark.parametrize("starts", [True, False])
def test_one_answer_that_settles_once_the_wheel_started_is_its_start(starts):
    table = runs()
    rows = np.arange(len(table)).reshape(-1, ROWS)
    # The last rows of a stop, in the order of a start, and then what is steady.
    order = np.concatenate(
        [rows[:, ::-1][:, : SLOWS + STANDS if starts else 0], rows[:, : ROWS - SLOWS - STANDS]], axis=1
    )
    begun = table.select(order.ravel())
    count = order.shape[1]
    climbs = 0.002 * np.exp(-np.maximum(np.arange(count) - (SLOWS + STANDS if starts else 0), 0) / 3.0)
    columns = {**begun.columns, "time_s": np.tile(np.arange(count) * STEP_S, 18)}
    columns["sinkage_m"] = begun["sinkage_m"] + np.tile(climbs, 18)
    fewer, found = only_steady(with_standstill(WheelTable(columns, None, begun.run, "rig.csv")))
    settling = [each.values["channels"] for each in found if each.code == "settling_rows"]
    assert settling == ([["sinkage_m"]] if starts else [])
    assert len(fewer) < len(begun) if starts else len(fewer) == len(begun)


def test_noisy_speeds_are_no_steps_of_slip():
    rng = np.random.default_rng(4)
    table = runs(slip="none")
    noisy = {name: table[name] + 0.03 * rng.normal(size=len(table)) * table[name].max() for name in
             ("wheel_speed_rad_s", "travel_speed_m_s")}  # fmt: skip
    found = steady_runs(with_standstill(WheelTable({**table.columns, **noisy}, None, table.run, "rig.csv")))
    assert found is not None
    assert len(found.each) == 18


@pytest.mark.parametrize("stopped", [10, 20, 23])
def test_a_carriage_at_rest_is_a_stop_though_the_wheel_speed_is_the_commanded_one(stopped):
    table = runs()
    rows = np.arange(len(table)).reshape(-1, ROWS)
    driven, last = rows[:, : ROWS - SLOWS - STANDS], rows[:, -1:]
    order = np.concatenate([driven, np.repeat(last, stopped, axis=1)], axis=1)
    longer = table.select(order.ravel())
    columns = {**longer.columns, "time_s": np.tile(np.arange(order.shape[1]) * STEP_S, 18)}
    columns["wheel_speed_rad_s"] = np.full(order.size, 0.4)
    fewer, found, _ = without_stops(with_standstill(WheelTable(columns, None, longer.run, "rig.csv")))
    assert found.code == "stop_rows"
    assert abs(len(fewer) - driven.size) <= 18


def test_a_slow_wheel_in_a_file_with_fast_rows_does_not_stand_nor_one_that_spins():
    rng = np.random.default_rng(6)
    travel = np.repeat([0.001, 0.05], [800, 200]) + 4e-4 * rng.normal(size=1000)
    slow = {"time_s": np.arange(1000) * 0.1, "slip": np.full(1000, 0.2), "travel_speed_m_s": travel}
    assert not stands(with_standstill(WheelTable(slow, None, None, "rig.csv"))).any()
    spins = {**slow, "slip": np.repeat([0.3, 0.999], 500), "travel_speed_m_s": np.repeat([0.05, 0.0], 500)}
    assert not stands(with_standstill(WheelTable(spins, None, None, "rig.csv"))).any()


def weak_ground(table):
    late = np.tile(np.arange(ROWS) >= ROWS - 10, 18)
    return {name: np.where(late, 0.5, 1.0) * table[name] for name in ("torque_Nm", "drawbar_pull_N")}


def gone_in_three_runs(table):
    late = np.tile(np.arange(ROWS) >= ROWS - 10, 18) & (np.arange(len(table)) < 3 * ROWS)
    return {"torque_Nm": np.where(late, 0.05, 1.0) * table["torque_Nm"]}


def slower_at_the_end(table):
    slower = np.where(np.tile(np.arange(ROWS) >= ROWS - 20, 18), 0.7, 1.0)
    return {name: slower * table[name] for name in ("wheel_speed_rad_s", "travel_speed_m_s")}


@pytest.mark.parametrize("change", [weak_ground, gone_in_three_runs, slower_at_the_end])
def test_changes_that_are_no_stop_are_kept(change):
    whole = runs()
    driven = whole.select(whole["time_s"] < (ROWS - SLOWS - STANDS) * STEP_S - 1e-9)
    again = np.arange(len(driven)).reshape(18, -1)
    longer = driven.select(np.concatenate([again, again[:, -(SLOWS + STANDS) :]], axis=1).ravel())
    columns = {**longer.columns, "time_s": whole["time_s"]}
    steady = WheelTable(columns, None, whole.run, "rig.csv")
    assert without_stops(with_standstill(steady))[1] is None
    changed = WheelTable({**columns, **change(steady)}, None, whole.run, "rig.csv")
    assert without_stops(with_standstill(changed))[1] is None


def test_a_drive_with_standstills_is_used_where_it_rolls():
    table = runs()
    one = WheelTable({**table.columns, "time_s": np.arange(len(table)) * STEP_S}, None, None, "drive.csv")
    rows = select_wheel_rows(recording(one))
    stopped = rows.reasons == "at standstill"
    assert 18 * (STANDS - 2) <= stopped.sum() <= 18 * (STANDS + 1)


def test_runs_that_stop_give_the_results_of_their_steady_rows():
    table = runs(speeds=(), slips=(0.05, 0.2, 0.45))
    answer = explain(recording(table), catalogue=("soil_patch", "drift", "torque_offset", "time_lag"))
    assert answer.verdict == "none"
    assert any("stopped" in note for note in answer.notes)
    found = identify(recording(table))
    assert found.overall is not None
    phi = found.overall.parameters["phi_rad"]
    assert phi.low < np.radians(31.0) < phi.high
    assert codes(found.findings) == ["stop_rows"]
