"""What `bevameter run` answers to bad input: one line, exit status 2, nothing written."""

from __future__ import annotations

import json

import numpy as np
import pytest
from bevameter import SoilEstimate
from bevameter.database.observations import SoilEffect, SoilObservation
from bevameter.framework.cli.main import app
from bevameter.framework.cli.results_run import print_summary
from bevameter.framework.core.findings import warning
from bevameter.framework.core.soil import Quantity
from bevameter.framework.summary import LearntSoil, TraverseSummary
from bevameter.framework.summary_text import soil_lines
from bevameter.identification.estimate.words import sentences
from typer.testing import CliRunner

WHEEL = "time_s,load_N,slip,torque_Nm\n0.0,500,0.1,12\n0.1,500,0.2,13\n"
VEHICLE = "[wheel]\nradius_m = 0.2\nwidth_m = 0.1\n"


@pytest.fixture
def folder(tmp_path):
    drive = tmp_path / "drive"
    drive.mkdir()
    (drive / "wheel.csv").write_text(WHEEL)
    (drive / "vehicle.toml").write_text(VEHICLE)
    return drive


def bad(tmp_path, *arguments):
    database, page = tmp_path / "t.db", tmp_path / "o.json"
    result = CliRunner().invoke(app, ["run", *map(str, arguments), "--db", str(database), "--json", str(page)])
    assert result.exit_code == 2, result.output
    assert len(result.stderr.splitlines()) == 1
    assert result.stderr.startswith("bevameter: ")
    assert not database.exists()
    assert not page.exists()
    return result.stderr


def test_a_missing_recording(tmp_path):
    assert "no such file" in bad(tmp_path, tmp_path / "nowhere")


def test_a_wheel_file_with_text_for_a_number(tmp_path, folder):
    (folder / "wheel.csv").write_text(WHEEL.replace("0.2,13", "abc,13"))
    said = bad(tmp_path, folder)
    assert "wheel.csv" in said
    assert "abc" in said


def test_a_vehicle_that_makes_no_sense(tmp_path, folder):
    (tmp_path / "v.toml").write_text("[wheel]\nradius_m = -1\nwidth_m = 0.1\n")
    assert "radius_m" in bad(tmp_path, folder, "--vehicle", tmp_path / "v.toml")


def test_models_that_are_not_there(tmp_path, folder):
    assert "no model" in bad(tmp_path, folder, "--models", tmp_path / "nowhere")


def test_a_topic_map_for_what_is_no_bag(tmp_path, folder):
    (tmp_path / "t.toml").write_text('[wheel]\ntopic = "/wheel"\n')
    assert "a topic map, which a bag needs" in bad(tmp_path, folder, "--topics", tmp_path / "t.toml")


def test_a_database_of_another_program_is_left_alone(tmp_path, folder):
    other = tmp_path / "other.db"
    other.write_text("my diary")
    result = CliRunner().invoke(app, ["run", str(folder), "--db", str(other)])
    assert result.exit_code == 2
    assert len(result.stderr.splitlines()) == 1
    assert other.read_text() == "my diary"


def test_an_output_that_cannot_be_written_is_refused_before_any_work(tmp_path, folder):
    arguments = ["run", str(folder), "--db", str(tmp_path / "t.db"), "--json", str(tmp_path / "no" / "o.json")]
    result = CliRunner().invoke(app, arguments)
    assert result.exit_code == 2
    assert not (tmp_path / "t.db").exists()


def test_wheels_alone_make_a_summary_that_says_what_is_missing(tmp_path, folder):
    result = CliRunner().invoke(app, ["run", str(folder), "--db", str(tmp_path / "t.db")])
    assert result.exit_code == 0, result.output
    assert "no camera in the recording" in result.output
    assert "no sound in the recording" in result.output
    assert "no places" in result.output


def test_several_recordings_make_a_table_and_one_that_fails_is_a_line(tmp_path, folder):
    page = tmp_path / "o.json"
    given = [str(folder), str(tmp_path / "nowhere"), str(folder)]
    result = CliRunner().invoke(app, ["run", *given, "--db", str(tmp_path / "t.db"), "--json", str(page)])
    assert result.exit_code == 2, result.output
    failure, count = result.stderr.splitlines()
    assert failure.startswith(f"bevameter: {tmp_path / 'nowhere'}: no such file")
    assert count == "bevameter: 1 of 3 recordings failed"
    header, *rows = result.stdout.splitlines()[:4]
    assert header.split()[0] == "recording"
    assert [row.split()[0] for row in rows] == given
    assert "failed" in rows[1]
    assert "known" in rows[2]
    assert result.stdout.count("no places and no travel speed") == 1  # of both recordings
    written = json.loads(page.read_text())
    assert written["schema"] == 1
    first, failed, again = written["recordings"]
    assert (first["schema"], first["known"], again["known"]) == (1, False, True)
    assert failed == {"source": given[1], "error": failure.removeprefix("bevameter: ")}


def test_a_model_that_does_not_fit_is_printed_and_written(capsys):
    finding = warning("wrong_form", misfit=4.2, misfit_with_freedom=1.2, c_Pa=900.0, phi_rad=0.5)
    estimate = SoilEstimate(
        {"c_Pa": Quantity(1e3, 1e2, 8e2, 12e2)}, np.array([1e3, 0.5]), np.eye(2), {}, (), {"c_Pa": False}, "", "ml",
        ("load_N",), 50, 4.2, (finding,),
    )  # fmt: skip
    effects = (SoilEffect("slip_sinkage", {"n1": 0.3}),)
    observed = SoilObservation(3.0, 9.0, 1.0, 2.0, {"sand": 1.0}, estimate, (5e3, 3e4), 80.0, effects)
    soils = (LearntSoil.of(estimate, observed),)
    summary = TraverseSummary(
        "drive", "drive", "0", "", "", "t.db", False, 9.0, 1.0, "", 0.5, False, {}, {}, 0, (), soils, {}, 6.0, 1, 0,
        (), (), 1.0,
    )  # fmt: skip
    print_summary(summary)
    printed = capsys.readouterr().out
    assert "sand, 3 to 9 s: the textbook's form does not hold" in printed
    assert "sand: slip_sinkage known from before and subtracted" in printed
    (soil,) = summary.as_dict()["soils"]
    assert (soil["misfit"], soil["problems"]) == (4.2, sentences(estimate.findings))
    assert soil["findings"][0]["code"] == "wrong_form"


def test_soil_of_ground_without_a_class_is_said_to_be_in_no_query():
    estimate = SoilEstimate(
        {"c_Pa": Quantity(1e3, 1e2, 8e2, 12e2)}, np.array([1e3, 0.5]), np.eye(2), {}, (), {"c_Pa": True}, "", "ml",
        ("load_N",), 50, 1.0,
    )  # fmt: skip
    nameless, sand = (
        LearntSoil.of(estimate, SoilObservation(3.0, 9.0, 1.0, 2.0, belief, estimate, (5e3, 3e4), 80.0))
        for belief in ({}, {"sand": 1.0})
    )
    assert soil_lines([sand]) == []
    (line,) = soil_lines([nameless, sand])
    assert line.startswith("the soil of 1 stretch is in no query: no class is probable enough there")
