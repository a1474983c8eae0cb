"""Fusion: drop-outs of a sense, calibration, and independence of order."""

from __future__ import annotations

import numpy as np
import pytest
from bevameter.framework.core.evidence import ClassEvidence
from bevameter.framework.fusion import fuse
from bevameter.framework.sense_map import (
    SenseMap,
    kind_of_reason,
    look_correlation,
)

CLASSES = ("clay", "gravel", "sand")


def evidence(rows, *, classes=CLASSES, quality=1.0, reason=None):
    """Evidence of the given probability rows; a row of None is a closed look."""
    k = len(classes)
    closed = np.array([row is None for row in rows])
    return ClassEvidence(
        tuple(classes),
        np.array([np.full(k, 1 / k) if row is None else row for row in rows], dtype=float).reshape(-1, k),
        np.where(closed, 0.0, quality),
        closed,
        tuple((reason or "closed",) if row is None else () for row in rows),
    )


def sense(name, cells, rows, **options):
    one = SenseMap(name)
    one.add(np.asarray(cells).reshape(-1, 2), evidence(rows, **options), np.zeros(len(rows)))
    return one


SAND = [0.05, 0.05, 0.9]
GRAVEL = [0.05, 0.9, 0.05]
DOUBT = [0.2, 0.4, 0.4]


def test_blur_drop_out_leaves_the_microphones_verdict():
    belief = fuse([sense("camera", [[0, 0]], [None], reason="blurred"), sense("microphone", [[0, 0]], [SAND])])
    np.testing.assert_allclose(belief.probabilities[0], SAND, rtol=1e-9)
    assert belief.labels()[0] == "sand"
    assert belief.sense_weights["camera"][0] == 0.0
    assert belief.quality[0] == 1.0


def test_noise_drop_out_leaves_the_cameras_verdict():
    belief = fuse([sense("camera", [[0, 0]], [GRAVEL]), sense("microphone", [[0, 0]], [None], reason="wind")])
    np.testing.assert_allclose(belief.probabilities[0], GRAVEL, rtol=1e-9)
    assert not belief.unknown[0]


def test_both_closed_is_unknown_with_the_reasons():
    belief = fuse(
        [
            sense("camera", [[3, -4]], [None], reason="blurred"),
            sense("microphone", [[3, -4]], [None], reason="clipped"),
        ]
    )
    assert belief.unknown[0]
    assert belief.labels()[0] == "unknown"
    assert belief.quality[0] == 0.0
    np.testing.assert_allclose(belief.probabilities[0], 1 / 3)
    assert belief.reasons[0] == ("camera: blurred", "microphone: clipped")


def test_a_cell_that_nobody_saw_is_unknown():
    belief = fuse([sense("camera", [[0, 0]], [SAND])], cells=np.array([[0, 0], [7, 7]]))
    row = belief.rows(np.array([[7, 7], [9, 9]]))
    assert belief.unknown[row[0]]
    assert belief.reasons[row[0]] == ("no sense looked here",)
    assert row[1] == -1


def test_without_any_sense_the_track_is_unknown():
    belief = fuse([], cells=np.array([[0, 0], [1, 0]]))
    assert len(belief) == 2
    assert belief.unknown.all()
    assert list(belief.labels()) == ["unknown", "unknown"]


def test_two_agreeing_senses_are_surer_than_one_and_doubt_counts_less():
    agreed = fuse([sense("camera", [[0, 0]], [SAND]), sense("microphone", [[0, 0]], [SAND])])
    assert agreed.probabilities[0, 2] == pytest.approx(0.9**2 / (0.9**2 + 2 * 0.05**2))
    doubted = fuse([sense("camera", [[0, 0]], [SAND]), sense("microphone", [[0, 0]], [GRAVEL], quality=0.2)])
    assert doubted.labels()[0] == "sand"


def test_low_quality_tempers_towards_the_uniform():
    low = fuse([sense("camera", [[0, 0]], [SAND], quality=0.3)])
    assert 1 / 3 < low.probabilities[0, 2] < 0.7
    assert low.quality[0] == pytest.approx(0.3)


def test_contradiction_of_certain_senses_lowers_quality_with_a_reason():
    belief = fuse([sense("camera", [[0, 0]], [SAND]), sense("microphone", [[0, 0]], [GRAVEL])])
    assert belief.quality[0] < 0.35
    assert belief.reasons[0] == ("camera says sand, microphone says gravel",)
    assert belief.probabilities[0, 1] == pytest.approx(belief.probabilities[0, 2])
    mild = fuse([sense("camera", [[0, 0]], [SAND]), sense("microphone", [[0, 0]], [[0.2, 0.41, 0.39]])])
    assert mild.quality[0] > 0.85
    assert mild.reasons[0] == ()


def test_a_class_that_a_sense_cannot_know_gets_no_vote():
    camera = sense("camera", [[0, 0]], [[0.1, 0.9]], classes=("asphalt", "sand"))
    microphone = sense("microphone", [[0, 0]], [[0.9, 0.1]], classes=("gravel", "sand"))
    belief = fuse([camera, microphone])
    assert belief.classes == ("asphalt", "gravel", "sand")
    # camera: asphalt 0.2, sand 1.8, gravel 1 (no vote); microphone: gravel 1.8, sand 0.2, asphalt 1
    expected = np.array([0.2, 1.8, 1.8 * 0.2])
    np.testing.assert_allclose(belief.probabilities[0], expected / expected.sum(), rtol=1e-9)
    alone = fuse([camera, SenseMap("microphone")])
    np.testing.assert_allclose(alone.probabilities[0], [0.1, 0.9], rtol=1e-9)


def test_a_class_known_only_to_a_sense_of_low_quality_has_little_weight():
    camera = sense("camera", [[0, 0]], [[0.1, 0.9]], classes=("asphalt", "sand"))
    microphone = sense("microphone", [[0, 0]], [[0.9, 0.1]], classes=("gravel", "sand"), quality=0.01)
    belief = fuse([camera, microphone])
    assert belief.probabilities[0, 1] < 0.01


def test_ten_looks_at_one_cell_are_not_independent():
    once = fuse([sense("camera", [[0, 0]], [DOUBT[::-1]])])
    ten = fuse([sense("camera", [[0, 0]] * 10, [[0.2, 0.2, 0.6]] * 10)])
    assert ten.effective_looks["camera"][0] <= 3.0
    assert ten.looks["camera"][0] == 10
    assert ten.probabilities[0, 2] < 0.95
    assert once.effective_looks["camera"][0] == pytest.approx(1.0)
    full = fuse([sense("camera", [[0, 0]] * 10, [[0.2, 0.2, 0.6]] * 10)], correlation={"camera": 1.0})
    np.testing.assert_allclose(full.probabilities[0], [0.2, 0.2, 0.6], rtol=1e-9)


def gaussian_looks(rng, n_cells, rho, spread):
    """Looks from a Gaussian world in which each look alone is calibrated exactly: truth, cell of look, posteriors."""
    centres = np.eye(3) * spread
    truth = rng.integers(0, 3, n_cells)
    looks = rng.integers(1, 9, n_cells)
    cell = np.repeat(np.arange(n_cells), looks)
    shared = rng.normal(size=(n_cells, 3)) * np.sqrt(rho)
    x = centres[truth[cell]] + shared[cell] + rng.normal(size=(len(cell), 3)) * np.sqrt(1 - rho)
    logs = x @ centres.T
    p = np.exp(logs - logs.max(axis=1, keepdims=True))
    return truth, cell, p / p.sum(axis=1, keepdims=True)


@pytest.mark.parametrize("rho", [0.35, 0.6, 0.9])
def test_fused_probabilities_are_calibrated(rng, rho):
    n = 6000
    truth, cell, p = gaussian_looks(rng, n, rho, 1.3)
    camera = SenseMap("camera")
    camera.add(np.column_stack([cell, np.zeros_like(cell)]), evidence(list(p)), np.zeros(len(cell)))
    assert look_correlation(camera.summed()) == pytest.approx(rho, abs=0.12)
    # A second, independent sense over the same truth.
    centres = np.eye(3) * 1.3
    logs = (centres[truth] + rng.normal(size=(n, 3))) @ centres.T
    heard = np.exp(logs) / np.exp(logs).sum(axis=1, keepdims=True)
    microphone = SenseMap("microphone")
    cells = np.column_stack([np.arange(n), np.zeros(n, dtype=int)])
    microphone.add(cells, evidence(list(heard)), np.zeros(n))
    belief = fuse([camera, microphone])
    best, right = belief.probabilities.max(axis=1), np.argmax(belief.probabilities, axis=1) == truth
    about = (best > 0.85) & (best < 0.95)
    assert about.sum() > 400
    assert right[about].mean() == pytest.approx(0.9, abs=0.04)
    assert best.mean() == pytest.approx(right.mean(), abs=0.02)


def test_multiplying_correlated_looks_would_have_been_overconfident(rng):
    """The test of calibration fails for looks taken as independent."""
    truth, cell, p = gaussian_looks(rng, 3000, 0.9, 1.3)
    camera = SenseMap("camera")
    camera.add(np.column_stack([cell, np.zeros_like(cell)]), evidence(list(p)), np.zeros(len(cell)))
    belief = fuse([camera], correlation={"camera": 0.0})
    best, right = belief.probabilities.max(axis=1), np.argmax(belief.probabilities, axis=1) == truth
    assert best.mean() - right.mean() > 0.05


def test_the_order_of_looks_batches_and_senses_does_not_matter(rng):
    m = 400
    cells = rng.integers(-5, 5, (m, 2))
    p = rng.dirichlet([1, 1, 1], m)
    rows = [None if rng.random() < 0.2 else row for row in p]
    given = evidence(rows)
    order = rng.permutation(m)
    shuffled = evidence([rows[index] for index in order])
    whole, parts = SenseMap("camera"), SenseMap("camera")
    whole.add(cells, given, np.arange(m))
    for part in np.array_split(np.arange(m), 7):
        piece = ClassEvidence(
            CLASSES, shuffled.probabilities[part], shuffled.quality[part], shuffled.unknown[part],
            tuple(shuffled.reasons[index] for index in part),
        )  # fmt: skip
        parts.add(cells[order][part], piece, order[part].astype(float))
        parts.summed()
    other = sense("microphone", cells[:50], list(p[:50]))
    first, second = fuse([whole, other]), fuse([other, parts])
    np.testing.assert_allclose(first.probabilities, second.probabilities, rtol=1e-9)
    np.testing.assert_array_equal(first.cells, second.cells)
    np.testing.assert_allclose(first.quality, second.quality, rtol=1e-9)
    np.testing.assert_array_equal(first.last_seen_s, second.last_seen_s)
    assert first.reasons == second.reasons


def test_evidence_that_is_not_finite_has_no_vote():
    camera = SenseMap("camera")
    bad = ClassEvidence(CLASSES, np.full((1, 3), np.nan), np.ones(1), np.zeros(1, dtype=bool), ((),))
    camera.add(np.zeros((1, 2), dtype=int), bad, np.zeros(1))
    belief = fuse([camera])
    assert belief.unknown[0]
    assert np.isfinite(belief.probabilities).all()


def test_classes_of_one_sense_may_not_change_on_the_way():
    camera = sense("camera", [[0, 0]], [SAND])
    with pytest.raises(ValueError, match="camera"):
        camera.add(np.zeros((1, 2)), evidence([[0.5, 0.5]], classes=("a", "b")), np.zeros(1))


@pytest.mark.parametrize(
    ("text", "kind"),
    [
        ("unlike anything trained on (distance 2.4, gate 2.0)", "unlike anything trained on"),
        ("/a/b.jpg: cut off after 4652 bytes: no end marker (expected a JPEG)", "cut off after … bytes: no end marker"),
        ("C:\\data\\b.jpg: cut off after 12 bytes", "cut off after … bytes"),
        ("contact sound 12 dB above the background", "contact sound … dB above the background"),
        ("black image", "black image"),
    ],
)
def test_reasons_are_counted_by_kind(text, kind):
    assert kind_of_reason(text) == kind
