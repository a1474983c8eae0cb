"""The wheel of synthetic drives against adaptive quadrature of the paper's Eq. 1-9."""

from __future__ import annotations

from dataclasses import replace
from math import cos, exp, sin, tan

import numpy as np
import pytest
from bevameter.framework.scenario.mechanics import UNIT_WEIGHT_N_M3, Soil, bulldozing_resistance, equilibrium
from scipy.integrate import quad

SOIL = Soil(c_Pa=1000.0, phi_rad=0.5, k_m=0.015, stiffness_Pa=1.5e5, n=0.8)
RADIUS, WIDTH = 0.2, 0.15


def forces(theta_1: float, slip: float, soil: Soil) -> list[float]:
    """Load, torque and drawbar pull at an entry angle."""
    peak, ratio = theta_1 / 2.0, 1.0 - slip if slip >= 0.0 else 1.0 / (1.0 + slip)

    def stresses(theta: float) -> tuple[float, float]:
        ahead = theta if theta >= peak else theta_1 - theta
        sigma = soil.stiffness_Pa * (RADIUS / WIDTH * max(cos(ahead) - cos(theta_1), 0.0)) ** soil.n
        run = RADIUS * (theta_1 - theta - ratio * (sin(theta_1) - sin(theta)))
        built_up = np.sign(run) * (1.0 - exp(-abs(run) / soil.k_m))
        return sigma, (soil.c_Pa + sigma * tan(soil.phi_rad)) * built_up

    def over_contact(part) -> float:
        integral = sum(
            quad(lambda theta: part(theta, *stresses(theta)), low, high, epsrel=1e-10, limit=200)[0]
            for low, high in ((0.0, peak), (peak, theta_1))
        )
        return RADIUS * WIDTH * integral

    return [
        over_contact(lambda theta, sigma, tau: sigma * cos(theta) + tau * sin(theta)),
        over_contact(lambda theta, sigma, tau: RADIUS * tau),
        over_contact(lambda theta, sigma, tau: tau * cos(theta) - sigma * sin(theta)),
    ]


@pytest.mark.parametrize("n", [0.5, 0.8, 1.1, 1.5])
@pytest.mark.parametrize("slip", [-0.3, 0.02, 0.4])
def test_forces_are_those_of_adaptive_quadrature(n, slip):
    soil = replace(SOIL, n=n)
    found = equilibrium(RADIUS, WIDTH, soil, np.array([60.0, 200.0]), np.array([slip, slip]))
    for row, load in enumerate((60.0, 200.0)):
        theta_1 = float(np.arccos(1.0 - found.sinkage_m[row] / RADIUS))
        expected = forces(theta_1, slip, soil)
        assert expected[0] == pytest.approx(load, rel=5e-5)
        assert found.torque_Nm[row] == pytest.approx(expected[1], rel=5e-5)
        assert found.drawbar_pull_N[row] == pytest.approx(expected[2], rel=5e-5, abs=5e-5 * load)


def test_each_row_has_its_own_soil():
    load, slip = np.array([100.0, 100.0]), np.array([0.2, 0.2])
    varied = equilibrium(RADIUS, WIDTH, SOIL, load, slip, cohesion=np.array([1.0, 1.2]), stiffness=np.array([1.0, 0.8]))
    other = replace(SOIL, c_Pa=1.2 * SOIL.c_Pa, stiffness_Pa=0.8 * SOIL.stiffness_Pa)
    for row, soil in enumerate((SOIL, other)):
        alone = equilibrium(RADIUS, WIDTH, soil, load[row:], slip[row:])
        for name in ("torque_Nm", "drawbar_pull_N", "sinkage_m"):
            assert getattr(varied, name)[row] == pytest.approx(getattr(alone, name)[0], rel=1e-9)


def test_a_load_that_the_soil_does_not_carry_has_no_answer():
    found = equilibrium(RADIUS, WIDTH, SOIL, np.array([100.0, 1e7]), np.array([0.2, 0.2]))
    assert np.isfinite(found.torque_Nm[0])
    assert np.isnan([found.torque_Nm[1], found.drawbar_pull_N[1], found.sinkage_m[1]]).all()


def test_slip_sinkage_is_a_sinkage_exponent_that_grows_with_slip():
    load, slip = np.full(3, 100.0), np.array([-0.2, 0.0, 0.4])
    found = equilibrium(RADIUS, WIDTH, SOIL, load, slip, slip_sinkage=0.3)
    for row, away in enumerate(np.abs(slip)):
        alone = equilibrium(RADIUS, WIDTH, replace(SOIL, n=SOIL.n + 0.3 * away), load[row:], slip[row:])
        for name in ("torque_Nm", "drawbar_pull_N", "sinkage_m"):
            assert getattr(found, name)[row] == pytest.approx(getattr(alone, name)[0], rel=1e-9)


def test_bulldozing_resistance_is_passive_pressure_integrated_over_the_sinkage():
    soil = replace(SOIL, c_Pa=800.0, phi_rad=np.radians(30.0))

    def pressure(depth: float) -> float:
        return 3.0 * UNIT_WEIGHT_N_M3 * depth + 2.0 * 800.0 * np.sqrt(3.0)  # K_p = 3 at 30 deg

    for sinkage in (0.0, 0.02, 0.06):
        expected = WIDTH * quad(pressure, 0.0, sinkage)[0]
        assert bulldozing_resistance(WIDTH, soil, np.array([sinkage]))[0] == pytest.approx(expected, rel=1e-9)
