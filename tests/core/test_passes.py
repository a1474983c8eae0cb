"""Slip of the preceding pass, for any order of runs, passes and gaps."""

from __future__ import annotations

import numpy as np
import pytest
from bevameter.framework.core.track.passes import slip_before


def stretches_of(numbers: list[float], slips: list[float], places: list[float] | None = None) -> dict[str, np.ndarray]:
    """Twenty rows for each number of a pass, with its slip, over one metre from its place on, all on one lane."""
    starts = np.repeat(np.zeros(len(numbers)) if places is None else places, 20)
    return {
        "slip": np.repeat(slips, 20),
        "pass_number": np.repeat(numbers, 20),
        "place_m": starts + np.tile(np.linspace(0.0, 1.0, 20), len(numbers)),
        "stretch": np.repeat(np.arange(len(numbers)), 20),
        "lane": np.zeros(20 * len(numbers), dtype=int),
    }


@pytest.mark.parametrize(
    ("numbers", "slips", "places", "of", "before"),
    [
        ([1.0, 2.0, 1.0, 2.0], [0.1, 0.3, 0.6, 0.3], None, (1, 3), (0.1, 0.6)),  # two runs, each on ground of its own
        ([1.0, 3.0, 4.0], [0.1, 0.2, 0.3], None, (1, 2), (0.1, 0.2)),  # numbers that skip
        ([1.0, 1.0, 2.0, 2.0], [0.1, 0.5, 0.2, 0.2], [0.0, 1.2, 0.0, 1.2], (2, 3), (0.1, 0.5)),  # gaps in a pass
        ([2.0, 2.0], [0.2, 0.4], None, (0, 1), (0.3, 0.3)),  # no first pass: the mean
        ([1.0, 2.0], [0.1, 0.3], [0.0, 5.0], (1,), (0.1,)),  # elsewhere: the mean of the pass before
    ],
)
def test_the_slip_before_is_that_of_the_last_lower_pass_on_the_same_track(numbers, slips, places, of, before):
    found = slip_before(**stretches_of(numbers, slips, places))
    for stretch, expected in zip(of, before, strict=True):
        np.testing.assert_allclose(found[20 * stretch : 20 * stretch + 20], expected, atol=1e-12)


def test_without_positions_it_is_the_mean_of_the_previous_pass():
    ramp = stretches_of([1.0, 1.0, 2.0], [0.1, 0.5, 0.3])
    np.testing.assert_allclose(slip_before(**{**ramp, "place_m": np.full(60, np.nan)})[40:], 0.3)


def test_a_row_without_a_position_does_not_affect_the_other_rows():
    lost = stretches_of([1.0, 1.0, 2.0, 2.0], [0.1, 0.5, 0.3, 0.3], [0.0, 1.2, 0.0, 1.2])
    lost["place_m"][[3, 45]] = np.nan
    found = slip_before(**lost)
    np.testing.assert_allclose(np.delete(found[40:60], 5), 0.1)
    assert found[45] == pytest.approx(0.3)
    np.testing.assert_allclose(found[60:], 0.5)


@pytest.mark.parametrize("numbers", [[1.0, 1.0, 1.0, 2.0, 2.0, 2.0], [1.0, 2.0, 1.0, 2.0, 1.0, 2.0]])
def test_lanes_driven_in_turn_are_kept_separate(numbers):
    lane = np.array([0, 1, 2, 0, 1, 2]) if numbers[1] == 1.0 else np.array([0, 0, 1, 1, 2, 2])
    slips = np.where(np.array(numbers) > 1.0, 0.7, 0.1 * (lane + 1.0))
    found = slip_before(**{**stretches_of(numbers, slips.tolist()), "lane": np.repeat(lane, 20)})
    later = np.repeat(np.array(numbers) > 1.0, 20)
    np.testing.assert_allclose(found[later], np.repeat(0.1 * (lane + 1.0), 20)[later])


def test_passes_are_matched_though_positions_drift_from_piece_to_piece():
    pieces = stretches_of([1.0, 1.0, 1.0, 2.0, 2.0, 2.0], [0.1, 0.4, 0.7, 0.3, 0.3, 0.3], [0.0, 1.2, 2.4] * 2)
    drifted = np.repeat([0, 1, 2, 1, 1, 1], 20)
    np.testing.assert_allclose(slip_before(**{**pieces, "lane": drifted})[60:], np.repeat([0.1, 0.4, 0.7], 20))


def test_a_rear_wheel_meets_the_slip_of_the_front_one_whichever_began_first():
    rear_first = stretches_of([2.0, 1.0], [0.3, 0.1])
    np.testing.assert_allclose(slip_before(**rear_first)[:20], 0.1)
    # The front wheel lost its signal for a while, and began again after the rear one.
    lost = stretches_of([1.0, 2.0, 1.0], [0.1, 0.3, 0.5], [0.0, 0.0, 1.2])
    lost["place_m"][20:40] = np.linspace(0.0, 2.2, 20)
    found = slip_before(**lost)[20:40]
    np.testing.assert_allclose(found[:9], 0.1)
    np.testing.assert_allclose(found[11:], 0.5)


def test_noise_about_zero_slip_causes_no_compaction(rng):
    towed = stretches_of([1.0, 2.0], [0.0, 0.3])
    towed = {name: np.concatenate([np.repeat(each[:20], 50), np.repeat(each[20:], 50)]) for name, each in towed.items()}
    towed["slip"] = towed["slip"] + 0.02 * rng.normal(size=2000) * (towed["pass_number"] == 1.0)
    assert slip_before(**towed)[1000:].mean() < 0.004
