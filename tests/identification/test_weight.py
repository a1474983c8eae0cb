"""Loads on the wheels from the vehicle's weight, where they are not sensed."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from bevameter.framework.core.errors import InputError
from bevameter.framework.core.recording.types import Recording, WheelTable
from bevameter.framework.core.vehicle import Vehicle
from bevameter.identification.mechanics.soil import Soil
from bevameter.identification.rows.select import select_wheel_rows
from bevameter.identification.rows.weight import loads
from bevameter.identification.simulate import simulate

PLACES = {"front_left": (0.4, 0.3), "front_right": (0.4, -0.3), "rear_left": (-0.4, 0.3), "rear_right": (-0.4, -0.3)}
MASS_KG, HEIGHT_M, BASE_M, G = 60.0, 0.35, 0.8, 9.80665


def rover(**changes) -> Vehicle:
    wheels = [{"name": name, "radius_m": 0.15, "width_m": 0.12, "position_m": at} for name, at in PLACES.items()]
    return Vehicle.model_validate({"name": "rover", "wheels": wheels, **changes})


def rows(**columns) -> WheelTable:
    """One row of each wheel."""
    return WheelTable({name: np.array(values, dtype=float) for name, values in columns.items()}, np.array([*PLACES]),
                      None, Path("wheel.csv"))  # fmt: skip


def test_slope_moves_weight_to_the_rear_as_moments_about_the_axles_say():
    pitch = 0.2
    vehicle = rover(mass_kg=MASS_KG, centre_of_mass_m=(0.1, 0.0, HEIGHT_M))
    front_left, front_right, rear_left, rear_right = loads(rows(pitch_rad=4 * [pitch]), vehicle)
    weight = MASS_KG * G
    # Moments about where the rear axle touches the ground.
    front = weight * (np.cos(pitch) * (0.1 + BASE_M / 2) - np.sin(pitch) * HEIGHT_M) / BASE_M
    assert front_left + front_right == pytest.approx(front)
    assert front_left + front_right + rear_left + rear_right == pytest.approx(weight * np.cos(pitch))
    assert front_left == pytest.approx(front_right)
    aside = loads(rows(pitch_rad=np.zeros(4)), rover(mass_kg=MASS_KG, centre_of_mass_m=(0.0, 0.06, 0.0)))
    np.testing.assert_allclose(aside, weight / 4 * np.array([1.2, 0.8, 1.2, 0.8]))


def test_acceleration_moves_weight_as_a_slope_does():
    time_s, rate = np.arange(40) / 10.0, 1.5
    count = len(time_s)
    columns = {"time_s": np.tile(time_s, 4), "travel_speed_m_s": np.tile(rate * time_s, 4)}
    table = WheelTable(columns, np.repeat([*PLACES], count), None, Path("wheel.csv"))
    answer = loads(table, rover(mass_kg=MASS_KG, centre_of_mass_m=(0.0, 0.0, HEIGHT_M))).reshape(4, count)
    moved = MASS_KG * rate * HEIGHT_M / BASE_M
    np.testing.assert_allclose(answer[0] + answer[1], MASS_KG * G / 2 - moved, rtol=1e-6)
    np.testing.assert_allclose(answer[2] + answer[3], MASS_KG * G / 2 + moved, rtol=1e-6)


def test_a_wheel_that_would_lift_off_has_no_load():
    answer = loads(rows(pitch_rad=4 * [1.2]), rover(mass_kg=MASS_KG, centre_of_mass_m=(0.3, 0.0, 1.0)))
    assert np.isnan(answer[:2]).all()
    assert (answer[2:] > 0.0).all()


def test_selected_rows_have_the_computed_load_its_noise_and_a_note():
    count, rng = 60, np.random.default_rng(3)
    columns = {
        "time_s": np.arange(count) / 10.0, "slip": 0.2 + 0.1 * np.sin(np.arange(count) / 9.0),
        "torque_Nm": 9.0 + rng.normal(0.0, 0.3, count), "travel_speed_m_s": np.full(count, 0.2),
    }  # fmt: skip
    table = WheelTable(columns, None, None, Path("wheel.csv"))
    wheel = {"radius_m": 0.15, "width_m": 0.12}
    vehicle = Vehicle.model_validate({"wheel": {**wheel, "load_N": 147.0}})
    unseen = WheelTable({**columns, "load_N": np.full(count, np.nan)}, None, None, Path("wheel.csv"))
    for each in (table, unseen):
        selected = select_wheel_rows(Recording("d", Path("d"), vehicle, None, "", "0" * 64, each))
        np.testing.assert_allclose(selected.table["load_N"], 147.0)
        assert selected.vehicle.noise["load_N"] == pytest.approx(0.05 * 147.0)
        assert "load_computed" in [finding.code for finding in selected.findings]
    sensed = WheelTable({**columns, "load_N": 150.0 + rng.normal(0.0, 1.0, count)}, None, None, Path("wheel.csv"))
    selected = select_wheel_rows(Recording("d", Path("d"), vehicle, None, "", "0" * 64, sensed))
    np.testing.assert_array_equal(selected.table["load_N"], sensed["load_N"])
    assert "load_N" not in selected.vehicle.noise
    bare = Vehicle.model_validate({"wheel": wheel})
    with pytest.raises(InputError, match="mass_kg"):
        select_wheel_rows(Recording("d", Path("d"), bare, None, "", "0" * 64, table))


@pytest.mark.parametrize(
    ("stated", "said"),
    [
        ({"centre_of_mass_m": (0.0, 0.0, 0.3)}, "without mass_kg"),
        ({"mass_kg": 0.0}, "mass_kg"),
        ({"mass_kg": 60.0, "centre_of_mass_m": (0.0, 0.0, -0.3)}, "centre_of_mass_m"),
        ({"mass_kg": 60.0, "centre_of_mass_m": (5.0, 0.0, 35.0)}, "off level ground"),
    ],
)
def test_a_weight_that_is_none_is_refused(stated, said):
    with pytest.raises(ValueError, match=said):
        rover(**stated)


def test_mass_and_loads_of_wheels_are_not_both_taken():
    wheels = [{"radius_m": 0.15, "width_m": 0.12, "load_N": 100.0}]
    with pytest.raises(ValueError, match="both mass_kg"):
        Vehicle.model_validate({"wheels": wheels, "mass_kg": 60.0})
    with pytest.raises(ValueError, match="with one wheel"):
        Vehicle.model_validate({"wheel": {"radius_m": 0.15, "width_m": 0.12}, "mass_kg": 60.0})


def test_a_drive_without_loads_is_simulated_by_the_vehicle_s_weight():
    table = WheelTable({"slip": np.array([0.1, 0.3])}, None, None, Path("drive.csv"))
    wheel, soil = {"radius_m": 0.15, "width_m": 0.12}, Soil(500.0, 0.5, 0.012, 2e5, 0.9)
    computed = simulate(Vehicle.model_validate({"wheel": {**wheel, "load_N": 10.0 * G}}), soil, table)
    loaded = WheelTable({**table.columns, "load_N": np.full(2, 10.0 * G)}, None, None, Path("drive.csv"))
    sensed = simulate(Vehicle.model_validate({"wheel": wheel}), soil, loaded)
    np.testing.assert_array_equal(computed["torque_Nm"], sensed["torque_Nm"])
