"""The classifier base: honest scores, calibration, gate, what it refuses."""

import json

import numpy as np
import pytest
from bevameter.framework.core.classifier import fitting
from bevameter.framework.core.classifier.calibration import joined
from bevameter.framework.core.classifier.classifier import TerrainClassifier
from bevameter.framework.core.classifier.fitting import row_weights
from bevameter.framework.core.classifier.gate import Gate
from bevameter.framework.core.classifier.page import report_html
from bevameter.framework.core.errors import InputError
from bevameter.framework.core.evidence import ClassEvidence

D = 12
NAMES = tuple(f"f{i}" for i in range(D))


@pytest.fixture(scope="module", autouse=True)
def small_forests():
    """Forests of a few trees: how the base treats them is tested here, not how well they do."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(fitting, "TREES", 8)
        yield


def blobs(rng, *, classes=3, groups=6, rows=12, shift=0.6, distance=2.0):
    """Rows that share an offset within each group, as windows of one recording do."""
    x, y, g = [], [], []
    for c in range(classes):
        for j in range(groups):
            centre = rng.normal(scale=shift, size=D)
            centre[c] += distance
            x.append(centre + rng.normal(size=(rows, D)))
            y += [f"class{c}"] * rows
            g += [f"site{c}.{j}"] * rows
    return np.concatenate(x), np.array(y), np.array(g)


def train(x, y, g, seed=0, **more):
    more = {"candidates": ("logistic",), "modality": "test", "feature_names": NAMES, "settings": {"a": 1}} | more
    return TerrainClassifier.train(x, y, g, rng=np.random.default_rng(seed), **more)


@pytest.fixture(scope="module")
def outcome():
    return train(*blobs(np.random.default_rng(1)), candidates=("logistic", "trees"))


def test_separable_classes_are_learnt(outcome, rng):
    x, y, _ = blobs(rng)
    evidence = outcome.classifier.evidence(x, np.ones(len(x)))
    assert np.mean(np.array(evidence.labels()) == y) > 0.7
    np.testing.assert_allclose(evidence.probabilities.sum(axis=1), 1.0)
    assert (evidence.probabilities > 0).all()


def test_reported_score_is_of_unseen_groups(outcome, rng):
    """The held-out score agrees with fresh groups, and its interval holds the score they give."""
    x, y, _ = blobs(rng, groups=40)
    evidence = outcome.classifier.evidence(x, np.ones(len(x)))
    fresh = np.mean(np.array(evidence.classes)[evidence.probabilities.argmax(axis=1)] == y)
    score = outcome.report["accuracy"]
    assert score["low"] - 0.08 < fresh < score["high"] + 0.08
    assert score["low"] <= score["value"] <= score["high"]


def test_degraded_copies_are_scored_apart(rng):
    """Noisy copies are trained on, but the main score is that of the original items."""
    x, y, g = blobs(rng, groups=15, shift=0.3)
    drowned = x + rng.normal(scale=4.0, size=x.shape)
    made = np.arange(2 * len(x)) >= len(x)
    report = train(np.vstack([x, drowned]), np.tile(y, 2), np.tile(g, 2), degraded=made).report
    assert (report["n"], report["n_degraded"], report["n_scored"]) == (2 * len(x), len(x), len(x))
    assert report["degraded"]["n"] == len(x)
    assert report["by_group"]["n"] == 45
    assert report["balanced_accuracy"]["value"] > 0.75
    assert report["degraded"]["balanced_accuracy"]["value"] < report["balanced_accuracy"]["value"] - 0.15
    page = report_html(report)
    assert "Per degraded item" in page
    assert f"{2 * len(x)} items ({len(x)} of them degraded copies)" in page
    assert "degraded" not in train(x, y, g).report


def test_few_groups_make_no_model_sure_of_everything(rng):
    """Two groups of each of two separate classes: held-out groups are all right, but there are only four."""
    x, y, g = blobs(rng, classes=2, groups=2, distance=6.0)
    trained = train(x, y, g, candidates=("logistic", "trees"))
    report = trained.report
    assert report["accuracy"]["value"] > 0.95
    assert report["accuracy"]["low"] < 0.5
    assert report["temperature"] > 0.8
    assert report["correlation_within_groups"] > 0.6
    between = (x[y == "class0"] + x[y == "class1"]) / 2
    evidence = trained.classifier.evidence(between, np.ones(len(between)))
    assert (evidence.probabilities.max(axis=1) > 0.9).mean() < 0.2


def test_many_groups_outweigh_the_prior_of_the_temperature(rng):
    """Labels are wrong at random in a third of the groups; the prior favours a temperature of 1."""
    x, y, g = blobs(rng, groups=40, rows=4, shift=0.1, distance=8.0)
    wrong = np.isin(g, rng.permutation(np.unique(g))[:40])
    shifted = np.char.add("class", ((np.char.replace(y, "class", "").astype(int) + 1) % 3).astype(str))
    report = train(x, np.where(wrong, shifted, y), g, candidates=("trees",)).report
    assert report["calibration_error"] < 0.08


def test_labels_without_meaning_score_as_chance(rng):
    """Groups that the features identify, with labels at random: leaking a group over a split would score high."""
    groups = np.repeat(np.arange(24), 15)
    x = rng.normal(scale=3.0, size=(24, D))[groups] + 0.1 * rng.normal(size=(len(groups), D))
    labels = np.array(["a", "b", "c"])[np.arange(24) % 3][groups]
    report = train(x, labels, groups.astype(str), candidates=("logistic", "trees")).report
    assert report["balanced_accuracy"]["value"] < 0.6
    assert report["log_loss"] > 0.9


def test_probabilities_are_calibrated_per_item_and_per_group(rng):
    x, y, g = blobs(rng, groups=20, rows=15, shift=0.8)
    report = train(x, y, g).report
    assert report["calibration_error"] < 0.08
    assert report["by_group"]["calibration_error"] < 0.15
    assert report["by_group"]["accuracy"]["value"] >= report["accuracy"]["value"]


def test_copies_add_nothing_when_pooled():
    one = np.array([[0.7, 0.2, 0.1]])
    many = np.repeat(one, 50, axis=0)
    unit = np.zeros(50, dtype=int)
    copies = joined(many, unit, np.ones(50), 1, correlation=1.0)
    independent = joined(many, unit, np.ones(50), 1, correlation=0.0)
    np.testing.assert_allclose(copies, 0.99 * one + 0.01 / 3, atol=1e-9)
    assert independent[0, 0] > 0.98
    np.testing.assert_allclose(joined(many, unit, np.zeros(50), 2, 0.3), np.full((2, 3), 1 / 3))


def test_pool_joins_known_items_only(outcome, rng):
    model = outcome.classifier
    x, _, _ = blobs(rng, classes=1, groups=1, rows=8)
    evidence = model.evidence(np.vstack([x, np.full((3, D), np.nan)]), np.ones(11))
    joined = model.pool(evidence, np.array([0] * 8 + [0] + [1] * 2), 3)
    assert joined.labels()[0] == "class0"
    assert joined.unknown.tolist() == [False, True, True]
    assert "features are not finite" in joined.reasons[1]
    assert joined.reasons[2] == ("nothing to go by",)
    assert joined.quality[0] < evidence.quality[:8].mean()


def test_rows_that_are_not_finite_are_unknown(outcome, rng):
    x, _, _ = blobs(rng, classes=1, groups=1, rows=4)
    x[0] = np.nan
    x[1, 3] = np.inf
    evidence = outcome.classifier.evidence(x, np.ones(4), [("loud",), (), (), ()])
    assert evidence.unknown.tolist() == [True, True, False, False]
    assert evidence.reasons[0] == ("loud", "features are not finite")
    np.testing.assert_allclose(evidence.probabilities[:2], 1 / 3)
    assert (evidence.quality[:2] == 0).all()


def test_what_is_unlike_training_is_unknown(outcome, rng):
    far = rng.normal(size=(50, D)) * 12
    evidence = outcome.classifier.evidence(far, np.ones(50))
    assert evidence.unknown.mean() > 0.95
    assert "unlike anything trained on" in next(r for r in evidence.reasons if r)[0]
    huge = outcome.classifier.evidence(np.full((1, D), 1e300), np.ones(1))
    assert huge.unknown[0]


def test_quality_that_falls_near_the_gate_has_a_reason(outcome, rng):
    """From well inside to far outside: once the gate lowers quality by a fifth, a reason names it."""
    x, _, _ = blobs(rng, classes=1, groups=1, rows=1)
    evidence = outcome.classifier.evidence(x + np.linspace(0, 12, 400)[:, None], np.ones(400))
    close = ~evidence.unknown & (evidence.quality < 0.8)
    assert close.any()
    for index in range(400):
        named = any("nearly unlike anything trained on" in text for text in evidence.reasons[index])
        assert named == close[index]


def test_gate_keeps_its_false_rejection_rate_on_fresh_groups(rng):
    x, y, g = blobs(rng, groups=25)
    trained = train(x, y, g)
    fresh, _, _ = blobs(rng, groups=25)
    evidence = trained.classifier.evidence(fresh, np.ones(len(fresh)))
    assert evidence.unknown.mean() < 0.06
    assert trained.report["gate"]["held_out_rejection"] < 0.06


def test_the_report_states_how_ground_of_no_class_is_classified(rng):
    far = train(*blobs(rng, distance=25.0)).report
    assert far["gate"]["other_ground_rejection"] > 0.9
    assert not any("no class" in text for text in far["warnings"])
    near = train(*blobs(rng, distance=1.0)).report
    assert near["gate"]["other_ground_rejection"] < 0.2
    assert any("mostly answered as one of these" in text for text in near["warnings"])
    assert "each left out in turn" in report_html(near)
    for few in (blobs(rng, classes=2), blobs(rng, groups=3, distance=25.0)):
        assert any("turned away is untested" in text for text in train(*few).report["warnings"])


def test_gate_distance_is_mahalanobis(rng):
    z = rng.normal(size=(4000, 2)) @ np.array([[1.0, 0.5], [0.0, 0.4]])
    gate = Gate.fit(z, np.zeros(len(z), dtype=int), np.ones(len(z)), 1)
    point = np.array([[0.7, -1.1]])
    rest = point - z.mean(axis=0)
    expected = np.sqrt((rest @ np.linalg.inv(np.cov(z.T)) @ rest.T).item() / 2)
    assert gate.distance(point)[0] == pytest.approx(expected, rel=0.02)


def test_a_gate_of_blocks_looks_at_the_worst_of_them(rng):
    z, one, weight = rng.normal(size=(2000, 21)), np.zeros(2000, dtype=int), np.ones(2000)
    odd = np.zeros((1, 21))
    odd[0, 20] = 6.0  # one column of its own, that twenty others would hide
    whole, blocks = (Gate.fit(z, one, weight, 1, ends) for ends in ((), (20, 21)))
    assert whole.distance(odd)[0] < np.quantile(whole.distance(z), 0.999)
    assert blocks.distance(odd)[0] > 2.0
    assert np.quantile(Gate.fit(z, one, weight, 1, (20,)).distance(z), 0.5) == pytest.approx(1.0, abs=0.05)
    for block in (slice(0, 20), slice(20, 21)):
        alone = np.zeros_like(z)
        alone[:, block] = z[:, block]
        assert np.quantile(blocks.distance(alone), 0.98) == pytest.approx(1.0, abs=0.05)
    alike = np.repeat(z[:1], 4, axis=0)
    assert np.isfinite(Gate.fit(alike, one[:4], weight[:4], 1, (20, 21)).distance(alike)).all()


def test_poor_quality_is_passed_on(outcome, rng):
    x, _, _ = blobs(rng, classes=1, groups=1, rows=3)
    evidence = outcome.classifier.evidence(x, np.array([0.0, 0.5, np.nan]))
    assert evidence.unknown.tolist() == [True, False, True]
    assert 0 < evidence.quality[1] <= 0.5
    assert evidence.reasons[0] == ("quality is 0",)


def test_shapes_that_disagree_are_refused(outcome):
    with pytest.raises(ValueError, match=r"\(n, 12\)"):
        outcome.classifier.evidence(np.zeros((2, 3)), np.ones(2))
    with pytest.raises(ValueError, match="do not agree"):
        outcome.classifier.evidence(np.zeros((2, D)), np.ones(3))


def test_no_rows_give_no_evidence(outcome):
    evidence = outcome.classifier.evidence(np.empty((0, D)), np.empty(0))
    assert isinstance(evidence, ClassEvidence)
    assert len(evidence) == 0


def test_one_class_is_an_input_error(rng):
    x, y, g = blobs(rng, classes=1)
    with pytest.raises(InputError, match=r"sounds: only class 'class0' \(expected items of at least two classes\)"):
        train(x, y, g, source="sounds")
    with pytest.raises(InputError, match="no usable item"):
        train(np.full_like(x, np.nan), y, g)


def test_unknown_candidate_and_disagreeing_rows_are_input_errors(rng):
    x, y, g = blobs(rng)
    with pytest.raises(InputError, match="no candidate"):
        train(x, y, g, candidates=("oracle",))
    with pytest.raises(InputError, match="one label and one group"):
        train(x, y[:-1], g)


@pytest.mark.parametrize(("name", "says"), [("Unknown", "'Unknown'"), ("Class1", "'Class1' and 'class1'")])
def test_names_that_no_class_may_have_are_input_errors(name, says, rng):
    x, y, g = blobs(rng)
    with pytest.raises(InputError, match=says):
        train(x, np.where(y == "class2", name, y), g)


def test_class_with_a_single_group_is_reported_not_scored(rng):
    x, y, g = blobs(rng)
    g = np.where(y == "class2", "only", g)
    report = train(x, y, g).report
    assert report["not_validated"] == ["class2"]
    assert report["recall"]["class2"] is None
    assert any("class2" in text for text in report["warnings"])


def test_one_group_a_class_trains_with_a_note(rng):
    x, y, _ = blobs(rng)
    trained = train(x, y, y)
    report = trained.report
    assert not report["validated"]
    assert report["gate"]["held_out_rejection"] is None
    evidence = trained.classifier.evidence(x, np.ones(len(x)))
    assert np.mean(np.array(evidence.labels()) == y) > 0.7
    assert "No group could be held out" in report_html(report)


def test_rows_left_out_are_counted(rng):
    x, y, g = blobs(rng)
    x[:5, 2] = np.nan
    report = train(x, y, g).report
    assert report["n"] == len(x) - 5
    assert any(text.startswith("5 items") for text in report["warnings"])


def test_a_class_whose_rows_are_all_left_out_is_named(rng):
    x, y, g = blobs(rng)
    x[y == "class1", 2] = np.nan
    with pytest.raises(InputError, match="class 'class1': none of 72 items has features that are finite"):
        train(x, y, g)


def test_notes_on_the_material_stand_first_among_the_warnings(rng):
    x, y, g = blobs(rng)
    x[:5, 2] = np.nan
    assert train(x, y, g, notes=["Two were lost."]).report["warnings"][0] == "Two were lost."


def test_weights_balance_classes_and_limit_large_groups():
    y = np.array([0] * 100 + [0] + [1] * 10)
    group = np.array([0] * 100 + [1] + [2] * 10)
    weight = row_weights(y, group)
    assert weight[y == 0].sum() == pytest.approx(weight[y == 1].sum())
    ratio = weight[:100].sum() / weight[100]
    assert 5 < ratio < 12


def test_same_seed_same_model_other_seed_other_model(rng):
    x, y, g = blobs(rng)
    first, again, other = (train(x, y, g, seed=seed, candidates=("trees",)) for seed in (3, 3, 4))
    assert first.classifier.version == again.classifier.version
    assert first.report == again.report
    assert first.classifier.version != other.classifier.version


def test_report_is_json_and_its_page_is_self_contained(rng):
    x, y, g = blobs(rng)
    y = np.where(y == "class1", "<script>alert(1)</script>", y)
    report = train(x, y, g, modality="a<b").report
    page = report_html(json.loads(json.dumps(report, allow_nan=False)))
    assert "<script>" not in page
    assert "&lt;script&gt;" in page
    assert "a&lt;b" in page
    assert "http" not in page
    assert str(report["confusion"][0][0]) in page


def test_progress_rises_to_one(rng):
    reported = []
    train(*blobs(rng), progress=reported.append)
    assert reported == sorted(reported)
    assert reported[-1] == 1.0


@pytest.mark.parametrize("name", fitting.CANDIDATES)
@pytest.mark.parametrize("classes", [2, 3])
def test_members_answer_as_scikit_learn_does(name, classes, rng):
    x, y = rng.normal(size=(300, 6)), rng.integers(classes, size=300)
    member = fitting.CANDIDATES[name](6, 1)
    if name == "reduced logistic":
        member.set_params(map__n_components=4)
    before = member.fit(x, y).predict_proba(x)
    if hasattr(member, "steps"):
        fitting.fold_map(member)
        np.testing.assert_allclose(member.predict_proba(x), before, rtol=0, atol=1e-9)
    np.testing.assert_allclose(fitting._predicted(member, x), before, rtol=0, atol=1e-9)


def test_a_whitened_member_passes_over_what_varies_from_group_to_group():
    """Each class has its direction; a second one, ten times as strong, differs from group to group."""
    rng = np.random.default_rng(5)
    direction = rng.normal(size=(2, D))

    def drawn(groups):
        y = np.arange(groups) % 2
        centre = (0.1 - 0.2 * y)[:, None] * direction[0] + 10 * rng.normal(size=(groups, 1)) * direction[1]
        x = (centre[:, None] + 0.1 * rng.normal(size=(groups, 10, D))).reshape(-1, D)
        return x, np.repeat(y, 10), np.repeat(np.arange(groups), 10)

    x, y, g = drawn(40)
    rows = fitting.Rows(x, y, g, row_weights(y, g), 2)
    fresh, truth, _ = drawn(200)
    right = {}
    for name in ("stiff logistic", "whitened logistic"):  # of one strength of regularisation
        model, _, _ = fitting.fit(rows, (name,), np.random.default_rng(0))
        right[name] = np.mean(model.probabilities(model.standardise(fresh)).argmax(axis=1) == truth)
    assert right["whitened logistic"] > 0.95 > right["stiff logistic"]
