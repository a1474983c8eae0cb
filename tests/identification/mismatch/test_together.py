"""Fits at once: their answers come in the order asked for, and a failure is not lost."""

from __future__ import annotations

import time

import numpy as np
import pytest
from bevameter.identification.felt_rows import felt_rows
from bevameter.identification.identify import open_recording
from bevameter.identification.mismatch.fit.samples import gather
from bevameter.identification.mismatch.fit.together import together
from bevameter.identification.mismatch.fit.trial import textbook_trial
from concealed.conceal import conceal


def test_answers_come_in_order_and_a_failure_is_raised():
    def slow(seconds: float) -> float:
        time.sleep(seconds)
        return seconds

    assert together(slow, [0.05, 0.0, 0.02]) == [0.05, 0.0, 0.02]
    assert together(slow, []) == []
    with pytest.raises(ZeroDivisionError):
        together(lambda value: 1 / value, [1, 0, 2])


def test_residuals_are_taken_by_the_weights_of_the_moment(tmp_path):
    opened = open_recording(conceal(130000, (), "plain", "bench").write(tmp_path), None)
    rows = felt_rows(opened)
    problem, textbook = textbook_trial(gather(rows.table, rows.wheel, rows.vehicle))
    response, own = textbook.fitted.response, problem.weights
    first = problem.residuals(response)
    problem.weights = None
    other = problem.linearise(textbook.fitted.model, textbook.fitted.vector * 1.05, None)
    problem.weights = other
    assert not np.allclose(problem.residuals(response), first)
    problem.weights = own
    np.testing.assert_array_equal(problem.residuals(response), first)
