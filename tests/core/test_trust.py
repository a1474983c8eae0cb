"""Learnt trust: the weight of an item by its quality is what held-out groups say, and few groups say little."""

from dataclasses import replace

import numpy as np
import pytest
from bevameter.framework.core.classifier.classifier import TerrainClassifier
from bevameter.framework.core.classifier.trust import Trust, learn_trust


def answers(rng, groups, exponent, n_classes=4):
    """Stated probabilities whose truth follows their `exponent(quality)`-th power, eight items a group."""
    n = 8 * groups
    quality = rng.uniform(0.01, 1.0, n)
    logs = rng.normal(scale=1.5, size=(n, n_classes))
    right = exponent(quality)[:, None] * logs
    y = np.argmax(right + rng.gumbel(size=right.shape), axis=1)
    stated = np.exp(logs)
    return stated / stated.sum(axis=1, keepdims=True), y, np.arange(n) // 8, quality, np.ones(n)


def test_calibrated_answers_keep_their_weight_at_every_quality(rng):
    trust, _ = learn_trust(*answers(rng, 400, np.ones_like))
    assert (trust.at(np.linspace(0.1, 1.0, 10)) > 0.85).all()


def test_answers_that_claim_too_much_of_bad_input_weigh_less(rng):
    trust, table = learn_trust(*answers(rng, 400, lambda q: np.clip(0.2 + q, 0.2, 1.0)))
    np.testing.assert_allclose(trust.at(np.array([0.15, 0.5, 0.95])), [0.35, 0.7, 1.0], atol=0.13)
    assert table[0]["said"] > table[0]["was_right"] + 0.1
    assert sum(row["n"] for row in table) == 3200


def test_few_groups_leave_the_weight_nearly_at_one(rng):
    trust, _ = learn_trust(*answers(rng, 12, lambda q: np.full_like(q, 0.5)))
    many, _ = learn_trust(*answers(rng, 400, lambda q: np.full_like(q, 0.5)))
    half = np.array([0.5])
    assert many.at(half) < 0.6 < trust.at(half)
    assert learn_trust(*answers(rng, 5, np.ones_like))[0] is None


def test_what_was_not_measured_weighs_less_down_to_nothing():
    trust = Trust((0.4, 1.0), (0.8, 1.0), (10, 10))
    np.testing.assert_allclose(trust.at(np.array([0.0, 0.2, 0.4, 0.7, 1.0])), [0.0, 0.4, 0.8, 0.9, 1.0])
    with pytest.raises(ValueError, match="falls"):
        Trust((0.4, 1.0), (0.9, 0.8), (10, 10))


def test_evidence_has_the_learnt_weight_as_its_quality(rng, tmp_path):
    """Of rows of low quality, which are noisy, the classifier claims too much; a file keeps what was learnt of that."""
    n, k = 720, 3
    y, group = np.arange(n) % k, np.arange(n) // 12
    quality = np.where(rng.random(n) < 0.5, 0.3, 1.0)
    x = np.eye(k)[y] * 2 + rng.normal(size=(n, k)) * np.where(quality < 1, 3.0, 0.7)[:, None]
    outcome = TerrainClassifier.train(
        x, y.astype(str), [f"{a}.{b}" for a, b in zip(group, y, strict=True)], modality="test", feature_names="abc",
        settings={}, rng=rng, candidates=("logistic",), quality=quality,
    )  # fmt: skip
    model, table = outcome.classifier, outcome.report["trust"]
    assert table[-1]["was_right"] > table[0]["was_right"] + 0.2
    given = model.evidence(x, quality)
    learnt = model.fitted.trust.at(quality)
    assert learnt.min() < 0.8
    # All but what is near the gate.
    assert np.mean(np.abs(given.quality - learnt)[~given.unknown] < 1e-9) > 0.95
    model.save(tmp_path / "m.skops")
    again = TerrainClassifier.load(tmp_path / "m.skops")
    assert (again.fitted.trust, again.version) == (model.fitted.trust, model.version)
    raw = replace(model, fitted=replace(model.fitted, trust=None)).evidence(x, quality)
    np.testing.assert_allclose(model.fitted.trust.at(raw.quality), given.quality)
