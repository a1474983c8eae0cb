"""Channels of reversed sign are refused or noted, and similar recordings are not."""

from __future__ import annotations

import numpy as np
import pytest
from bevameter import InputError, WheelTable
from bevameter.framework.core.findings import codes
from bevameter.identification.mechanics.textbook import equilibrium
from bevameter.identification.rows.select import select_wheel_rows
from slow_drive import SAND, WHEEL, drive, recording, with_columns
from steady_trials import SLIPS, trials, without

MIRRORED = r"column drawbar_pull_N: falls by .* N for each newton that torque over radius rises by \(correlation -"


def found(table: WheelTable) -> list[str]:
    return [
        code for code in codes(select_wheel_rows(recording(table)).findings) if code.endswith(("_sign", "_by_slip"))
    ]


def turned(table: WheelTable, **columns) -> WheelTable:
    return with_columns(table, drawbar_pull_N=-table["drawbar_pull_N"], **columns)


@pytest.mark.parametrize("slips", [SLIPS, (-0.6, -0.3, -0.1, 0.1, 0.3, 0.6)], ids=["driven", "braked, too"])
def test_a_pull_of_steady_trials_with_the_other_sign_is_refused(slips, rng):
    table = trials(rng, slips)
    assert found(table) == []
    with pytest.raises(InputError, match=MIRRORED):
        select_wheel_rows(recording(turned(table)))


def test_a_pull_along_a_drive_with_the_other_sign_is_refused(rng):
    table = drive(rng)
    load, slip = 110.0 + 45.0 * np.sin(table["time_s"] / 2.0), 0.3 + 0.2 * np.sin(table["time_s"] / 1.3)
    pull = equilibrium(WHEEL, SAND, load, slip).drawbar_pull_N
    assert found(with_columns(table, drawbar_pull_N=pull)) == []
    with pytest.raises(InputError, match=MIRRORED):
        select_wheel_rows(recording(with_columns(table, drawbar_pull_N=-pull)))


@pytest.mark.parametrize("why", ["no sinkage", "slope"])
def test_a_likely_wrong_sign_of_the_pull_is_noted(why, rng):
    table = trials(rng)
    pitch = np.full(len(table), 0.1)
    table = without(turned(table), "sinkage_m") if why == "no sinkage" else turned(table, pitch_rad=pitch)
    assert found(table) == ["pull_sign"]


def test_without_torque_the_pull_is_doubted_by_slip(rng):
    table = without(trials(rng), "torque_Nm")
    assert found(table) == []
    assert found(turned(table)) == ["pull_sign_by_slip"]


def test_a_wheel_that_digs_itself_in_until_it_is_dragged_is_not_refused(rng):
    """Resistance grows twice as fast as thrust, from a twentieth of the load; the wheel ends buried to its axle."""
    table = trials(rng)
    thrust = table["torque_Nm"] / (WHEEL.radius_m * table["load_N"])
    pull = table["load_N"] * (thrust - (0.05 + 1.9 * (thrust - thrust.min())))
    dug = with_columns(table, drawbar_pull_N=pull, sinkage_m=0.02 + 0.12 * table["slip"] / table["slip"].max())
    assert found(dug) == ["pull_sign"]
    with pytest.raises(InputError, match=MIRRORED):
        select_wheel_rows(recording(with_columns(table, drawbar_pull_N=pull)))


@pytest.mark.parametrize("offset", [-8.0, 8.0])
def test_a_pull_that_is_off_or_wholly_negative_is_not_doubted(offset, rng):
    table = trials(rng)
    assert found(with_columns(table, drawbar_pull_N=table["drawbar_pull_N"] + offset)) == []


def test_towed_wheels_are_not_doubted(rng):
    table = trials(rng, slips=(-0.02, -0.01, 0.0, 0.01, 0.02), loads=(40.0, 80.0, 160.0))
    assert found(table) == []


def test_few_rows_are_not_judged(rng):
    table = trials(rng).select(np.arange(6))
    assert found(turned(table)) == []


def test_a_torque_that_brakes_a_driven_wheel_is_refused(rng):
    table = drive(rng)
    with pytest.raises(InputError, match=r"column torque_Nm: -.*100 % of the rows with a slip above 0.1 below 0"):
        select_wheel_rows(recording(with_columns(table, torque_Nm=-table["torque_Nm"])))


def test_a_wheel_without_torque_or_braked_is_not_refused(rng):
    table = drive(rng)
    select_wheel_rows(recording(with_columns(table, torque_Nm=-0.1 + 0.01 * rng.normal(size=len(table)))))
    braked = with_columns(table, torque_Nm=-table["torque_Nm"], slip=-table["slip"])
    assert all("braked" in reason for reason in select_wheel_rows(recording(braked)).reasons)


def test_a_sinkage_whose_zero_is_a_little_off_is_not_refused(rng):
    table = drive(rng)
    select_wheel_rows(
        recording(with_columns(table, sinkage_m=table["sinkage_m"] - np.median(table["sinkage_m"]) - 1e-3))
    )


def mirrored_slip(rng, braked=1.0):
    """A drive whose slip has its sign reversed in the last share `braked` of the rows."""
    table = drive(rng)
    first = int((1.0 - braked) * len(table))
    return with_columns(table, slip=np.where(np.arange(len(table)) < first, table["slip"], -table["slip"]))


def test_a_torque_that_drives_a_braked_wheel_is_refused(rng):
    said = (
        r"columns torque_Nm and slip: .* 100 % of the rows with a slip below -0.2 above 0 \(expected .* both negative"
    )
    with pytest.raises(InputError, match=said):
        select_wheel_rows(recording(mirrored_slip(rng)))


def test_a_torque_of_the_wrong_sign_in_part_of_a_drive_is_noted(rng):
    assert found(mirrored_slip(rng, braked=0.3)) == ["torque_sign"]


def test_a_wheel_that_slips_a_little_backwards_by_the_radius_of_its_lugs_is_not_refused(rng):
    table = drive(rng)
    assert found(with_columns(table, slip=np.full(len(table), -0.12))) == []
