"""Speeds of wheels in bends, by where each is and how fast it gets on."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from bevameter.framework.core.recording.types import Pose, WheelTable
from bevameter.framework.core.vehicle import Vehicle
from bevameter.identification.rows.bends import with_bends

PLACES = {"left": (0.0, 0.3), "right": (0.0, -0.3), "front": (0.4, 0.0)}
RADIUS_M, SPEED_M_S, BEND_M, SLIP = 0.1, 0.2, 2.5, 0.25


def vehicle() -> Vehicle:
    wheels = [{"name": n, "radius_m": RADIUS_M, "width_m": 0.05, "position_m": at} for n, at in PLACES.items()]
    return Vehicle.model_validate({"wheels": wheels})


def bend(noise_rad: float = 0.0, **more) -> tuple[WheelTable, Pose]:
    """Half a turn to the left: each wheel is where its place in the turned vehicle is, and slips by a quarter."""
    time_s = np.arange(0.0, 30.0, 0.05)
    yaw = SPEED_M_S / BEND_M * time_s
    x_m, y_m = BEND_M * np.sin(yaw), BEND_M * (1.0 - np.cos(yaw))
    rims = []
    for ahead, aside in PLACES.values():
        place = (x_m + 1j * y_m) + (ahead + 1j * aside) * np.exp(1j * yaw)
        # what of the wheel's way over ground lies in its plane
        rims.append(np.real(np.gradient(place, time_s) * np.exp(-1j * yaw)) / (1.0 - SLIP) / RADIUS_M)
    columns = {
        "time_s": np.tile(time_s, 3), "wheel_speed_rad_s": np.concatenate(rims),
        "travel_speed_m_s": np.full(3 * len(time_s), SPEED_M_S),
    }  # fmt: skip
    columns["slip"] = 1.0 - SPEED_M_S / (RADIUS_M * columns["wheel_speed_rad_s"])
    wheel = np.repeat(np.array([*PLACES], dtype=object), len(time_s))
    measured = yaw + noise_rad * np.random.default_rng(1).standard_normal(len(yaw))
    return WheelTable({**columns, **more}, wheel, None, Path("w.csv")), Pose(time_s, x_m, y_m, measured)


def test_each_wheel_has_the_slip_of_its_own_way():
    table, pose = bend()
    answer, found = with_bends(table, vehicle(), pose)
    inner = np.tile(np.arange(600), 3) % 600
    kept = (inner > 20) & (inner < 580)
    np.testing.assert_allclose(answer["slip"][kept], SLIP, atol=1e-3)
    assert np.abs(table["slip"] - SLIP).max() > 0.08
    assert found.values["most_m_s"] == pytest.approx(0.3 * SPEED_M_S / BEND_M, rel=0.01)
    angle = {name: np.median(answer["slip_angle_rad"][answer.wheel == name]) for name in PLACES}
    assert angle["front"] == pytest.approx(np.arctan(0.4 / BEND_M), rel=0.01)
    assert angle["left"] == pytest.approx(0.0, abs=1e-6)


def test_what_was_recorded_of_slip_and_angle_stays():
    table, pose = bend(slip=np.full(1800, 0.4), slip_angle_rad=np.zeros(1800))
    answer, _ = with_bends(table, vehicle(), pose)
    np.testing.assert_array_equal(answer["slip"], 0.4)
    np.testing.assert_array_equal(answer["slip_angle_rad"], 0.0)


def test_a_heading_that_is_hardly_known_turns_nothing():
    table, pose = bend(noise_rad=0.5)
    answer, found = with_bends(table, vehicle(), pose)
    assert answer is table
    assert found is None
