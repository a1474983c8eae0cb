"""The wheel with effects: derivatives near a locked wheel, and agreement of both evaluations."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from bevameter.identification.mechanics.augmented import AugmentedWheel
from bevameter.identification.mechanics.soil import soil_vector
from effects_tried import DRIVE, IMPOSED, SOIL, WHEEL


def test_a_wheel_next_to_locked_answers_slip_as_its_differences_do():
    slip = -1.0 + np.geomspace(1e-5, 0.3, len(DRIVE))
    drive, imposed = replace(DRIVE, slip=slip), np.column_stack([DRIVE.load_N, slip])
    model, vector = AugmentedWheel(WHEEL), soil_vector(SOIL)
    here = model.linearise(drive, imposed, vector, None)
    step = 1e-6
    further = model.predict(drive, imposed + np.array([0.0, step]), vector).channels
    numeric = (further - model.predict(drive, imposed, vector).channels) / step
    np.testing.assert_allclose(here.by_latent[:, 1:, 1], numeric[:, 1:], rtol=0.03)


def test_predictions_and_linearised_channels_agree_to_what_the_quick_rule_has():
    model, vector = AugmentedWheel(WHEEL), soil_vector(SOIL)
    predicted = model.predict(DRIVE, IMPOSED, vector)
    linearised = model.linearise(DRIVE, IMPOSED, vector, None)
    scale = np.abs(predicted.channels).max(axis=0)
    np.testing.assert_allclose(linearised.channels / scale, predicted.channels / scale, atol=1e-6)
    np.testing.assert_allclose(linearised.theta_1, predicted.theta_1, rtol=1e-6)


def test_each_sample_may_have_a_soil_of_its_own():
    model, vector = AugmentedWheel(WHEEL), soil_vector(SOIL)
    soils = np.repeat(vector[:, None], len(DRIVE), axis=1)
    soils[3] += np.linspace(-0.5, 0.5, len(DRIVE))
    together = model.predict(DRIVE, IMPOSED, soils).channels
    for row in (0, 7, len(DRIVE) - 1):
        alone = model.predict(DRIVE, IMPOSED, soils[:, row]).channels[row]
        np.testing.assert_allclose(together[row], alone, rtol=1e-9)
