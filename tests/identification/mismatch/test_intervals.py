"""Intervals of what the mismatch tool finds: as wide as the data scatter, and about values that are not biased."""

from __future__ import annotations

import numpy as np
import pytest
from bevameter.identification.effects.drive import rate_of_change
from bevameter.identification.mismatch.fit.steps import Prior, covariance_of, normal_equations

ROWS, GROUPS = 240, 24
FLAT = Prior(np.zeros(2), np.full(2, 1e-9), np.full(2, -np.inf), np.full(2, np.inf))


def estimate(shared: float, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Estimate two slopes that are zero, with errors that rows of a group share, and what they are said to vary by."""
    group = np.arange(ROWS) * GROUPS // ROWS
    along = np.sin(np.arange(ROWS) / 17.0)
    jacobian = -np.column_stack([along, np.ones(ROWS)])[:, None, :]
    errors = rng.normal(size=ROWS) + shared * rng.normal(size=GROUPS)[group]
    gradient, information = normal_equations(errors[:, None], jacobian)
    found = -np.linalg.solve(information, gradient)
    left = errors[:, None] + np.einsum("nmp,p->nm", jacobian, found)
    return found, np.sqrt(np.diag(covariance_of(left, jacobian, FLAT, group)))


@pytest.mark.parametrize("shared", [0.0, 1.0])
def test_errors_that_neighbours_share_widen_the_intervals(shared):
    rng = np.random.default_rng(3)
    found, sd = map(np.array, zip(*[estimate(shared, rng) for _ in range(400)], strict=True))
    held = np.mean(np.abs(found) < 1.96 * sd, axis=0)
    # 400 drawn: a coverage is known to 1 %.
    assert ((held > 0.92) & (held < 0.985)).all(), held
    # Taken for independent, rows would show 1.4 / sqrt(ROWS) at most.
    assert np.median(sd[:, 1]) > (1.0 + 1.5 * shared) / np.sqrt(ROWS)


@pytest.mark.parametrize("noise", [0.0, 0.003, 0.01])
@pytest.mark.parametrize("period_s", [4.0, 12.0])
def test_what_acceleration_does_is_found_without_bias(noise, period_s):
    rng = np.random.default_rng(5)
    time_s = np.arange(3000) / 5.0
    turn = 2.0 * np.pi / period_s
    speed = 1.0 + 0.3 * np.sin(turn * time_s)
    truth = 0.3 * turn * np.cos(turn * time_s)
    rate = rate_of_change(speed * (1.0 + noise * rng.normal(size=3000)), time_s, np.zeros(3000, dtype=int))
    mass = truth @ rate / (rate @ rate)
    assert mass == pytest.approx(1.0, abs=0.03)


def test_a_speed_that_is_all_noise_has_no_acceleration():
    speed = 1.0 + 0.01 * np.random.default_rng(7).normal(size=2000)
    rate = rate_of_change(speed, np.arange(2000) / 10.0, np.arange(2000) // 500)
    raw = np.gradient(speed, 0.1)
    assert np.std(rate) < 0.1 * np.std(raw)
