"""Soil from drives whose true load and slip change from row to row: changes that the answers follow are no noise."""

from __future__ import annotations

from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest
from bevameter import Vehicle, identify
from bevameter.framework.core.findings import codes
from bevameter.framework.core.recording.types import Recording, WheelTable
from bevameter.framework.core.soil import SoilEstimate, SoilKnowledge
from bevameter.identification.estimate.estimate import usable
from bevameter.identification.estimate.identify import measured_rows
from bevameter.identification.estimate.noise_likelihood import solve_with_noise
from bevameter.identification.rows.select import select_wheel_rows
from unsteady_drive import ROWS, SOIL, WHEEL, drive

CODE = "unsteady_input"


def recording(table: WheelTable, stated: dict[str, float] | None = None) -> Recording:
    vehicle = Vehicle(name="test", wheels=(WHEEL,), noise=stated or {})
    return Recording("table", Path("table.csv"), vehicle, None, "", "0" * 64, wheel=table)


def estimated(table: WheelTable, stated: dict[str, float] | None = None) -> SoilEstimate:
    found = identify(recording(table, stated)).overall
    assert found is not None
    return found


@pytest.mark.parametrize("noise", [(0.0, 0.0), (0.0, 0.006), (0.01, 0.014)])
def test_the_noise_of_each_channel_is_estimated(noise):
    """Torque by 0.05 Nm, sinkage by 0.2 mm and pull by 0.4 N (`unsteady_drive`)."""
    rows = select_wheel_rows(recording(drive(1, (0.02, 0.016), noise)))
    measured = usable(measured_rows(rows, np.arange(300)))
    updated, _, notes = solve_with_noise(measured, WHEEL, SoilKnowledge())
    assert updated.noise[[1, 2, 4]] == pytest.approx([0.05, 2e-4, 0.4], rel=0.25)
    assert updated.noise[0] == pytest.approx(150.0 * noise[0], rel=0.25, abs=0.7)
    assert updated.noise[3] == pytest.approx(noise[1], rel=0.2, abs=0.0012)
    assert len(notes) == 2


def test_intervals_are_narrow_and_hold_the_truth():
    """With the noise estimated from neighbouring rows the intervals of c are seven times as wide."""
    table = drive(0, (0.04, 0.02), (0.0, 0.0)).select(np.arange(200))
    found, shown = estimated(table), estimated(table, {"load_N": 5.8, "slip": 0.019})
    assert codes(found.findings).count(CODE) == 2
    assert CODE not in codes(shown.findings)
    held = [found.parameters[each.name].low <= getattr(SOIL, each.name) <= found.parameters[each.name].high
            for each in fields(SOIL)]  # fmt: skip
    assert np.mean(held) >= 0.8
    width, wider = (each.parameters["c_Pa"].high - each.parameters["c_Pa"].low for each in (found, shown))
    assert width < 0.25 * wider


@pytest.mark.parametrize("seed", range(2))
def test_changes_that_the_answers_do_not_follow_are_noise(seed):
    found = estimated(drive(seed, (0.0, 0.0), (0.02, 0.012)).select(np.arange(300)))
    assert CODE not in codes(found.findings)


def test_steady_trials_have_no_neighbours_that_are_unsteady():
    table = drive(1, (0.04, 0.02), (0.0, 0.0))
    trials = WheelTable(
        {name: values for name, values in table.columns.items() if name != "time_s"}, None,
        np.array([f"trial {number}" for number in range(ROWS)], dtype=object), "test",
    )  # fmt: skip
    assert CODE not in codes(estimated(trials).findings)


@pytest.mark.filterwarnings("error")
def test_a_channel_that_is_not_there_has_no_noise():
    table = drive(1, (0.04, 0.02), (0.0, 0.0)).select(np.arange(300))
    columns = {name: values for name, values in table.columns.items() if name != "drawbar_pull_N"}
    assert CODE in codes(estimated(replace(table, columns=columns)).findings)


@pytest.mark.parametrize("start", [0, 200])
def test_few_rows_do_not_determine_the_noise_of_five_channels(start):
    rows = select_wheel_rows(recording(drive(1, (0.04, 0.02), (0.0, 0.0))))
    measured = usable(measured_rows(rows, np.arange(start, start + 40)))
    assert not solve_with_noise(measured, WHEEL, SoilKnowledge())[2]


def test_no_noise_is_estimated_where_the_form_does_not_fit():
    """A load recorded as constant that is not: no noise of slip explains the rows by one soil."""
    table = drive(1, (0.0, 0.02), (0.0, 0.0))
    held = {**table.columns, "load_N": np.full(ROWS, 150.0) + 0.1 * np.random.default_rng(1).normal(size=ROWS)}
    measured = usable(measured_rows(select_wheel_rows(recording(replace(table, columns=held))), np.arange(200)))
    updated, solution, notes = solve_with_noise(measured, WHEEL, SoilKnowledge())
    np.testing.assert_array_equal(updated.noise, measured.noise)
    assert not notes
    assert solution.misfit > 1.5
