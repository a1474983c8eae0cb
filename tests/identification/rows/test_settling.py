"""Transients at the start of a wheel are left out of runs at constant slip, and nothing else is."""

from __future__ import annotations

import numpy as np
import pytest
from bevameter import Recording, Vehicle, Wheel, WheelTable, explain, identify
from bevameter.framework.core.findings import codes
from bevameter.identification.mechanics.soil import Soil
from bevameter.identification.mechanics.textbook import equilibrium
from bevameter.identification.rows.settling import without_settling

WHEEL = Wheel(radius_m=0.15, width_m=0.1)
ANSWERS = ("torque_Nm", "sinkage_m", "drawbar_pull_N")
ROWS, STEP_S = 60, 0.2
FEW_SLIPS = (0.05, 0.2, 0.45)
SETTLING = np.exp(-np.arange(ROWS) / 4.0)
"""As over 5 cm of the rim's way at 12 mm a row."""


def runs(change=lambda number, answers: None, *, seed=0, slips=(0.05, 0.1, 0.2, 0.3, 0.45, 0.6), varied=0.02):
    """Runs at constant slips and three loads, on soil of their own; `change` alters the answers (k, 3) of each run."""
    rng = np.random.default_rng(seed)
    columns: dict[str, list[np.ndarray]] = {}
    labels = []
    for load_N in (60.0, 100.0, 140.0):
        for slip in slips:
            soil = Soil(600.0, np.radians(31.0), 0.012, 6e5 * np.exp(varied * rng.normal()), 1.0)
            load, slips_driven = load_N * (1.0 + 0.01 * rng.normal(size=ROWS)), slip + 0.003 * rng.normal(size=ROWS)
            state = equilibrium(WHEEL, soil, load, slips_driven)
            answers = np.column_stack([state.torque_Nm, state.sinkage_m, state.drawbar_pull_N])
            change(len(labels), answers)
            answers += rng.normal(size=answers.shape) * [0.05, 4e-5, 0.25]
            channels = (np.arange(ROWS) * STEP_S, load, slips_driven, np.full(ROWS, 0.4), *answers.T)
            names = ("time_s", "load_N", "slip", "wheel_speed_rad_s", *ANSWERS)
            for name, values in zip(names, channels, strict=True):
                columns.setdefault(name, []).append(values)
            labels.append(f"{load_N:.0f} N at {slip:g}")
    together = {name: np.concatenate(parts) for name, parts in columns.items()}
    return WheelTable(together, None, np.repeat(labels, ROWS), "rig.csv")


def starts(share=0.4):
    def change(_, answers):
        answers[:, :2] *= 1.0 - share * SETTLING[:, None]
        answers[:, 2] -= 8.0 * share * SETTLING

    return change


def in_steps(late=(), order=None):
    """Three drives of one load whose slip goes up in steps, all answers behind by first order, or only those late."""
    table = runs(varied=0.0)
    rows = np.arange(len(table)).reshape(3, 6, ROWS)
    rows = rows[:, np.arange(6) if order is None else order].ravel()
    columns = {name: values[rows] for name, values in table.columns.items()}
    columns["time_s"] = np.tile(np.arange(6 * ROWS) * STEP_S, 3)
    for name in late or ANSWERS:
        behind = columns[name].reshape(3, 6, ROWS)
        ends = np.median(behind, axis=2)
        for step in range(1, 6):
            behind[:, step] += (ends[:, step - 1] - ends[:, step])[:, None] * SETTLING
    return WheelTable(columns, None, np.repeat(["a", "b", "c"], 6 * ROWS), "rig.csv")


def recording(table: WheelTable) -> Recording:
    return Recording("rig", "rig.csv", Vehicle(wheels=(WHEEL,)), None, "", "0" * 64, wheel=table)


@pytest.mark.parametrize("share", [0.05, 0.4])
def test_transients_are_left_out(share):
    table, found = without_settling(runs(starts(share)))
    assert (found.values["runs"], found.values["steps"]) == (18, False)
    assert found.values["channels"][:2] == ["torque_Nm", "sinkage_m"]
    first = table["time_s"].min()
    # Less than half a standard deviation is left of it, and more than half of each run.
    sizes = np.array([0.4 * 5.0 / 0.05, 0.4 * 0.006 / 4e-5]) * share / 0.4
    assert np.all(sizes * np.exp(-first / STEP_S / 4.0) < 0.5)
    assert len(table) >= 18 * ROWS // 2
    assert first < 0.5 * ROWS * STEP_S


@pytest.mark.parametrize("slips", [(0.05, 0.1, 0.2, 0.3, 0.45, 0.6), (0.1, 0.3)])
def test_a_start_at_rest_is_left_out_whatever_its_course(slips):
    """All answers grow in a straight line from nothing, as no other ground makes them."""
    ramp = np.minimum(np.arange(ROWS) / 15.0, 1.0)[:, None]

    def from_rest(_, answers):
        answers *= ramp

    table, found = without_settling(runs(from_rest, slips=slips))
    assert found is not None
    assert 15 <= found.values["seconds"] / STEP_S <= 24
    assert len(table) == 3 * len(slips) * (ROWS - round(found.values["seconds"] / STEP_S))


def test_transients_are_found_without_names_of_runs_and_in_any_order_of_rows():
    table = runs(starts())
    shuffled = table.select(np.random.default_rng(1).permutation(len(table)))
    expected = len(without_settling(table)[0])
    assert len(without_settling(shuffled)[0]) == expected
    time_s = table["time_s"] + np.repeat(np.arange(18) * 40.0, ROWS)
    assert len(without_settling(WheelTable({**table.columns, "time_s": time_s}, None, None, "rig.csv"))[0]) == expected


@pytest.mark.parametrize("order", [None, [0, 4, 1, 5, 2, 3]])
def test_steps_settle_from_where_the_wheel_was(order):
    table, found = without_settling(in_steps(order=order))
    assert (found.values["runs"], found.values["steps"]) == (18, True)
    assert 18 * ROWS // 2 <= len(table) <= 18 * (ROWS - 12)


def test_without_slip_steps_show_in_the_speeds():
    table = in_steps()
    columns = {name: values for name, values in table.columns.items() if name != "slip"}
    columns["travel_speed_m_s"] = 0.06 * (1.0 - table["slip"])
    found = without_settling(WheelTable(columns, None, table.run, "rig.csv"))[1]
    assert (found.values["runs"], found.values["steps"]) == (18, True)


@pytest.mark.parametrize("late", [("torque_Nm",), ("drawbar_pull_N",)])
def test_an_instrument_that_is_late_after_steps_is_kept(late):
    assert without_settling(in_steps(late))[1] is None


@pytest.mark.parametrize("rows", range(1, 9))
def test_channels_that_arrive_late_are_kept(rows):
    columns = dict(in_steps(()).columns)
    steady = runs(varied=0.0)
    for name in ANSWERS:
        columns[name] = steady[name].copy()
    for name in ("torque_Nm", "drawbar_pull_N"):
        by_drive = columns[name].reshape(3, 6 * ROWS)
        by_drive[:, rows:] = by_drive[:, :-rows].copy()
    assert without_settling(WheelTable(columns, None, np.repeat(["a", "b", "c"], 6 * ROWS), "rig.csv"))[1] is None


def test_initial_changes_of_load_slip_or_speed_are_no_transient():
    table = runs(starts())
    settling = np.tile(SETTLING, 18)
    for name, change in (("load_N", 1.0 - 0.08 * settling), ("wheel_speed_rad_s", 1.0 - 0.09 * settling)):
        changing = {**table.columns, name: table[name] * change}
        assert without_settling(WheelTable(changing, None, table.run, "rig.csv"))[1] is None


def test_runs_of_several_rates_are_left_as_they_are():
    table = runs(starts())
    slow = np.isin(np.arange(len(table)) // ROWS, (2, 5, 8, 11, 14, 17)) & (np.arange(len(table)) % 2 == 1)
    assert without_settling(table.select(~slow))[1] is None


def plateau(_, answers):
    answers[:12] *= 0.8


def soft_patch(_, answers):
    answers *= 1.0 - 0.1 * (1.0 - np.tanh((np.arange(ROWS) - 8.0) / 4.0))[:, None]


def warms_up(_, answers):
    answers[:, 0] += 1.0 - SETTLING


def drift(_, answers):
    answers[:, 0] += np.linspace(0.0, 2.0, ROWS)


def wanders(number, answers):
    walk = np.cumsum(np.random.default_rng(100 + number).normal(size=ROWS)) * 0.01
    answers[:, 1] *= 1.0 + walk


def ripples(_, answers):
    answers[:, 0] += 0.5 * np.cos(2.0 * np.pi * np.arange(ROWS) / 7.0)


def one_starts(number, answers):
    if number == 4:
        starts()(number, answers)


@pytest.mark.parametrize(
    "change", [lambda *_: None, plateau, soft_patch, warms_up, drift, wanders, ripples, one_starts]
)
@pytest.mark.parametrize("seed", range(4))
def test_nothing_else_is_left_out(change, seed):
    table = runs(change, seed=seed)
    fewer, found = without_settling(table)
    assert fewer is table
    assert found is None


def test_runs_whose_slip_or_load_keeps_changing_are_kept_whole():
    table = runs(starts())
    for name, change in (("slip", np.linspace(0.0, 0.2, ROWS)), ("load_N", np.linspace(0.0, 30.0, ROWS))):
        changing = {**table.columns, name: table[name] + np.tile(change, 18)}
        assert without_settling(WheelTable(changing, None, table.run, "rig.csv"))[1] is None


def test_few_runs_and_trials_are_kept_whole():
    table = runs(starts(), slips=(0.2,))
    assert without_settling(table)[1] is None
    trials = {name: values for name, values in runs(starts()).columns.items() if name != "time_s"}
    assert without_settling(WheelTable(trials, None, None, "rig.csv"))[1] is None


def test_gaps_are_no_transient():
    table = runs(starts())
    pull = np.full(len(table), np.nan)
    holes = {**table.columns, "drawbar_pull_N": pull}
    holes["torque_Nm"] = np.where(np.arange(len(table)) % ROWS < 30, np.nan, holes["torque_Nm"])
    assert without_settling(WheelTable(holes, None, table.run, "rig.csv"))[1].values["channels"] == ["sinkage_m"]


def test_the_soil_is_that_of_the_steady_part():
    found = identify(recording(runs(starts(), varied=0.0, slips=FEW_SLIPS)))
    assert found.overall is not None
    phi = found.overall.parameters["phi_rad"]
    assert phi.low < np.radians(31.0) < phi.high
    assert phi.high - phi.low < np.radians(1.0)
    assert codes(found.findings) == ["settling_rows"]


MISTAKEN = ("soil_patch", "drift", "torque_offset", "time_lag")
"""Effects that a start could be taken for."""


def test_a_start_is_taken_neither_for_physics_nor_for_an_instrument():
    answer = explain(recording(runs(starts(), slips=FEW_SLIPS)), catalogue=MISTAKEN)
    assert answer.verdict == "none"
    assert any("where the wheel starts" in note for note in answer.notes)


def test_a_start_is_no_mismatch_of_a_simulation_without_one(tmp_path):
    steady = runs(varied=0.0, slips=FEW_SLIPS)
    path = tmp_path / "simulated.csv"
    header = ",".join(("run", *steady.columns))
    rows = zip(steady.run, *steady.columns.values(), strict=True)
    path.write_text("\n".join([header, *(",".join(map(str, row)) for row in rows)]) + "\n")
    answer = explain(recording(runs(starts(), slips=FEW_SLIPS)), simulated=path, catalogue=MISTAKEN)
    assert any("where the wheel starts" in note for note in answer.notes)
    assert answer.verdict == "none"
