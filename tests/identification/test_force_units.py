"""Loads in kilograms and pulls that are no newtons are named, and others are not."""

from __future__ import annotations

import numpy as np
import pytest
from bevameter import Vehicle
from bevameter.identification.rows.select import felt_rows
from slow_drive import WHEEL, recording, with_columns
from steady_trials import trials, without


def said(table, **noise) -> list[str]:
    return list(felt_rows(recording(table, Vehicle(wheels=(WHEEL,), noise=noise))).problems)


def test_forces_in_newtons_are_not_doubted(rng):
    table = trials(rng)
    assert said(table) == []
    assert said(without(table, "torque_Nm")) == []


@pytest.mark.parametrize(
    ("left_out", "told"), [("sinkage_m", "torque over radius is"), ("torque_Nm", "the pull is")], ids=["torque", "pull"]
)
def test_a_load_in_kilograms_is_named(left_out, told, rng):
    table = without(trials(rng), left_out)
    (note,) = said(with_columns(table, load_N=table["load_N"] / 9.81))
    assert note.startswith(told)
    assert "as usual, were load_N in kg: check its unit; the load is used as it is" in note


@pytest.mark.parametrize("left_out", ["sinkage_m", "torque_Nm"])
@pytest.mark.parametrize(("per", "told"), [("load", "divided by the load"), (1e3, "in kN")], ids=["coefficient", "kN"])
def test_a_pull_that_is_no_newtons_is_named(left_out, per, told, rng):
    table = without(trials(rng), left_out)
    pull = table["drawbar_pull_N"] / (table["load_N"] if per == "load" else per)
    (note,) = said(with_columns(table, drawbar_pull_N=pull))
    assert f"would be usual were it {told}: check its unit; the pull is used as it is" in note


def test_the_noise_stated_in_newtons_is_not_blamed_for_a_pull_over_the_load(rng):
    table = trials(rng)
    table = with_columns(table, drawbar_pull_N=table["drawbar_pull_N"] / table["load_N"])
    (note,) = said(table, drawbar_pull_N=10.0)
    assert "divided by the load" in note


def test_a_vehicle_that_rolls_freely_pulls_nothing_and_is_not_doubted(rng):
    table = trials(rng)
    assert said(with_columns(table, drawbar_pull_N=0.2 * rng.normal(size=len(table)))) == []


def test_a_load_of_a_newton_is_no_pull_over_the_load(rng):
    table = trials(rng)
    scaled = {name: table[name] / 90.0 for name in ("load_N", "torque_Nm", "drawbar_pull_N")}
    assert said(with_columns(table, **scaled)) == []


def test_a_braked_wheel_tells_nothing_of_the_load(rng):
    table = trials(rng, slips=(-0.8, -0.6, -0.4, -0.2))
    assert said(with_columns(table, load_N=table["load_N"] / 9.81)) == []
    assert np.all(table["slip"] < 0.0)
