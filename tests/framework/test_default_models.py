"""The folder of a run's models, and the cache of the default models."""

from __future__ import annotations

import numpy as np
import pytest
from bevameter.framework import default_models
from bevameter.framework.core.classifier.classifier import TerrainClassifier
from bevameter.framework.core.errors import InputError
from bevameter.framework.default_models import cached_path, default_model, find_models, models_of


@pytest.fixture(scope="module")
def tiny():
    """A small model of each sense, trained on two separate clouds of features."""

    def train(modality):
        rng = np.random.default_rng(5)
        x = np.concatenate([rng.normal(size=(40, 3)), rng.normal(size=(40, 3)) + 4])
        labels = np.repeat(["gravel", "sand"], 40)
        groups = np.array([str(index) for index in range(80)])
        return TerrainClassifier.train(
            x, labels, groups, modality=modality, feature_names=("a", "b", "c"), settings={}, rng=rng,
            candidates=("logistic",),
        ).classifier  # fmt: skip

    return {"vision": train("vision"), "audio": train("audio")}


@pytest.fixture
def cache(tmp_path, monkeypatch, tiny):
    """An empty cache, and a list of the senses whose default model was trained."""
    monkeypatch.setenv("BEVAMETER_CACHE", str(tmp_path / "cache"))
    trained = []

    def train(sense, *, progress=None):
        trained.append(sense)
        return tiny[sense]

    monkeypatch.setattr(default_models, "train_default", train)
    return trained


def test_a_default_model_is_trained_once_and_then_cached(cache, tmp_path):
    first = default_model("vision")
    assert cache == ["vision"]
    assert cached_path("vision").parent == tmp_path / "cache"
    assert default_model("vision").version == first.version
    assert cache == ["vision"]


def test_a_damaged_cache_is_rebuilt(cache, tiny):
    default_model("audio")
    path = cached_path("audio")
    path.write_bytes(path.read_bytes()[:500])
    assert default_model("audio").version == tiny["audio"].version
    assert cache == ["audio", "audio"]
    assert TerrainClassifier.load(path).version == tiny["audio"].version


def test_a_cached_model_of_another_sense_is_not_used(cache, tiny):
    path = cached_path("audio")
    path.parent.mkdir(parents=True)
    tiny["vision"].save(path)
    assert default_model("audio").modality == "audio"
    assert cache == ["audio"]


def test_an_interrupted_training_leaves_no_model(cache, monkeypatch):
    def interrupted(sense, *, progress=None):
        raise KeyboardInterrupt

    monkeypatch.setattr(default_models, "train_default", interrupted)
    with pytest.raises(KeyboardInterrupt):
        default_model("vision")
    assert not cached_path("vision").exists()


def test_models_are_found_next_to_the_database(cache, tiny, tmp_path):
    database = tmp_path / "site.db"
    tiny["vision"].save(tmp_path / "site.models" / "vision.skops")
    models = find_models(None, database)
    assert models.origins["vision"] == str(tmp_path / "site.models" / "vision.skops")
    assert models.synthetic == ("audio",)
    assert "audio" in models.warnings[0]
    assert "vision" not in models.warnings[0]
    assert "synthetic ground only" in models.warnings[0]


def test_a_folder_that_is_given_has_precedence_over_the_databases(cache, tiny, tmp_path):
    for folder in ("site.models", "mine"):
        for sense in ("vision", "audio"):
            tiny[sense].save(tmp_path / folder / f"{sense}.skops")
    models = find_models(tmp_path / "mine", tmp_path / "site.db")
    assert models.origins["audio"] == str(tmp_path / "mine" / "audio.skops")
    assert models.synthetic == ()
    assert models.warnings == ()
    assert cache == []


def test_a_folder_without_models_is_an_error(cache, tmp_path):
    with pytest.raises(InputError, match="no model"):
        find_models(tmp_path, None)
    with pytest.raises(InputError, match="no model"):
        find_models(tmp_path / "missing", None)
    assert cache == []


def test_a_damaged_model_of_the_user_is_an_error_and_not_replaced(cache, tiny, tmp_path):
    path = tmp_path / "mine" / "vision.skops"
    path.parent.mkdir()
    path.write_text("no model")
    with pytest.raises(InputError, match=r"vision\.skops"):
        find_models(tmp_path / "mine", None)
    assert path.read_text() == "no model"


def test_only_what_is_needed_is_trained(cache):
    assert find_models(None, None, senses=()).classifiers == {}
    assert list(find_models(None, None, senses=("audio",)).classifiers) == ["audio"]
    assert cache == ["audio"]


def test_which_folder_belongs_to_a_database(tmp_path):
    assert models_of(tmp_path / "terrain.db") == tmp_path / "terrain.models"
    assert models_of("sqlite:///some/terrain.db").as_posix() == "some/terrain.models"
    assert models_of("postgresql://user@host/terrain") is None
    assert models_of("sqlite://") is None
    assert models_of(None) is None
