"""The likelihood ratio of errors of form against the same by dense matrices and a search without derivatives."""

import numpy as np
import pytest
from bevameter.identification.estimate.ground_variation import likelihood_ratio
from scipy.optimize import differential_evolution

SAMPLES, IN_PIECE = 48, 4
PIECES = SAMPLES // IN_PIECE
GROUND = np.array([[1.0, 0.0], [0.0, 0.7], [0.0, 0.0]])
PRECISION = np.array([0.0, 0.0, 4.0])


def drive(form: float, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Scores (n, 3) and information (n, 3, 3) of samples of two channels, whose third parameter is `form`."""
    jacobian = rng.normal(size=(SAMPLES, 2, 3))
    along = np.convolve(rng.normal(size=SAMPLES + 14), np.hanning(15), "valid")
    soil = np.column_stack([0.2 * along, -0.1 * along, np.full(SAMPLES, form)])
    left = np.einsum("ncp,np->nc", jacobian, soil) + rng.normal(size=(SAMPLES, 2))
    return np.einsum("ncp,nc->np", jacobian, left), np.einsum("ncp,ncq->npq", jacobian, jacobian)


def dense(scores, information, freed: bool) -> float:
    """Largest log-likelihood, the two processes and the soil integrated out, by one matrix of all that is unknown."""
    design = np.zeros((SAMPLES, 3, 2 * PIECES + 3))
    for sample in range(SAMPLES):
        design[sample][:, [sample // IN_PIECE, PIECES + sample // IN_PIECE]] = GROUND
        design[sample][:, 2 * PIECES :] = np.eye(3)
    slope = np.einsum("npk,np->k", design, scores)
    curvature = np.einsum("npk,npq,nql->kl", design, information, design)
    curvature[2 * PIECES :, 2 * PIECES :] += np.diag(PRECISION)
    last = len(slope) - 1

    def loss(logs):
        *sds, length = np.exp(logs)
        place = np.arange(PIECES)
        along = np.exp(-(((place[:, None] - place) / length) ** 2) / 2.0) + 1e-6 * np.eye(PIECES)
        whole, value = curvature.copy(), 0.0
        for number, sd in enumerate(sds):
            block = slice(number * PIECES, (number + 1) * PIECES)
            whole[block, block] += np.linalg.inv(sd**2 * along)
            value -= 0.5 * np.linalg.slogdet(sd**2 * along)[1]
        kept = slice(0, last + 1 if freed else last)
        value += 0.5 * slope[kept] @ np.linalg.solve(whole[kept, kept], slope[kept])
        return -(value - 0.5 * np.linalg.slogdet(whole[:last, :last])[1])

    bounds = [(np.log(1e-4), np.log(0.5))] * 2 + [(0.0, np.log(0.5 * PIECES))]
    return -differential_evolution(loss, bounds, rng=1, tol=1e-8, maxiter=60).fun


@pytest.mark.parametrize("form", [0.0, 0.6])
def test_ratio_agrees_with_dense_matrices(form, rng):
    scores, information = drive(form, rng)
    expected = 2.0 * (dense(scores, information, True) - dense(scores, information, False))
    assert likelihood_ratio(scores, information, PRECISION, np.zeros(len(PRECISION)), GROUND, 2) == pytest.approx(
        expected, abs=0.02
    )
