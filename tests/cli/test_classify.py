"""What `bevameter classify` answers to bad input."""

from __future__ import annotations

import numpy as np
import pytest
from bevameter.framework.cli.main import app
from bevameter.framework.cli.results import print_classified
from bevameter.framework.core.classifier.classifier import TerrainClassifier
from typer.testing import CliRunner


@pytest.fixture(scope="module")
def vibration_model(tmp_path_factory):
    """A model of another sense."""
    rng = np.random.default_rng(1)
    x = np.concatenate([rng.normal(size=(30, 2)), rng.normal(size=(30, 2)) + 3])
    outcome = TerrainClassifier.train(
        x, np.repeat(["a", "b"], 30), np.array([str(index) for index in range(60)]), modality="vibration",
        feature_names=("u", "v"), settings={}, rng=rng, candidates=("logistic",),
    )  # fmt: skip
    path = tmp_path_factory.mktemp("models") / "vibration.skops"
    outcome.classifier.save(path)
    return path


def bad(out, *arguments):
    result = CliRunner().invoke(app, [*map(str, arguments), "--json", str(out)])
    assert result.exit_code == 2, result.output
    assert len(result.stderr.splitlines()) == 1
    assert not out.exists()
    return result.stderr


def test_a_model_of_another_sense_is_refused(vibration_model, tmp_path):
    picture = tmp_path / "x.png"
    picture.write_bytes(b"")
    said = bad(tmp_path / "o.json", "classify", "vision", picture, "--model", vibration_model)
    assert "a model for vibration" in said
    assert "vibration.skops" in said


def test_a_missing_or_damaged_model_is_one_line(tmp_path):
    assert "no such file" in bad(tmp_path / "o.json", "classify", "audio", "x.wav", "--model", tmp_path / "m.skops")
    (tmp_path / "m.skops").write_bytes(b"PK\x03\x04 nonsense")
    assert "m.skops" in bad(tmp_path / "o.json", "classify", "audio", "x.wav", "--model", tmp_path / "m.skops")


def test_reasons_of_one_kind_are_one(capsys):
    far = [f"unlike anything trained on (distance {d}.0, gate 1.7)" for d in (4, 5, 6)]
    row = {"file": "x.png", "class": "unknown", "unknown": True, "probabilities": {}, "quality": 0.0}
    print_classified([row | {"reasons": ["dark", *far]}, row | {"reasons": far[:1]}])
    said = capsys.readouterr().out
    assert said.count("unlike anything") == 2
    assert said.count("(distance 4.0, gate 1.7)") == 1
