"""Held-out blocks against fits without them."""

from dataclasses import replace

import numpy as np
from bevameter.identification.explain.fit import fit
from bevameter.identification.explain.held_out import hold_out
from bevameter.identification.explain.likelihood import Problem
from bevameter.identification.mechanics.augmented import Entry


def test_each_block_is_predicted_as_by_a_fit_without_it(fitted):
    problem, textbook = fitted
    held = hold_out(problem, textbook)
    assert not held.untested
    for block in np.unique(problem.samples.block)[::4]:
        rows = problem.samples.block == block
        measured = problem.samples.measured.copy()
        measured[np.ix_(rows, problem.answers)] = np.nan
        others = Problem(replace(problem.samples, measured=measured), problem.known, problem.noise_share)
        others.reference = problem.reference
        without = fit(others, textbook.model, textbook.vector, textbook.noise, Entry(textbook.theta_1), fit_noise=False)
        predicted = without.response.channels[np.ix_(rows, problem.answers)]
        expected = problem.measured[rows] - predicted
        np.testing.assert_allclose(held.residuals[rows] / textbook.noise.sd, expected / textbook.noise.sd, atol=0.02)


def test_the_true_model_is_predicted_to_within_its_noise(fitted):
    problem, textbook = fitted
    residuals = hold_out(problem, textbook).residuals
    size = np.sqrt(np.nanmean(residuals**2, axis=0)) / textbook.noise.sd
    assert (size < 3.0).all()
