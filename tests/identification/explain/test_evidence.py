"""Evidence against numerical integration, and discrepancies against the dense Gaussian."""

from copy import copy

import numpy as np
import pytest
from bevameter.identification.effects.catalogue.sinkage_offset import SinkageOffset
from bevameter.identification.explain.evidence import (
    AMPLITUDES,
    dependence,
    discrepancy,
    discrepancy_basis,
    log_evidence,
    log_integral,
    structures,
)
from bevameter.identification.explain.fit import fit, with_effect
from bevameter.identification.explain.steps import Prior
from bevameter.identification.explain.whitening import robust_weight
from bevameter.identification.mechanics.augmented import AugmentedWheel, Entry
from scipy.integrate import dblquad
from scipy.special import logsumexp


def test_laplace_agrees_with_integration_over_an_offset(fitted):
    problem, textbook = fitted
    offset = SinkageOffset(float(np.sqrt(np.nanmean(problem.samples.measured[:, 2] ** 2))))
    model, vector = with_effect(textbook, offset, np.zeros(1))
    whole = fit(problem, model, vector, textbook.noise, Entry(textbook.theta_1), fit_noise=False)
    sd = float(np.sqrt(whole.covariance(problem)[-1, -1]))
    grid = whole.vector[-1] + sd * np.linspace(-6.0, 6.0, 49)
    prior_sd = offset.parameters[0].scale
    logs = []
    for value in grid:
        held = type(problem)(problem.samples, problem.known, problem.noise_share)
        held.reference = problem.reference
        held.measured = problem.measured - value * (np.array(problem.answers) == 2)
        there = fit(held, AugmentedWheel(model.wheel), whole.vector[:-1], textbook.noise, fit_noise=False)
        logs.append(log_evidence(held, there) - 0.5 * (value / prior_sd) ** 2)
    density = logsumexp(logs) + np.log(grid[1] - grid[0]) - np.log(np.sqrt(2.0 * np.pi) * prior_sd)
    # Cohesion is at its bound in a part of the grid: there the density is not normal.
    assert log_evidence(problem, whole) == pytest.approx(density, abs=0.2)


@pytest.mark.parametrize("gradient", [0.0, -0.7, -4.0])
@pytest.mark.parametrize("place", [0.0, 0.6])
def test_integral_within_bounds_is_exact(gradient, place):
    """A parameter at its bound, or inside it, correlated with another one."""
    information = np.array([[2.0, 1.5], [1.5, 3.0]])
    vector, slope = np.array([place, 5.0]), np.array([gradient if place == 0.0 else 0.0, 0.0])
    prior = Prior(np.zeros(2), np.zeros(2), np.array([0.0, -np.inf]), np.full(2, np.inf))

    def density(b, a):
        d = np.array([a, b]) - vector
        return np.exp(slope @ d - 0.5 * d @ information @ d) / (2.0 * np.pi)

    expected = np.log(dblquad(density, 0.0, 8.0, -5.0, 15.0)[0])
    assert log_integral(slope, information, vector, prior) == pytest.approx(expected, abs=1e-6)


def test_discrepancy_is_marginalised_exactly(fitted):
    problem, textbook = fitted
    basis, covariates = discrepancy_basis(problem.samples.drive)
    rows, count = basis.shape
    channels = len(problem.answers)
    extra = np.zeros((rows, channels, count * channels))
    for channel in range(channels):
        extra[:, channel, channel * count : (channel + 1) * count] = basis * textbook.noise.sd[channel]
    columns = np.concatenate([problem.columns(textbook.response), extra * problem.seen[..., None]], axis=-1)
    white, _ = problem.whitener(textbook.noise, textbook.response).whiten(columns)
    weight = robust_weight(white[..., 0]).ravel()
    flat = white.reshape(len(weight), -1) * np.sqrt(weight)[:, None]
    residual, soil, smooth = flat[:, 0], flat[:, 1:6], flat[:, 6:]
    prior = problem.prior(textbook.model)
    # The prior of the soil is one more observation of each of its parameters.
    known = np.sqrt(np.diag(prior.precision))
    residual = np.concatenate([residual, known * (prior.mean - textbook.vector)])
    soil = np.vstack([soil, np.diag(known)])
    smooth = np.vstack([smooth, np.zeros((5, smooth.shape[1]))])
    left, _ = np.linalg.qr(soil)
    free = np.eye(len(residual)) - left @ left.T
    logs = []
    for chosen in structures(covariates, channels):
        some = smooth[:, chosen]
        for amplitude in AMPLITUDES:
            inside = np.eye(len(chosen)) / amplitude**2 + some.T @ free @ some
            slope = some.T @ free @ residual
            gain = 0.5 * slope @ np.linalg.solve(inside, slope)
            logs.append(gain - 0.5 * np.linalg.slogdet(inside)[1] - len(chosen) * np.log(amplitude))
    assert discrepancy(problem, textbook).log_evidence == pytest.approx(logsumexp(logs) - np.log(len(logs)), abs=0.05)


def test_a_discrepancy_depends_on_one_covariate_on_slip_and_load_or_on_all():
    covariates = np.array(["constant", "slip", "slip", "load_N", "slip load_N"])
    found = {tuple(each.tolist()) for each in structures(covariates, 2)}
    one = {(0,), (0, 1, 2), (0, 3), (0, 1, 2, 3, 4)}
    shifted = {tuple(5 + each for each in chosen) for chosen in one}
    both = {(*chosen, *(5 + each for each in chosen)) for chosen in one}
    assert found == one | shifted | both


def test_a_step_of_one_channel_along_slip_is_found(fitted):
    """Five sensor noises in drawbar pull at high slip: the other channels are left as they are."""
    problem, textbook = fitted
    slip, pull = problem.samples.drive.slip, problem.answers.index(4)
    moved = copy(problem)
    moved.measured = problem.measured.copy()
    moved.measured[:, pull] += 5.0 * textbook.noise.sd[pull] * (slip > np.median(slip))
    found = discrepancy(moved, textbook)
    assert found.log_evidence > 10.0
    assert np.abs(np.delete(found.mean, pull, axis=1)).max() == 0.0
    assert dependence(moved, found)[0][:2] == (4, "slip")


def test_a_null_has_no_discrepancy(fitted):
    assert discrepancy(*fitted).log_evidence < 0.0
