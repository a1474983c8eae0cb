"""The signal-to-noise ratio as it is learnt from features."""

import json

import numpy as np
import pytest
from bevameter.framework.core.classifier.signal_to_noise import NOISE_FREE_DB, SignalToNoise


def learnt(rng, squares):
    """A feature that noise drives away from 0 to either side, and one that means nothing."""
    snr_dB = np.where(np.arange(600) % 3 == 0, NOISE_FREE_DB, rng.uniform(-20.0, 30.0, 600))
    away = rng.choice([-1.0, 1.0], 600) * (NOISE_FREE_DB - snr_dB) / 20 + 0.1 * rng.normal(size=600)
    inputs = np.column_stack([away, rng.normal(size=600)])
    return SignalToNoise.fit(inputs, snr_dB, np.arange(600) // 20, drowned_dB=-5.0, squares=squares), inputs, snr_dB


def test_squares_find_noise_that_shows_on_either_side(rng):
    (model, held_dB), inputs, snr_dB = learnt(rng, squares=True)
    (_, straight_dB), *_ = learnt(rng, squares=False)
    assert np.corrcoef(held_dB, snr_dB)[0, 1] > 0.9 > 0.3 > np.corrcoef(straight_dB, snr_dB)[0, 1]
    clear = model.clear(model.estimate(inputs))
    assert clear[snr_dB == NOISE_FREE_DB].mean() > 0.9
    assert clear[snr_dB < -10].mean() < 0.1


@pytest.mark.parametrize("squares", [False, True])
def test_a_model_comes_back_from_its_settings(squares, rng):
    (model, _), inputs, _ = learnt(rng, squares)
    again = SignalToNoise.from_settings(json.loads(json.dumps(model.settings())), 2)
    np.testing.assert_allclose(again.estimate(inputs), model.estimate(inputs), atol=1e-6)
    with pytest.raises(ValueError, match="noise model"):
        SignalToNoise.from_settings(model.settings() | {"coefficient": [1.0, 1.0, 1.0]}, 2)


def test_clean_data_keep_their_quality_where_noise_does_not_show(rng):
    inputs, groups = rng.normal(size=(400, 5)), np.arange(400) % 8
    snr_dB = np.where(np.arange(400) % 2, NOISE_FREE_DB, rng.uniform(-10, 20, 400))
    noise, held_dB = SignalToNoise.fit(inputs, snr_dB, groups, drowned_dB=0.0)
    clean = snr_dB >= NOISE_FREE_DB
    assert noise.clear(held_dB)[clean].min() > 0.5
