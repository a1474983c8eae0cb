"""How senses and fused belief agree with labels, in metres of track; and what fusion with an inertial sensor gains."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from bevameter.framework.agreement import FUSED, agreement_with
from bevameter.framework.core.evidence import ClassEvidence
from bevameter.framework.core.recording.types import Labels, Pose, Recording
from bevameter.framework.core.track.way import track_of
from bevameter.framework.fusion import fuse
from bevameter.framework.scenario.write import write_scenario
from bevameter.framework.segments import classes_along
from bevameter.framework.sense_map import SenseMap, SenseRecord
from bevameter.framework.traverse import run_traverse

SAND, LOAM = [0.05, 0.95], [0.95, 0.05]


def observed(sense, rows):
    """What a sense said of cells of 0.5 m in a row along x, None where it was blind."""
    closed = np.array([row is None for row in rows])
    evidence = ClassEvidence(
        ("loam", "sand"), np.array([[0.5, 0.5] if row is None else row for row in rows]), np.where(closed, 0.0, 1.0),
        closed, ((),) * len(rows),
    )  # fmt: skip
    seen = SenseMap(sense)
    seen.add(np.column_stack([np.arange(len(rows)), np.zeros(len(rows), dtype=int)]), evidence, np.arange(len(rows)))
    return SenseRecord(sense, sense, seen, items=len(rows))


def compared(labels, *records):
    time_s = np.linspace(0.0, 20.0 - 1e-6, 400)
    pose = Pose(time_s, time_s, np.full_like(time_s, 0.1), np.zeros_like(time_s))
    track = track_of(Recording("d", Path("d"), None, None, "", "0" * 64, pose=pose))
    assert track is not None
    along = classes_along(fuse([record.map for record in records]), track, None, 0.5)
    return agreement_with(labels, along, records, track, None, 0.5)


def test_each_sense_and_all_together_are_compared_in_metres_of_labelled_track():
    labels = Labels(np.array([0.0, 10.0, 18.0]), np.array([10.0, 18.0, 20.0]), ("sand", "loam", "unknown"))
    camera = observed("camera", [SAND] * 20 + [None] * 20)
    shaken = observed("vibration sensor", [SAND] * 26 + [LOAM] * 14)
    found = {each.sense: (each.right_m, each.wrong_m, each.unknown_m) for each in compared(labels, camera, shaken)}
    assert found["camera"] == pytest.approx((10.0, 0.0, 8.0), abs=0.6)
    assert found["vibration sensor"] == pytest.approx((15.0, 3.0, 0.0), abs=0.6)
    assert list(found)[-1] == FUSED
    assert found[FUSED] == pytest.approx((15.0, 3.0, 0.0), abs=0.6)


def test_without_labels_or_senses_there_is_nothing_to_compare():
    labels = Labels(np.array([0.0]), np.array([20.0]), ("unknown",))
    camera = observed("camera", [SAND] * 40)
    assert compared(None, camera) == ()
    assert compared(labels, camera) == ()


@pytest.mark.slow
def test_where_the_camera_is_blind_the_inertial_sensor_names_the_ground(tmp_path):
    summary = run_traverse(write_scenario("camera-imu", tmp_path / "drive", seed=7), tmp_path / "terrain.db")
    right = {each.sense: each.right_m for each in summary.agreement}
    assert list(right) == ["camera", "vibration sensor", FUSED]
    assert right[FUSED] > max(right["camera"], right["vibration sensor"])
    assert right[FUSED] > 0.85 * summary.distance_m > 1.2 * right["camera"]
