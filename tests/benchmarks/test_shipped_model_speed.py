"""How long the models that come with the package take: a frame, a prediction, a second of sound beside librosa's."""

from __future__ import annotations

import librosa
import numpy as np
import pytest
from bevameter.audio.classify import sound_evidence
from bevameter.audio.features import RATE_HZ
from bevameter.framework.core.classifier.shipped import shipped_model, shipped_models
from bevameter.framework.scenario.presets import PRESETS
from bevameter.vision.classify import patch_evidence
from bevameter.vision.measures import measures_of
from bevameter.vision.observe import BATCH_FRAMES
from bevameter.vision.project import ground_patches

FRAME_ALLOWED_S = 0.015
SOUND_S = 30.0
SOUND_ALLOWED = 1e-3
"""Time that a second of sound may take [s]."""
PREDICTION_ALLOWED_S = 0.3e-3

pytestmark = pytest.mark.slow


def test_a_frame(benchmark):
    """Eight frames of 640 x 480: cut, measured, rated, classified."""
    model, camera = shipped_model("vision-real").load(), PRESETS["demo"].vehicle.camera
    measures = measures_of(model)
    layout = ground_patches(camera, 0.5, measures.side_px)
    frames = np.random.default_rng(0).integers(0, 256, (BATCH_FRAMES, 480, 640, 3), dtype=np.uint8)
    assert (camera.width_px, camera.height_px) == (640, 480)

    def once():
        return patch_evidence(model, measures, np.concatenate([layout.cut(frame) for frame in frames]))

    benchmark.pedantic(once, rounds=20, warmup_rounds=2)
    if benchmark.enabled:
        assert benchmark.stats.stats.min < BATCH_FRAMES * FRAME_ALLOWED_S


@pytest.mark.parametrize("way", ["package", "librosa"])
def test_sound(benchmark, way):
    """Half a minute of sound; librosa's features are those of a common recipe, not classified."""
    sound = np.random.default_rng(0).normal(0.0, 0.05, round(SOUND_S * RATE_HZ)).astype(np.float32)
    model = shipped_model("audio-real").load()

    def plain():
        for start in range(0, sound.size, RATE_HZ // 2):
            part = {"y": sound[start : start + RATE_HZ // 2], "sr": RATE_HZ}
            cepstra = librosa.feature.mfcc(**part, n_mfcc=20)
            librosa.feature.delta(cepstra)
            for feature in ("spectral_centroid", "spectral_bandwidth", "spectral_contrast", "spectral_rolloff"):
                getattr(librosa.feature, feature)(**part)
            librosa.feature.spectral_flatness(y=part["y"])

    once = plain if way == "librosa" else lambda: sound_evidence(sound, RATE_HZ, model)
    benchmark.pedantic(once, rounds=5, warmup_rounds=1)
    if benchmark.enabled:
        benchmark.extra_info["ms_a_second_of_sound"] = 1e3 * benchmark.stats.stats.min / SOUND_S
        assert way == "librosa" or benchmark.stats.stats.min < SOUND_ALLOWED * SOUND_S


@pytest.mark.parametrize("name", shipped_models())
def test_one_prediction(benchmark, name):
    """One prediction from features that are at hand."""
    model = shipped_model(name).load()
    row, quality = model.fitted.mean[None] + 0.3 * model.fitted.scale, np.ones(1)
    benchmark.pedantic(lambda: model.evidence(row, quality), rounds=500, warmup_rounds=20)
    if benchmark.enabled:
        assert benchmark.stats.stats.min < PREDICTION_ALLOWED_S
