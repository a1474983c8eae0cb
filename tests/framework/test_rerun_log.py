"""A drive as a file of the Rerun viewer, read back: what is in it is what the run found. The viewer is not run."""

from __future__ import annotations

import math
import sys
from collections import defaultdict
from dataclasses import replace
from datetime import UTC, datetime
from types import SimpleNamespace

import cv2
import numpy as np
import pytest
from bevameter.database.store import TerrainDatabase
from bevameter.framework.cli.main import app
from bevameter.framework.core.errors import InputError
from bevameter.framework.core.recording.readers import read_recording
from bevameter.framework.core.soil import PLAUSIBLE
from bevameter.framework.core.vehicle import Camera
from bevameter.framework.default_models import Models
from bevameter.framework.rerun_log import write_rerun
from bevameter.framework.rerun_parts import FRAME_PERIOD_S, WIDEST_PX
from bevameter.framework.rerun_stream import broken, check_rerun, opened
from bevameter.framework.scenario.write import write_scenario
from bevameter.framework.sense_map import kind_of_reason
from bevameter.framework.traverse import run_traverse
from bevameter.identification.estimate.identifiability import is_search_limit
from bevameter.vision.project import camera_axes, ground_to_image
from rrd_file import WITHOUT, File
from typer.testing import CliRunner


@pytest.fixture(scope="module")
def driven(tmp_path_factory):
    """A minute of the synthetic demo, the summary of the run over them, its database, and the file."""
    pytest.importorskip("rerun.chunk", reason=WITHOUT)
    folder = tmp_path_factory.mktemp("rerun")
    recording = read_recording(write_scenario("demo", folder / "drive", duration_s=60.0))
    summary = run_traverse(recording, folder / "t.db")
    write_rerun(summary, recording, folder / "drive.rrd")
    with TerrainDatabase(folder / "t.db") as database:
        (drive,) = database.drives()
    return recording, summary, drive, File(folder / "drive.rrd")


def test_each_cell_appears_when_it_was_last_seen_coloured_by_class_and_opaque_by_probability(driven):
    _, summary, drive, file = driven
    terrain, evidence = drive.terrain, drive.terrain.evidence
    found = {}
    for name in summary.cells:
        boxes = [row for row in file.rows[f"/world/cells/{name}"] if row[0] is not None]
        assert sum(len(each["centers"]) for _, each in boxes) == summary.cells[name]
        for time, each in boxes:
            for centre, half, colour in zip(each["centers"], each["half_sizes"], each["colors"], strict=True):
                assert 2 * half[0] <= terrain.cell_size_m
                cell = tuple(math.floor(c / terrain.cell_size_m) for c in centre[:2])
                found[cell] = name, time, colour & 0xFF, colour >> 8
    colours = defaultdict(set)
    for row, name in enumerate(evidence.labels()):
        written, time, opacity, colour = found.pop((terrain.cell_x[row], terrain.cell_y[row]))
        assert written == name
        assert time == pytest.approx(terrain.time_s[row], abs=1e-6)
        k, best = len(evidence.classes), evidence.probabilities[row].max()
        expected = 1.0 if name == "unknown" else 0.15 + 0.85 * (best - 1 / k) / (1 - 1 / k)
        assert opacity == pytest.approx(255 * expected, abs=1)
        colours[name].add(colour)
    assert not found
    assert all(len(each) == 1 for each in colours.values())
    assert len({each.pop() for each in colours.values()}) == len(summary.cells) > 1


def test_soil_is_drawn_with_its_interval_on_its_stretch_and_nowhere_else(driven):
    _, summary, drive, file = driven
    assert summary.soils
    for name, entity, scale in (("c_Pa", "c_kPa", 1e-3), ("phi_rad", "phi_deg", 180 / math.pi)):
        for end in ("value", "low", "high"):
            expected = []
            for soil in summary.soils:
                number = getattr(soil.parameters[name], end) * scale
                hidden = not soil.separable[name] if end == "value" else is_search_limit(name, number / scale)
                if not hidden:
                    expected += [(soil.start_s, number), (soil.end_s, number), (soil.end_s, math.nan)]
            np.testing.assert_allclose(list(zip(*file.series(f"/soil/{entity}/{end}"), strict=True)), expected)
    labels = [row["labels"][0] for _, row in file.rows["/world/soil"]]
    assert [label.split(":")[0] for label in labels] == [soil.class_name for soil in summary.soils]
    stretch = next(one for one in drive.soils if one.estimate is not None)
    assert file.rows["/world/soil"][0][1]["positions"][0][:2] == pytest.approx([stretch.x_m, stretch.y_m], abs=1e-4)


def test_what_the_data_do_not_determine_has_no_value_and_an_open_end_none(driven, tmp_path):
    recording, summary, drive, _ = driven
    stretch = next(one for one in drive.soils if one.estimate is not None)
    c = replace(stretch.estimate.parameters["c_Pa"], low=500.0, high=PLAUSIBLE["c_Pa"][1])
    parameters = {**stretch.estimate.parameters, "c_Pa": c}
    unsure = replace(stretch.estimate, parameters=parameters, separable={**stretch.estimate.separable, "c_Pa": False})
    with TerrainDatabase(tmp_path / "u.db") as database:
        database.add_drive(replace(drive, soils=(replace(stretch, estimate=unsure),)))
    write_rerun(replace(summary, database=str(tmp_path / "u.db")), recording, tmp_path / "u.rrd")
    file = File(tmp_path / "u.rrd")
    assert "/soil/c_kPa/value" not in file.rows
    assert "/soil/c_kPa/high" not in file.rows
    assert file.series("/soil/c_kPa/low")[1][:2] == [0.5, 0.5]
    assert "/soil/phi_deg/value" in file.rows
    assert "c not determined: above 0.50" in file.one("/world/soil", "labels")[0]


def test_the_quality_of_sound_is_that_of_the_run_and_the_log_says_why_it_is_low(driven):
    _, summary, _, file = driven
    (microphone,) = [one for one in summary.senses if one.sense == "microphone"]
    _, quality = file.series("/senses/microphone/quality")
    quality = np.array(quality)
    assert len(quality) == microphone.items
    assert np.mean(quality > 0) == pytest.approx(microphone.trusted_share)
    assert quality[quality > 0].mean() == pytest.approx(microphone.mean_quality)
    said = " ".join(kind_of_reason(row["text"][0]) for _, row in file.rows["/senses/microphone/log"])
    assert microphone.closed
    assert all(kind in said for kind in microphone.closed)


def test_wheels_track_and_findings_are_those_of_the_recording(driven):
    recording, summary, drive, file = driven
    wheel = recording.wheel
    for channel in ("load_N", "torque_Nm", "slip", "sinkage_m", "drawbar_pull_N"):
        for name in set(wheel.wheel):
            there = (wheel.wheel == name) & np.isfinite(wheel[channel])
            times, values = file.series(f"/wheels/{channel}/{name}")
            known = np.isfinite(values)
            np.testing.assert_allclose(np.array(times)[known], wheel["time_s"][there], atol=1e-9)
            np.testing.assert_array_equal(np.array(values)[known], wheel[channel][there])
    pose = [(time, *each["translation"][0][:2]) for time, each in file.rows["/world/vehicle"]]
    recorded = np.column_stack([recording.pose.time_s, recording.pose.x_m, recording.pose.y_m])
    np.testing.assert_allclose(pose, recorded, atol=1e-4)
    texts = {row["text"][0] for _, row in file.rows["/log"]}
    assert {*summary.warnings, *summary.problems, *summary.notes} <= texts
    closed = [one.gate_reason for one in drive.soils if one.estimate is None]
    assert all(any(text.endswith(reason) for text in texts) for reason in closed)
    assert all(name in file.one("/summary", "text")[0] for name in summary.track_m)
    assert file.timelines == {"recording", "utc"}
    absolute, since_s = file.utc
    assert (absolute.replace(tzinfo=UTC) - recording.start_time).total_seconds() == pytest.approx(since_s, abs=1e-6)


def test_every_view_shows_something_and_everything_is_in_a_view(driven):
    file = driven[-1]
    assert len(file.views) == len(set(file.views)) + 1  # /world is in two
    entities = [entity for entity in file.rows if entity != "/__properties"]
    assert all(any(f"{each}/".startswith(f"{view}/") for each in entities) for view in file.views)
    assert all(any(f"{each}/".startswith(f"{view}/") for view in file.views) for each in entities)


def test_the_camera_looks_from_where_it_is_at_two_frames_a_second(driven):
    recording, _, _, file = driven
    frames = sorted((t, each["blob"][0]) for t, each in file.rows["/world/vehicle/camera/image"] if t is not None)
    assert len(frames) > 0.9 * 60.0 / 0.6
    assert np.diff([time for time, _ in frames]).min() >= FRAME_PERIOD_S
    assert cv2.imdecode(np.array(frames[0][1], np.uint8), cv2.IMREAD_COLOR).shape[1] <= WIDEST_PX
    camera: Camera = recording.vehicle.camera
    # Rerun's own convention, columns first: a point in front, by its matrices, and by those of the projection.
    turn = np.array(file.one("/world/vehicle/camera", "mat3x3")[0]).reshape(3, 3).T
    place = np.array(file.one("/world/vehicle/camera", "translation")[0])
    matrix = np.array(file.one("/world/vehicle/camera", "image_from_camera")[0]).reshape(3, 3).T
    np.testing.assert_allclose(turn, camera_axes(camera)[0].T, atol=1e-6)
    seen = matrix @ turn.T @ (np.array([4.0, 0.5, 0.0]) - place)
    flat = camera.model_copy(update={"distortion": ()})
    np.testing.assert_allclose(seen[:2] / seen[2], ground_to_image(flat, np.array([[4.0, 0.5]]))[0][0], atol=0.01)


def test_the_map_of_the_site_lies_where_its_cells_are(driven):
    _, _, drive, file = driven
    terrain, evidence = drive.terrain, drive.terrain.evidence
    form = file.one("/world/site_map", "format")[0]
    picture = np.array(file.one("/world/site_map", "data")[0], np.uint8).reshape(form["height"], form["width"], 4)
    corner = file.one("/world/site_map", "translation")[0]
    column = terrain.cell_x - round(corner[0] / terrain.cell_size_m)
    row = form["height"] - 1 - (terrain.cell_y - round(corner[1] / terrain.cell_size_m))
    named = ~evidence.unknown
    assert (picture[row, column, 3] > 0).all()
    assert (picture[..., 3] > 0).sum() == len(terrain)
    colours = {name: set() for name in evidence.classes}
    for name, pixel in zip(np.array(evidence.labels())[named], picture[row, column, :3][named], strict=True):
        colours[name].add(tuple(pixel))
    assert max(map(len, colours.values())) == 1


def test_a_value_that_is_not_known_is_an_empty_row(tmp_path):
    pytest.importorskip("rerun.chunk", reason=WITHOUT)
    time_s = np.array([0.0, 0.1, 0.2, 0.3, 0.4, 9.0])
    values = np.array([math.nan, 1.0, math.nan, math.nan, 2.0, 3.0])
    with opened(tmp_path / "s.rrd", datetime(2026, 3, 1, tzinfo=UTC)) as log:
        log.series("known", *broken(time_s, values))
        log.series("never", time_s, np.full(6, math.nan))
    file = File(tmp_path / "s.rrd")
    times, written = file.series("/known")
    assert times == [0.1, 0.2, 0.4, 0.4, 9.0]
    np.testing.assert_array_equal(written, [1.0, math.nan, 2.0, math.nan, 3.0])
    assert "/never" not in file.rows


def test_the_quality_is_not_that_of_another_model(driven, tmp_path):
    recording, summary, _, _ = driven
    other = Models({"audio": SimpleNamespace(version="another")}, {"audio": "audio.skops"})  # pyright: ignore
    write_rerun(summary, recording, tmp_path / "d.rrd", models=other)
    file = File(tmp_path / "d.rrd")
    assert "/senses/microphone/quality" not in file.rows
    assert any("the model of the run is not there" in row["text"][0] for _, row in file.rows["/log"])


def test_a_file_that_cannot_be_written_whole_is_not_there(driven, tmp_path, monkeypatch):
    recording, summary, _, _ = driven
    (tmp_path / "d.rrd").write_bytes(b"before")

    def full(*_):
        raise RuntimeError("No space left on device")

    monkeypatch.setattr("bevameter.framework.rerun_log.write_legend", full)
    with pytest.raises(InputError, match="No space left"):
        write_rerun(summary, recording, tmp_path / "d.rrd")
    assert [each.name for each in tmp_path.iterdir()] == ["d.rrd"]
    assert (tmp_path / "d.rrd").read_bytes() == b"before"
    monkeypatch.setenv("RERUN", "off")
    with pytest.raises(InputError, match="switches Rerun off"):
        write_rerun(summary, recording, tmp_path / "d.rrd")


def test_a_drive_of_wheels_alone_has_a_file_too(tmp_path):
    pytest.importorskip("rerun.chunk", reason=WITHOUT)
    rows = "".join(f"{0.1 * i:.1f},500,0.2,12,0.5\n" for i in range(100))
    (tmp_path / "wheel.csv").write_text("time_s,load_N,slip,torque_Nm,travel_speed_m_s\n" + rows)
    summary = run_traverse(tmp_path / "wheel.csv", tmp_path / "t.db")
    write_rerun(summary, read_recording(tmp_path / "wheel.csv"), tmp_path / "w.rrd")
    file = File(tmp_path / "w.rrd")
    assert file.timelines == {"recording"}
    assert file.series("/wheels/load_N/wheel")[1] == [500.0] * 100
    assert not any(entity.startswith(("/world/cells", "/world/site_map", "/soil")) for entity in file.rows)


@pytest.mark.parametrize(
    ("name", "said"),
    [("d.txt", ".rrd"), ("nowhere/d.rrd", "there is no folder"), ("d.rrd", 'pip install "bevameter[rerun]"')],
)
def test_what_cannot_be_written_is_refused_before_the_run(tmp_path, monkeypatch, name, said):
    monkeypatch.setitem(sys.modules, "rerun", None)
    monkeypatch.setitem(sys.modules, "rerun.blueprint", None)
    (tmp_path / "wheel.csv").write_text("time_s,load_N,slip\n0.0,500,0.1\n0.1,500,0.2\n")
    arguments = ["run", tmp_path / "wheel.csv", "--db", tmp_path / "t.db", "--rerun", tmp_path / name]
    result = CliRunner().invoke(app, list(map(str, arguments)))
    assert result.exit_code == 2
    assert len(result.stderr.splitlines()) == 1
    assert said in result.stderr
    assert not (tmp_path / "t.db").exists()


def test_one_recording_only(tmp_path):
    result = CliRunner().invoke(app, ["run", "a", "b", "--db", str(tmp_path / "t.db"), "--rerun", "d.rrd"])
    assert result.exit_code == 2
    assert "--rerun: 2 recordings (expected one recording, on this machine)" in result.stderr


def test_rerun_is_looked_for(monkeypatch, tmp_path):
    monkeypatch.setitem(sys.modules, "rerun.blueprint", None)
    with pytest.raises(InputError, match="is not installed"):
        check_rerun(tmp_path / "d.rrd")
