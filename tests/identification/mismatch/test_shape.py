"""A correction in words and in algebra: what it says has to be what the curve does."""

from __future__ import annotations

import numpy as np
import pytest
from bevameter.identification.mismatch.show.shape import shape_of

SLIP = np.linspace(0.02, 0.6, 300)


@pytest.mark.parametrize(
    ("values", "said"),
    [
        (0.01 * SLIP**2, "sinkage z rises, ever faster, with slip i by 3.6"),
        (-0.02 * SLIP, "sinkage z falls with slip i by 11.6 mm"),
        (np.sqrt(SLIP), "rises, ever slower, with slip i"),
        (-((SLIP - 0.3) ** 2), "peaks near 0.3 with slip i"),
        ((SLIP - 0.2) ** 2, "dips near 0.2 with slip i"),
        (np.sin(40.0 * SLIP), "wanders with slip i"),
        (np.where(SLIP > 0.3, 1.0, 0.0), "with slip i by 1000 mm"),
    ],
)
def test_words_say_what_the_curve_does(values, said):
    assert said in shape_of("sinkage_m", "slip", SLIP, values).words


def test_a_short_formula_stands_for_the_curve_where_it_is_as_good():
    noise = 1e-4 * np.random.default_rng(0).normal(size=SLIP.size)
    formula = shape_of("sinkage_m", "slip", SLIP, 0.005 + 0.03 * SLIP**2 + noise).formula
    assert formula.endswith("slip^2")
    constant, slope, _ = formula.split()
    assert float(constant) == pytest.approx(0.005, rel=0.05)
    assert float(slope) == pytest.approx(0.03, rel=0.05)
    assert shape_of("torque_Nm", "slip", SLIP, np.sin(40.0 * SLIP)).formula == ""
    assert shape_of("torque_Nm", "slip", SLIP, 3.0 * SLIP**2).formula == "3 slip^2", "rounding is no constant"


def test_rows_where_the_variable_was_not_observed_say_nothing():
    at = SLIP.copy()
    at[:20] = np.nan
    values = np.where(np.isfinite(at), 0.1 * SLIP, 7.0)
    assert "torque T rises with slip i by 0.05" in shape_of("torque_Nm", "slip", at, values).words


def test_a_ripple_is_told_by_its_cycles():
    angle = np.linspace(0.0, 30.0, 400)
    told = shape_of("torque_Nm", "wheel_angle_rad (18 cycles a turn)", angle, 0.2 * np.cos(18.0 * angle))
    assert told.words == "torque T ripples with wheel angle, 18 cycles a turn, by 0.4 N m"
    assert told.formula == ""
