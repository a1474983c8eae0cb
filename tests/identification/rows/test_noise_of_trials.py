"""Noise of a table of steady trials: slips at several loads, none of them repeated."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from bevameter.framework.core.recording.types import Recording, WheelTable
from bevameter.framework.core.vehicle import Vehicle
from bevameter.framework.scenario.mechanics import Soil, equilibrium
from bevameter.identification.estimate.identify import identify
from bevameter.identification.rows.noise import measured_noise

SOIL = Soil(c_Pa=800.0, phi_rad=np.radians(31.0), k_m=0.018, stiffness_Pa=180e3, n=1.0)
ANSWERS = ("torque_Nm", "drawbar_pull_N", "sinkage_m")


def trials(seed: int, slips=(0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6), loads=(60.0, 100.0, 150.0)):
    """A table, and the noise of its answers: 2 % of the mean."""
    rng = np.random.default_rng(seed)
    slip, load = (each.ravel() for each in np.meshgrid(slips, loads))
    wheel = equilibrium(0.13, 0.08, SOIL, load, slip)
    noise = {name: 0.02 * float(np.mean(np.abs(getattr(wheel, name)))) for name in ANSWERS}
    columns = {name: getattr(wheel, name) + sd * rng.standard_normal(len(slip)) for name, sd in noise.items()}
    columns |= {"slip": slip + 0.003 * rng.standard_normal(len(slip)), "load_N": load + rng.normal(0.0, 0.5, len(slip))}
    names = np.array([f"trial {each}" for each in range(len(slip))], dtype=object)
    return WheelTable(columns, None, names, Path("w.csv")), noise


def test_the_scatter_about_a_surface_is_the_noise():
    found = {name: [] for name in ANSWERS}
    for seed in range(20):
        table, noise = trials(seed)
        for name in ANSWERS:
            found[name].append(measured_noise(table, name) / noise[name])
    for name, ratio in found.items():
        # a little of the signal, and what load and slip bring in, count for noise
        assert 0.8 < np.median(ratio) < 2.0, name
        assert min(ratio) > 0.5, name


def test_few_trials_have_the_difference_of_the_nearest():
    table, _ = trials(0, slips=(0.1, 0.15, 0.2, 0.25), loads=(100.0,))
    torque = table["torque_Nm"]
    assert measured_noise(table, "torque_Nm") == pytest.approx(
        1.4826 * np.median([abs(torque[1] - torque[0])] * 2 + [abs(torque[2] - torque[3])] * 2) / np.sqrt(2.0), rel=0.5
    )


def test_a_factorial_table_determines_the_soil():
    vehicle = Vehicle.model_validate({"wheel": {"radius_m": 0.13, "width_m": 0.08}})
    found = identify(Recording("r", Path("w.csv"), vehicle, None, "", "0" * 64, wheel=trials(1)[0])).overall.parameters
    for name in ("c_Pa", "phi_rad", "k_m"):
        assert found[name].low <= getattr(SOIL, name) <= found[name].high, name
    assert found["c_Pa"].high - found["c_Pa"].low < 2000.0
    assert np.degrees(found["phi_rad"].high - found["phi_rad"].low) < 4.0


def test_repeated_trials_have_the_noise_where_no_polynomial_is_right():
    rng = np.random.default_rng(3)
    slip = np.repeat(np.linspace(-1.0, 0.9, 9), 3)
    torque = 10.0 * np.tanh(8.0 * slip) + rng.normal(0.0, 0.2, len(slip))
    columns = {"slip": slip, "load_N": np.full(len(slip), 25.0), "torque_Nm": torque}
    table = WheelTable(columns, None, np.arange(len(slip)).astype(str).astype(object), Path("w.csv"))
    assert measured_noise(table, "torque_Nm") == pytest.approx(0.2, rel=0.5)
