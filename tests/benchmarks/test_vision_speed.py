"""How long the camera's classifier takes on a frame, built-in features only."""

from __future__ import annotations

from time import perf_counter

import numpy as np
import pytest
from bevameter.framework.core.classifier.fitting import Rows, fit, row_weights
from bevameter.vision.augment import training_patches
from bevameter.vision.features import patch_features
from bevameter.vision.observe import BATCH_FRAMES
from bevameter.vision.project import COLUMNS, ROWS
from bevameter.vision.train import CANDIDATES

FRAME_ALLOWED_S = 0.015
PREDICTION_ALLOWED_S = 0.0003

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def patches():
    rng = np.random.default_rng(0)
    frames = rng.integers(0, 256, (BATCH_FRAMES, 480, 640, 3), dtype=np.uint8)
    return np.concatenate([training_patches(frame, ROWS * COLUMNS, rng)[0] for frame in frames])


def test_features_and_class_of_a_frame(benchmark, patches):
    """Nine patches a frame, eight frames at once, as `observe_ground` takes them."""
    x = np.concatenate([patch_features(patches)] * 6)
    y, group = np.arange(len(x)) % 9, np.arange(len(x)) // 18
    x += np.random.default_rng(1).normal(size=x.shape)
    fitted, _, _ = fit(Rows(x, y, group, row_weights(y, group), 9), CANDIDATES, np.random.default_rng(2))

    def once():
        z = fitted.standardise(patch_features(patches))
        return fitted.gate.distance(z), fitted.probabilities(z)

    benchmark.pedantic(once, rounds=20, warmup_rounds=2)
    if benchmark.enabled:
        assert benchmark.stats.stats.min < BATCH_FRAMES * FRAME_ALLOWED_S
        z = fitted.standardise(patch_features(patches))
        assert _fastest_s(lambda: fitted.probabilities(z)) < len(z) * PREDICTION_ALLOWED_S


def _fastest_s(call, rounds=20):
    found = []
    for _ in range(rounds):
        start = perf_counter()
        call()
        found.append(perf_counter() - start)
    return min(found)
