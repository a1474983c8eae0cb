"""Intervals of accuracies: they hold the truth where groups are few, and do not vanish where all is right."""

import numpy as np
import pytest
from bevameter.framework.core.classifier.scores import accuracy_intervals


def counted(right, rows):
    """Counts (u, k, k) from rows that are right (k, groups) of `rows` a group; each group is of one class."""
    k, groups = right.shape
    by_unit = np.zeros((k, groups, k, k))
    for c in range(k):
        by_unit[c, :, c, c] = right[c]
        by_unit[c, :, c, (c + 1) % k] = rows - right[c]
    return by_unit.reshape(-1, k, k)


@pytest.mark.parametrize("rows", [1, 40])
def test_groups_that_are_all_right_or_all_wrong_count_once_each(rows):
    """Clopper and Pearson's bound for n of n is 0.025 to the power of 1/n, however many rows a group has."""
    bound = 0.025 ** (1 / 4)
    for share, low, high in ((1, bound, 1.0), (0, 0.0, 1 - bound)):
        for score in accuracy_intervals(counted(np.full((2, 2), share * rows), rows)).values():
            assert (score["value"], score["low"], score["high"]) == pytest.approx((share, low, high))


def test_groups_that_are_all_right_have_an_interval_whatever_their_number():
    for n in range(2, 100, 2):
        by_unit = np.zeros((n, 2, 2))
        by_unit[: n // 2, 0, 0] = by_unit[n // 2 :, 1, 1] = 1
        for each in accuracy_intervals(by_unit).values():
            assert each["value"] == each["high"] == 1.0
            assert each["low"] == pytest.approx(0.025 ** (1 / n))


def test_single_rows_give_the_interval_of_a_proportion():
    """Many groups of one row: the normal approximation holds."""
    right = np.repeat([[1] * 600 + [0] * 400], 2, axis=0)
    score = accuracy_intervals(counted(right, 1))["accuracy"]
    half = 1.96 * np.sqrt(0.6 * 0.4 / 2000)
    assert (score["low"], score["high"]) == pytest.approx((0.6 - half, 0.6 + half), abs=2e-3)


def test_classes_count_alike_in_balanced_accuracy_only():
    right = np.stack([np.full(30, 10), np.zeros(30, dtype=int)])
    uneven = np.concatenate([counted(right, 10), counted(right[:, :1], 10)[:1]])
    scores = accuracy_intervals(uneven)
    assert scores["balanced_accuracy"]["value"] == pytest.approx(0.5)
    assert scores["accuracy"]["value"] == pytest.approx(31 / 61)


@pytest.mark.parametrize(("groups", "k", "rows"), [(2, 2, 12), (3, 5, 6), (5, 2, 12), (20, 3, 4)])
@pytest.mark.parametrize(("recall", "alike"), [(0.6, 2.0), (0.8, 20.0), (0.95, 2.0), (0.99, 5.0)])
def test_nine_intervals_in_ten_hold_the_truth_at_least(groups, k, rows, recall, alike, rng):
    """The rate of recognition differs between groups (beta-distributed); the nominal level is 0.95."""
    held = []
    for _ in range(200):
        rate = rng.beta(recall * alike, (1 - recall) * alike, (k, groups))
        scores = accuracy_intervals(counted(rng.binomial(rows, rate), rows))
        held.append([score["low"] <= recall <= score["high"] for score in scores.values()])
        assert all(score["low"] <= score["value"] <= score["high"] for score in scores.values())
    assert np.mean(held, axis=0).min() > 0.9
