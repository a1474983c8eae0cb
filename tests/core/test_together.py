"""What many items of one thing say together: things that are bad as a whole are not trusted as their items are."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from bevameter.framework.core.classifier.classifier import TerrainClassifier
from bevameter.framework.core.classifier.scores import calibration_error
from bevameter.framework.core.classifier.together import Wholes

K, ITEMS = 3, 8


def things(rng, groups, shared):
    """Items of things, `ITEMS` each: noise of their own, and such as all items of a thing share; classes and units."""
    y = np.arange(groups) % K
    centre = 2.0 * np.eye(K)[y] + shared[:, None] * rng.normal(size=(groups, K))
    unit = np.repeat(np.arange(groups), ITEMS)
    return centre[unit] + rng.normal(size=(len(unit), K)), y, unit


@pytest.fixture(scope="module")
def outcome():
    rng = np.random.default_rng(4)
    groups = 150
    rows, y, unit = things(rng, groups, np.full(groups, 0.3))
    bad = np.full(groups, 2.5)
    again, _, _ = things(rng, groups, bad)
    names = np.array([f"thing {index}" for index in range(groups)])
    quality = np.ones(len(rows))
    wholes = Wholes(
        np.concatenate([rows, again]), np.concatenate([quality, 0.4 * quality]), np.concatenate([unit, groups + unit]),
        np.tile(y.astype(str), 2), np.tile(names, 2), np.arange(2 * groups) >= groups, 0.4,
    )  # fmt: skip
    return TerrainClassifier.train(
        rows, y.astype(str)[unit], names[unit], modality="test", feature_names="abc", settings={}, rng=rng,
        candidates=("logistic",), wholes=wholes,
    )  # fmt: skip


def test_things_that_are_bad_as_a_whole_claim_less_and_good_ones_as_much(outcome):
    model, rng = outcome.classifier, np.random.default_rng(9)
    without = replace(model, fitted=replace(model.fitted, together=None))
    for shared, quality, gain in ((2.5, 0.4, 0.6), (0.3, 1.0, 1.3)):
        rows, y, unit = things(rng, 600, np.full(600, shared))
        errors = []
        for each in (without, model):
            said = each.pool(each.evidence(rows, np.full(len(rows), quality)), unit)
            open_ = ~said.unknown
            errors.append(calibration_error(said.probabilities[open_], y[open_], np.ones(open_.sum()))[0])
        assert errors[1] < gain * errors[0] + 0.02
        if gain < 1:
            assert errors[0] > 0.1


def test_the_report_says_what_it_gains_on_groups_that_it_was_not_learnt_on(outcome):
    learnt = outcome.report["together"]
    assert learnt["degraded"]["calibration_error"] < 0.7 * learnt["degraded"]["calibration_error_without"]
    assert learnt["as_it_came"]["n"] > 100
    for part in (learnt["as_it_came"], learnt["degraded"]):
        assert 0.0 < part["balanced_accuracy"]["low"] < part["balanced_accuracy"]["value"] <= 1.0
    assert sum(row["n"] for row in learnt["table"]) == learnt["as_it_came"]["n"] + learnt["degraded"]["n"]


def test_a_file_keeps_it(outcome, tmp_path):
    outcome.classifier.save(tmp_path / "m.skops")
    again = TerrainClassifier.load(tmp_path / "m.skops")
    assert again.fitted.together == outcome.classifier.fitted.together is not None
    assert again.version == outcome.classifier.version
