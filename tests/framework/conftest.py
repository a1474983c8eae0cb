"""What the tests of the main job share: a short synthetic drive and small models of synthetic ground."""

from __future__ import annotations

import pytest
from bevameter.audio import train as audio_train
from bevameter.framework import default_models
from bevameter.framework.scenario.write import write_scenario
from bevameter.vision import train as vision_train


@pytest.fixture(scope="session")
def short_drive(tmp_path_factory):
    """The `short` scenario: 70 s over sand, loam and grass, each fault once."""
    return write_scenario("short", tmp_path_factory.mktemp("drive") / "short", seed=4)


@pytest.fixture(scope="session")
def small_models(tmp_path_factory):
    """The default models from a tenth of their material and one kind of classifier: a folder for --models."""
    folder = tmp_path_factory.mktemp("models")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(default_models, "_SAMPLES_PER_CLASS", {"vision": 12, "audio": 9})
        patch.setattr(vision_train, "CANDIDATES", ("logistic",))
        patch.setattr(vision_train, "ROWS_WANTED", 1500)
        patch.setattr(audio_train, "CANDIDATES", ("logistic",))
        patch.setattr(audio_train, "TARGET_ROWS", 1000)
        for sense in default_models.SENSES:
            default_models._train(sense, None).save(folder / f"{sense}.skops")
    return folder
