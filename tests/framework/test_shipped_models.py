"""The models that come with the package are those that `make models` makes."""

from __future__ import annotations

import json

import numpy as np
import pytest
import shipped_models
from bevameter.framework.core.classifier import shipped
from bevameter.framework.core.classifier.classifier import TerrainClassifier
from bevameter.framework.core.classifier.shipped import shipped_model
from bevameter.vision.classify import image_evidence
from measured import read
from model_cards import table

TOLERANCE = 1e-9
"""Most that a probability may differ from the shipped model's [-]; on the machine that made it none does."""


def made_again(name, tmp_path, *arguments):
    shipped_models.main([name, "--out", str(tmp_path), *arguments])
    (entry,) = json.loads((tmp_path / "index.json").read_text()).values()
    made, ours = TerrainClassifier.load(tmp_path / f"{name}.skops"), shipped_model(name).load()
    d = len(ours.feature_names)
    rows = ours.fitted.mean + ours.fitted.scale * np.random.default_rng(1).normal(size=(200, d))
    one, other = (each.evidence(rows, np.ones(200)) for each in (made, ours))
    np.testing.assert_allclose(one.probabilities, other.probabilities, rtol=0, atol=TOLERANCE)
    np.testing.assert_array_equal(one.unknown, other.unknown)
    listed = shipped_model(name)
    assert (entry["measured"], entry["limits"], entry["default"]) == (listed.measured, listed.limits, listed.default)


def test_the_documentation_gives_the_figures_of_the_training():
    index = {
        name: {"measured": each.measured, "limits": each.limits, "default": each.default}
        for name, each in shipped.shipped_models().items()
    }
    assert sorted(table(index)) == sorted(read("models-shipped").rows)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["audio-synthetic", "vibration-synthetic", "vision-synthetic"])
def test_models_of_synthetic_ground_are_what_the_command_makes(name, tmp_path):
    made_again(name, tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["audio-real", "vibration-real", "vision-real"])
def test_models_of_real_ground_are_what_the_command_makes(name, tmp_path, shared_data):
    made_again(name, tmp_path, "--data", str(shared_data))


def test_data_that_are_not_there_are_named_before_anything_is_trained(tmp_path, capsys):
    with pytest.raises(SystemExit):
        shipped_models.main(["vision-real", "--data", str(tmp_path / "nowhere"), "--out", str(tmp_path / "out")])
    assert "nowhere is not there" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(("name", "channels"), [("vision-real", 1), ("vision-real", 3), ("vision-synthetic", 3)])
def test_noise_alone_is_no_ground(name, channels):
    rng = np.random.default_rng(3)
    noise = [rng.normal(128, sd, (480, 640, channels)) * np.ones(3) for sd in (20, 40, 80)]
    evidence = image_evidence(shipped_model(name).load(), [np.clip(each, 0, 255).astype(np.uint8) for each in noise])
    assert evidence.unknown.all()
    assert all("noise" in reasons for reasons in evidence.reasons)
