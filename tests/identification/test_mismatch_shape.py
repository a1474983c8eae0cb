"""A correction in words and in algebra: what it says has to be what the curve does."""

from __future__ import annotations

import numpy as np
import pytest
from bevameter.identification.mismatch.shape import shape_of

SLIP = np.linspace(0.02, 0.6, 300)


@pytest.mark.parametrize(
    ("values", "said"),
    [
        (0.01 * SLIP**2, "rises, ever faster, with slip by 0.0036"),
        (-0.02 * SLIP, "falls with slip by 0.0116"),
        (np.sqrt(SLIP), "rises, ever slower, with slip"),
        (-((SLIP - 0.3) ** 2), "peaks near 0.3 with slip"),
        ((SLIP - 0.2) ** 2, "dips near 0.2 with slip"),
        (np.sin(40.0 * SLIP), "wanders with slip"),
        (np.where(SLIP > 0.3, 1.0, 0.0), "with slip by 1"),
    ],
)
def test_words_say_what_the_curve_does(values, said):
    assert said in shape_of("slip", SLIP, values).words


def test_a_short_formula_stands_for_the_curve_where_it_is_as_good():
    noise = 1e-4 * np.random.default_rng(0).normal(size=SLIP.size)
    formula = shape_of("slip", SLIP, 0.005 + 0.03 * SLIP**2 + noise).formula
    assert formula.endswith("slip^2")
    constant, slope, _ = formula.split()
    assert float(constant) == pytest.approx(0.005, rel=0.05)
    assert float(slope) == pytest.approx(0.03, rel=0.05)
    assert shape_of("slip", SLIP, np.sin(40.0 * SLIP)).formula == ""


def test_rows_where_the_variable_was_not_observed_say_nothing():
    at = SLIP.copy()
    at[:20] = np.nan
    values = np.where(np.isfinite(at), 0.1 * SLIP, 7.0)
    assert "rises with slip by 0.05" in shape_of("slip", at, values).words


def test_a_ripple_is_told_by_its_cycles():
    angle = np.linspace(0.0, 30.0, 400)
    told = shape_of("wheel_angle_rad (18 cycles a turn)", angle, 0.2 * np.cos(18.0 * angle))
    assert told.words == "ripples with wheel_angle_rad, 18 cycles a turn, by 0.4"
    assert told.formula == ""
