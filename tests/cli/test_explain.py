"""`bevameter explain`: printed and written output, and bad input refused in one line."""

from __future__ import annotations

import json
import sqlite3
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest
from bevameter import TerrainDatabase
from bevameter.framework.cli.main import app
from explanations import SOUND, cannot_tell, explanation, nothing, several, unknown
from refusals import SOIL, VEHICLE, WHEEL, edited, refused
from typer.testing import CliRunner

EXPLAIN = "bevameter.framework.explain.explain"
KEYS = {
    "schema", "verdict", "summary", "n", "soil", "soil_textbook", "trust", "located", "missing", "candidates", "fit",
    "notes", "seed", "seconds", "screened", "grounds",
}  # fmt: skip


def call(*arguments):
    return CliRunner().invoke(app, ["explain", *map(str, arguments)])


@pytest.fixture
def answers(monkeypatch):
    """Have `explain` give a prepared answer; what it was called with is kept."""
    kept: dict = {}

    def prepare(answer):
        def stand_in(recording, **options):
            kept.update(options, recording=recording)
            options["progress"]("trying slip_sinkage[exponent]")
            return answer

        monkeypatch.setattr(EXPLAIN, stand_in)
        return kept

    return prepare


def test_the_answer_is_printed(answers):
    answers(explanation())
    result = call("wheel.csv")
    assert result.exit_code == 0, result.output
    for said in (
        "slip-sinkage (98 %)", "0.3 to 0.55", "n1 = 0.213 ± 0.019", "n = n0 + n1 |i|", "2.8 (2.4 to 3.3)",
        "0.512 ± 0.083", "Most probable of 2 candidates", explanation().trust,
        "note: 3 rows without load or slip are left out",
    ):  # fmt: skip
        assert said in result.stdout, said
    assert result.stderr == "", "progress is for terminals only"


@pytest.mark.parametrize(
    ("answer", "said"),
    [
        (nothing(), "400 rows"),
        (cannot_tell(), "to decide: measure drawbar pull"),
        (unknown(), "93 %"),
        (several(), "Possibly also: load gain (30 %)"),
    ],
    ids=["none", "cannot tell", "unknown", "several"],
)
def test_an_answer_of_any_kind_is_a_success(answers, answer, said):
    answers(answer)
    result = call("wheel.csv")
    assert result.exit_code == 0
    assert said in result.stdout


def test_every_option_reaches_the_function(answers):
    kept = answers(explanation())
    call("wheel.csv", "--vehicle", "v.toml", "--soil", "s.toml", "--simulated", "sim.csv", "--seed", 5)
    assert {name: str(kept[name]) for name in ("recording", "vehicle", "soil", "simulated", "seed")} == {
        "recording": "wheel.csv", "vehicle": "v.toml", "soil": "s.toml", "simulated": "sim.csv", "seed": "5",
    }  # fmt: skip


def test_json_and_report_are_written(answers, tmp_path):
    answers(explanation())
    result = call("wheel.csv", "--json", tmp_path / "o.json", "--report", tmp_path / "o.html")
    assert result.exit_code == 0, result.output
    page = json.loads((tmp_path / "o.json").read_text(encoding="utf-8"))
    assert set(page) == KEYS
    assert page["schema"] == 1
    assert page["located"][0]["variable"] == "slip"
    assert page["missing"][0]["parameters"]["n1"] == {"value": 0.2134, "sd": 0.0189}
    assert set(page["fit"]["channels"]["torque_Nm"]) >= {"rmse_before", "rmse_after", "noise", "n"}
    assert "slip-sinkage" in (tmp_path / "o.html").read_text(encoding="utf-8")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["o.html", "o.json"]


@pytest.mark.parametrize("option", ["--json", "--report"])
def test_outputs_that_cannot_be_written_are_refused_before_the_work(option, tmp_path, monkeypatch):
    monkeypatch.setattr(EXPLAIN, lambda *_, **__: pytest.fail("the work began"))
    refused(tmp_path, ["explain", "wheel.csv", option, tmp_path / "nowhere" / "o"], "nowhere", "there is no folder")
    refused(tmp_path, ["explain", "wheel.csv", option, tmp_path], "is a folder")


def test_the_sound_is_printed_under_a_heading_of_its_own(answers):
    answers(explanation(sound=SOUND))
    assert "\nSound\n" in call("wheel.csv").stdout


def test_what_was_found_is_stored_with_a_class(answers, tmp_path):
    answers(explanation())
    result = call("wheel.csv", "--db", tmp_path / "terrain.db", "--class", "sand")
    assert result.exit_code == 0, result.output
    assert "terrain.db with sand" in result.stdout.splitlines()[-1]
    with TerrainDatabase(tmp_path / "terrain.db", must_exist=True) as database:
        (kept,) = database.physics("sand")
    assert kept.source == explanation().source
    (effect,) = kept.physics.effects
    assert (effect.slug, effect.probability, effect.parameters["n1"].value) == ("slip_sinkage", 0.98, 0.2134)


def test_what_is_found_again_is_stored_once(answers, tmp_path):
    for _ in range(2):
        answers(explanation())
        result = call("wheel.csv", "--db", tmp_path / "terrain.db", "--class", "sand")
        assert result.exit_code == 0, result.output
    with closing(sqlite3.connect(tmp_path / "terrain.db")) as connection:
        assert connection.execute("SELECT count(*) FROM class_physics").fetchone() == (1,)


@pytest.mark.parametrize("answer", [nothing(), cannot_tell(), unknown()], ids=lambda answer: answer.verdict)
def test_nothing_is_stored_where_nothing_is_asserted_and_the_answer_is_not_lost(answers, answer, tmp_path):
    answers(answer)
    result = call("w.csv", "--db", tmp_path / "terrain.db", "--class", "sand", "--json", tmp_path / "o.json")
    assert result.exit_code == 2
    assert answer.verdict in result.stderr
    assert answer.trust in result.stdout
    assert [path.name for path in tmp_path.iterdir()] == ["o.json"]


def test_a_store_that_cannot_be_is_refused_before_the_work(tmp_path, monkeypatch):
    monkeypatch.setattr(EXPLAIN, lambda *_, **__: pytest.fail("the work began"))
    (tmp_path / "other.db").write_text("no database")
    refused(tmp_path, ["explain", "wheel.csv", "--db", tmp_path / "terrain.db"], "--class")
    refused(tmp_path, ["explain", "wheel.csv", "--class", "sand"], "--db")
    refused(tmp_path, ["explain", "wheel.csv", "--db", tmp_path / "terrain.db", "--class", "unknown"], "--class")
    refused(tmp_path, ["explain", "wheel.csv", "--db", tmp_path / "other.db", "--class", "sand"], "other.db")
    refused(tmp_path, ["explain", "wheel.csv", "--db", tmp_path / "no" / "t.db", "--class", "sand"], "t.db")


@pytest.fixture
def drive(tmp_path) -> Path:
    folder = tmp_path / "drive"
    folder.mkdir()
    (folder / "wheel.csv").write_text(WHEEL)
    (folder / "vehicle.toml").write_text(VEHICLE)
    return folder


def command(folder: Path, recording: Path, *more) -> list:
    return ["explain", recording, "--json", folder / "o.json", "--report", folder / "o.html", *more]


def test_bad_recordings_are_refused(drive, tmp_path):
    refused(tmp_path, command(tmp_path, tmp_path / "none.csv"), "none.csv", "no such file")
    (drive / "wheel.csv").write_text(edited(5, "503", "heavy"))
    refused(tmp_path, command(tmp_path, drive), "wheel.csv", "row 5", "'heavy'")
    (drive / "wheel.csv").write_text("time_s,load_N,slip\n" + "".join(f"{i},500,0.2\n" for i in range(40)))
    refused(tmp_path, command(tmp_path, drive), "wheel.csv", "torque_Nm, sinkage_m or drawbar_pull_N")
    (drive / "wheel.csv").write_text("\n".join(WHEEL.split("\n")[:4]) + "\n")
    refused(tmp_path, command(tmp_path, drive), "wheel.csv", "3 rows", "at least")
    (drive / "wheel.csv").unlink()
    refused(tmp_path, command(tmp_path, drive), "drive", "wheel.csv")
    (drive / "pose.csv").write_text("time_s,x_m,y_m,yaw_rad\n0,0,0,0\n2,0.5,0,0\n")
    refused(tmp_path, command(tmp_path, drive), "drive", "no wheel channels")


def test_bad_vehicles_soils_and_simulations_are_refused(drive, tmp_path):
    wheel = tmp_path / "wheel.csv"
    wheel.write_text(WHEEL)
    refused(tmp_path, command(tmp_path, wheel), "wheel.csv", "no wheel geometry", "--vehicle")
    refused(tmp_path, command(tmp_path, wheel, "--vehicle", tmp_path / "none.toml"), "none.toml", "no such file")
    (tmp_path / "flat.toml").write_text(VEHICLE.replace("0.2", "-0.2"))
    refused(tmp_path, command(tmp_path, wheel, "--vehicle", tmp_path / "flat.toml"), "flat.toml", "radius_m", "-0.2")
    (tmp_path / "soil.toml").write_text(SOIL.replace("30.0", "95"))
    refused(tmp_path, command(tmp_path, drive, "--soil", tmp_path / "soil.toml"), "soil.toml", "phi_deg", "95")
    refused(tmp_path, command(tmp_path, drive, "--simulated", tmp_path / "sim.csv"), "sim.csv")


def test_a_negative_seed_is_refused():
    assert call("wheel.csv", "--seed", -1).exit_code == 2


@pytest.mark.slow
def test_real_sand_is_answered(shared_data, tmp_path):
    """Real: a smooth wheel in dry sand. Whatever the answer, it is whole, and held-out error does not grow."""
    sand = shared_data / "single-wheel-sand"
    report = tmp_path / "sand.html"
    result = call(
        sand / "wheel.csv", "--vehicle", sand / "vehicle.toml", "--json", tmp_path / "o.json", "--report", report
    )
    assert result.exit_code == 0, result.output
    page = json.loads((tmp_path / "o.json").read_text(encoding="utf-8"))
    assert set(page) >= KEYS
    assert page["verdict"] in ("physics", "instrument", "unknown", "cannot_tell"), "not to within noise"
    fits = page["fit"]["channels"]
    assert set(fits) == {"sinkage_m", "drawbar_pull_N"}
    ratio = [fit["rmse_after"] / fit["rmse_before"] for fit in fits.values()]
    assert np.prod(ratio) < 1.0
    assert result.stdout.splitlines()[0].split(" (")[0] in report.read_text(encoding="utf-8").replace("&nbsp;", " ")
