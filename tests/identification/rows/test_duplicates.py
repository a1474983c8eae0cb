"""Rows recorded twice are left out, repeats that agree by chance are not."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from bevameter import Recording, Vehicle, Wheel, WheelTable, explain, identify
from bevameter.framework.core.findings import codes
from bevameter.identification.mechanics.soil import Soil
from bevameter.identification.mechanics.textbook import equilibrium
from bevameter.identification.rows.duplicates import without_duplicates

WHEEL = Wheel(radius_m=0.15, width_m=0.12)
SAND = Soil(c_Pa=300.0, phi_rad=0.55, k_m=0.012, stiffness_Pa=9e4, n=0.9)


def trials(rng, repeats=1, digits=(2, 3, 3, 5, 2), noise=1.0) -> WheelTable:
    """Steady trials, three loads by seven slips, written with so many digits: load, slip, torque, sinkage, pull."""
    load, slip = (grid.ravel() for grid in np.meshgrid([60.0, 120.0, 180.0], np.linspace(0.05, 0.6, 7)))
    load, slip = np.repeat(load, repeats), np.repeat(slip, repeats)
    state = equilibrium(WHEEL, SAND, load, slip)
    channels = {
        "load_N": (load, 0.3), "slip": (slip, 0.0), "torque_Nm": (state.torque_Nm, 0.03),
        "sinkage_m": (state.sinkage_m, 2e-4), "drawbar_pull_N": (state.drawbar_pull_N, 0.3),
    }  # fmt: skip
    columns = {
        name: np.round(values + noise * sd * rng.normal(size=len(load)), places)
        for (name, (values, sd)), places in zip(channels.items(), digits, strict=True)
    }
    return WheelTable(columns, None, np.array([f"t{row}" for row in range(len(load))]), Path("trials.csv"))


def together(*tables: WheelTable, wheel=None, run=None) -> WheelTable:
    columns = {name: np.concatenate([table[name] for table in tables]) for name in tables[0].columns}
    return WheelTable(columns, wheel, run, tables[0].source)


def recording(table: WheelTable) -> Recording:
    return Recording("test", table.source, Vehicle(wheels=(WHEEL,)), None, "", "0" * 64, wheel=table)


@pytest.mark.parametrize("times", [2, 3])
def test_duplicates_are_left_out_and_counted(rng, times):
    table = trials(rng)
    doubled = together(*[table] * times, run=np.array([f"u{row}" for row in range(21 * times)]))
    kept, found = without_duplicates(doubled)
    for name in table.columns:
        np.testing.assert_array_equal(kept[name], table[name])
    count = 21 * (times - 1)
    assert found.values == {"n": count, "rows": ["run u21", "run u22", "run u23", "run u24"], "more": count - 4}


def test_duplicates_under_another_wheel_are_duplicates(rng):
    table = trials(rng)
    kept, found = without_duplicates(together(table, table, wheel=np.repeat(["A", "B"], 21), run=np.tile(table.run, 2)))
    assert set(kept.wheel) == {"A"}
    assert found.values["n"] == 21


def test_one_duplicate_is_named(rng):
    table = trials(rng)
    kept, found = without_duplicates(table.select(np.append(np.arange(21), 4)))
    assert len(kept) == 21
    assert found.values == {"n": 1, "rows": ["run t4"], "more": 0}


def test_repeats_are_no_duplicates(rng):
    table = trials(rng, repeats=3)
    assert without_duplicates(table) == (table, None)


@pytest.mark.parametrize("repeats", [2, 5, 20])
def test_readings_so_coarse_that_repeats_agree_by_chance_are_kept(rng, repeats):
    """Load and slip are set, and the noise is about a digit of each answer."""
    table = trials(rng, repeats, digits=(-1, 3, 1, 3, 0), noise=1.5)
    rows = np.column_stack([table[name] for name in table.columns])
    assert len(np.unique(rows, axis=0)) < 0.9 * len(rows)
    assert without_duplicates(table) == (table, None)


def test_duplicates_of_repeated_trials_are_found(rng):
    table = trials(rng, repeats=3)
    kept, found = without_duplicates(together(table, table, run=np.tile(table.run, 2)))
    assert len(kept) == 63
    assert found.values["n"] == 63


def test_rows_at_different_times_are_no_duplicates_and_at_the_same_time_they_are(rng):
    time_s = np.repeat(0.1 * np.arange(20), 2)
    columns = {"time_s": time_s, "load_N": np.full(40, 60.0), "slip": np.full(40, 0.2), "sinkage_m": np.full(40, 0.01)}
    table = WheelTable(columns, None, None, Path("drive.csv"))
    kept, found = without_duplicates(table)
    np.testing.assert_array_equal(kept["time_s"], time_s[::2])
    assert found.values == {"n": 20, "rows": ["0 s", "0.1 s", "0.2 s", "0.3 s"], "more": 16}


def test_what_was_not_observed_makes_no_duplicate(rng):
    table = trials(rng)
    empty = {name: np.full(21, np.nan) for name in table.columns if name not in ("load_N", "slip")}
    unanswered = replace(table, columns={**table.columns, **empty})
    doubled = together(unanswered, unanswered, run=np.tile(table.run, 2))
    assert without_duplicates(doubled) == (doubled, None)
    no_torque = replace(table, columns={**table.columns, "torque_Nm": np.full(21, np.nan)})
    assert len(without_duplicates(together(no_torque, no_torque, run=np.tile(table.run, 2)))[0]) == 21


def test_identify_and_explain_answer_as_without_duplicates(rng):
    table = trials(rng)
    doubled = together(table, table, run=np.tile(table.run, 2))
    once, twice = (identify(recording(each)) for each in (table, doubled))
    assert twice.overall.n == once.overall.n == 21
    assert twice.overall.parameters == once.overall.parameters
    assert codes(twice.findings) == ["duplicate_rows"]
    answers = [explain(recording(each), catalogue=()) for each in (table, doubled)]
    assert [answer.n for answer in answers] == [21, 21]
    assert answers[0].soil == answers[1].soil
    assert "duplicates" in answers[1].notes[0]
