"""Ends of profile intervals: of a parabola, at a discontinuity, at a bound."""

from __future__ import annotations

from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np
import pytest
from bevameter.framework.core.soil import Quantity, ShearStrength
from bevameter.identification.estimate import intervals
from bevameter.identification.estimate.identifiability import separable

QUANTILE = 1.96


@dataclass(frozen=True)
class Held:
    """A problem of two parameters, the first of which may be held; the second goes half as far."""

    upper: np.ndarray
    lower: np.ndarray
    measured: np.ndarray
    value: float = np.nan

    def fixing(self, index: int, value: float) -> Held:
        assert index == 0
        return Held(self.upper, self.lower, self.measured, value)


@dataclass(frozen=True)
class At:
    vector: np.ndarray


def end(monkeypatch, profile, direction: float = 1.0, bound: float = 100.0, known: float | None = None) -> np.ndarray:
    """Where a profile (log-likelihood of the first parameter, best at 0) has fallen far enough."""

    def fit(problem: Held, point: At, **stopping: float):
        vector = np.array([problem.value, 0.5 * problem.value])
        return SimpleNamespace(vector=vector, point=At(vector), log_likelihood=profile(problem.value))

    monkeypatch.setattr(intervals, "fit", fit)
    problem = Held(np.array([bound, 100.0]), np.array([-bound, -100.0]), np.zeros((300, 5)))
    best = SimpleNamespace(vector=np.zeros(2), point=At(np.zeros(2)), log_likelihood=profile(0.0))
    solution = SimpleNamespace(fit=best, problem=problem, quantile=QUANTILE, widening=None, widened=lambda index: 1.0)
    solution.free = np.ones(2, dtype=bool)
    return intervals.profile_end(
        solution, 0, 1.0, intervals.ProfilePath(np.zeros(2), 0, np.array([1.0, 0.5])), direction, known
    )


@pytest.mark.parametrize("direction", [1.0, -1.0])
@pytest.mark.parametrize("sd", [0.2, 1.0, 6.0])
def test_on_a_parabola_the_end_is_its_quantile(monkeypatch, sd, direction):
    found = end(monkeypatch, lambda at: -0.5 * (at / sd) ** 2, direction)
    assert found[0] == pytest.approx(direction * QUANTILE * sd, rel=1e-6)


def test_a_lopsided_profile_is_followed_on_its_own_side(monkeypatch):
    found = end(monkeypatch, lambda at: -0.5 * (np.log1p(at) / 0.8) ** 2)
    assert np.log1p(found[0]) / 0.8 == pytest.approx(QUANTILE, rel=0.1)


@pytest.mark.parametrize("edge", [0.3, 1.1, 1.9, 7.0])
def test_a_profile_that_breaks_off_ends_at_its_edge(monkeypatch, edge):
    """Another parameter reaches its bound: the profile is flat up to the edge and undefined beyond it."""
    found = end(monkeypatch, lambda at: -0.5 * (at / 20.0) ** 2 if at < edge else -1e4)
    assert found[0] == pytest.approx(edge, rel=0.05)
    assert found[1] == pytest.approx(0.5 * edge, rel=0.1), "what goes with the edge is what went with the last foothold"


def test_a_flat_profile_ends_at_the_bound(monkeypatch):
    assert end(monkeypatch, lambda at: -1e-4 * at**2, bound=3.0)[0] == pytest.approx(3.0)


def test_a_friction_with_a_wide_interval_is_not_determined_even_if_strength_is():
    """The strength of a cohesive soil depends little on friction."""
    strength = (ShearStrength(1e3, 12e3, 11.5e3, 12.5e3),)
    quantities = {
        "c_Pa": Quantity(12e3, 300.0, 11.4e3, 12.6e3),
        "phi_rad": Quantity(0.2, 0.3, 0.0, 0.918),
        "k_m": Quantity(0.01, 0.001, 0.008, 0.012),
        "stiffness_Pa": Quantity(1e5, 1e4, 8e4, 1.2e5),
        "n": Quantity(1.0, 0.1, 0.8, 1.2),
    }
    determined = separable(quantities, strength, np.ones(5, dtype=bool), 1.0)
    assert determined == {"c_Pa": True, "phi_rad": False, "k_m": True, "stiffness_Pa": True, "n": True}
    narrow = {**quantities, "phi_rad": Quantity(0.2, 0.1, 0.0, 0.39)}
    assert separable(narrow, strength, np.ones(5, dtype=bool), 1.0)["phi_rad"]


def test_an_end_within_a_known_one_is_not_looked_for(monkeypatch):
    tried = []

    def profile(at):
        tried.append(at)
        return -0.5 * at**2

    assert end(monkeypatch, profile, known=3.0)[0] == 0.0, "the best stands for it"
    assert tried == [0.0, 3.0]
    assert end(monkeypatch, lambda at: -0.5 * at**2, known=1.0)[0] == pytest.approx(QUANTILE, rel=0.1)
    assert end(monkeypatch, lambda at: -0.5 * at**2, known=-1.0)[0] == pytest.approx(QUANTILE, rel=1e-6)
