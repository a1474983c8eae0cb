"""Forces and equilibrium over the paper's 60,000 simulations, against quadratures that share nothing with them."""

from __future__ import annotations

import forces_against_quadrature
import pytest


@pytest.fixture(scope="module")
def study():
    return forces_against_quadrature


def test_all_points_agree_with_tanh_sinh_quadrature_to_eight_digits(study):
    figures = study.over_all()
    assert figures["forces"] < 1e-8
    assert figures["entry angle"] < 1e-8


def test_that_quadrature_and_the_equilibrium_agree_with_quad_and_brentq(study):
    figures = study.on_subset(600.0, most=5)
    assert figures["points"] == 5
    assert figures["reference against quad"] < 1e-11
    assert figures["forces against quad"] < 1e-8
    assert figures["entry angle against brentq"] < 1e-8
