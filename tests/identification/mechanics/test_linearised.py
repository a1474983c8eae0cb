"""The paper's closed form against forces integrated from the triangular stresses that it assumes."""

from __future__ import annotations

import numpy as np
import pytest
from bevameter.framework.core.vehicle import Wheel
from bevameter.identification.mechanics import linearised
from bevameter.identification.mechanics.soil import Soil
from bevameter.identification.mechanics.textbook import entry_angle, equilibrium
from scipy.integrate import trapezoid

WHEEL = Wheel(radius_m=0.5, width_m=0.3)
SOIL = Soil(c_Pa=1e3, phi_rad=np.radians(30.0), k_m=0.005, stiffness_Pa=20e3 + 600e3 * 0.3, n=0.9)


def triangular_wheel(sigma_m, sinkage, slip):
    """W, T, DP from the linear stresses of Eq. 10-13, integrated numerically; tau_m from Eq. 19."""
    r, b = WHEEL.radius_m, WHEEL.width_m
    theta_1 = float(entry_angle(sinkage, r))
    theta_m = theta_1 / 2.0
    bracket = theta_1 - theta_m - (1.0 - slip) * (np.sin(theta_1) - np.sin(theta_m))
    tau_m = (SOIL.c_Pa + sigma_m * np.tan(SOIL.phi_rad)) * (1.0 - np.exp(-r / SOIL.k_m * bracket))
    theta = np.concatenate([np.linspace(0.0, theta_m, 20001), np.linspace(theta_m, theta_1, 20001)[1:]])
    shape = np.where(theta < theta_m, theta / theta_m, (theta_1 - theta) / (theta_1 - theta_m))
    sigma, tau = sigma_m * shape, tau_m * shape
    return (
        r * b * trapezoid(sigma * np.cos(theta) + tau * np.sin(theta), theta),
        r * r * b * trapezoid(tau, theta),
        r * b * trapezoid(tau * np.cos(theta) - sigma * np.sin(theta), theta),
    )


def test_linear_stresses_give_back_cohesion_friction_and_drawbar_pull_exactly():
    slip = np.array([0.1, 0.2, 0.3, 0.4])
    sinkage = np.array([0.03, 0.035, 0.045, 0.05])
    sigma_m = np.array([15e3, 20e3, 30e3, 38e3])
    load, torque, pull = np.array([triangular_wheel(*row) for row in zip(sigma_m, sinkage, slip, strict=True)]).T
    estimate = linearised.estimate(load, torque, sinkage, slip, SOIL.k_m, WHEEL)
    assert estimate.c_Pa == pytest.approx(SOIL.c_Pa, rel=1e-4)
    assert estimate.phi_rad == pytest.approx(SOIL.phi_rad, rel=1e-5)
    np.testing.assert_allclose(linearised.drawbar_pull(load, torque, sinkage, WHEEL), pull, rtol=1e-6)
    np.testing.assert_allclose(linearised.peak_stresses(load, torque, sinkage, WHEEL)[0], sigma_m, rtol=1e-6)


def test_the_on_line_form_is_the_batch_form_and_forgets():
    time_s = np.arange(300) / 10.0
    load = 800.0 + 300.0 * np.sin(0.6 * time_s)
    slip = 0.3 + 0.25 * np.sin(0.9 * time_s)
    state = equilibrium(WHEEL, SOIL, load, slip)
    batch = linearised.estimate(load, state.torque_Nm, state.sinkage_m, slip, SOIL.k_m, WHEEL)
    online = linearised.OnlineEstimator(WHEEL, SOIL.k_m)
    for row in zip(load, state.torque_Nm, state.sinkage_m, slip, strict=True):
        answer = online.update(*row)
    assert answer == pytest.approx((batch.c_Pa, batch.tan_phi), rel=1e-5)
    assert online.n == batch.n == 300

    weak = Soil(c_Pa=200.0, phi_rad=np.radians(22.0), k_m=SOIL.k_m, stiffness_Pa=SOIL.stiffness_Pa, n=SOIL.n)
    later = equilibrium(WHEEL, weak, load, slip)
    forgetful = linearised.OnlineEstimator(WHEEL, SOIL.k_m, memory=30.0)
    for source in (state, later):
        for row in zip(load, source.torque_Nm, source.sinkage_m, slip, strict=True):
            answer = forgetful.update(*row)
    only_later = linearised.estimate(load, later.torque_Nm, later.sinkage_m, slip, SOIL.k_m, WHEEL)
    assert answer[1] == pytest.approx(only_later.tan_phi, abs=0.02)

    window = linearised.OnlineEstimator(WHEEL, SOIL.k_m, window=300)
    for source in (state, later):
        for row in zip(load, source.torque_Nm, source.sinkage_m, slip, strict=True):
            answer = window.update(*row)
    assert window.n == 300
    assert answer == pytest.approx((only_later.c_Pa, only_later.tan_phi), rel=1e-4)


def test_no_rows_give_no_estimate():
    online = linearised.OnlineEstimator(WHEEL, 0.01)
    assert np.isnan(online.update(np.nan, 1.0, 0.01, 0.2)).all()
    assert online.n == 0
    empty = np.empty(0)
    assert np.isnan(linearised.estimate(empty, empty, empty, empty, 0.01, WHEEL).c_Pa)
