"""Load and pull that follow from the vehicle's weight: their errors are common to all rows, and no error of form."""

from __future__ import annotations

from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest
from bevameter.framework.core.recording.types import Recording, WheelTable
from bevameter.framework.core.soil import WRONG_FORM, SoilKnowledge
from bevameter.framework.core.vehicle import Wheel, load_vehicle
from bevameter.identification.estimate.computed_channels import NUISANCES, ComputedChannels
from bevameter.identification.estimate.estimate import solve, usable
from bevameter.identification.estimate.form_error import rejected
from bevameter.identification.estimate.identify import measured_rows
from bevameter.identification.mechanics.flexible import FREEDOMS
from bevameter.identification.mechanics.soil import soil_vector
from bevameter.identification.mechanics.textbook import TextbookWheel
from bevameter.identification.rows.select import select_wheel_rows
from robot_bag import NAMES, RADIUS_M, SAND, VEHICLE_TOML, drive

WHEEL = Wheel(radius_m=0.15, width_m=0.12)
VALUES = {"c_Pa": 900.0, "phi_rad": 0.5, "k_m": 0.015, "stiffness_Pa": 2e5, "n": 1.0}
IMPOSED = np.array([[120.0, 0.1], [180.0, 0.4], [90.0, -0.05], [150.0, 0.7]])


@pytest.mark.parametrize("freed", [False, True])
def test_derivatives_are_those_of_differences(freed):
    model = ComputedChannels(TextbookWheel(WHEEL), 140.0, towed=(0.15, -0.2))
    vector = np.append(soil_vector(VALUES), [0.03, 0.02, -0.05, 0.2, 0.1])
    if freed:
        model = model.freed(140.0)
        vector = np.append(vector, [0.1, 0.45, 0.05, 0.1, 0.2, 0.05][: len(FREEDOMS)])
    angle = np.full(len(IMPOSED), 0.6)
    found = model.predict(IMPOSED, vector, angle)
    for column in range(len(vector)):
        step = 1e-5 * max(abs(vector[column]), 1.0)
        ends = [model.predict(IMPOSED, vector + sign * step * (np.arange(len(vector)) == column), found.theta_1)
                for sign in (1.0, -1.0)]  # fmt: skip
        slope = (ends[0].channels - ends[1].channels) / (2.0 * step)
        np.testing.assert_allclose(found.by_parameter[:, :, column], slope, rtol=1e-3, atol=1e-6 * np.abs(slope).max())
    for column, step in ((0, 1e-3), (1, 1e-6)):
        ends = [model.predict(IMPOSED + sign * step * np.eye(2)[column], vector, found.theta_1) for sign in (1.0, -1.0)]
        slope = (ends[0].channels - ends[1].channels) / (2.0 * step)
        np.testing.assert_allclose(found.by_latent[:, :, column], slope, rtol=1e-3, atol=1e-6 * np.abs(slope).max())


def test_without_errors_it_is_the_wheel_itself():
    vector = soil_vector(VALUES)
    angle = np.full(len(IMPOSED), 0.6)
    model = ComputedChannels(TextbookWheel(WHEEL), 140.0)
    computed = model.predict(IMPOSED, np.append(vector, np.zeros(NUISANCES)), angle)
    np.testing.assert_array_equal(computed.channels, TextbookWheel(WHEEL).predict(IMPOSED, vector, angle).channels)


def of_a_robot(driven, path: Path, seed: int, noise: dict[str, float] | None = None, **also) -> Recording:
    """A robot's recording: torque, speeds and pitch with noise; what else is measured as (sd, values (n, 4))."""
    path.write_text(VEHICLE_TOML, encoding="utf-8")
    rng, n = np.random.default_rng(seed), len(driven.time_s)
    columns = {
        "time_s": np.repeat(driven.time_s, 4),
        "torque_Nm": (driven.torque_Nm + 0.25 * rng.standard_normal((n, 4))).ravel(),
        "wheel_speed_rad_s": (driven.rim_m_s[:, None] / RADIUS_M + 0.01 * rng.standard_normal((n, 4))).ravel(),
        "travel_speed_m_s": np.repeat(driven.speed_m_s + 0.003 * rng.standard_normal(n), 4),
        "pitch_rad": np.repeat(driven.pitch_rad + 0.003 * rng.standard_normal(n), 4),
    }
    columns |= {name: (values + sd * rng.standard_normal((n, 4))).ravel() for name, (sd, values) in also.items()}
    table = WheelTable(columns, np.tile(np.array(NAMES, dtype=object), n), None, Path("wheel.csv"))
    vehicle = load_vehicle(path).model_copy(update={"noise": noise or {}})
    return Recording("r", Path("wheel.csv"), vehicle, None, "", "0" * 64, wheel=table)


def solved(recording: Recording):
    rows = select_wheel_rows(recording)
    (stretch,) = [each for each in rows.stretches() if not each.reason]
    measured = usable(measured_rows(rows, stretch.rows))
    return measured, solve(measured, rows.wheel, SoilKnowledge())


@pytest.fixture(scope="module")
def driven():
    return drive(24.0)


@pytest.fixture(scope="module")
def sparse(driven):
    """The same, eight rows a second instead of fifty."""
    return replace(driven, **{field.name: getattr(driven, field.name)[::6] for field in fields(driven)})


@pytest.mark.slow
@pytest.mark.parametrize("sinkage", [False, True])
def test_an_exact_simulation_is_no_wrong_form(driven, sinkage, tmp_path):
    also = {"sinkage_m": (0.0008, driven.sinkage_m)} if sinkage else {}
    measured, solution = solved(of_a_robot(driven, tmp_path / "vehicle.toml", 1, **also))
    assert measured.computed is not None
    assert (measured.computed.pull > 0.0) is not sinkage
    assert not rejected(solution, WRONG_FORM)
    # As if the errors of load and pull were those of sensors, by themselves in each row: the alarm is false.
    noise = measured.noise.copy()
    noise[0] = measured.computed.load * measured.computed.mean_load_N
    if not sinkage:
        noise[4] = measured.computed.pull * measured.computed.mean_load_N
    independent = replace(measured, computed=None, noise=noise)
    assert rejected(solve(independent, WHEEL, SoilKnowledge()), WRONG_FORM)


def test_a_wrong_mass_is_found_where_the_soil_is_known(sparse, tmp_path):
    recording = of_a_robot(sparse, tmp_path / "vehicle.toml", 1, sinkage_m=(0.0008, sparse.sinkage_m))
    heavy = recording.vehicle.model_copy(update={"mass_kg": 1.08 * recording.vehicle.mass_kg})
    rows = select_wheel_rows(replace(recording, vehicle=heavy))
    (stretch,) = [each for each in rows.stretches() if not each.reason]
    known = SoilKnowledge({name: getattr(SAND, name) for name in ("c_Pa", "phi_rad", "k_m", "stiffness_Pa", "n")})
    solution = solve(usable(measured_rows(rows, stretch.rows)), rows.wheel, known)
    assert solution.fit.vector[5] == pytest.approx(0.08, abs=0.02)


def test_a_load_that_is_sensed_has_no_error_in_common(sparse, tmp_path):
    measured, _ = solved(
        of_a_robot(sparse, tmp_path / "v.toml", 1, load_N=(2.0, sparse.load_N), drawbar_pull_N=(2.0, sparse.pull_N))
    )
    assert measured.computed is None
