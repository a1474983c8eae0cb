"""A class that is stated of a whole recording: soil of a vehicle without senses, and evidence beside a camera's."""

from __future__ import annotations

import numpy as np
import pytest
from bevameter import InputError, TerrainDatabase
from bevameter.framework.batch import run_traverses
from bevameter.framework.cli.results_run import print_summary
from bevameter.framework.core.recording.types import Pose
from bevameter.framework.default_models import Models
from bevameter.framework.stated_ground import observe_stated
from bevameter.framework.traverse import run_traverse
from slow_drive import drive, recording


@pytest.fixture(scope="module")
def driven():
    """A wheel on sand with its places, and no camera, sound or inertial sensor."""
    table = drive(np.random.default_rng(5))
    time_s = table["time_s"]
    found = recording(table)
    zero = np.zeros_like(time_s)
    return type(found)(**{**vars(found), "pose": Pose(time_s, 0.15 * time_s, zero, zero), "site": "pit"})


@pytest.fixture(scope="module")
def stored(driven, tmp_path_factory):
    path = tmp_path_factory.mktemp("stated") / "t.db"
    return path, run_traverse(driven, path, ground="sand")


def test_the_soil_of_a_vehicle_without_senses_belongs_to_the_class_that_is_stated(driven, stored, capsys):
    path, summary = stored
    assert [soil.class_name for soil in summary.soils] == ["sand"]
    assert summary.track_m == {"sand": pytest.approx(0.15 * 29.9, abs=0.01)}
    with TerrainDatabase(path) as database:
        answer = database.snapshot().along(np.array([[2.0, 0.0], [2.0, 30.0]]))
    assert answer.class_names == ("sand",)
    assert np.isfinite(answer.shear_strength[0])
    assert not answer.known[1]
    print_summary(summary)
    assert "operator: sand, as stated for the whole recording" in capsys.readouterr().out


def test_a_statement_is_another_processing_of_the_drive(driven, stored, tmp_path):
    path, _ = stored
    assert run_traverse(driven, path, ground="sand").known
    (plain,) = run_traverses([driven], tmp_path / "plain.db")
    (said,) = run_traverses([driven], tmp_path / "said.db", ground="sand")
    assert plain.track_m == {"unknown": pytest.approx(said.track_m["sand"])}


@pytest.mark.parametrize(("ground", "says"), [("", "a class named ''"), ("unknown", "closed gate"), (3, "the name of")])
def test_what_is_no_class_is_refused(ground, says, driven, tmp_path):
    with pytest.raises(InputError, match=f"^ground: .*{says}"):
        run_traverse(driven, tmp_path / "t.db", ground=ground)
    assert not (tmp_path / "t.db").exists()


def test_another_spelling_than_in_the_database_is_refused(driven, stored):
    with pytest.raises(InputError, match=r"^ground: a class named 'Sand ' .*'sand', as it is spelt here"):
        run_traverse(driven, stored[0], ground="Sand ")


def test_a_statement_speaks_against_the_other_classes_of_a_model(driven, small_models):
    from bevameter.framework.core.track.way import track_of
    from bevameter.framework.default_models import find_models

    models = find_models(small_models, senses=["vision"])
    (record,) = observe_stated("clay", driven, track_of(driven), models, 0.5)
    assert record.map.classes == models.classifiers["vision"].classes
    assert observe_stated(None, driven, track_of(driven), Models({}, {}), 0.5) == ()
    assert record.said == {"clay": record.items}
