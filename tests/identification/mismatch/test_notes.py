"""What an answer adds in words."""

from __future__ import annotations

import numpy as np
from bevameter.framework.core.recording.types import Labels
from bevameter.identification.mismatch.show.notes import several_grounds

TIME_S = np.arange(0.0, 100.0, 0.5)


def labels(*stretches: tuple[float, float, str]) -> Labels:
    start, end, classes = zip(*stretches, strict=True)
    return Labels(np.array(start), np.array(end), tuple(classes))


def test_several_kinds_of_ground_are_named():
    (note,) = several_grounds(labels((0.0, 50.0, "sand"), (50.0, 90.0, "loam")), TIME_S)
    assert "loam, sand" in note
    assert "cut the recording" in note


def test_one_kind_of_ground_is_no_word_worth():
    assert several_grounds(None, TIME_S) == []
    assert several_grounds(labels((0.0, 99.0, "sand"), (99.0, 100.0, "loam")), TIME_S) == []
    assert several_grounds(labels((0.0, 50.0, "sand"), (60.0, 90.0, "sand")), TIME_S) == []
    assert several_grounds(labels((0.0, 50.0, "sand"), (50.0, 90.0, "loam")), np.empty(0)) == []
