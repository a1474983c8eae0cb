"""A pull that is measured the other way round is refused or doubted, and what looks like it is not."""

from __future__ import annotations

import numpy as np
import pytest
from bevameter import InputError, WheelTable
from bevameter.identification.mechanics.textbook import equilibrium
from bevameter.identification.rows.select import felt_rows
from slow_drive import SAND, WHEEL, drive, recording, with_columns
from steady_trials import SLIPS, trials, without

MIRRORED = r"column drawbar_pull_N: falls by .* N for each newton that torque over radius rises by \(correlation -"


def said(table: WheelTable) -> list[str]:
    return [problem for problem in felt_rows(recording(table)).problems if "drawbar_pull_N" in problem]


def turned(table: WheelTable, **columns) -> WheelTable:
    return with_columns(table, drawbar_pull_N=-table["drawbar_pull_N"], **columns)


@pytest.mark.parametrize("slips", [SLIPS, (-0.6, -0.3, -0.1, 0.1, 0.3, 0.6)], ids=["driven", "braked, too"])
def test_a_pull_of_steady_trials_with_the_other_sign_is_refused(slips, rng):
    table = trials(rng, slips)
    assert said(table) == []
    with pytest.raises(InputError, match=MIRRORED):
        felt_rows(recording(turned(table)))


def test_a_pull_along_a_drive_with_the_other_sign_is_refused(rng):
    table = drive(rng)
    load, slip = 110.0 + 45.0 * np.sin(table["time_s"] / 2.0), 0.3 + 0.2 * np.sin(table["time_s"] / 1.3)
    pull = equilibrium(WHEEL, SAND, load, slip).drawbar_pull_N
    assert said(with_columns(table, drawbar_pull_N=pull)) == []
    with pytest.raises(InputError, match=MIRRORED):
        felt_rows(recording(with_columns(table, drawbar_pull_N=-pull)))


@pytest.mark.parametrize("why", ["no sinkage", "slope"])
def test_where_it_is_not_beyond_doubt_a_note_says_so(why, rng):
    table = trials(rng)
    pitch = np.full(len(table), 0.1)
    table = without(turned(table), "sinkage_m") if why == "no sinkage" else turned(table, pitch_rad=pitch)
    (note,) = said(table)
    assert "falls by" in note
    assert "it may be measured the other way round (positive forwards); it is used as it is" in note


def test_without_torque_the_pull_is_doubted_by_slip(rng):
    table = without(trials(rng), "torque_Nm")
    assert said(table) == []
    (note,) = said(turned(table))
    assert "forwards where slip is least and backwards where it is largest" in note


def test_a_wheel_that_digs_itself_in_until_it_is_dragged_is_not_refused(rng):
    """Resistance grows twice as fast as thrust, from a twentieth of the load; the wheel ends buried to its axle."""
    table = trials(rng)
    thrust = table["torque_Nm"] / (WHEEL.radius_m * table["load_N"])
    pull = table["load_N"] * (thrust - (0.05 + 1.9 * (thrust - thrust.min())))
    dug = with_columns(table, drawbar_pull_N=pull, sinkage_m=0.02 + 0.12 * table["slip"] / table["slip"].max())
    (note,) = said(dug)
    assert "it may be measured the other way round" in note
    with pytest.raises(InputError, match=MIRRORED):
        felt_rows(recording(with_columns(table, drawbar_pull_N=pull)))


@pytest.mark.parametrize("offset", [-8.0, 8.0])
def test_a_pull_that_is_off_or_wholly_negative_is_not_doubted(offset, rng):
    table = trials(rng)
    assert said(with_columns(table, drawbar_pull_N=table["drawbar_pull_N"] + offset)) == []


def test_towed_wheels_are_not_doubted(rng):
    table = trials(rng, slips=(-0.02, -0.01, 0.0, 0.01, 0.02), loads=(40.0, 80.0, 160.0))
    assert said(table) == []


def test_few_rows_tell_nothing(rng):
    table = trials(rng).select(np.arange(6))
    assert said(turned(table)) == []
