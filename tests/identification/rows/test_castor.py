"""A robot of two driven wheels and a castor, which carries weight, resists, and makes no pull."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from bevameter.framework.core.errors import InputError
from bevameter.framework.core.recording.types import Recording, WheelTable
from bevameter.framework.core.soil import SoilKnowledge
from bevameter.framework.core.vehicle import Vehicle
from bevameter.framework.part import part_of
from bevameter.framework.scenario.mechanics import equilibrium
from bevameter.identification.estimate.computed_channels import SHAPE
from bevameter.identification.estimate.estimate import solve, usable
from bevameter.identification.estimate.identify import identify, measured_rows
from bevameter.identification.rows.select import select_wheel_rows
from robot_bag import GRAVITY, RADIUS_M, SAND, WIDTH_M
from scipy.stats import chi2

MASS_KG, AHEAD_M, BACK_M, HEIGHT_M, TRACK_M = 40.0, 0.05, 0.35, 0.25, 0.5
"""The centre of mass lies between the driven axle, AHEAD_M before it, and the castor, BACK_M behind it."""


def vehicle(**of_castor) -> Vehicle:
    sides = {"left": TRACK_M / 2, "right": -TRACK_M / 2}
    wheels = [
        {"name": n, "radius_m": RADIUS_M, "width_m": WIDTH_M, "position_m": (AHEAD_M, y)} for n, y in sides.items()
    ]
    castor = {"name": "castor", "radius_m": 0.06, "width_m": 0.04, "position_m": (-BACK_M, 0.0), **of_castor}
    return Vehicle.model_validate(
        {"wheels": [*wheels, castor], "mass_kg": MASS_KG, "centre_of_mass_m": (0.0, 0.0, HEIGHT_M)}
    )


def recording(resistance: float, robot: Vehicle, seed: int = 1) -> Recording:
    """Drive steadily over waves: the slip is that at which both wheels carry the weight uphill and drag the castor."""
    time_s = np.arange(0.0, 60.0, 0.4)
    pitch = np.radians(4.5) * np.sin(2 * np.pi * time_s / 23.0) + np.radians(2.0) * np.sin(2 * np.pi * time_s / 7.0)
    weight = MASS_KG * GRAVITY
    on_castor = weight * (np.cos(pitch) * AHEAD_M + np.sin(pitch) * HEIGHT_M) / (AHEAD_M + BACK_M)
    load = 0.5 * (weight * np.cos(pitch) - on_castor)
    needed = 0.5 * (weight * np.sin(pitch) + resistance * on_castor)
    slips = np.linspace(-0.3, 0.9, 121)
    each = np.repeat(load, len(slips)), np.tile(slips, len(load))
    pull = equilibrium(RADIUS_M, WIDTH_M, SAND, *each).drawbar_pull_N.reshape(len(load), -1)
    rising = np.maximum.accumulate(pull, axis=1)
    at = np.array([np.interp(wanted, row, slips) for wanted, row in zip(needed, rising, strict=True)])
    torque = equilibrium(RADIUS_M, WIDTH_M, SAND, load, at).torque_Nm
    rng = np.random.default_rng(seed)
    columns = {
        "time_s": np.repeat(time_s, 2), "pitch_rad": np.repeat(pitch, 2), "slip": np.repeat(at, 2),
        "torque_Nm": np.repeat(torque, 2), "travel_speed_m_s": np.full(2 * len(time_s), 0.2),
    }  # fmt: skip
    for name, sd in (("slip", 0.01), ("torque_Nm", 0.2)):
        columns[name] = columns[name] + rng.normal(0.0, sd, len(columns[name]))
    wheel = np.tile(np.array(["left", "right"], dtype=object), len(time_s))
    return Recording(
        "r", Path("w.csv"), robot, None, "", "0" * 64, wheel=WheelTable(columns, wheel, None, Path("w.csv"))
    )


@pytest.mark.parametrize("resistance", [0.05, 0.25])
def test_driven_wheels_carry_the_vehicle_and_drag_the_castor(resistance):
    rows = select_wheel_rows(recording(resistance, vehicle(driven=False)))
    (found,) = [each for each in rows.findings if each.code == "pull_computed"]
    assert found.values["towed"] == ["castor"]
    pull, load, pitch = (rows.table[name] for name in ("drawbar_pull_N", "load_N", "pitch_rad"))
    truth = 0.5 * MASS_KG * GRAVITY * np.sin(pitch) + resistance * (0.5 * MASS_KG * GRAVITY * np.cos(pitch) - load)
    # What the castor resists is a standard deviation from what is taken; the rest is for shares of the pull.
    assert np.abs(pull - truth).max() < 1.0 * found.values["sd_N"]
    assert np.abs(np.mean(pull - truth)) > 0.5 * found.values["sd_N"]
    # One parameter that all rows share takes away the error: what is left is within what the estimator allows for.
    of = found.values
    towed = of["towed_over_driven"] + of["towed_over_driven_by_N"] * (load - of["load_N"])
    left = pull - truth + (resistance - of["resistance"]) * towed * load
    assert np.abs(left).max() < SHAPE["drawbar_pull_N"] * of["load_N"]


@pytest.mark.slow
@pytest.mark.parametrize("resistance", [0.05, 0.15, 0.25])
def test_intervals_hold_whatever_the_castor_resists(resistance):
    """Slip and load both follow the slope, and so each other along a curve: an estimator that takes that for a straight
    line is biased, to c = 7 kPa and phi = 0 here.
    """
    found = identify(recording(resistance, vehicle(driven=False))).overall.parameters
    for name in ("c_Pa", "phi_rad"):
        assert found[name].low <= getattr(SAND, name) <= found[name].high, name


def test_the_true_soil_is_as_likely_as_chance_allows():
    """Twice the gain of five parameters is chi-squared about 5: an estimator with a bias gains more, and one that
    stops on the way less than nothing.
    """
    gains = []
    for seed in range(2):
        rows = select_wheel_rows(recording(0.15, vehicle(driven=False), seed))
        (stretch,) = [each for each in rows.stretches() if not each.reason]
        measured = usable(measured_rows(rows, stretch.rows[::2]))
        soil = {name: getattr(SAND, name) for name in ("c_Pa", "phi_rad", "k_m", "stiffness_Pa", "n")}
        free, true = (solve(measured, rows.wheel, SoilKnowledge(known)) for known in ({}, soil))
        gains.append(2.0 * (free.fit.log_likelihood - true.fit.log_likelihood))
    assert min(gains) > 0.0
    assert np.mean(gains) < chi2.ppf(0.99, 10) / 2


def test_no_pull_is_made_up_where_nobody_says_whether_a_wheel_is_driven():
    drive = recording(0.2, vehicle())
    for each in (drive, part_of(drive, from_s=10.0, to_s=50.0)):
        rows = select_wheel_rows(each)
        assert "drawbar_pull_N" not in rows.table
        assert [(f.severity, f.values["wheels"]) for f in rows.findings if f.code == "driven_not_known"] == [
            ("warning", ["castor"])
        ]
    # rows of one wheel chosen: the other is known to be driven from the whole
    rows = select_wheel_rows(part_of(recording(0.2, vehicle(driven=False)), wheels="left"))
    assert "drawbar_pull_N" in rows.table


def test_a_torque_before_the_gear_is_refused():
    drive = recording(0.2, vehicle(driven=False))
    small = {**drive.wheel.columns, "torque_Nm": drive.wheel["torque_Nm"] / 34.0}
    table = WheelTable(small, drive.wheel.wheel, None, Path("w.csv"))
    with pytest.raises(InputError, match=r"torque_Nm: over the radius it is .* N uphill .* after the gear"):
        select_wheel_rows(replace(drive, wheel=table))


def test_rows_of_a_castor_are_left_out():
    drive = recording(0.2, vehicle(driven=False))
    table = drive.wheel
    named = np.where(np.arange(len(table)) % 4 == 0, "castor", table.wheel).astype(object)
    mixed = Recording("r", Path("w.csv"), drive.vehicle, None, "", "0" * 64,
                      wheel=WheelTable(table.columns, named, None, Path("w.csv")))  # fmt: skip
    rows = select_wheel_rows(mixed)
    assert "castor" not in set(rows.table.wheel)
    assert [f.values["used"] for f in rows.findings if f.code == "towed_wheels"] == [int((named != "castor").sum())]
    with pytest.raises(InputError, match="rows are of the vehicle's driven wheels"):
        select_wheel_rows(mixed, every_row=True)


def test_weight_on_wheels_that_do_not_hold_the_vehicle_is_refused():
    axle = [{"name": n, "radius_m": 0.1, "width_m": 0.05, "position_m": (0.0, y)} for n, y in (("l", 0.2), ("r", -0.2))]
    for place in ({}, {"centre_of_mass_m": (0.0, 0.0, 0.2)}, {"centre_of_mass_m": (0.1, 0.0, 0.2)}):
        with pytest.raises(ValueError, match=r"in one line \(l, r\), .* castor with driven = false"):
            Vehicle.model_validate({"wheels": axle, "mass_kg": 30.0, **place})
    with pytest.raises(ValueError, match="driven = false of every wheel"):
        Vehicle.model_validate({"wheel": {"radius_m": 0.1, "width_m": 0.05, "driven": False}})
