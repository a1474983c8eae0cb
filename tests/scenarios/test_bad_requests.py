"""Bad soils, databases, models and labels through the command line: one line, exit 2, nothing written."""

from __future__ import annotations

import sqlite3
from pathlib import Path

import numpy as np
import pytest
from refusals import (
    SOIL,
    identify,
    picture,
    refused,
    run,
    sound,
)

# A library's warning would be a second line on the user's stderr.
pytestmark = pytest.mark.filterwarnings("error")

SOIL_FAULTS = {
    "steeper than any soil": (SOIL.replace("30.0", "95"), ("phi_deg", "95", "0 to 60")),
    "typing error": (SOIL.replace("c_Pa", "cohesion_Pa"), ("cohesion_Pa", "no such key")),
    "text": (SOIL.replace("500.0", "'soft'"), ("c_Pa", "'soft'", "a number")),
    "no value": (SOIL.replace("500.0", "{sd = 5}"), ("c_Pa", "value")),
    "negative spread": (SOIL.replace("500.0", "{value = 500.0, sd = -5}"), ("key c_Pa", "sd -5", "at least")),
    "no spread to speak of": (
        SOIL.replace("30.0", "{value = 30, sd = 1e-300}"),
        ("key phi_deg", "sd 1e-300", "6e-11"),
    ),
    "not finite": (SOIL.replace("500.0", "nan"), ("c_Pa", "nan")),
    "no TOML": ("c_Pa 500", ("valid TOML",)),
    "empty": ("", ("no value", "c_Pa")),
}


@pytest.mark.parametrize("fault", SOIL_FAULTS)
@pytest.mark.parametrize("command", ["simulate", "identify"])
def test_a_bad_soil(fault, command, drive, tmp_path):
    text, said = SOIL_FAULTS[fault]
    (tmp_path / "soil.toml").write_text(text)
    if command == "identify":
        arguments = identify(tmp_path, drive, "--soil", tmp_path / "soil.toml")
    else:
        arguments = simulate(drive, tmp_path)
    refused(tmp_path, arguments, "soil.toml", *said)


def simulate(drive: Path, folder: Path, out: str = "s.csv") -> list:
    return [
        "simulate", drive / "wheel.csv", "--vehicle", drive / "vehicle.toml", "--soil", folder / "soil.toml",
        "--out", folder / out,
    ]  # fmt: skip


def test_a_simulation_that_cannot_be(drive, tmp_path):
    soil = tmp_path / "soil.toml"
    refused(tmp_path, simulate(drive, tmp_path), "soil.toml", "no such file")
    soil.write_text("c_Pa = 500.0\n")
    refused(tmp_path, simulate(drive, tmp_path), "soil.toml", "phi_deg")
    soil.write_text(SOIL)
    refused(tmp_path, simulate(drive, tmp_path, "nowhere/s.csv"), "nowhere", "there is no folder")
    refused(tmp_path, simulate(drive, tmp_path, "s.txt"), "s.txt", ".csv, .csv.gz or .parquet")
    refused(tmp_path, [*simulate(drive, tmp_path), "--effect", "gravity"], "'gravity'")
    (drive / "wheel.csv").write_text("time_s,load_N\n0,500\n1,500\n")
    refused(tmp_path, simulate(drive, tmp_path), "wheel.csv", "no column slip")


def folder_of(path: Path) -> Path:
    path.mkdir()
    return path


def text_of(path: Path) -> Path:
    path.write_text("Dear diary, today I learnt nothing.")
    return path


def database_of(path: Path) -> Path:
    with sqlite3.connect(path) as database:
        database.execute("CREATE TABLE recipe (name TEXT)")
        database.execute("INSERT INTO recipe VALUES ('soup')")
    database.close()
    return path


DATABASES = {
    "folder": (folder_of, ("is a folder",)),
    "text": (text_of, ("is not a database",)),
    "other program": (database_of, ("a database of another program", "recipe")),
    "nowhere": (lambda path: path / "deep" / "t.db", ("no such folder",)),
    "another kind": (lambda path: "mysql://server/terrain", ("'mysql'", "postgresql")),
    "no URL": (lambda path: "sqlite://", ("no file",)),
}


@pytest.mark.parametrize("kind", DATABASES)
def test_a_database_of_another_program(kind, drive, tmp_path, models, monkeypatch):
    monkeypatch.chdir(tmp_path)
    make, said = DATABASES[kind]
    database = make(tmp_path / "other.db")
    options = ["--db", database]
    refused(tmp_path, ["run", drive, *options, "--models", models], *said)
    if kind != "nowhere":
        refused(tmp_path, ["query", "classes", *options], *said)
        refused(tmp_path, ["map", "--out", tmp_path / "m.png", *options], *said)


def test_a_missing_database_is_not_created_by_a_query(tmp_path):
    options = ["--db", tmp_path / "none.db"]
    for query in (["classes"], ["class", "sand"], ["at", "1", "2"], ["near", "1", "2", "--radius", "3"]):
        refused(tmp_path, ["query", *query, *options], "none.db", "no such file")
    refused(tmp_path, ["map", "--out", tmp_path / "m.png", *options], "none.db", "no such file")


def test_invalid_queries(tmp_path):
    for query, said in (
        (["at", "east", "2"], ("X", "'east'")),
        (["at", "1", "nan"], ("Y", "'nan'")),
        (["near", "1", "2", "--radius", "far"], ("--radius", "'far'")),
        (["classes", "--format", "xml"], ("--format", "'xml'", "geojson")),
        (["classes", "--normal-stress", "20 kg"], ("--normal-stress", "'20 kg'")),
        (["along", str(tmp_path / "none.csv")], ("none.csv", "no such file")),
    ):
        if query[:1] == ["classes"] and "geojson" in said:
            said = said[:2]
        refused(tmp_path, ["query", *query, "--db", tmp_path / "none.db"], *said)


@pytest.mark.parametrize("sense", ["vision", "audio"])
def test_files_that_are_no_models(sense, drive, tmp_path, models):
    chosen = tmp_path / "chosen"
    chosen.mkdir()
    model = chosen / f"{sense}.skops"
    file = picture(tmp_path / "p.jpg") if sense == "vision" else sound(tmp_path / "s.wav")
    other = models / ("audio.skops" if sense == "vision" else "vision.skops")
    for content, said in (
        (np.random.default_rng(2).bytes(5000), "not a readable model"),
        (b"", "not a readable model"),
        (other.read_bytes(), f"expected a model for {sense}"),
    ):
        model.write_bytes(content)
        command = ["classify", sense, file, "--model", model, "--json", tmp_path / "o.json"]
        refused(tmp_path, command, model.name, said)
        refused(tmp_path, run(tmp_path, drive, "--models", chosen), model.name, said)
    refused(tmp_path, run(tmp_path, drive, "--models", tmp_path / "none"), "none", "no model")
    refused(tmp_path, ["classify", sense, file, "--model", tmp_path], "expected a model")


CLASSIFY_FAULTS = {
    "half a JPEG": ("vision", lambda path: picture(path / "x.jpg", 0.5), ("x.jpg", "a JPEG cut off")),
    "empty image": ("vision", lambda path: picture(path / "x.jpg", 0.0), ("x.jpg", "an empty file")),
    "text image": ("vision", lambda path: text_of(path / "x.png"), ("x.png", "b'Dear dia'", "JPEG or PNG")),
    "missing image": ("vision", lambda path: path / "x.jpg", ("x.jpg", "no such file")),
    "folder": ("vision", lambda path: folder_of(path / "x"), ("x", "a folder")),
    "empty sound": ("audio", lambda path: sound(path / "x.wav", 0.0), ("x.wav", "no sample")),
    "text sound": ("audio", lambda path: text_of(path / "x.flac"), ("x.flac", "no sound that can be read")),
    "missing sound": ("audio", lambda path: path / "x.wav", ("x.wav", "no such file")),
}


@pytest.mark.parametrize("fault", CLASSIFY_FAULTS)
def test_classifying_a_file_of_another_kind(fault, tmp_path, models):
    sense, make, said = CLASSIFY_FAULTS[fault]
    command = ["classify", sense, make(tmp_path), "--model", models / f"{sense}.skops"]
    refused(tmp_path, [*command, "--json", tmp_path / "o.json"], *said)


def test_a_truncated_wav_is_refused(tmp_path, models):
    whole = sound(tmp_path / "x.wav").read_bytes()
    (tmp_path / "x.wav").write_bytes(whole[: len(whole) // 2])
    command = ["classify", "audio", tmp_path / "x.wav", "--model", models / "audio.skops"]
    refused(tmp_path, command, "x.wav", "cut off", "a whole sound file")


def labelled(folder: Path, classes=("a", "b"), index: str | None = None) -> Path:
    for name in classes:
        (folder / name).mkdir(parents=True)
        sound(folder / name / "0.wav")
    if index is not None:
        (folder / "index.csv").write_text(index)
    return folder


LABELLED_FAULTS = {
    "one class": (("a",), None, ("one class only", "'a'", "two classes")),
    "nothing": ((), None, ("labelled",)),
    "blank class": (("a", "b"), "file,class,group\na/0.wav,,1\nb/0.wav,b,2\n", ("index.csv", "row 2, column class")),
    "blank group": (("a", "b"), "file,class,group\na/0.wav,a,\nb/0.wav,b,2\n", ("index.csv", "row 2, column group")),
    "no group": (("a", "b"), "file,class\na/0.wav,a\nb/0.wav,b\n", ("index.csv", "no column group")),
    "unknown as a class": (
        ("a", "b"), "file,class,group\na/0.wav,unknown,1\nb/0.wav,b,2\n", ("row 2, column class", "'unknown'"),
    ),
    "missing file": (("a", "b"), "file,class,group\nc/0.wav,a,1\nb/0.wav,b,2\n", ("row 2, column file", "no file")),
    "file outside": (("a", "b"), "file,class,group\n/x.wav,a,1\nb/0.wav,b,2\n", ("row 2, column file", "leads out")),
    "backwards": (
        ("a", "b"), "file,class,group,start_s,end_s\na/0.wav,a,1,1.5,0.5\nb/0.wav,b,2,0,1\n", ("row 2", "end_s"),
    ),
    "beyond the end": (
        ("a", "b"), "file,class,group,start_s,end_s\na/0.wav,a,1,7,9\nb/0.wav,b,2,0,1\n", ("0.wav", "within its 2.0"),
    ),
}  # fmt: skip


@pytest.mark.parametrize("fault", LABELLED_FAULTS)
def test_a_bad_labelled_folder(fault, tmp_path):
    classes, index, said = LABELLED_FAULTS[fault]
    (tmp_path / "data").mkdir()
    folder = labelled(tmp_path / "data", classes, index)
    command = ["train", "audio", folder, "--out", tmp_path / "m.skops", "--json", tmp_path / "o.json"]
    refused(tmp_path, [*command, "--report", tmp_path / "r.html"], *said)


@pytest.mark.parametrize(
    ("sense", "content"), [("vision", b"\xff\xd8\xff"), ("audio", b"RIFF"), ("vibration", b"a,b\n")]
)
def test_training_on_a_bad_file(sense, content, tmp_path):
    suffix = {"vision": "jpg", "audio": "wav", "vibration": "csv"}[sense]
    for name in ("a", "b"):
        (tmp_path / "data" / name).mkdir(parents=True)
        (tmp_path / "data" / name / f"x.{suffix}").write_bytes(content)
    command = ["train", sense, tmp_path / "data", "--out", tmp_path / "m.skops"]
    refused(tmp_path, command, f"x.{suffix}")


@pytest.mark.parametrize("option", ["--out", "--json", "--report"])
def test_a_result_that_cannot_be_written_is_reported_first(option, drive, tmp_path):
    outputs = {"--out": tmp_path / "m.skops", option: tmp_path / "nowhere" / "no" / "x"}
    arguments = ["train", "audio", tmp_path / "none", *(part for pair in outputs.items() for part in pair)]
    refused(tmp_path, arguments, "nowhere", "there is no folder")
    if option == "--json":
        refused(tmp_path, ["identify", drive, option, tmp_path / "nowhere" / "x"], "nowhere")
        refused(tmp_path, [*run(tmp_path, drive), option, tmp_path], "is a folder")


def test_scenarios_that_cannot_be_written(tmp_path):
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "x.txt").write_text("mine")
    (tmp_path / "file").write_text("mine")
    refused(tmp_path, ["scenario", "moon", tmp_path / "s"], "'moon'", "demo")
    refused(tmp_path, ["scenario", "short"], "OUT missing")
    for duration in ("1", "1e12", "inf", "nan"):
        command = ["scenario", "testbed", tmp_path / "s", "--duration", duration]
        refused(tmp_path, command, f"duration {float(duration)!r} s", "at least 5 s and at most 86400 s")
    refused(tmp_path, ["scenario", "short", tmp_path / "full"], "full")
    refused(tmp_path, ["scenario", "short", tmp_path / "file"], "file")
    for duration in ("-5", "nan", "0"):
        refused(tmp_path, ["scenario", "short", tmp_path / "s", "--duration", duration], "duration")
