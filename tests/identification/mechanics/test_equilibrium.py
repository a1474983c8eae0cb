"""The entry angle that carries the load, against adaptive quadrature and root finding."""

from __future__ import annotations

import numpy as np
import pytest
from bevameter.identification.mechanics.equilibrium import CORRECTABLE, LARGEST_ENTRY_ANGLE, carry
from bevameter.identification.mechanics.fields import COLUMN, STIFFNESS, THETA_1
from bevameter.identification.mechanics.stresses import QUICK, rim_forces
from rim_by_quad import LAWS, WHEEL, by_quad, contacts, scaled
from scipy.optimize import brentq

WIDTH = WHEEL.width_m


def started(rows: int, slip: np.ndarray, law: str = "textbook") -> np.ndarray:
    """Contacts where a search starts, whose angles stay in proportion."""
    return contacts(np.full(rows, 0.5), slip, theta_m=0.27, theta_2=-0.1, **LAWS[law])


@pytest.mark.filterwarnings("ignore::scipy.integrate.IntegrationWarning")
@pytest.mark.parametrize("law", LAWS)
def test_the_load_is_carried_by_adaptive_quadrature_too(law, rng):
    """Driven and braked; the load grows with a power of the angle of more than 1, so that the angle has more digits."""
    load = rng.uniform(30.0, 250.0, 10)
    found = carry(started(10, rng.uniform(-0.4, 0.9, 10), law), load, WIDTH)
    expected = np.array([by_quad(row) for row in found.contact])
    np.testing.assert_allclose(expected[:, 0], load, rtol=1e-7 if law == "sech" else 1e-8)
    np.testing.assert_allclose(
        scaled(found.forces, expected), scaled(expected, expected), atol=1e-7 if law == "sech" else 1e-8
    )


@pytest.mark.filterwarnings("ignore::scipy.integrate.IntegrationWarning")
def test_the_entry_angle_is_that_of_root_finding(rng):
    slip, load = rng.uniform(-0.4, 0.9, 4), rng.uniform(30.0, 250.0, 4)
    start = started(4, slip)
    for row, target, theta_1 in zip(start, load, carry(start, load, WIDTH).contact[:, THETA_1], strict=True):

        def missing(angle: float, row: np.ndarray = row, target: float = float(target)) -> float:
            moved = row.copy()
            moved[:3] *= angle / row[0]
            return float(by_quad(moved)[0]) - target

        assert theta_1 == pytest.approx(brentq(missing, 0.5 * theta_1, 1.5 * theta_1, xtol=1e-12), rel=1e-8)


def test_contacts_whose_fields_follow_no_power_of_the_angle_are_laid_out_until_they_carry(rng):
    slip, load = rng.uniform(-0.4, 0.9, 200), rng.uniform(30.0, 250.0, 200)

    def lay_out(theta_1: np.ndarray) -> np.ndarray:
        contact = contacts(theta_1, slip)
        contact[:, STIFFNESS] *= 1.0 + np.sin(6.0 * theta_1) ** 2
        contact[:, COLUMN["radius_m"]] *= np.sqrt(1.0 + 0.02 / theta_1)
        contact[:, COLUMN["lift_N"]] = 20.0 * np.maximum(theta_1 - 0.2, 0.0)
        return contact

    for sloped in (False, True):
        found = carry(lay_out(np.full(200, 0.4)), load, WIDTH, lay_out=lay_out, sloped=sloped)
        np.testing.assert_array_equal(found.contact, lay_out(found.contact[:, THETA_1]))
        carried = rim_forces(found.contact, WIDTH)[:, 0]
        np.testing.assert_allclose(carried, load, rtol=2.0 * CORRECTABLE if sloped else 1e-8)


def test_what_is_left_of_the_load_where_slopes_are_wanted_is_small_enough_to_be_corrected(rng):
    slip, load = rng.uniform(-0.4, 0.9, 300), rng.uniform(30.0, 250.0, 300)
    exact, found = (carry(started(300, slip), load, WIDTH, sloped=sloped) for sloped in (False, True))
    by_angle = np.einsum("nkf,nf->nk", found.slopes[:, :, :3], found.contact[:, :3] / found.contact[:, :1])
    turn = (load - found.forces[:, 0]) / by_angle[:, 0]
    forces = found.forces + by_angle * turn[:, None]
    np.testing.assert_allclose(scaled(forces, exact.forces), scaled(exact.forces, exact.forces), atol=3e-6)
    np.testing.assert_array_equal(found.forces, rim_forces(found.contact, WIDTH, QUICK))


def test_a_search_from_a_near_start_moves_only_rows_out_of_tolerance(rng):
    slip, load = rng.uniform(-0.4, 0.9, 50), rng.uniform(30.0, 250.0, 50)
    first = carry(started(50, slip), load, WIDTH, sloped=True)
    again = carry(first.contact, load, WIDTH, growth=first.growth, near=True, sloped=True)
    np.testing.assert_array_equal(again.contact, first.contact)
    load[7] *= 1.3
    moved = carry(first.contact, load, WIDTH, growth=first.growth, near=True, sloped=True)
    np.testing.assert_allclose(moved.forces[:, 0], load, rtol=CORRECTABLE)
    assert np.flatnonzero(moved.contact[:, 0] != first.contact[:, 0]).tolist() == [7]


def test_a_hard_floor_under_loose_soil_carries_the_load(rng):
    """The load has a kink in the entry angle, about which secant steps oscillate."""
    load = np.geomspace(5.0, 3e3, 60)
    contact = contacts(
        np.full(60, 1.5), rng.uniform(0.0, 0.9, 60), layer_depth_m=0.01, layer_stiffness_Pa=1e9, stiffness_Pa=2e3
    )  # fmt: skip
    found = carry(contact, load, WIDTH)
    np.testing.assert_allclose(rim_forces(found.contact, WIDTH)[:, 0], load, rtol=1e-8)


def test_loads_that_are_none_or_not_carried_have_no_answer():
    load = np.array([1e9, -5.0, 0.0, np.nan, 100.0, 100.0])
    contact = started(6, np.array([0.2, 0.2, 0.2, 0.2, np.nan, 0.2]))
    for sloped in (False, True):
        found = carry(contact, load, WIDTH, sloped=sloped)
        lost = np.isnan(found.forces).all(axis=1)
        assert lost.tolist() == [True] * 5 + [False]
        assert np.isnan(found.contact[lost, :3]).all()
        assert np.isnan(found.slopes[lost]).all()
        assert 0.0 < found.contact[5, 0] < LARGEST_ENTRY_ANGLE
    assert contact[0, THETA_1] == 0.5  # the input is not changed
