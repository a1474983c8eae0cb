"""Located regions: none in noise, and a step where it is."""

from copy import copy

import numpy as np
from bevameter.identification.explain.locate import locate


def test_nothing_is_located_where_the_model_is_true(fitted):
    problem, textbook = fitted
    assert locate(problem, textbook) == ()


def test_a_step_along_slip_is_located_in_its_channel(fitted):
    problem, textbook = fitted
    slip, torque = problem.samples.drive.slip, problem.answers.index(1)
    edge = float(np.quantile(slip, 0.7))
    moved = copy(problem)
    moved.measured = problem.measured.copy()
    moved.measured[:, torque] += 6.0 * textbook.noise.sd[torque] * (slip > edge)
    found = locate(moved, textbook)
    assert found[0].channel == "torque_Nm"
    along_slip = [each for each in found if each.variable == "slip"]
    assert any(abs(each.start - edge) < 0.1 for each in along_slip)
    assert found[0].p_value < 1e-6
