"""True load and slip from noisy ones."""

import numpy as np
import pytest
from bevameter.identification.explain.latent import independent, path_of

ROWS = 600


def _found(truth: np.ndarray, noise: float, seed: int, stretch: np.ndarray | None = None):
    measured = truth + np.random.default_rng(seed).normal(0.0, noise, len(truth))
    stretch = np.zeros(len(truth), dtype=int) if stretch is None else stretch
    return path_of(measured, np.arange(float(len(truth))), stretch, np.ones(len(truth)), noise)


@pytest.mark.parametrize("seed", range(3))
def test_a_smooth_course_is_found_with_its_noise_and_its_error(seed):
    truth = 0.3 + 0.2 * np.sin(np.arange(ROWS) / 25.0)
    path = _found(truth, 0.01, seed)
    assert np.mean(path.white_sd) == pytest.approx(0.01, rel=0.15)
    error, sd = path.mean - truth, np.sqrt(path.covariance[:, 0, 0])
    assert np.sqrt(np.mean(error**2)) < 0.006
    assert np.mean(np.abs(error) < 1.96 * sd) == pytest.approx(0.95, abs=0.06)


def test_steps_stay_sharp():
    truth = np.repeat([0.1, 0.4, 0.2], ROWS // 3)
    path = _found(truth, 0.01, 4)
    assert np.abs(path.mean - truth).max() < 0.03
    assert np.sqrt(np.mean((path.mean - truth) ** 2)) < 0.004


def test_the_error_of_the_mean_is_a_chain_with_the_variance_stated():
    truth = np.cumsum(np.random.default_rng(0).normal(0.0, 0.004, ROWS))
    path = _found(truth, 0.01, 1)
    covariance = path.covariance[0]
    for row in range(1, ROWS):
        covariance = path.transition[row] @ covariance @ path.transition[row].T + path.process_noise[row]
        np.testing.assert_allclose(covariance[0, 0], path.covariance[row, 0, 0], rtol=1e-6)


def test_unseen_rows_are_less_certain_and_a_new_stretch_begins_anew():
    walk = np.cumsum(np.random.default_rng(1).normal(0.0, 0.02, 200))
    truth = walk + np.repeat([0.0, 5.0], 100)
    measured = truth + np.random.default_rng(2).normal(0.0, 0.01, 200)
    measured[40:45] = np.nan
    path = path_of(measured, np.arange(200.0), np.repeat([0, 1], 100), np.ones(200), 0.01)
    sd = np.sqrt(path.covariance[:, 0, 0])
    assert sd[42] > 1.2 * sd[60]
    assert np.abs(path.mean - truth).max() < 0.15
    np.testing.assert_allclose(path.transition[100], 0.0, atol=1e-100)


def test_a_share_of_sensor_noise_pulls_the_mean_towards_the_reading():
    truth = np.full(ROWS, 0.3)
    path = _found(truth, 0.01, 7)
    latent = path.latent(0.25)
    expected = 0.25 * path.mean + 0.75 * path.measured
    np.testing.assert_allclose(latent.mean, expected)
    np.testing.assert_allclose(latent.white, 0.25 * 0.75 * path.white_sd**2)
    np.testing.assert_allclose(path.latent(1.0).mean, path.mean)


def test_trials_are_shrunk_towards_their_mean_by_the_noise():
    rng = np.random.default_rng(3)
    truth = rng.normal(0.3, 0.1, 400)
    measured = truth + rng.normal(0.0, 0.1, 400)
    path = independent(measured, np.full(400, 0.1))
    slope = np.polyfit(path.mean, truth, 1)[0]
    assert slope == pytest.approx(1.0, abs=0.15)
    assert np.polyfit(measured, truth, 1)[0] < 0.65
