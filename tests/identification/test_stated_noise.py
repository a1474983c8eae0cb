"""A stated noise that cannot be a sensor's is refused, one that is contradicted is noted, others are neither."""

from __future__ import annotations

import numpy as np
import pytest
from bevameter import InputError, Vehicle, identify
from bevameter.identification.rows.select import felt_rows
from slow_drive import VEHICLE, WHEEL, drive, recording, with_columns
from steady_trials import trials


def said(table, **noise) -> list[str]:
    problems = felt_rows(recording(table, Vehicle(wheels=(WHEEL,), noise=noise))).problems
    return [problem for problem in problems if "noise" in problem]


@pytest.mark.parametrize(
    ("name", "stated", "told"),
    [
        ("sinkage_m", 0.5, r"sinkage_m of wheel.csv ranges from 0\.\d+ to 0\.\d+"),
        ("torque_Nm", 1e9, "torque_Nm of wheel.csv ranges from"),
        ("drawbar_pull_N", 1e4, "drawbar_pull_N of wheel.csv ranges from"),
        ("load_N", 1e3, r"load_N of wheel.csv is 12\d at most"),
        ("slip", 1.0, r"slip of wheel.csv lies in \[-1, 1\]"),
    ],
)
def test_a_noise_beside_which_a_channel_is_nothing_is_refused(name, stated, told, rng):
    with pytest.raises(InputError, match=rf"vehicle 'vehicle', key noise\.{name}: .*standard deviation: {told}"):
        said(trials(rng), **{name: stated})


def test_it_is_refused_by_identify(rng):
    vehicle = Vehicle(wheels=(WHEEL,), noise={**VEHICLE.noise, "sinkage_m": 0.5})
    with pytest.raises(InputError, match=r"key noise\.sinkage_m: 0\.5 "):
        identify(recording(drive(rng), vehicle))


@pytest.mark.parametrize("timed", [True, False])
def test_a_noise_of_nothing_is_noted(timed, rng):
    (note,) = said(drive(rng) if timed else trials(rng), torque_Nm=1e-9)
    assert "the noise stated of torque_Nm, 1e-09, is less than a hundredth of what neighbours differ by" in note


def test_noise_as_it_is_and_several_times_it_is_neither(rng):
    table = drive(rng)
    for factor in (0.1, 1.0, 10.0):
        assert said(table, **{name: factor * each for name, each in VEHICLE.noise.items()}) == []


def test_a_channel_that_is_held_or_stuck_or_not_recorded_says_nothing(rng):
    table = trials(rng)
    held = {"load_N": np.full(len(table), 90.0), "sinkage_m": np.full(len(table), 0.02)}
    assert said(with_columns(table, **held), load_N=20.0, sinkage_m=0.5, x_m=1e6, wheel_speed_rad_s=1e6) == []
    assert said(table.select(table["slip"] == 0.05), sinkage_m=0.5) == []
