"""What is no effect and was once named one: wrongly stated noise, and ground that is prepared anew for each run."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from bevameter import explain
from bevameter.framework.core.recording.types import Recording, WheelTable
from bevameter.framework.core.vehicle import Vehicle
from bevameter.framework.scenario import mechanics
from scipy.ndimage import gaussian_filter1d

RADIUS_M, WIDTH_M = 0.16, 0.12
SOIL = mechanics.Soil(900.0, 0.52, 0.015, 2.5e5, 1.05)
NOISE = {"load_N": 9.0, "slip": 0.006, "torque_Nm": 1.0, "sinkage_m": 0.0006, "drawbar_pull_N": 10.0}


def recorded(
    rng: np.random.Generator, load_N: np.ndarray, slip: np.ndarray, stated: float | None, stiffness=1.0, **others
) -> Recording:
    """A wheel of the textbook, with noise of which the vehicle states a multiple."""
    state = mechanics.equilibrium(RADIUS_M, WIDTH_M, SOIL, load_N, slip, stiffness=stiffness)
    channels = {
        "load_N": load_N, "slip": slip, "torque_Nm": state.torque_Nm, "sinkage_m": state.sinkage_m,
        "drawbar_pull_N": state.drawbar_pull_N,
    }  # fmt: skip
    columns = {name: values + rng.normal(0.0, NOISE[name], len(values)) for name, values in channels.items()}
    columns |= {name: values for name, values in others.items() if name != "run"}
    noise = {} if stated is None else {name: stated * sd for name, sd in NOISE.items()}
    vehicle = Vehicle.model_validate({"wheel": {"radius_m": RADIUS_M, "width_m": WIDTH_M}, "noise": noise})
    table = WheelTable(columns, None, others.get("run"), Path("made.csv"))
    return Recording("made", Path("made"), vehicle, None, "", "0" * 64, table)


def test_noise_that_is_stated_half_as_large_names_nothing(rng):
    """Half the load's noise was once taken for bouncing, after which torque lagged."""
    count = 400
    time_s = 0.1 * np.arange(count)
    course = [gaussian_filter1d(rng.normal(size=count), width) for width in (20.0, 15.0)]
    load_N, slip = (each / each.std() for each in course)
    speed = np.full(count, 0.25)
    slip = np.clip(0.3 + 0.15 * slip, -0.1, 0.8)
    drive = recorded(
        rng, 700.0 + 120.0 * load_N, slip, 0.5, time_s=time_s, travel_speed_m_s=speed,
        wheel_speed_rad_s=speed / (RADIUS_M * (1.0 - slip)),
    )  # fmt: skip
    assert explain(drive, catalogue=("time_lag", "inertia")).verdict == "none"


def test_ground_that_is_prepared_anew_for_each_run_is_no_zero(rng):
    run = np.repeat(np.arange(10), 9)
    stiffness = np.exp(0.06 * rng.normal(size=10))[run]
    load_N, slip = 700.0 * np.exp(0.2 * rng.normal(size=10))[run], np.tile(np.linspace(0.03, 0.6, 9), 10)
    labels = np.array([f"run {number}" for number in run])
    trials = recorded(rng, load_N, slip, None, stiffness, run=labels)
    assert explain(trials, catalogue=("zeros_by_run",)).verdict == "none"


def test_zeros_that_differ_from_run_to_run_are_found_in_trials(rng):
    run = np.repeat(np.arange(10), 9)
    load_N, slip = 700.0 * np.exp(0.2 * rng.normal(size=10))[run], np.tile(np.linspace(0.03, 0.6, 9), 10)
    labels = np.array([f"run {number}" for number in run])
    trials = recorded(rng, load_N, slip, None, np.exp(0.03 * rng.normal(size=90)), run=labels)
    columns = {**trials.wheel.columns, "torque_Nm": trials.wheel["torque_Nm"] + rng.normal(0.0, 5.0, 10)[run]}
    drive = Recording(
        "made", Path("made"), trials.vehicle, None, "", "0" * 64, WheelTable(columns, None, labels, Path("made.csv"))
    )
    (found,) = explain(drive, catalogue=("zeros_by_run", "torque_gain")).missing
    assert (found.effect, found.form) == ("zeros_by_run", "torque_Nm")
