"""The fused class along the track: single wrong cells do not cut a stretch, changes of ground do."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from bevameter.framework.core.evidence import ClassEvidence
from bevameter.framework.core.recording.types import Pose, Recording
from bevameter.framework.core.track.way import track_of
from bevameter.framework.fusion import fuse
from bevameter.framework.segments import classes_along
from bevameter.framework.sense_map import SenseMap


def drive(rows):
    """A track of one cell of 0.5 m a row along x, at 1 m/s; the belief of each cell, None where unknown."""
    n = len(rows)
    t = np.linspace(0.0, 0.5 * n - 1e-6, 20 * n)
    pose = Pose(t, t, np.full_like(t, 0.1), np.zeros_like(t))
    track = track_of(Recording("d", Path("d"), None, None, "", "0" * 64, pose=pose))
    closed = np.array([row is None for row in rows])
    evidence = ClassEvidence(
        ("loam", "sand"),
        np.array([[0.5, 0.5] if row is None else row for row in rows]),
        np.where(closed, 0.0, 1.0),
        closed,
        tuple(("blurred",) if one else () for one in closed),
    )
    camera = SenseMap("camera")
    camera.add(np.column_stack([np.arange(n), np.zeros(n, dtype=int)]), evidence, np.arange(n) * 0.5)
    return classes_along(fuse([camera]), track, None, 0.5)


SAND, LOAM = [0.1, 0.9], [0.9, 0.1]


def test_a_change_of_ground_is_found_where_it_is():
    along = drive([SAND] * 20 + [LOAM] * 20)
    np.testing.assert_allclose(along.changes_s(), [10.0], atol=0.6)
    metres = along.metres()
    assert metres["sand"] == pytest.approx(10.0, abs=0.6)
    assert metres["loam"] == pytest.approx(10.0, abs=0.6)


def test_a_single_wrong_cell_does_not_split_a_stretch():
    along = drive([SAND] * 10 + [[0.8, 0.2]] + [SAND] * 10)
    assert len(along.changes_s()) == 0
    assert along.metres() == {"sand": pytest.approx(10.5, abs=0.1)}


def test_unknown_cells_inside_a_stretch_are_bridged_but_counted_as_unknown():
    along = drive([SAND] * 10 + [None] * 6 + [SAND] * 10)
    assert len(along.changes_s()) == 0
    assert along.metres()["unknown"] == pytest.approx(3.0, abs=0.6)
    belief = along.belief_between(0.0, 13.0)
    assert belief["sand"] == pytest.approx(0.9, abs=1e-6)


def test_a_stretch_that_is_mostly_unknown_has_no_class():
    along = drive([SAND] * 4 + [None] * 20 + [SAND] * 4)
    assert along.belief_between(2.5, 11.0) == {}
    assert along.belief_between(0.0, 2.0)["sand"] > 0.8
    assert along.belief_between(100.0, 101.0) == {}


def test_where_nothing_is_known_there_is_no_class_and_no_change():
    along = drive([None] * 8)
    assert along.metres() == {"unknown": pytest.approx(4.0, abs=0.1)}
    assert len(along.changes_s()) == 0


def test_a_stretch_with_two_likely_classes_has_no_class():
    along = drive([[0.55, 0.45]] * 12)
    assert along.belief_between(0.0, 6.0) == {}
    assert along.metres() == {"loam": pytest.approx(6.0, abs=0.1)}
