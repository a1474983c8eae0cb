"""The forward mechanics against an independent integration of the same equations."""

from __future__ import annotations

import numpy as np
import pytest
from bevameter.framework.core.errors import InputError
from bevameter.framework.core.soil import SoilKnowledge
from bevameter.framework.core.vehicle import Wheel
from bevameter.identification.mechanics import stresses
from bevameter.identification.mechanics import textbook as ws
from bevameter.identification.mechanics.soil import Soil
from scipy.integrate import quad
from scipy.optimize import brentq

WHEEL = Wheel(radius_m=0.25, width_m=0.2)


def random_soil(rng: np.random.Generator) -> Soil:
    """Draw a soil from the parameter space of the paper's Sec. 3.1."""
    return Soil(
        c_Pa=rng.uniform(0.0, 3e3),
        phi_rad=np.radians(rng.uniform(20.0, 40.0)),
        k_m=rng.uniform(0.005, 0.04),
        stiffness_Pa=rng.uniform(0.0, 140e3) + rng.uniform(520e3, 680e3) * WHEEL.width_m,
        n=rng.uniform(0.6, 1.2),
    )


def reference_forces(theta_1: float, slip: float, soil: Soil) -> np.ndarray:
    """W, T, DP by adaptive quadrature of Eq. 2-5, 8, 9 as they stand in the paper."""
    r, b, theta_m = WHEEL.radius_m, WHEEL.width_m, theta_1 / 2.0

    def sigma(theta: float) -> float:
        ahead = theta if theta > theta_m else theta_1 - theta / theta_m * (theta_1 - theta_m)
        return soil.stiffness_Pa * (r / b) ** soil.n * max(np.cos(ahead) - np.cos(theta_1), 0.0) ** soil.n

    def tau(theta: float) -> float:
        bracket = theta_1 - theta - (1.0 - slip) * (np.sin(theta_1) - np.sin(theta))
        return (soil.c_Pa + sigma(theta) * np.tan(soil.phi_rad)) * (1.0 - np.exp(-r / soil.k_m * bracket))

    def integral(function) -> float:
        return sum(
            quad(function, low, high, epsabs=0.0, epsrel=1e-11, limit=200)[0]
            for low, high in ((0.0, theta_m), (theta_m, theta_1))
        )

    return np.array(
        [
            r * b * integral(lambda t: sigma(t) * np.cos(t) + tau(t) * np.sin(t)),
            r * r * b * integral(tau),
            r * b * integral(lambda t: tau(t) * np.cos(t) - sigma(t) * np.sin(t)),
        ]
    )


def forces_of(theta_1: float, slip: float, soil: Soil) -> np.ndarray:
    """W, T, DP (3,) as the product has them."""
    return stresses.rim_forces(ws.contact_array(theta_1, np.array([slip]), soil, WHEEL), WHEEL.width_m)[0]


def test_forces_and_equilibrium_agree_with_adaptive_quadrature_and_root_finding(rng):
    for _ in range(25):
        soil, theta_1, slip = random_soil(rng), np.radians(rng.uniform(20.0, 60.0)), rng.uniform(0.0, 1.0)
        expected = reference_forces(theta_1, slip, soil)
        forces = forces_of(theta_1, slip, soil)
        scale = np.array([expected[0], expected[0] * WHEEL.radius_m, expected[0]])
        np.testing.assert_allclose(forces / scale, expected / scale, atol=1e-9)

        load = 0.7 * expected[0]
        root = brentq(lambda t, i=slip, s=soil, w=load: reference_forces(t, i, s)[0] - w, 1e-3, theta_1, xtol=1e-12)
        state = ws.equilibrium(WHEEL, soil, np.array([load]), np.array([slip]))
        assert state.theta_1_rad[0] == pytest.approx(root, rel=1e-8)
        assert state.sinkage_m[0] == pytest.approx(WHEEL.radius_m * (1.0 - np.cos(root)), rel=1e-8)
        assert state.torque_Nm[0] == pytest.approx(reference_forces(root, slip, soil)[1], rel=1e-7)


def test_stresses_along_the_rim_are_those_that_the_forces_integrate(rng):
    soil, theta_1, slip = random_soil(rng), 0.7, 0.3
    theta = np.linspace(0.0, theta_1, 200_001)
    sigma = ws.normal_stress(theta, theta_1, soil, WHEEL)
    tau = ws.shear_stress(theta, theta_1, slip, soil, WHEEL)
    area = WHEEL.radius_m * WHEEL.width_m
    forces = forces_of(theta_1, slip, soil)
    assert area * np.trapezoid(sigma * np.cos(theta) + tau * np.sin(theta), theta) == pytest.approx(forces[0], rel=1e-7)
    assert area * WHEEL.radius_m * np.trapezoid(tau, theta) == pytest.approx(forces[1], rel=1e-7)
    assert (ws.normal_stress(np.array([-0.1, 0.8]), theta_1, soil, WHEEL) == 0.0).all()


def test_braking_reverses_the_shear_stress_and_passes_smoothly_through_free_rolling(rng):
    soil = random_soil(rng)
    slip = np.array([-0.9, -0.3, -1e-6, 1e-6, 0.3])
    state = ws.equilibrium(WHEEL, soil, np.full(5, 800.0), slip)
    assert (np.diff(state.torque_Nm) > 0.0).all()
    assert (np.diff(state.drawbar_pull_N) > 0.0).all()
    assert state.torque_Nm[0] < 0.0 < state.torque_Nm[-1]
    assert state.torque_Nm[2] == pytest.approx(state.torque_Nm[3], rel=1e-3)


def test_a_load_that_is_not_carried_is_not_a_number(rng):
    state = ws.equilibrium(
        WHEEL, random_soil(rng), np.array([1e9, -5.0, np.nan, 500.0]), np.array([0.2, 0.2, 0.2, np.nan])
    )
    for values in (state.sinkage_m, state.torque_Nm, state.drawbar_pull_N):
        assert np.isnan(values).all()


def test_a_soil_that_is_no_soil_is_refused():
    with pytest.raises(InputError, match="k_m"):
        Soil(c_Pa=0.0, phi_rad=0.5, k_m=0.0, stiffness_Pa=1e5, n=1.0)
    with pytest.raises(InputError, match="n missing"):
        Soil.from_knowledge(SoilKnowledge({"c_Pa": 0.0, "phi_rad": 0.5, "k_m": 0.01, "stiffness_Pa": 1e5}))
