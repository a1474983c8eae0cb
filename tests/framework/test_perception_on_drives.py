"""What camera and microphone state on drives whose truth is known, and whether they are as right as they say.

Development looked at seeds 1 and 2 of `demo`, `short` and `rover4`; the seeds here took no part in it.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from bevameter.framework.core.classifier.classifier import TerrainClassifier
from bevameter.framework.core.errors import InputError
from bevameter.framework.default_models import default_model
from bevameter.framework.scenario.judge import judge_camera, judge_microphone
from bevameter.framework.scenario.plan import make_plan
from bevameter.framework.scenario.presets import PRESETS

HELD_OUT = (("demo", 101), ("demo", 102), ("short", 103), ("short", 104), ("rover4", 105), ("rover4", 106))


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


@pytest.mark.slow
def test_default_models_on_unseen_drives():
    """The models that a first run trains, on six drives; figures are printed with ``-s``."""
    models = {sense: default_model(sense) for sense in ("vision", "audio")}
    totals: dict[str, list[dict[str, float]]] = {"camera": [], "microphone": []}
    for name, seed in HELD_OUT:
        plan = make_plan(PRESETS[name], seed)
        for sense, judged in (
            ("camera", judge_camera(plan, models["vision"])),
            ("microphone", judge_microphone(plan, models["audio"])),
        ):
            score = judged.scores()
            totals[sense].append(score)
            print(f"{name} {seed} {sense}: " + ", ".join(f"{key} {value:.3f}" for key, value in score.items()))
            if sense == "microphone" and (judged.fault == "engine").any():
                engine = judged.scores(judged.fault == "engine")
                print(f"   engine: n {engine['n']:.0f}, open {engine['known']:.2f}")
                assert engine["known"] < 0.15
    for sense, scores in totals.items():
        weight = [score["n"] * score["known"] for score in scores]
        mean = {key: np.average([score[key] for score in scores], weights=weight) for key in scores[0]}
        print(f"{sense} pooled: " + ", ".join(f"{key} {value:.3f}" for key, value in mean.items()))
        assert mean["accuracy"] > 0.9
        assert mean["sure_right"] > 0.95
        assert abs(mean["said"] - mean["accuracy"]) < 0.06
