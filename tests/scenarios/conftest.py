"""Fixtures of the whole-system tests."""

from __future__ import annotations

import numpy as np
import pytest
from bevameter.audio.features import FEATURE_NAMES as SOUND_FEATURES
from bevameter.audio.features import HOP_S, RATE_HZ, WINDOW_S
from bevameter.audio.quality import MEASURES
from bevameter.framework.core.classifier.classifier import TerrainClassifier
from bevameter.vision.features import FEATURE_NAMES as IMAGE_FEATURES
from bevameter.vision.features import PATCH_PX
from refusals import VEHICLE, WHEEL, picture, sound


@pytest.fixture
def drive(tmp_path):
    """A recording of four seconds, sound in every part."""
    folder = tmp_path / "drive"
    (folder / "camera").mkdir(parents=True)
    (folder / "wheel.csv").write_text(WHEEL)
    (folder / "vehicle.toml").write_text(VEHICLE)
    (folder / "pose.csv").write_text("time_s,x_m,y_m,yaw_rad\n0,0,0,0\n2,0.5,0,0\n4,1,0,0\n")
    (folder / "camera" / "camera.csv").write_text("time_s,file\n0.0,0.jpg\n0.5,1.jpg\n")
    for index in range(2):
        picture(folder / "camera" / f"{index}.jpg")
    sound(folder / "sound.wav")
    return folder


@pytest.fixture(scope="module")
def models(tmp_path_factory):
    """One model of each sense, trained on noise."""
    folder = tmp_path_factory.mktemp("models")
    rng = np.random.default_rng(1)
    width = len(SOUND_FEATURES) + len(MEASURES)
    noise = {
        "mean": [0.0] * width, "scale": [1.0] * width, "coefficient": [0.0] * width, "intercept": 0.0,
        "usual_mean": [0.0] * len(MEASURES), "usual_sd": [1.0] * len(MEASURES), "low_dB": 0.0, "high_dB": 10.0,
    }  # fmt: skip
    settings = {
        "vision": {"patch_px": PATCH_PX, "limits": {"sharp": 0.0, "blurred": -3.0}},
        "audio": {"rate_hz": RATE_HZ, "window_s": WINDOW_S, "hop_s": HOP_S, "noise": noise},
        "vibration": {},
    }
    for sense, names in (("vision", IMAGE_FEATURES), ("audio", SOUND_FEATURES), ("vibration", ("u", "v"))):
        x = rng.normal(size=(40, len(names))) + np.repeat([0.0, 3.0], 20)[:, None]
        outcome = TerrainClassifier.train(
            x, np.repeat(["a", "b"], 20), np.array([str(index) for index in range(40)]), modality=sense,
            feature_names=names, settings=settings[sense], rng=rng, candidates=("logistic",),
        )  # fmt: skip
        outcome.classifier.save(folder / f"{sense}.skops")
    return folder
