"""Forces and equilibrium over the paper's 60,000 simulations, against quadratures that share nothing with them."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import pytest

STUDY = Path(__file__).resolve().parents[2] / "tests" / "studies" / "forces_against_quadrature.py"


@pytest.fixture(scope="module")
def study():
    spec = importlib.util.spec_from_file_location(STUDY.stem, STUDY)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_all_points_agree_with_tanh_sinh_quadrature_to_eight_digits(study):
    figures = study.over_all()
    assert figures["forces"] < 1e-8
    assert figures["entry angle"] < 1e-8


def test_that_quadrature_and_the_equilibrium_agree_with_quad_and_brentq(study):
    figures = study.on_subset(2.0, most=500)
    assert figures["points"] >= 3
    assert figures["reference against quad"] < 1e-11
    assert figures["forces against quad"] < 1e-8
    assert figures["entry angle against brentq"] < 1e-8
