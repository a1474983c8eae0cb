"""Held-out blocks against fits without them."""

from copy import copy
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


def test_a_block_has_no_part_in_its_own_discrepancy(fitted):
    """Its prediction stays where it is, whatever was measured in the block."""
    problem, textbook = fitted
    rows = problem.samples.block == np.unique(problem.samples.block)[3]
    moved = copy(problem)
    moved.measured = problem.measured.copy()
    moved.measured[rows] += 5.0 * textbook.noise.sd
    predicted, again = (
        each.measured[rows] - hold_out(each, textbook, discrepant=True).residuals[rows] for each in (problem, moved)
    )
    np.testing.assert_allclose(again / textbook.noise.sd, predicted / textbook.noise.sd, atol=1e-6)


def test_a_discrepancy_that_other_blocks_show_is_predicted(fitted):
    problem, textbook = fitted
    slip, pull = problem.samples.drive.slip, problem.answers.index(4)
    moved = copy(problem)
    moved.measured = problem.measured.copy()
    moved.measured[:, pull] += 20.0 * textbook.noise.sd[pull] * np.cos(6.0 * slip)
    without, with_it = (hold_out(moved, textbook, discrepant=given) for given in (False, True))
    gain, sd = with_it.gain(without)
    assert gain > 5.0 * sd
    error = [np.sqrt(np.nanmean(each.residuals[:, pull] ** 2)) for each in (without, with_it)]
    assert error[1] < 0.5 * error[0]
