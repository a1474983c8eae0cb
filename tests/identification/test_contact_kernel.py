"""The compiled contact: the textbook's forces where nothing is added, adaptive quadrature's where everything is."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from bevameter.identification import contact_kernel, stress_kernel
from bevameter.identification.mechanics.augmented import AugmentedWheel
from bevameter.identification.effects.named import specimen
from bevameter.identification.simulate import soil_vector
from bevameter.identification.mechanics.soil import Soil
from bevameter.identification.mechanics.stresses import rim_forces
from bevameter.identification.mechanics.textbook import contact_array
from scipy.integrate import quad

SITUATION = specimen()
WHEEL, DRIVE = SITUATION.wheel, SITUATION.drive
SOIL = Soil(c_Pa=500.0, phi_rad=math.radians(32.0), k_m=0.012, stiffness_Pa=2e5, n=0.9)
JANOSI = 1.0 / (1.0 - math.exp(-1.0))
"""K_r from which on the humped law has no hump."""


def textbook_contact(theta_1: np.ndarray, slip: np.ndarray) -> np.ndarray:
    """Rows of `contact_kernel` as the augmented wheel lays them out without effects."""
    true = np.column_stack([np.ones(len(slip)), slip])
    return AugmentedWheel(WHEEL)._contact(DRIVE, true, soil_vector(SOIL), theta_1).array


def forces_of(contact: np.ndarray, count: int = 0) -> np.ndarray:
    nodes, weights = stress_kernel.quadrature(count) if count else (contact_kernel.NODES, contact_kernel.WEIGHTS)
    forces = np.empty((len(contact), 3))
    contact_kernel.rim_forces(contact, WHEEL.width_m, nodes, weights, np.ones(len(contact), dtype=bool), forces)
    return forces


def test_the_kernel_is_the_textbooks_where_nothing_is_added(rng):
    theta_1, slip = rng.uniform(0.2, 1.2, 60), rng.uniform(0.0, 0.95, 60)
    expected = rim_forces(contact_array(theta_1, slip, SOIL), WHEEL)
    scale = expected[:, [0]] * np.array([1.0, WHEEL.radius_m, 1.0])
    np.testing.assert_allclose(forces_of(textbook_contact(theta_1, slip)) / scale, expected / scale, atol=1e-5)


@pytest.mark.parametrize(
    "fields", [{"layer_depth_m": 0.008, "layer_stiffness_Pa": 4e6}, {"most_normal_Pa": 1.5e4}], ids=["layer", "flat"]
)
def test_kinks_of_the_pressure_cost_no_digits(fields, rng):
    """Eight nodes over a kink were wrong by up to 9 % for a layer, 2 % for a tyre that gives way."""
    contact = textbook_contact(rng.uniform(0.2, 1.0, 200), rng.uniform(0.0, 0.8, 200))
    smooth = forces_of(contact)
    for name, value in fields.items():
        contact[:, contact_kernel.COLUMN[name]] = value
    few, many = forces_of(contact), forces_of(contact, 200)
    assert np.abs(many / smooth - 1.0).max() > 0.3
    scale = many[:, [0]] * np.array([1.0, WHEEL.radius_m, 1.0])
    np.testing.assert_allclose(few / scale, many / scale, atol=1e-6)


def test_the_kernel_agrees_with_adaptive_quadrature_of_a_contact_that_has_everything():
    column = contact_kernel.COLUMN
    contact = textbook_contact(np.array([0.8]), np.array([0.35]))
    fields = {
        "theta_2": -0.2, "theta_m": 0.35, "radius_m": 0.16, "shear_radius_m": 0.165, "lever_m": 0.162,
        "residual": 0.6, "adhesion_Pa": 700.0, "tan_delta": 0.5, "layer_depth_m": 0.02, "layer_stiffness_Pa": 4e5,
    }  # fmt: skip
    for name, value in fields.items():
        contact[:, column[name]] = value
    f = {name: float(contact[0, index]) for name, index in column.items()}

    def sigma(theta: float) -> float:
        front = f["theta_1"] - f["theta_m"]
        ahead = theta if theta > f["theta_m"] else (
            f["theta_1"] - (theta - f["theta_2"]) / (f["theta_m"] - f["theta_2"]) * front
        )  # fmt: skip
        depth = max(f["radius_m"] * (math.cos(ahead) - math.cos(f["theta_1"])), 0.0)
        below = max(depth - f["layer_depth_m"], 0.0)
        upper = f["stiffness_Pa"] * (depth / WHEEL.width_m) ** f["n"]
        return upper + f["layer_stiffness_Pa"] * (below / WHEEL.width_m) ** f["n"]

    def tau(theta: float) -> float:
        slid = f["shear_radius_m"] * (f["theta_1"] - theta) - f["advance_m"] * (
            math.sin(f["theta_1"]) - math.sin(theta)
        )
        strength = min(f["c_Pa"] + sigma(theta) * f["tan_phi"], f["adhesion_Pa"] + sigma(theta) * f["tan_delta"])
        return math.copysign(strength * mobilised(abs(slid) / f["k_m"], f["residual"]), slid)

    def integral(function) -> float:
        pieces = np.linspace(f["theta_2"], f["theta_1"], 41)
        return sum(quad(function, low, high, epsrel=1e-9)[0] for low, high in pairwise(pieces))

    expected = WHEEL.width_m * np.array([
        integral(lambda t: f["radius_m"] * sigma(t) * math.cos(t) + f["shear_radius_m"] * tau(t) * math.sin(t)),
        f["shear_radius_m"] * f["lever_m"] * integral(tau),
        integral(lambda t: f["shear_radius_m"] * tau(t) * math.cos(t) - f["radius_m"] * sigma(t) * math.sin(t)),
    ])  # fmt: skip
    scale = expected[0] * np.array([1.0, WHEEL.radius_m, 1.0])
    np.testing.assert_allclose(forces_of(contact, 200)[0] / scale, expected / scale, atol=1e-4)
    # The kinks of layer and cap cost the few nodes of everyday use some of their digits, no more.
    np.testing.assert_allclose(forces_of(contact)[0] / scale, expected / scale, atol=1e-2)


def mobilised(along: float, residual: float) -> float:
    """Mobilised share after Wong & Preston-Thomas, written out as they print it."""
    hump = (1.0 / (residual * (1.0 - math.exp(-1.0))) - 1.0) * math.exp(1.0 - along)
    return residual * (1.0 + hump) * (1.0 - math.exp(-along))


def test_a_contact_that_goes_on_behind_the_wheel_carries_more():
    contact = textbook_contact(np.array([0.6]), np.array([0.2]))
    forces, behind = forces_of(contact), contact.copy()
    behind[:, contact_kernel.COLUMN["theta_2"]] = -0.24
    assert forces_of(behind)[0, 0] > forces[0, 0]


def test_the_humped_law_peaks_and_falls_to_its_residual():
    small, peak, large = (mobilised(at, 0.5) for at in (0.2, 1.0, 12.0))
    assert peak == pytest.approx(1.0)
    assert large == pytest.approx(0.5, rel=1e-3)
    assert small < peak
    assert all(np.diff([mobilised(at, JANOSI) for at in np.linspace(0.0, 6.0, 50)]) > 0.0)


@pytest.mark.parametrize("hump", [0.1, 0.8, 4.0])
def test_the_law_of_kacigin_and_guskov_stands_at_its_peak_and_falls_to_what_is_left(hump):
    at = np.linspace(0.01, 30.0, 3001)
    printed = (1.0 + hump / np.cosh(at)) * np.tanh(at)
    top = contact_kernel._top(hump)
    assert top == pytest.approx(printed.max(), rel=1e-4)
    share = np.array([contact_kernel._mobilised(0.02 * along, 0.02, math.inf, hump, top)[0] for along in at])
    np.testing.assert_allclose(share, printed / printed.max(), atol=1e-4)
    assert share.max() == pytest.approx(1.0, abs=1e-4)
    back, ahead = (contact_kernel._mobilised(way, 0.02, math.inf, hump, top)[0] for way in (-0.02, 0.02))
    assert back == -ahead
    assert contact_kernel._mobilised(1e3, 0.02, math.inf, hump, top) == pytest.approx(
        (1.0 / printed.max(), 0.0), rel=1e-4
    )


LAWS = {
    "textbook": {},
    "hump": {"residual": 0.6},
    "sech": {"hump": 1.4},
    "slips on the rim": {"adhesion_Pa": 300.0, "tan_delta": 0.3},
    "cut off at the rim": {"adhesion_Pa": 300.0, "tan_delta": 0.3, "rim_cuts_off": 1.0},
    "layer": {"layer_depth_m": 0.005, "layer_stiffness_Pa": 5e5},
    "flat": {"most_normal_Pa": 2e4},
}


@pytest.mark.parametrize("law", LAWS)
def test_slopes_are_those_of_the_forces(law, rng):
    """Each of the thirteen, against central differences of a fine quadrature."""
    rows, column = 80, contact_kernel.COLUMN
    contact = textbook_contact(rng.uniform(0.2, 1.1, rows), rng.uniform(-0.5, 0.9, rows))
    contact[:, column["theta_m"]] = contact[:, column["theta_1"]] * rng.uniform(0.2, 0.8, rows)
    contact[:, column["theta_2"]] = -rng.uniform(0.0, 0.3, rows)
    contact[:, column["n"]] = rng.uniform(0.4, 1.4, rows)
    for name, value in ({"shear_radius_m": 0.16, "lever_m": 0.155, "lift_N": 3.0} | LAWS[law]).items():
        contact[:, column[name]] = value
    nodes, weights = stress_kernel.quadrature(40)
    forces, slopes = np.empty((rows, 3)), np.empty((rows, 3, contact_kernel.SLOPED))
    contact_kernel.rim_forces_and_slopes(contact, WHEEL.width_m, nodes, weights, forces, slopes)
    np.testing.assert_array_equal(forces, forces_of(contact, 40))
    for field in range(contact_kernel.SLOPED):
        step = 1e-6 * np.abs(contact[:, field]).max()
        low, high = contact.copy(), contact.copy()
        low[:, field] -= step
        high[:, field] += step
        expected = (forces_of(high, 40) - forces_of(low, 40)) / (2.0 * step)
        scale = np.abs(expected).max(axis=0) + 1e-12
        np.testing.assert_allclose(slopes[:, :, field] / scale, expected / scale, atol=2e-4)


def test_forces_are_carried_to_a_contact_near_by_their_slopes_and_rows_that_have_none_are_marked(rng):
    column = contact_kernel.COLUMN
    here = textbook_contact(rng.uniform(0.3, 0.9, 40), rng.uniform(0.0, 0.6, 40))
    forces, slopes = np.empty((40, 3)), np.empty((40, 3, contact_kernel.SLOPED))
    contact_kernel.rim_forces_and_slopes(
        here, WHEEL.width_m, contact_kernel.NODES, contact_kernel.WEIGHTS, forces, slopes
    )
    there = here.copy()
    for name, share in (("theta_1", 1e-5), ("stiffness_Pa", 2e-5), ("n", -1e-5), ("tan_phi", 1e-5), ("k_m", 3e-5)):
        there[:, column[name]] *= 1.0 + share
    there[:, column["lift_N"]] += 0.01
    there[7, column["layer_depth_m"]] = 0.02
    near, beyond = np.empty_like(forces), np.empty(40, dtype=bool)
    contact_kernel.forces_near(there, here, forces, slopes, near, beyond)
    assert np.flatnonzero(beyond).tolist() == [7]
    moved = forces_of(there) - forces
    assert np.abs(moved).min() > 1e-6
    np.testing.assert_allclose(near - forces, moved, rtol=1e-3, atol=1e-7)
