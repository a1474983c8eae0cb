"""White residuals against the full covariance matrix."""

import numpy as np
import pytest
from bevameter.identification.explain.whitening import TO_ONE_OVER_E, Chain, Noise, matern

ROWS, CHANNELS = 40, 2


def _dense(chain: Chain, seen: np.ndarray) -> np.ndarray:
    """Covariance of all seen values (k, k), row by row, as the chain has it."""
    rows, channels, size = chain.loading.shape
    states = np.zeros((rows, rows, size, size))
    own = np.zeros((size, size))
    for row in range(rows):
        transition, process_noise = chain.transition[chain.which[row]], chain.process_noise[chain.which[row]]
        own = transition @ own @ transition.T + process_noise
        states[row, row] = own
        carried = own
        for later in range(row + 1, rows):
            carried = chain.transition[chain.which[later]] @ carried
            states[later, row] = carried
            states[row, later] = carried.T
    covariance = np.einsum("ics,ijst,jdt->icjd", chain.loading, states, chain.loading).reshape(rows * channels, -1)
    covariance += np.diag(chain.variance.ravel())
    kept = seen.ravel()
    return covariance[np.ix_(kept, kept)]


def _chain(rng: np.random.Generator, smooth: int) -> Chain:
    gap = rng.uniform(0.01, 0.2, ROWS)
    gap[[0, 17]] = np.inf
    noise = Noise(np.ones(CHANNELS), np.zeros(CHANNELS), np.array([0.8, 1.5]), 0.3, smooth)
    loading = np.zeros((ROWS, CHANNELS, 2 * (smooth + 1)))
    loading[..., :: smooth + 1] = rng.normal(size=(ROWS, CHANNELS, 2))
    return Chain(*matern(gap, noise), np.arange(ROWS), loading, rng.uniform(0.5, 2.0, (ROWS, CHANNELS)))


@pytest.mark.parametrize("smooth", [0, 1, 2])
def test_innovations_are_the_inverse_root_of_the_full_covariance(smooth):
    rng = np.random.default_rng(smooth)
    chain, seen = _chain(rng, smooth), rng.random((ROWS, CHANNELS)) > 0.2
    columns = rng.normal(size=(ROWS, CHANNELS, 3)) * 0.3
    filtered, white = chain.filter(seen), columns.copy()
    filtered.whiten(white, np.arange(ROWS))
    root = np.linalg.cholesky(_dense(chain, seen))
    expected = np.linalg.solve(root, columns[seen])
    np.testing.assert_allclose(white[seen], expected, rtol=1e-8, atol=1e-10)
    assert np.log(filtered.sd[seen]).sum() == pytest.approx(0.5 * np.linalg.slogdet(_dense(chain, seen))[1], rel=1e-10)
    assert not white[~seen].any()


def test_a_gross_error_does_not_move_the_states():
    rng = np.random.default_rng(5)
    chain, seen = _chain(rng, 0), np.ones((ROWS, CHANNELS), dtype=bool)
    columns = rng.normal(size=(ROWS, CHANNELS, 1)) * 0.3
    spoilt = columns.copy()
    spoilt[5, 0] = 1e6
    near, far, filtered = columns.copy(), spoilt.copy(), chain.filter(seen)
    assert filtered.whiten(near, np.arange(ROWS)).min() == 1.0
    weights = filtered.whiten(far, np.arange(ROWS))
    assert weights[5, 0] < 1e-4
    np.testing.assert_allclose(far[8:], near[8:], atol=3.0)
    # Further columns can follow later, with the weights of the first.
    np.testing.assert_allclose(filtered.whiten(spoilt, np.arange(ROWS), weights), weights)
    np.testing.assert_allclose(spoilt, far)


@pytest.mark.parametrize("smooth", [0, 1, 2])
def test_correlation_of_the_ground_falls_to_one_over_e_at_its_length(smooth):
    gap = np.array([np.inf, 0.3])
    transition, process_noise = matern(gap, Noise(np.ones(1), np.zeros(1), np.array([2.0, 1.0]), 0.3, smooth))
    correlation = (transition[1] @ process_noise[0])[0, 0] / process_noise[0][0, 0]
    assert correlation == pytest.approx(np.exp(-1.0), rel=1e-6)
    after = transition[1] @ process_noise[0] @ transition[1].T + process_noise[1]
    np.testing.assert_allclose(after, process_noise[0], atol=1e-9)
    assert TO_ONE_OVER_E[0] == 1.0
