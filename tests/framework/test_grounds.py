"""What says which grounds a drive led over: labels, else the map of a database, else nothing."""

from __future__ import annotations

import shutil
from dataclasses import replace

import numpy as np
import pytest
from bevameter import InputError, TerrainDatabase, explain
from bevameter.database.observations import Drive, TerrainObservations
from bevameter.framework.core.classifier.shipped import shipped_model
from bevameter.framework.core.evidence import ClassEvidence
from bevameter.framework.core.recording.camera import read_camera
from bevameter.framework.core.recording.types import Labels
from bevameter.framework.explain import store
from bevameter.framework.grounds import grounds_of
from bevameter.identification.explain.explanation import ExplainedGround
from explanations import SOIL, SOIL_TEXTBOOK, explanation
from ground_drive import LOAM, SAND, SPEED_M_S, ground_drive

DRIVE = ground_drive({"sand": SAND, "loam": LOAM})
BORDER_M = 20.0 * SPEED_M_S


def spans(grounds):
    return [(each.class_name, each.start_s, each.end_s) for each in grounds]


def test_labels_come_first_and_neighbours_of_one_class_are_one_ground():
    labels = Labels(np.array([0.0, 8.0, 20.0]), np.array([8.0, 20.0, 40.0]), ("sand", "sand", "loam"))
    grounds, source = grounds_of(replace(DRIVE, labels=labels))
    assert spans(grounds) == [("sand", 0.0, 20.0), ("loam", 20.0, 40.0)]
    assert "labels" in source


def test_where_nothing_says_it_there_are_none():
    assert grounds_of(replace(DRIVE, labels=None)) == ((), "")
    assert grounds_of(replace(DRIVE, labels=None, pose=None)) == ((), "")
    assert grounds_of(replace(DRIVE, wheel=None)) == ((), "")


@pytest.fixture
def map_of_the_track(tmp_path):
    """A database that knows the cells of the track, sand before the border and loam behind it."""
    return track_map(tmp_path, "a" * 64)


def track_map(tmp_path, model):
    cell_x = np.arange(-2, 20)
    p = np.where((0.5 * (cell_x + 0.5) < BORDER_M)[:, None], [0.03, 0.97], [0.97, 0.03])
    count = len(cell_x)
    evidence = ClassEvidence(("loam", "sand"), p, np.ones(count), np.zeros(count, dtype=bool), count * ((),))
    terrain = TerrainObservations(
        0.5, cell_x, np.zeros(count, dtype=int), 0.5 * cell_x, np.full(count, "fused"), evidence
    )
    path = tmp_path / "terrain.db"
    with TerrainDatabase(path) as database:
        database.add_drive(Drive("e" * 64, "before", "pit", "rover", None, {"camera": model}, "test", terrain, ()))
    return path


def test_without_labels_the_map_of_the_site_says_it(map_of_the_track):
    grounds, source = grounds_of(replace(DRIVE, labels=None, site="pit"), map_of_the_track)
    assert [each.class_name for each in grounds] == ["sand", "loam"]
    assert grounds[0].end_s == pytest.approx(20.0, abs=2.6)
    assert "terrain.db" in source


def test_a_map_by_the_packages_own_model_of_real_ground_counts_only_where_a_class_was_asked_for(tmp_path):
    path = track_map(tmp_path, shipped_model("vision-real").version)
    seen = replace(DRIVE, labels=None, site="pit")
    grounds, why = grounds_of(seen, path)
    assert grounds == ()
    assert why == f"the map of {path} has classes by vision-real, too often wrong to tell grounds apart: not used"
    assert [each.class_name for each in grounds_of(seen, path, doubtful=True)[0]] == ["sand", "loam"]


def test_the_map_of_another_site_says_nothing(map_of_the_track):
    assert grounds_of(replace(DRIVE, labels=None, site="elsewhere"), map_of_the_track) == ((), "")


def test_the_answer_says_what_the_classes_come_from():
    answer = explain(DRIVE, catalogue=("torque_offset",))
    assert [each.class_name for each in answer.grounds] == ["sand", "loam"]
    assert answer.notes[0] == "classes of ground: sand, loam, by labels of the recording"


def test_one_known_soil_for_several_grounds_is_refused(tmp_path):
    soil = tmp_path / "soil.toml"
    soil.write_text("c_Pa = 500.0\n")
    with pytest.raises(InputError, match="one soil for 2 grounds"):
        explain(DRIVE, soil=soil, catalogue=("torque_offset",))


def on_grounds(*names):
    """An answer whose grounds have these classes, the later ones more rows."""
    answer = explanation()
    count = len(names)
    soils = np.ravel(answer.vector[:5] + np.arange(count)[:, None] * [100.0, 0.0, 0.0, 0.0, 0.0])
    return replace(
        answer, simulator=replace(answer.simulator, grounds=count), vector=np.append(soils, answer.vector[5:]),
        grounds=tuple(
            ExplainedGround(name, 0.0, 1.0, 10 + at, SOIL, SOIL_TEXTBOOK) for at, name in enumerate(names)
        ),
    )  # fmt: skip


def test_each_class_is_stored_with_the_soil_of_its_ground_with_most_rows(tmp_path):
    assert store(on_grounds("sand", "loam", "sand", ""), tmp_path / "t.db") == ("sand", "loam")
    with TerrainDatabase(tmp_path / "t.db", must_exist=True) as database:
        cohesion = {name: database.physics(name)[0].physics.soil["c_Pa"].value for name in ("sand", "loam")}
    assert cohesion == {"sand": pytest.approx(712.0), "loam": pytest.approx(612.0)}


def test_a_class_for_several_grounds_or_none_for_one_is_refused(tmp_path):
    with pytest.raises(InputError, match="several grounds"):
        store(on_grounds("sand", "loam"), tmp_path / "t.db", "sand")
    with pytest.raises(InputError, match="--class"):
        store(on_grounds("", ""), tmp_path / "t.db")
    assert not list(tmp_path.iterdir())


def test_physics_of_several_grounds_is_that_of_one_of_them():
    answer = on_grounds("sand", "loam")
    with pytest.raises(InputError, match="2 grounds"):
        _ = answer.physics
    assert answer.physics_of(1).soil["c_Pa"].value == pytest.approx(612.0)


def test_labels_that_contradict_each_other_are_refused():
    times = np.array([0.0, 10.0]), np.array([20.0, 30.0])
    with pytest.raises(InputError, match="overlap"):
        grounds_of(replace(DRIVE, labels=Labels(*times, ("sand", "loam"))))
    with pytest.raises(InputError, match="one spelling"):
        grounds_of(replace(DRIVE, labels=Labels(times[0], np.array([10.0, 30.0]), ("sand", "Sand"))))
    (first, second), _ = grounds_of(
        replace(DRIVE, labels=Labels(times[0], np.array([10.0, 30.0]), ("sand", "unknown")))
    )
    assert (first.class_name, second.class_name) == ("sand", "")


def test_models_of_real_ground_that_come_with_the_package_do_not_tell_grounds_apart(tmp_path):
    shutil.copyfile(shipped_model("vision-real").example_file(), tmp_path / "0.png")
    (tmp_path / "camera.csv").write_text("time_s,file\n0.0,0.png\n")
    stream, _ = read_camera(tmp_path)
    seen = replace(DRIVE, labels=None, site="pit", camera=stream)
    grounds, why = grounds_of(seen)
    assert grounds == ()
    assert why == "vision: no model of your own, so they do not distinguish grounds"
    assert grounds_of(replace(seen, site="synthetic pit"))[1] != why
