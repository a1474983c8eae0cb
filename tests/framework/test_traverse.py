"""The main job with senses and wheels of prescribed answers: what is fused, stored, reported and left out."""

from __future__ import annotations

import itertools
import json
import math
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from bevameter.audio import listen as listening
from bevameter.database.store import TerrainDatabase
from bevameter.framework import segments
from bevameter.framework.cli.printing import write_json
from bevameter.framework.core.classifier.shipped import shipped_model
from bevameter.framework.core.errors import InputError
from bevameter.framework.core.evidence import ClassEvidence
from bevameter.framework.core.findings import warning
from bevameter.framework.core.recording.types import Pose, Recording, WheelTable
from bevameter.framework.core.soil import Quantity, ShearStrength, SoilEstimate
from bevameter.framework.core.vehicle import Camera, Vehicle, Wheel
from bevameter.framework.default_models import Models
from bevameter.framework.summary_page import write_report
from bevameter.framework.traverse import run_traverse
from bevameter.identification.estimate.identify import Segment
from bevameter.vision import observe as looking

CLASSES = ("loam", "sand")
CHANGE_M = 20.0


class Stream(list):
    """Stands for a camera or a microphone; what is seen and heard comes from the fakes below."""

    duration_s = 40.0


def vehicle():
    camera = Camera(
        matrix=((400.0, 0.0, 320.0), (0.0, 400.0, 240.0), (0.0, 0.0, 1.0)),
        width_px=640, height_px=480, height_m=1.0, pitch_rad=0.4,
    )  # fmt: skip
    return Vehicle(name="rover", wheels=(Wheel(radius_m=0.2, width_m=0.1),), camera=camera)


def recording(**streams):
    t = np.arange(0.0, 40.0, 0.1)
    zero = np.zeros_like(t)
    wheel = {"time_s": t, "load_N": np.full_like(t, 500.0), "slip": zero + 0.2, "travel_speed_m_s": zero + 1.0}
    parts = {
        "wheel": WheelTable(wheel, None, None, Path("wheel.csv")),
        "pose": Pose(t, t, zero, zero),
        "camera": Stream([1, 2]),
        "sound": Stream(),
        "vehicle": vehicle(),
    } | streams
    return Recording("drive", Path("drive"), start_time=None, site="field", digest="ab" * 32, **parts)


def said(x_m, sure, closed, reason):
    """Evidence of the truth (sand, then loam) with probability `sure`; closed where said so."""
    sand = np.where(x_m < CHANGE_M, sure, 1.0 - sure)
    sand = np.where(closed, 0.5, sand)
    return ClassEvidence(
        CLASSES, np.column_stack([1 - sand, sand]), np.where(closed, 0.0, 0.9), closed,
        tuple((reason,) if one else () for one in closed),
    )  # fmt: skip


@pytest.fixture
def world(monkeypatch):
    """Senses that state the true class outside their drop-outs, and c = 1 kPa for each stretch."""
    blind, deaf = (5.0, 8.0), (7.0, 12.0)

    def observe_ground(camera, lens, pose_at, speed_at, model, cell_size_m):
        for time in np.arange(0.0, 40.0, 0.5):
            x, _, _ = pose_at(np.array([time]))
            ahead = np.repeat(x + np.arange(0.25, 3.0, 0.5), 3)
            y = np.tile([-0.75, 0.25, 0.75], len(ahead) // 3)
            closed = (ahead >= blind[0]) & (ahead < blind[1])
            yield SimpleNamespace(
                time_s=np.full(len(ahead), time), x_m=ahead, y_m=y, evidence=said(ahead, 0.85, closed, "blurred")
            )

    def listen(sound, model):
        start = np.arange(0.0, 39.5, 0.5)
        for part in np.array_split(start, 6):
            closed = (part >= deaf[0]) & (part < deaf[1])
            yield SimpleNamespace(start_s=part, end_s=part + 0.5, evidence=said(part, 0.8, closed, "wind"))

    def identify_segments(recording, *, boundaries_s=()):
        edges = [0.0, *np.asarray(boundaries_s).tolist(), 30.0, 39.9]
        return tuple(
            Segment(start, end, end <= 30.0, "" if end <= 30.0 else "too fast", 150, soil if end <= 30.0 else None)
            for start, end in itertools.pairwise(edges)
        )

    soil = estimate(1000.0, 0.55)
    monkeypatch.setattr(looking, "observe_ground", observe_ground)
    monkeypatch.setattr(listening, "listen", listen)
    monkeypatch.setattr(segments, "identify_segments", identify_segments)


def estimate(c_Pa, phi_rad):
    return SoilEstimate(
        {"c_Pa": Quantity(c_Pa, 100.0, c_Pa - 200, c_Pa + 200), "phi_rad": Quantity(phi_rad, 0.02, 0.5, 0.6)},
        np.array([c_Pa, math.tan(phi_rad)]), np.diag([1e4, 4e-4]), {"c_Pa,phi_rad": 0.0},
        (ShearStrength(5e3, 4e3, 3e3, 5e3), ShearStrength(2e4, 1.3e4, 1.2e4, 1.4e4)),
        {"c_Pa": True, "phi_rad": True}, "", "ml", ("load_N", "slip", "torque_Nm"), 150, 1.0,
    )  # fmt: skip


MODELS = Models(
    {
        "vision": SimpleNamespace(version="v" * 64, settings={}),
        "audio": SimpleNamespace(version="a" * 64, settings={}),
    },  # pyright: ignore
    {"vision": "vision.skops", "audio": "audio.skops"},
    (),
)


def test_a_drive_gives_a_map(world, tmp_path):
    summary = run_traverse(recording(), tmp_path / "t.db", models=MODELS)
    assert summary.distance_m == pytest.approx(39.9)
    assert summary.track_m["sand"] == pytest.approx(20.0, abs=1.5)
    assert summary.track_m["loam"] == pytest.approx(20.0, abs=1.5)
    # Between 7 m and 8 m both were closed: unknown on the track.
    assert summary.track_m["unknown"] == pytest.approx(1.0, abs=0.6)
    with TerrainDatabase(tmp_path / "t.db") as database:
        view = database.snapshot()
    ahead = view.along(np.array([[6.2, 0.2], [10.2, 0.2], [30.2, 0.2], [7.7, 0.7], [3.0, 50.0]]))
    assert list(np.array(ahead.class_names)[np.argmax(ahead.class_probability[:3], axis=1)]) == ["sand", "sand", "loam"]
    assert "blurred" in str(ahead.reason[3])
    assert ahead.known[:3].all()
    assert not ahead.known[3:].any()


def test_the_report_is_one_page_of_what_the_summary_says(world, tmp_path):
    driven = recording()
    for known in (False, True):
        summary = run_traverse(driven, tmp_path / "t.db", models=MODELS)
        assert summary.known == known
        write_report(summary, driven, tmp_path / "run.html")
        page = (tmp_path / "run.html").read_text().replace("&nbsp;", " ")
        assert ("Cells seen: " if known else "Driven: ") in page
        assert page.count("data:image/png;base64,") == 1
        for soil in summary.soils:
            assert f"{soil.parameters['c_Pa'].value / 1e3:.2f} (" in page
        assert "bevameter query classes" in page


def test_the_report_of_a_drive_without_any_ground_has_no_map(world, tmp_path):
    driven = recording(camera=None, sound=None)
    summary = run_traverse(driven, tmp_path / "t.db", models=Models({}, {}, ()))
    write_report(summary, driven, tmp_path / "run.html")
    assert "There is no map" in (tmp_path / "run.html").read_text()


def test_gaps_of_the_poses_are_left_off_the_map_and_reported(world, tmp_path):
    t = np.concatenate([np.arange(0.0, 25.0, 0.1), np.arange(35.0, 40.0, 0.1)])
    holed = recording(pose=Pose(t, t, np.zeros_like(t), np.zeros_like(t)))
    first, again = (run_traverse(holed, tmp_path / "t.db", models=MODELS) for _ in range(2))
    assert first.problems[0].startswith("no places for 10.1 s from 24.9 s to 35.0 s")
    assert again.problems[0] == first.problems[0]
    assert first.senses[1].doubted == {"where no place was recorded": 20}
    assert first.track_m["unknown"] > 6.0  # the camera looks 3 m into the hole
    with TerrainDatabase(tmp_path / "t.db") as database:
        ahead = database.snapshot().along(np.array([[20.2, 0.2], [31.2, 0.2], [37.2, 0.2]]))
    np.testing.assert_array_equal(np.isnan(ahead.class_probability[:, 0]), [False, True, False])


def test_the_summary_states_the_weight_of_each_sense(world, tmp_path):
    camera, microphone, _ = run_traverse(recording(), tmp_path / "t.db", models=MODELS).senses
    assert camera.closed == {"blurred": camera.items - round(camera.trusted_share * camera.items)}
    assert microphone.closed == {"wind": 10}
    assert microphone.trusted_share == pytest.approx(1 - 10 / 79)
    assert camera.mean_quality == pytest.approx(0.9)
    assert set(camera.said) == {"loam", "sand"}
    assert sum(camera.said.values()) == pytest.approx(1.0)
    assert microphone.cells == pytest.approx(70, abs=3)


def test_soil_is_attached_to_the_class_and_cut_where_it_changes(world, tmp_path):
    summary = run_traverse(recording(), tmp_path / "t.db", models=MODELS)
    assert [soil.class_name for soil in summary.soils] == ["sand", "loam"]
    # Half a metre on either side of the change is left out, at 1 m/s.
    assert summary.soils[0].end_s == pytest.approx(CHANGE_M - 0.5, abs=0.7)
    assert summary.soils[1].start_s - summary.soils[0].end_s == pytest.approx(1.0, abs=0.3)
    assert summary.soils[0].class_probability > 0.8
    assert summary.closed_s == {"too fast": pytest.approx(9.9), "at a change of ground": pytest.approx(1.0, abs=0.3)}
    assert summary.used_s == pytest.approx(29.0, abs=0.3)
    with TerrainDatabase(tmp_path / "t.db") as database:
        drive = database.drives()[0]
        soils = database.snapshot().soils
    assert set(soils) == {"sand", "loam"}
    assert soils["sand"].strength.mean[0] == pytest.approx(1000.0, rel=0.05)
    assert drive.soils[0].x_m == pytest.approx(10.0, abs=0.6)
    assert drive.soils[0].normal_stress_Pa == (5e3, 2e4)
    assert drive.soils[0].load_N == pytest.approx(500.0)
    assert drive.soils[3].gate_reason == "too fast"


def test_where_the_simulation_lacks_something_a_run_names_the_class_and_the_command(world, tmp_path, monkeypatch):
    def identify_segments(recording, *, boundaries_s=()):
        wrong = warning("wrong_form", misfit=2.1, misfit_with_freedom=1.0, c_Pa=900.0, phi_rad=0.5)
        soils = (replace(estimate(1000.0, 0.55), findings=(wrong,)), estimate(1000.0, 0.55))
        return (Segment(0.0, 15.0, True, "", 150, soils[0]), Segment(25.0, 39.9, True, "", 150, soils[1]))

    monkeypatch.setattr(segments, "identify_segments", identify_segments)
    first, again = (run_traverse(recording(), tmp_path / "t.db", models=MODELS) for _ in range(2))
    assert again.known
    for summary in (first, again):
        assert "on sand: `bevameter explain drive --db" in summary.warnings[-1]
    weak = {**MODELS.classifiers, "vision": SimpleNamespace(version=shipped_model("vision-real").version, settings={})}
    summary = run_traverse(recording(), tmp_path / "w.db", models=Models(weak, MODELS.origins))  # pyright: ignore
    assert (
        "on sand: `bevameter explain drive`, with the --vehicle and" in summary.warnings[-1]
    )  # classes are too doubtful to store by


def test_a_second_run_adds_nothing(world, tmp_path):
    first = run_traverse(recording(), tmp_path / "t.db", models=MODELS)
    second = run_traverse(recording(), tmp_path / "t.db", models=MODELS)
    assert first.observations_new > 200
    assert first.observations_known == 0
    assert (second.observations_new, second.observations_known) == (0, first.observations_new)


def test_other_models_make_another_processing_of_the_same_drive(world, tmp_path):
    run_traverse(recording(), tmp_path / "t.db", models=MODELS)
    other = Models(
        {**MODELS.classifiers, "audio": SimpleNamespace(version="b" * 64, settings={})}, MODELS.origins, ("audio",)
    )  # pyright: ignore
    assert run_traverse(recording(), tmp_path / "t.db", models=other).observations_new > 0
    with TerrainDatabase(tmp_path / "t.db") as database:
        assert len(database.drives()) == 2
        assert database.snapshot().drives == 1
        assert database.drives()[1].models["microphone"].startswith("synthetic")


@pytest.mark.parametrize("stage", ["camera", "soil", "storing"])
def test_an_interrupt_leaves_the_database_unchanged(world, tmp_path, stage):
    run_traverse(recording(), tmp_path / "t.db", models=MODELS)
    before = (tmp_path / "t.db").read_bytes()

    def interrupt(name, share):
        if name == stage:
            raise KeyboardInterrupt

    other = Recording(**{**vars(recording()), "digest": "cd" * 32})
    with pytest.raises(KeyboardInterrupt):
        run_traverse(other, tmp_path / "t.db", models=MODELS, progress=interrupt)
    assert (tmp_path / "t.db").read_bytes() == before


def test_what_a_sense_raises_reaches_the_caller(world, tmp_path, monkeypatch):
    def listen(sound, model):
        raise InputError("audio.skops", "no sound classifier")
        yield

    monkeypatch.setattr(listening, "listen", listen)
    with pytest.raises(InputError, match="no sound classifier"):
        run_traverse(recording(), tmp_path / "t.db", models=MODELS)
    assert not (tmp_path / "t.db").exists()


def test_a_missing_camera_is_reported_and_the_microphone_is_used(world, tmp_path):
    summary = run_traverse(recording(camera=None), tmp_path / "t.db", models=MODELS)
    assert summary.senses[0].absent == "no camera in the recording"
    assert summary.senses[0].items == 0
    assert summary.track_m["sand"] > 10


def test_a_camera_without_geometry_is_reported(world, tmp_path):
    blind = Vehicle(wheels=vehicle().wheels)
    summary = run_traverse(recording(vehicle=blind), tmp_path / "t.db", models=MODELS)
    assert "[camera]" in summary.senses[0].absent


def test_a_missing_sound_is_reported(world, tmp_path):
    summary = run_traverse(recording(sound=None), tmp_path / "t.db", models=MODELS)
    assert summary.senses[1].absent == "no sound in the recording"
    assert summary.track_m["loam"] > 10


def test_without_wheels_no_soil_is_learnt_and_that_is_reported(world, tmp_path):
    summary = run_traverse(recording(wheel=None), tmp_path / "t.db", models=MODELS)
    assert summary.soils == ()
    assert any("no wheel channels" in text for text in summary.problems)


def test_without_senses_soil_is_stored_without_a_class(world, tmp_path):
    summary = run_traverse(recording(camera=None, sound=None), tmp_path / "t.db", models=Models({}, {}, ()))
    assert [soil.class_name for soil in summary.soils] == [None]
    with TerrainDatabase(tmp_path / "t.db") as database:
        assert database.snapshot().soils == {}
        assert len(database.drives()[0].soils) == 2
    assert summary.track_m == {"unknown": pytest.approx(39.9)}


def test_without_places_nothing_is_mapped_and_that_is_reported(world, tmp_path):
    table = WheelTable({"time_s": np.arange(10.0), "load_N": np.ones(10)}, None, None, Path("wheel.csv"))
    summary = run_traverse(recording(pose=None, wheel=table), tmp_path / "t.db", models=MODELS)
    assert summary.places == ""
    assert any("no places" in text for text in summary.warnings)
    assert summary.senses[0].absent == "no places in the recording"


def test_trials_are_refused(world, tmp_path):
    table = WheelTable({"slip": np.ones(3), "load_N": np.ones(3)}, None, np.array(["1", "2", "3"]), Path("trials.csv"))
    with pytest.raises(InputError, match="steady-state trials have no time and place"):
        run_traverse(recording(pose=None, wheel=table, camera=None, sound=None), tmp_path / "t.db", models=MODELS)
    assert not (tmp_path / "t.db").exists()


def test_dead_reckoning_is_reported(world, tmp_path):
    summary = run_traverse(recording(pose=None), tmp_path / "t.db", models=MODELS)
    assert summary.places == "dead reckoning"
    assert any("heading unknown" in text for text in summary.warnings)


def test_a_drive_without_positions_adds_no_cells_but_its_soils(world, tmp_path):
    run_traverse(recording(pose=None), tmp_path / "t.db", models=MODELS)
    with TerrainDatabase(tmp_path / "t.db") as database:
        (drive,) = database.drives()
        snapshot = database.snapshot()
    assert len(drive.terrain) == 0
    assert "sand" in snapshot.soils
    assert all(np.isnan(soil.x_m) for soil in drive.soils)
    assert not snapshot.at(5.0, 0.0).known.any()


def test_soil_that_cannot_be_identified_is_reported(world, tmp_path, monkeypatch):
    def identify_segments(recording, **options):
        raise InputError("wheel.csv", "no slip was observed")

    monkeypatch.setattr(segments, "identify_segments", identify_segments)
    summary = run_traverse(recording(), tmp_path / "t.db", models=MODELS)
    assert summary.problems == ("no soil was identified: wheel.csv: no slip was observed",)
    assert summary.track_m["sand"] > 10


def test_models_of_synthetic_ground_are_warned_about(world, tmp_path):
    said = {"vision": "vision-synthetic knows synthetic ground only"}
    models = Models(MODELS.classifiers, MODELS.origins, ("vision", "audio"), {"audio": "which and why"}, said)
    summary = run_traverse(recording(), tmp_path / "t.db", models=models)
    assert summary.synthetic
    assert summary.warnings[0] == said["vision"]
    assert "which and why" in summary.notes
    assert summary.senses[0].synthetic_model


def test_the_summary_is_json(world, tmp_path):
    summary = run_traverse(recording(), tmp_path / "t.db", models=MODELS)
    write_json(summary.as_dict(), tmp_path / "out.json")
    page = json.loads((tmp_path / "out.json").read_text())
    assert page["schema"] == 1
    assert page["soils"][0]["parameters"]["c_Pa"]["low"] == 800.0
    assert page["senses"][1]["closed"] == {"wind": 10}


def test_progress_ends_at_one_for_every_stage(world, tmp_path):
    reported = {}
    run_traverse(recording(), tmp_path / "t.db", models=MODELS, progress=reported.__setitem__)
    assert reported == {"reading": 1.0, "camera": 1.0, "microphone": 1.0, "soil": 1.0, "storing": 1.0}
