"""The main job on a synthetic drive with every fault in it, against the ground truth."""

from __future__ import annotations

import json
import math
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from bevameter.database.store import TerrainDatabase
from bevameter.framework.cli.main import app
from bevameter.framework.core.recording.readers import read_recording
from bevameter.framework.core.track.way import DEAD_RECKONING, track_of
from bevameter.framework.traverse import run_traverse
from typer.testing import CliRunner


@pytest.fixture(scope="module")
def drive(short_drive, small_models, tmp_path_factory):
    """The drive's folder, the database made of it, and the summary."""
    path = tmp_path_factory.mktemp("db") / "terrain.db"
    return short_drive, path, run_traverse(short_drive, path, models=small_models)


def truth(folder: Path):
    return json.loads((folder / "truth.json").read_text(encoding="utf-8"))


def on_track(folder: Path, path: Path):
    """Places every tenth of a metre of the track: class by the labels, and what the database says of them."""
    recording = read_recording(folder)
    track = track_of(recording)
    times = track.every(0.1)
    x, y, _ = track.place_at(times)
    with TerrainDatabase(path) as database:
        answer = database.snapshot().along(np.column_stack([x, y]))
    return times, recording.labels.at(times), answer


def test_most_of_the_track_is_recognised_rightly(drive):
    folder, path, _ = drive
    _, labels, answer = on_track(folder, path)
    known = np.isfinite(answer.class_probability).all(axis=1)
    labelled = labels != ""
    named = np.array(answer.class_names)[np.argmax(answer.class_probability, axis=1)]
    right = (named == labels)[known & labelled]
    assert known[labelled].mean() > 0.9
    assert right.mean() > 0.85
    sure = answer.class_probability.max(axis=1) > 0.95
    assert (named == labels)[known & labelled & sure].mean() > 0.9


def test_drop_outs_are_detected_and_the_other_sense_is_used(drive):
    folder, path, summary = drive
    camera, microphone, _ = summary.senses
    closed_camera, closed_microphone = " ".join(camera.closed), " ".join(microphone.closed)
    assert "black image" in closed_camera
    assert "JPEG" in closed_camera
    assert "silent" in closed_microphone or "missing" in closed_microphone
    assert 0.8 < camera.trusted_share < 1.0
    assert 0.5 < microphone.trusted_share < 0.97
    times, labels, answer = on_track(folder, path)
    known = np.isfinite(answer.class_probability).all(axis=1)
    named = np.array(answer.class_names)[np.argmax(answer.class_probability, axis=1)]
    for fault in truth(folder)["faults"]:
        if fault["kind"].startswith("wheel"):
            continue
        during = (times >= fault["start_s"]) & (times < fault["end_s"])
        assert known[during].all(), fault
        assert (named[during] == labels[during]).mean() >= 0.5, fault


def test_the_soil_learnt_contains_the_truth(drive):
    folder, _, summary = drive
    stretches = {one["class"]: one["soil"] for one in truth(folder)["stretches"]}
    assert [soil.class_name for soil in summary.soils] == ["sand", "loam"]
    for soil in summary.soils:
        for name in ("c_Pa", "phi_rad"):
            quantity = soil.parameters[name]
            assert quantity.low <= stretches[soil.class_name][name] <= quantity.high
        phi = soil.parameters["phi_rad"]
        assert phi.high - phi.low < math.radians(15.0)


def test_a_planner_finds_the_soil_under_the_class(drive):
    folder, path, _ = drive
    _, labels, answer = on_track(folder, path)
    sand = np.flatnonzero((labels == "sand") & answer.known)
    assert len(sand) > 10
    soil = next(one["soil"] for one in truth(folder)["stretches"] if one["class"] == "sand")
    strength = soil["c_Pa"] + 20e3 * math.tan(soil["phi_rad"])
    assert np.median(answer.shear_strength_lower[sand]) < strength
    assert np.median(answer.shear_strength[sand]) == pytest.approx(strength, rel=0.25)


def test_fast_driving_is_not_used_for_soil_and_that_is_reported(drive):
    folder, _, summary = drive
    assert any(reason.startswith("too fast") for reason in summary.closed_s)
    for soil in summary.soils:
        stretch = next(one for one in truth(folder)["stretches"] if one["class"] == soil.class_name)
        assert soil.end_s <= stretch["slow_until_s"] + 2.0


def test_the_command_prints_the_summary_and_a_second_run_adds_nothing(drive, small_models, tmp_path):
    folder, path, summary = drive
    arguments = [
        "run",
        str(folder),
        "--db",
        str(path),
        "--models",
        str(small_models),
        "--json",
        str(tmp_path / "o.json"),
    ]
    result = CliRunner().invoke(app, arguments)
    assert result.exit_code == 0, result.output
    for said in ("sand", "loam", "grass", "phi [deg]", "too fast", "nothing added"):
        assert said in result.output
    page = json.loads((tmp_path / "o.json").read_text(encoding="utf-8"))
    assert page["observations_new"] == 0
    assert page["observations_known"] == summary.observations_new
    assert page["soils"][0]["class_name"] == "sand"


def test_without_poses_soil_is_learnt_and_no_cell_is_added(drive, small_models, tmp_path):
    folder, path, _ = drive
    both = shutil.copy(path, tmp_path / "both.db")
    recording = replace(read_recording(folder), pose=None, camera=None, digest="cd" * 32)
    assert track_of(recording).origin == DEAD_RECKONING
    summary = run_traverse(recording, both, models=small_models)
    assert summary.soils
    with TerrainDatabase(path) as before, TerrainDatabase(both) as after:
        old, new = before.snapshot(), after.snapshot()
    np.testing.assert_array_equal(new.cells.key, old.cells.key)
    np.testing.assert_array_equal(new.cells.probability, old.cells.probability)
    learnt = {soil.class_name for soil in summary.soils} - {None}
    assert learnt
    assert all(new.soils[name].stretches > old.soils[name].stretches for name in learnt)


def test_ctrl_c_leaves_the_database_as_it_was(drive, small_models, tmp_path):
    folder, path, _ = drive
    copy = tmp_path / "copy.db"
    copy.write_bytes(path.read_bytes())
    before = copy.read_bytes()

    def interrupt(stage, share):
        if stage == "camera" and share > 0.2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run_traverse(folder, copy, models=small_models, cell_size_m=0.4, progress=interrupt)
    assert copy.read_bytes() == before
    fresh = tmp_path / "fresh.db"
    with pytest.raises(KeyboardInterrupt):
        run_traverse(folder, fresh, models=small_models, progress=interrupt)
    assert not fresh.exists()
