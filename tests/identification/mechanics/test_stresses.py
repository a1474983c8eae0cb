"""The quadrature along the rim: forces against adaptive quadrature, slopes against differences."""

from __future__ import annotations

import math

import numpy as np
import pytest
from bevameter.identification.mechanics import kinks, stresses
from bevameter.identification.mechanics.fields import COLUMN, SLOPED
from bevameter.identification.mechanics.stresses import FINE, QUICK, quadrature, rim_forces
from rim_by_quad import LAWS, SOIL, WHEEL, by_quad, contacts, scaled

JANOSI = 1.0 / (1.0 - math.exp(-1.0))
"""K_r from which on the humped law has no hump."""


def forces_of(contact: np.ndarray, rule: stresses.Rule = FINE) -> np.ndarray:
    return rim_forces(contact, WHEEL.width_m, rule)


@pytest.mark.filterwarnings("ignore::scipy.integrate.IntegrationWarning")
@pytest.mark.parametrize("law", LAWS)
def test_forces_agree_with_adaptive_quadrature_whatever_effects_change(law, rng):
    """To eight digits, driven and braked: the rim is cut at the kinks of the stresses.

    One law has them to seven only: 1 / cosh has poles near to what displacements there are.
    """
    rows = 12
    contact = contacts(
        rng.uniform(0.3, 1.0, rows), rng.uniform(-0.4, 0.9, rows), shear_radius_m=0.16, lever_m=0.155, lift_N=3.0,
        **LAWS[law],
    )  # fmt: skip
    contact[:, COLUMN["theta_m"]] *= rng.uniform(0.7, 1.3, rows)
    contact[:, COLUMN["theta_2"]] = -rng.uniform(0.0, 0.3, rows) * contact[:, COLUMN["theta_1"]]
    expected = np.array([by_quad(row) for row in contact])
    fine, quick = (np.abs(scaled(forces_of(contact, rule) - expected, expected)).max() for rule in (FINE, QUICK))
    assert fine < (1e-7 if law == "sech" else 1e-8)
    assert quick < 1e-5


@pytest.mark.parametrize("law", ["layer", "flat", "slips on the rim", "cut off at the rim"])
def test_kinks_of_the_stresses_cost_no_digits(law, rng):
    """Without a cut at the kink eight nodes err by up to 9 % for a layer and by 2 % for a flexible tyre."""
    theta_1, slip = rng.uniform(0.2, 1.0, 200), rng.uniform(0.0, 0.8, 200)
    smooth, contact = forces_of(contacts(theta_1, slip)), contacts(theta_1, slip, **LAWS[law])
    many = forces_of(contact, quadrature(200, 2))
    assert np.abs(many / smooth - 1.0).max() > 0.02
    np.testing.assert_allclose(scaled(forces_of(contact, QUICK), many), scaled(many, many), atol=3e-6)


def test_a_wheel_that_is_all_but_locked_costs_no_digits(rng):
    """Its shear stress is mobilised within a millionth of the contact; the forces were wrong by 1e-5, and their
    derivative by slip by a factor of five.
    """
    contact = contacts(rng.uniform(0.3, 1.0, 300), -(1.0 - 10.0 ** rng.uniform(-5.0, -0.3, 300)))
    many = forces_of(contact, quadrature(300, 3))
    np.testing.assert_allclose(scaled(forces_of(contact), many), scaled(many, many), atol=1e-8)
    np.testing.assert_allclose(scaled(forces_of(contact, QUICK), many), scaled(many, many), atol=1e-5)


def test_the_shear_displacement_of_a_braked_wheel_changes_its_sign_where_the_rim_is_cut(rng):
    for theta_1, ratio in zip(rng.uniform(0.1, 1.8, 200), rng.uniform(0.01, 0.999, 200), strict=True):
        theta = kinks.turning_point(theta_1, ratio)
        if math.isfinite(theta):
            assert theta < theta_1 - 1e-9
            assert ratio * (theta_1 - theta) - math.sin(theta_1) + math.sin(theta) == pytest.approx(0.0, abs=1e-10)
        else:
            inside = np.linspace(-math.acos(ratio), theta_1, 500)[:-1]
            away = ratio * (theta_1 - inside) - math.sin(theta_1) + np.sin(inside)
            assert (away < 0.0).all() or (away > 0.0).all()


def test_a_contact_behind_the_bottom_of_the_wheel_carries_more():
    theta_1, slip = np.array([0.6]), np.array([0.2])
    behind = contacts(theta_1, slip, theta_2=-0.24)
    assert forces_of(behind)[0, 0] > forces_of(contacts(theta_1, slip))[0, 0]


def test_a_hump_that_is_none_is_janosis_law_with_a_weaker_soil(rng):
    theta_1, slip = rng.uniform(0.2, 1.0, 30), rng.uniform(-0.4, 0.8, 30)
    weaker = {"c_Pa": SOIL.c_Pa / JANOSI, "tan_phi": math.tan(SOIL.phi_rad) / JANOSI}
    hump = forces_of(contacts(theta_1, slip, residual=JANOSI, **weaker))
    np.testing.assert_allclose(hump, forces_of(contacts(theta_1, slip)), rtol=1e-12)


@pytest.mark.parametrize("hump", [0.1, 0.8, 4.0])
def test_the_law_of_kacigin_and_guskov_stands_at_its_peak_and_falls_to_what_is_left(hump):
    at = np.linspace(0.01, 30.0, 30_001)
    printed = (1.0 + hump / np.cosh(at)) * np.tanh(at)
    top, by_hump = kinks.top_of(hump, math.inf)
    assert top == pytest.approx(printed.max(), rel=1e-6)
    assert by_hump == pytest.approx(
        (kinks.top_of(hump + 1e-5, math.inf)[0] - kinks.top_of(hump - 1e-5, math.inf)[0]) / 2e-5, rel=1e-6
    )
    far = kinks.with_peak(1e3, 0.02, math.inf, hump, math.inf, top, by_hump)
    assert far[:2] == pytest.approx((1.0 / printed.max(), 0.0), rel=1e-6)


@pytest.mark.parametrize("law", LAWS)
def test_slopes_are_those_of_the_forces(law, rng):
    """By each of the twenty-one fields, against central differences of a fine quadrature."""
    rows, rule = 80, quadrature(40, 3)
    contact = contacts(
        rng.uniform(0.2, 1.1, rows), rng.uniform(-0.5, 0.9, rows), theta_2=-rng.uniform(0.0, 0.3, rows),
        n=rng.uniform(0.4, 1.4, rows), shear_radius_m=0.16, lever_m=0.155, lift_N=3.0, **LAWS[law],
    )  # fmt: skip
    contact[:, COLUMN["theta_m"]] = contact[:, COLUMN["theta_1"]] * rng.uniform(0.2, 0.8, rows)
    forces, slopes = stresses.rim_forces_and_slopes(contact, WHEEL.width_m, rule)
    np.testing.assert_array_equal(forces, forces_of(contact, rule))
    for field in np.flatnonzero(np.isfinite(contact[0, :SLOPED])):
        step = 1e-6 * max(np.abs(contact[:, field]).max(), 1e-3)
        low, high = contact.copy(order="K"), contact.copy(order="K")
        low[:, field] -= step
        high[:, field] += step
        expected = (forces_of(high, rule) - forces_of(low, rule)) / (2.0 * step)
        scale = np.abs(expected).max(axis=0) + 1e-12
        np.testing.assert_allclose(slopes[:, :, field] / scale, expected / scale, atol=2e-4, err_msg=str(field))
    assert np.isfinite(slopes).all()


def test_forces_are_carried_to_a_contact_near_by_their_slopes_and_rows_that_have_none_are_marked(rng):
    here = contacts(rng.uniform(0.3, 0.9, 40), rng.uniform(0.0, 0.6, 40), residual=0.6, layer_depth_m=0.004)
    here[:, COLUMN["layer_stiffness_Pa"]] = 3e5
    forces, slopes = stresses.rim_forces_and_slopes(here, WHEEL.width_m)
    there = here.copy(order="K")
    for name, share in (("theta_1", 1e-5), ("stiffness_Pa", 2e-5), ("n", -1e-5), ("tan_phi", 1e-5), ("k_m", 3e-5),
                        ("residual", 2e-5), ("layer_depth_m", -1e-5)):  # fmt: skip
        there[:, COLUMN[name]] *= 1.0 + share
    there[:, COLUMN["lift_N"]] += 0.01
    there[7, COLUMN["most_normal_Pa"]] = 2e4
    there[9, COLUMN["rim_cuts_off"]] = 1.0
    near, beyond = np.empty_like(forces), np.empty(40, dtype=bool)
    stresses.forces_near(there, here, forces, slopes, near, beyond)
    assert np.flatnonzero(beyond).tolist() == [7, 9]
    moved = forces_of(there) - forces
    np.testing.assert_allclose((near - forces)[~beyond], moved[~beyond], rtol=1e-3, atol=1e-6)
