"""Which models a recording is recognised by: a user's own, else those that come with the package, and what is said."""

from __future__ import annotations

import shutil

import numpy as np
import pytest
from bevameter.framework.core.classifier import shipped
from bevameter.framework.core.classifier.classifier import TerrainClassifier
from bevameter.framework.core.classifier.shipped import shipped_model, shipped_models
from bevameter.framework.core.errors import InputError
from bevameter.framework.default_models import check_shipped, find_models, models_of


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


def test_a_synthetic_recording_gets_the_models_of_synthetic_ground_and_no_caution():
    models = find_models(synthetic=True)
    assert models.origins == {name: f"{name}-synthetic" for name in ("vision", "audio", "vibration")}
    assert set(models.synthetic) == set(models.origins)
    assert models.notes["vision"] == (
        "camera: vision-synthetic, which comes with the package, because the recording calls itself synthetic"
    )
    assert models.cautions == {}


def test_another_recording_gets_those_of_real_ground_that_are_defaults_and_is_told_what_they_are_worth(tmp_path):
    models = find_models(None, tmp_path / "site.db")
    defaults = {one.name for one in shipped_models().values() if one.ground == "real" and one.default}
    assert set(models.origins.values()) == defaults >= {"vision-real"}
    assert models.synthetic == ()
    said = models.cautions["vision"]
    real = shipped_model("vision-real")
    assert ", ".join(real.classes) in said
    assert real.measured in said
    assert f"bevameter train vision LABELLED --out {tmp_path / 'site.models' / 'vision.skops'}" in said
    for name in {one.sense for one in shipped_models().values()} - set(models.origins):
        assert (
            f"{name}-real is used only where it is named (--models {name}-real): {shipped_model(f'{name}-real').limits}"
            in models.notes[name]
        )


def test_models_are_found_next_to_the_database(tiny, tmp_path):
    tiny["vision"].save(tmp_path / "site.models" / "vision.skops")
    models = find_models(None, tmp_path / "site.db", synthetic=True)
    assert models.origins["vision"] == str(tmp_path / "site.models" / "vision.skops")
    assert "a model of your own" in models.notes["vision"]
    assert set(models.synthetic) == {"audio", "vibration"}
    assert "vision" not in find_models(None, tmp_path / "site.db").cautions


def test_a_folder_that_is_given_has_precedence_over_the_databases(tiny, tmp_path):
    for folder in ("site.models", "mine"):
        for sense in ("vision", "audio"):
            tiny[sense].save(tmp_path / folder / f"{sense}.skops")
    models = find_models(tmp_path / "mine", tmp_path / "site.db", senses=("vision", "audio"))
    assert models.origins["audio"] == str(tmp_path / "mine" / "audio.skops")
    assert models.synthetic == ()
    assert models.cautions == {}


def test_a_model_of_the_package_is_named_beside_a_folder(tiny, tmp_path):
    tiny["vision"].save(tmp_path / "mine" / "vision.skops")
    models = find_models([tmp_path / "mine", "vibration-real", "audio-synthetic"])
    assert models.origins["vision"] == str(tmp_path / "mine" / "vision.skops")
    assert models.origins["vibration"] == "vibration-real"
    assert models.synthetic == ("audio",)
    assert "synthetic ground only" in models.cautions["audio"]
    assert shipped_model("vibration-real").limits in models.cautions["vibration"]


def test_a_folder_without_models_is_an_error(tmp_path):
    for given in (tmp_path, tmp_path / "missing", "vision-unreal"):
        with pytest.raises(InputError, match=r"no model \(expected a folder with .*, or one of audio-real"):
            find_models(given)


def test_a_damaged_model_of_the_user_is_an_error_and_not_replaced(tiny, tmp_path):
    path = tmp_path / "mine" / "vision.skops"
    path.parent.mkdir()
    path.write_text("no model")
    with pytest.raises(InputError, match=r"vision\.skops"):
        find_models(tmp_path / "mine")
    assert path.read_text() == "no model"


def test_only_what_is_needed_is_read():
    assert find_models(synthetic=True, senses=()).classifiers == {}
    assert list(find_models(synthetic=True, senses=("audio",)).classifiers) == ["audio"]


@pytest.mark.parametrize("name", sorted(shipped_models()))
def test_each_model_of_the_package_loads_and_answers_its_example_as_at_training(name):
    model = shipped_model(name)
    assert check_shipped(model).version == model.version
    score = model.load().report["by_group"]["balanced_accuracy"]
    held_out = f"{score['value']:.3f} ({score['low']:.3f} to {score['high']:.3f})"
    for text in (*model.classes, model.measured[1:], held_out, model.version, "## Not to be trusted for", "CC0"):
        assert text in model.card
    assert ("somewhat optimistic" in model.card) == (model.ground == "real")


def test_what_ships_is_small():
    assert sum(file.stat().st_size for file in shipped.FOLDER.iterdir()) < 5 * 2**20


@pytest.fixture
def copy(tmp_path, monkeypatch):
    """A copy of the package's models that may be spoilt."""
    folder = tmp_path / "trained"
    shutil.copytree(shipped.FOLDER, folder)
    monkeypatch.setattr(shipped, "FOLDER", folder)
    return folder


def test_another_file_than_the_one_that_was_made_is_refused(copy):
    (copy / "vision-synthetic.skops").write_bytes((copy / "vision-real.skops").read_bytes())
    with pytest.raises(InputError, match=r"vision-synthetic\.skops: SHA-256 .* \(expected .*install it again"):
        find_models(synthetic=True)


def test_another_answer_than_at_training_is_found(copy):
    model = shipped_model("vision-synthetic")
    (row,) = model.answers
    changed = {**row, "probabilities": {name: 1 / len(model.classes) for name in model.classes}}
    with pytest.raises(InputError, match=r"another answer to vision-synthetic-example\.png than at training"):
        check_shipped(model.model_copy(update={"answers": (changed,)}))


def test_which_folder_belongs_to_a_database(tmp_path):
    assert models_of(tmp_path / "terrain.db") == tmp_path / "terrain.models"
    assert models_of("sqlite:///some/terrain.db").as_posix() == "some/terrain.models"
    assert models_of("postgresql://user@host/terrain") is None
    assert models_of("sqlite://") is None
    assert models_of(None) is None
