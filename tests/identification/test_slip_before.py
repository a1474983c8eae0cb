"""The slip of the wheel that ran before, whatever order runs, passes and gaps come in."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from bevameter.identification.effects.effect import COVARIATES, Drive
from bevameter.identification.effects.multipass_compaction import slip_before
from bevameter.identification.effects.named import specimen

DRIVE = specimen().drive


def stretches_of(numbers: list[float], slips: list[float], places: list[float] | None = None) -> Drive:
    """Twenty rows for each number of a pass, with its slip, over one metre from its place on."""
    rows = 20 * len(numbers)
    columns = {name: np.resize(getattr(DRIVE, name), rows) for name in COVARIATES}
    starts = np.repeat(np.zeros(len(numbers)) if places is None else places, 20)
    place_m = starts + np.tile(np.linspace(0.0, 1.0, 20), len(numbers))
    stretch = np.repeat(np.arange(len(numbers)), 20)
    numbers, slips = np.repeat(numbers, 20), np.repeat(slips, 20)
    return replace(Drive(**columns), pass_number=numbers, slip=slips, place_m=place_m, stretch=stretch)


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
    found = slip_before(stretches_of(numbers, slips, places))
    for stretch, expected in zip(of, before, strict=True):
        np.testing.assert_allclose(found[20 * stretch : 20 * stretch + 20], expected, atol=1e-12)


def test_without_places_it_is_the_mean_of_the_pass_before():
    ramp = stretches_of([1.0, 1.0, 2.0], [0.1, 0.5, 0.3])
    unseen = replace(ramp, place_m=np.where(np.arange(60) == 3, np.nan, ramp.place_m))
    np.testing.assert_allclose(slip_before(unseen)[40:], 0.3)
