"""What camera and microphone state on drives whose truth is known; on many drives it is a study
(`tests/studies/perception_on_drives.py`).
"""

from __future__ import annotations

from dataclasses import replace

import pytest
from bevameter.framework.core.classifier.classifier import TerrainClassifier
from bevameter.framework.core.errors import InputError
from bevameter.framework.scenario.plan import make_plan
from bevameter.framework.scenario.presets import PRESETS
from drive_scores import judge_camera, judge_microphone


@pytest.fixture(scope="module")
def few_sites(small_models):
    """Default models of a sixth of the usual number of sites."""
    return {sense: TerrainClassifier.load(small_models / f"{sense}.skops", sense) for sense in ("vision", "audio")}


@pytest.fixture(scope="module")
def drive():
    """A picture a second: nearly all are looked at, and few more are painted than that."""
    return make_plan(replace(PRESETS["rover4"], camera_rate_Hz=1.0), 105, 45.0)


def test_the_camera_names_the_ground_ahead(few_sites, drive):
    judged = judge_camera(drive, few_sites["vision"])
    score = judged.scores()
    assert score["n"] > 200
    assert score["known"] > 0.6
    assert score["balanced_accuracy"] > 0.7  # six classes to choose from: chance is 0.17
    assert score["sure_right"] > 0.8


def test_the_microphone_names_the_ground_below(few_sites, drive):
    score = judge_microphone(drive, few_sites["audio"]).scores()
    assert score["n"] > 80
    assert score["known"] > 0.6
    assert score["balanced_accuracy"] > 0.7
    assert score["sure_right"] > 0.8


def test_faulty_sensors_say_nothing(few_sites):
    plan = make_plan(PRESETS["short"], 103, 54.0)
    heard = judge_microphone(plan, few_sites["audio"])
    for kind in ("wind", "engine", "microphone_dropout"):
        rows = heard.fault == kind
        assert rows.sum() >= 5, kind
        # Windows at its ends hold only a little of it.
        assert heard.scores(rows)["known"] < 0.35, kind
        assert heard.evidence.quality[rows].mean() < 0.15, kind
    assert heard.scores()["known"] > 0.6


def test_a_drive_without_the_sense_is_an_error(few_sites):
    plan = make_plan(PRESETS["testbed"], 1, 10.0)
    with pytest.raises(InputError, match="camera"):
        judge_camera(plan, few_sites["vision"])
    with pytest.raises(InputError, match="microphone"):
        judge_microphone(plan, few_sites["audio"])
