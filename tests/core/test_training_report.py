"""The closer look that a training report takes: learning curve, worst mistakes, risk against coverage, the page."""

import json
from pathlib import Path

import numpy as np
import pytest
from bevameter.framework.core.classifier.classifier import TerrainClassifier
from bevameter.framework.core.classifier.labelled import LabelledFile
from bevameter.framework.core.classifier.learning import curve_of
from bevameter.framework.core.classifier.page import report_html
from bevameter.framework.core.classifier.scores import selective_error


def power_law(groups, power):
    return 0.4 * (np.asarray(groups) / 8) ** -power


@pytest.mark.parametrize("power", [0.0, 0.3, 0.6])
def test_the_interval_of_what_more_groups_bring_holds_the_truth(rng, power):
    """Groups held out differ in how hard they are, and each model in how lucky its training groups were."""
    counts = np.tile([8, 16, 32], (5, 1))
    truth = power_law(40, power) - power_law(80, power)
    held, width = [], []
    for _ in range(300):
        hard = rng.lognormal(-0.08, 0.4, (5, 8, 1))
        luck = rng.lognormal(-0.005, 0.1, (5, 1, 3))
        wrong = rng.binomial(12, np.minimum(power_law(counts, power)[:, None] * hard * luck, 0.95)).sum(axis=1)
        gain = curve_of(np.column_stack([wrong, np.full(5, 96)]), counts, 40).gains[-1]
        held.append(gain.low <= truth <= gain.high)
        width.append(gain.high - gain.low)
    assert np.mean(held) >= 0.92
    assert np.median(width) < 0.25


@pytest.fixture(scope="module")
def outcome():
    """Twenty groups of each of two classes; one group of the first is labelled as the second."""
    rng = np.random.default_rng(5)
    n, each = 40, 6
    truth = np.arange(n) % 2
    x = np.repeat(truth[:, None] * [2.0, 0.0, 0.0] + rng.normal(scale=0.4, size=(n, 3)), each, axis=0)
    labels = np.array(["<b>sand", "snow"])[truth]
    labels[0] = "snow"
    samples = [LabelledFile(Path(f"{i}.png"), str(labels[i]), f"group {i}") for i in range(n)]
    owner = np.repeat(np.arange(n), each)
    return TerrainClassifier.train(
        x + rng.normal(scale=0.7, size=x.shape), labels[owner], [samples[i].group for i in owner], modality="test",
        feature_names="abc", settings={}, rng=rng, candidates=("logistic",), quality=rng.uniform(0.2, 1.0, n * each),
        samples=samples, sample_of=owner,
    )  # fmt: skip


def test_a_wrong_label_is_the_worst_mistake(outcome):
    mistakes = outcome.material.mistakes(outcome.report["classes"])
    assert (mistakes[0].sample.file.name, mistakes[0].said) == ("0.png", "<b>sand")
    assert len({mistake.sample.group for mistake in mistakes}) == len(mistakes)
    assert all(mistake.said != mistake.sample.class_name for mistake in mistakes)


def test_the_learning_curve_leaves_the_model_alone_and_needs_groups(outcome):
    version = outcome.classifier.version
    curve = outcome.material.learning_curve(np.random.default_rng(0))
    assert curve.total == 40
    np.testing.assert_allclose(curve.groups, [8, 16, 32], atol=2)
    assert outcome.classifier.version == version
    few = TerrainClassifier.train(
        np.random.default_rng(1).normal(size=(60, 2)), ["a", "b"] * 30, [f"{i % 2}{i % 6}" for i in range(60)],
        modality="test", feature_names="ab", settings={}, rng=np.random.default_rng(0), candidates=("logistic",),
    )  # fmt: skip
    assert few.material.learning_curve(np.random.default_rng(0)) is None


def test_the_page_shows_everything_and_escapes_names(outcome):
    report = json.loads(json.dumps(outcome.report, allow_nan=False))
    material = outcome.material
    learning, mistakes = material.learning_curve(np.random.default_rng(0)), material.mistakes(report["classes"])
    page = report_html(
        report, learning=learning, mistakes=mistakes, excerpt=lambda sample: f"<i>{sample.file.stem}</i>"
    )
    share = report["gate"]["held_out_rejection"]
    assert share > 0  # the scores say what became of these
    for words in (
        "40 more groups", "percentage points", "Worst mistakes", "<i>0</i>", "Trust by quality", "share answered",
        "stated", f"{share:.1%} of the items as they came are answered &#x27;unknown&#x27;",
    ):  # fmt: skip
        assert words in page
    assert "<b>sand" not in page
    assert "&lt;b&gt;sand" in page
    assert "http" not in page


def test_one_item_left_out_is_told_in_the_singular():
    x = np.random.default_rng(1).normal(size=(60, 2))
    x[0, 0] = np.nan
    report = TerrainClassifier.train(
        x, ["a", "b"] * 30, [str(i % 12) for i in range(60)], modality="test", feature_names="ab", settings={},
        rng=np.random.default_rng(0), candidates=("logistic",),
    ).report  # fmt: skip
    assert "1 item had features that are not finite and was left out." in report["warnings"]


def test_the_surest_answers_are_wrong_less_often(rng):
    p = rng.uniform(0.5, 1.0, 4000)
    truth = (rng.random(4000) > p).astype(int)
    both = np.column_stack([p, 1 - p])
    full, most = (selective_error(both, truth, np.ones(4000), share) for share in (1.0, 0.5))
    assert full == pytest.approx(0.25, abs=0.03)
    assert most == pytest.approx(0.125, abs=0.03)
    ties = np.full((4000, 2), 0.5)
    assert selective_error(ties, truth, np.ones(4000), 0.1) == selective_error(ties, truth, np.ones(4000), 1.0)
