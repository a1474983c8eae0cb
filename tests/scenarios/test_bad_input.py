"""Bad input through the command line: one line naming file, place, value and expectation, exit 2, nothing written."""

from __future__ import annotations

import hashlib
import sqlite3
import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest
import soundfile
from bevameter.audio.features import FEATURE_NAMES as SOUND_FEATURES
from bevameter.audio.features import HOP_S, RATE_HZ, WINDOW_S
from bevameter.audio.quality import MEASURES
from bevameter.framework.cli.main import app
from bevameter.framework.core.learning import TerrainClassifier
from bevameter.vision.features import FEATURE_NAMES as IMAGE_FEATURES
from typer.testing import CliRunner

# A library's warning would be a second line on the user's stderr.
pytestmark = pytest.mark.filterwarnings("error")

HEADER = "time_s,load_N,slip,torque_Nm,sinkage_m"
ROWS = [f"{0.1 * i:.1f},{500 + i},{0.1 + 0.01 * i:.2f},{12 + 0.1 * i:.1f},{0.01 + 1e-4 * i:.4f}" for i in range(40)]
WHEEL = "\n".join([HEADER, *ROWS, ""])
VEHICLE = "[wheel]\nradius_m = 0.2\nwidth_m = 0.1\n"
SOIL = "c_Pa = 500.0\nphi_deg = 30.0\nk_m = 0.02\nstiffness_Pa = 8e5\nn = 1.0\n"
VIBRATION = "time_s,wz,az\n" + "\n".join(f"{0.01 * i:.2f},{i % 7},{9.8 + 0.1 * (i % 5)}" for i in range(400)) + "\n"


def edited(row: int, old: str, new: str) -> str:
    """The wheel file with a change in the row of that number, the header being row 1."""
    lines = WHEEL.split("\n")
    assert old in lines[row - 1]
    lines[row - 1] = lines[row - 1].replace(old, new, 1)
    return "\n".join(lines)


def jpeg() -> bytes:
    noise = np.random.default_rng(3).integers(0, 255, (96, 128, 3)).astype(np.uint8)
    return cv2.imencode(".jpg", cv2.GaussianBlur(noise, (0, 0), 1.5))[1].tobytes()


def picture(path: Path, share: float = 1.0) -> Path:
    """A JPEG, or its beginning."""
    data = jpeg()
    path.write_bytes(data[: int(len(data) * share)])
    return path


def sound(path: Path, seconds: float = 2.0) -> Path:
    samples = 0.1 * np.random.default_rng(4).normal(size=int(seconds * 8000))
    soundfile.write(path, samples.astype(np.float32), 8000)
    return path


@pytest.fixture
def drive(tmp_path):
    """A recording of four seconds, sound in every part."""
    folder = tmp_path / "drive"
    (folder / "camera").mkdir(parents=True)
    (folder / "wheel.csv").write_text(WHEEL)
    (folder / "vehicle.toml").write_text(VEHICLE)
    (folder / "pose.csv").write_text("time_s,x_m,y_m,yaw_rad\n0,0,0,0\n2,0.5,0,0\n4,1,0,0\n")
    (folder / "camera" / "camera.csv").write_text("time_s,file\n0.0,0.jpg\n0.5,1.jpg\n")
    for index in range(2):
        picture(folder / "camera" / f"{index}.jpg")
    sound(folder / "sound.wav")
    return folder


@pytest.fixture(scope="module")
def models(tmp_path_factory):
    """One model of each sense, of noise: enough to get past its door."""
    folder = tmp_path_factory.mktemp("models")
    rng = np.random.default_rng(1)
    width = len(SOUND_FEATURES) + len(MEASURES)
    noise = {
        "mean": [0.0] * width, "scale": [1.0] * width, "coefficient": [0.0] * width, "intercept": 0.0,
        "usual_mean": [0.0] * len(MEASURES), "usual_sd": [1.0] * len(MEASURES), "low_dB": 0.0, "high_dB": 10.0,
    }  # fmt: skip
    settings = {
        "vision": {"limits": {"sharp": 0.0, "blurred": -3.0}},
        "audio": {"rate_hz": RATE_HZ, "window_s": WINDOW_S, "hop_s": HOP_S, "noise": noise},
        "vibration": {},
    }
    for sense, names in (("vision", IMAGE_FEATURES), ("audio", SOUND_FEATURES), ("vibration", ("u", "v"))):
        x = rng.normal(size=(40, len(names))) + np.repeat([0.0, 3.0], 20)[:, None]
        outcome = TerrainClassifier.train(
            x, np.repeat(["a", "b"], 20), np.array([str(index) for index in range(40)]), modality=sense,
            feature_names=names, settings=settings[sense], rng=rng, candidates=("logistic",),
        )  # fmt: skip
        outcome.classifier.save(folder / f"{sense}.skops")
    return folder


def everything(folder: Path) -> dict[str, str]:
    """Every file and folder under a folder, hidden ones included, with a digest of its content."""
    return {
        str(path.relative_to(folder)): hashlib.sha256(path.read_bytes()).hexdigest() if path.is_file() else "folder"
        for path in folder.rglob("*")
    }


def refused(folder: Path, arguments, *said: str) -> str:
    before = everything(folder)
    result = CliRunner().invoke(app, [str(argument) for argument in arguments])
    assert result.exit_code == 2, (result.exit_code, result.output, result.exception)
    assert len(result.stderr.splitlines()) == 1, result.stderr
    assert result.stderr.startswith("bevameter: ")
    assert result.stdout == ""
    for fragment in said:
        assert fragment in result.stderr
    assert everything(folder) == before
    return result.stderr


def run(tmp_path: Path, recording: Path, *more) -> list:
    return ["run", recording, "--db", tmp_path / "t.db", "--json", tmp_path / "o.json", *more]


def identify(tmp_path: Path, recording: Path, *more) -> list:
    return ["identify", recording, "--json", tmp_path / "o.json", *more]


WHEEL_FAULTS = {
    "no time": (WHEEL.replace("time_s", "clock", 1), ("neither column time_s nor column run", "clock")),
    "unit misspelt": (WHEEL.replace("load_N", "load_n", 1), ("column load_n", "expected load_N")),
    "another unit": (WHEEL.replace("torque_Nm", "torque_kNm", 1), ("column torque_kNm", "expected torque_Nm")),
    "column misspelt": (WHEEL.replace("sinkage_m", "sinkgae_m", 1), ("column sinkgae_m", "expected sinkage_m")),
    "a column twice": (WHEEL.replace("slip", "load_N", 1), ("load_N stands twice",)),
    "time backwards": (edited(9, "0.7,", "0.35,"), ("row 9, column time_s", "0.35 s", "does not decrease")),
    "text": (edited(5, "503", "5o3"), ("row 5, column load_N", "'5o3'", "a number")),
    "infinite": (edited(5, "503", "inf"), ("row 5, column load_N", "inf", "a finite number")),
    "no time in a row": (edited(5, "0.3,", ","), ("row 5, column time_s", "a finite number")),
    "slip in percent": (edited(12, "0.20", "20.0"), ("row 12, column slip", "20", "[-1, 1]")),
    "a short row": (edited(12, ",0.0110", ""), ("row 12", "4 cells", "5")),
    "semicolons": (WHEEL.replace(",", ";"), ("row 1", "commas")),
    "header only": (HEADER + "\n", ("a header without rows", "at least one row")),
    "empty": ("", ("an empty file",)),
    "blank lines": ("\n\n", ("an empty file",)),
    "binary": ("time_s,load_N\n\0\1,2\n", ("binary data",)),
    "no channel": ("time_s,remark\n0,a\n1,b\n", ("no wheel channel",)),
    "nothing measured": ("time_s,load_N,slip\n0,,\n1,,\n", ("no wheel channel has a value",)),
}


@pytest.mark.parametrize("command", [run, identify])
@pytest.mark.parametrize("fault", WHEEL_FAULTS)
def test_a_bad_wheel_file(fault, command, drive, tmp_path):
    text, said = WHEEL_FAULTS[fault]
    (drive / "wheel.csv").write_text(text)
    refused(tmp_path, command(tmp_path, drive), "wheel.csv", *said)


@pytest.mark.parametrize("command", [run, identify])
def test_a_wheel_file_that_is_not_utf8(command, drive, tmp_path):
    (drive / "wheel.csv").write_bytes(WHEEL.replace("slip", "Schlüpf").encode("latin-1"))
    refused(tmp_path, command(tmp_path, drive), "wheel.csv", "not UTF-8")


@pytest.mark.parametrize("command", [run, identify])
def test_a_damaged_parquet_file(command, drive, tmp_path):
    (drive / "wheel.csv").unlink()
    (drive / "wheel.parquet").write_bytes(b"PAR1 and nothing more")
    refused(tmp_path, command(tmp_path, drive), "wheel.parquet", "no readable Parquet")


VEHICLE_FAULTS = {
    "typing error": (VEHICLE + "raduis_m = 0.2\n", ("raduis_m",)),
    "negative radius": ("[wheel]\nradius_m = -0.2\nwidth_m = 0.1\n", ("radius_m", "-0.2", "greater than 0")),
    "text": ("[wheel]\nradius_m = 'wide'\nwidth_m = 0.1\n", ("radius_m", "'wide'")),
    "no width": ("[wheel]\nradius_m = 0.2\n", ("width_m",)),
    "no geometry": ("name = 'x'\n", ("no wheel geometry", "[wheel]")),
    "no TOML": ("radius 0.2", ("valid TOML",)),
    "no wheel in the list": ("wheels = []\n", ("wheels",)),
    "unknown noise": (VEHICLE + "[noise]\nload_n = 5.0\n", ("load_n",)),
}


@pytest.mark.parametrize("where", ["inside", "given"])
@pytest.mark.parametrize("command", [run, identify])
@pytest.mark.parametrize("fault", VEHICLE_FAULTS)
def test_a_bad_vehicle(fault, command, where, drive, tmp_path):
    text, said = VEHICLE_FAULTS[fault]
    file = drive / "vehicle.toml" if where == "inside" else tmp_path / "other.toml"
    file.write_text(text)
    more = () if where == "inside" else ("--vehicle", file)
    refused(tmp_path, command(tmp_path, drive, *more), file.name, *said)


def test_no_wheel_geometry_at_all(drive, tmp_path):
    (drive / "vehicle.toml").unlink()
    refused(tmp_path, identify(tmp_path, drive), "drive", "no wheel geometry", "vehicle.toml")
    refused(tmp_path, identify(tmp_path, drive / "wheel.csv"), "wheel.csv", "no wheel geometry")
    refused(tmp_path, identify(tmp_path, drive, "--vehicle", tmp_path / "none.toml"), "none.toml", "no such file")


ABOUT_FAULTS = {
    "typing error": ("strat_time = 2024-05-01T10:00:00Z\n", ("strat_time",)),
    "no such stream": ("streams = ['wheel', 'cammera']\n", ("streams", "cammera")),
    "no date": ("start_time = 'yesterday'\n", ("start_time", "yesterday")),
    "missing stream": ("streams = ['vibration']\n", ("vibration", "no such file")),
    "missing file": ("[sound]\nfile = 'mic.wav'\n", ("mic.wav", "no such file")),
    "way out": ("[sound]\nfile = '../../x.wav'\n", ("leads out of the folder",)),
    "no TOML": ("name = ", ("valid TOML",)),
}


@pytest.mark.parametrize("fault", ABOUT_FAULTS)
def test_a_bad_recording_toml(fault, drive, tmp_path):
    text, said = ABOUT_FAULTS[fault]
    (drive / "recording.toml").write_text(text)
    refused(tmp_path, run(tmp_path, drive), *said)


def write(path: str, content: str | bytes):
    return lambda folder: (folder / path).write_bytes(content.encode() if isinstance(content, str) else content)


STREAM_FAULTS = {
    "text named wav": (write("sound.wav", "hello, I am a text\n"), ("sound.wav", "no sound that can be read")),
    "sound without a sample": (lambda folder: sound(folder / "sound.wav", 0), ("sound.wav", "no sample")),
    "empty sound file": (write("sound.wav", b""), ("sound.wav", "an empty file")),
    "two sounds": (lambda folder: sound(folder / "sound.flac"), ("sound.wav and sound.flac",)),
    "pose column": (write("pose.csv", "time_s,x_m,y\n0,1,2\n"), ("pose.csv", "no column y_m")),
    "pose backwards": (
        write("pose.csv", "time_s,x_m,y_m,yaw_rad\n1,0,0,0\n0,1,0,0\n"),
        ("pose.csv", "row 3, column time_s", "time runs backwards"),
    ),
    "camera index gone": (lambda folder: (folder / "camera" / "camera.csv").unlink(), ("camera.csv", "no such file")),
    "camera column": (write("camera/camera.csv", "time_s,image\n0,0.jpg\n"), ("camera.csv", "no column file")),
    "images gone": (write("camera/camera.csv", "time_s,file\n0,a.jpg\n1,b.jpg\n"), ("a.jpg", "no such file")),
    "image outside": (write("camera/camera.csv", "time_s,file\n0,../../a.jpg\n"), ("row 2, column file", "leads out")),
    "labels": (write("labels.csv", "start_s,end_s,class\n5,1,sand\n"), ("labels.csv", "row 2")),
}


@pytest.mark.parametrize("fault", STREAM_FAULTS)
def test_a_bad_stream(fault, drive, tmp_path):
    spoil, said = STREAM_FAULTS[fault]
    spoil(drive)
    refused(tmp_path, run(tmp_path, drive), *said)


def test_a_text_file_named_flac(drive, tmp_path, models):
    (drive / "sound.wav").unlink()
    (drive / "sound.flac").write_text("this is no sound\n")
    refused(tmp_path, run(tmp_path, drive), "sound.flac", "no sound that can be read", "WAV or FLAC")
    arguments = ["classify", "audio", drive / "sound.flac", "--model", models / "audio.skops"]
    refused(tmp_path, [*arguments, "--json", tmp_path / "o.json"], "sound.flac", "no sound that can be read")


@pytest.mark.parametrize("command", [run, identify])
def test_no_recording(command, tmp_path):
    (tmp_path / "empty").mkdir()
    (tmp_path / "notes.txt").write_text("hello")
    for name in ("x.bag", "x.mcap", "x.db3"):
        (tmp_path / name).write_text("hello, I am a text")
        refused(tmp_path, command(tmp_path, tmp_path / name), name)
    refused(tmp_path, command(tmp_path, tmp_path / "none"), "none", "no such file or folder", "a recording's folder")
    refused(tmp_path, command(tmp_path, tmp_path / "empty"), "empty", "no stream", "wheel.csv")
    refused(tmp_path, command(tmp_path, tmp_path / "notes.txt"), "notes.txt", "'.txt'")


def test_a_bad_topic_map(drive, tmp_path):
    topics = tmp_path / "topics.toml"
    topics.write_text("")
    refused(tmp_path, run(tmp_path, drive, "--topics", topics), "this is no bag")


def test_soil_that_cannot_be_identified(drive, tmp_path):
    (drive / "wheel.csv").unlink()
    refused(tmp_path, identify(tmp_path, drive), "no wheel channels", "wheel.csv")


SOIL_FAULTS = {
    "steeper than any soil": (SOIL.replace("30.0", "95"), ("phi_deg", "95", "0 to 60")),
    "typing error": (SOIL.replace("c_Pa", "cohesion_Pa"), ("cohesion_Pa", "unknown key")),
    "text": (SOIL.replace("500.0", "'soft'"), ("c_Pa", "'soft'", "a finite number")),
    "no value": (SOIL.replace("500.0", "{sd = 5}"), ("c_Pa", "value")),
    "not finite": (SOIL.replace("500.0", "nan"), ("c_Pa", "nan")),
    "no TOML": ("c_Pa 500", ("valid TOML",)),
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
def test_a_database_that_is_none_of_ours(kind, drive, tmp_path, models, monkeypatch):
    monkeypatch.chdir(tmp_path)
    make, said = DATABASES[kind]
    database = make(tmp_path / "other.db")
    asked = ["--db", database]
    refused(tmp_path, ["run", drive, *asked, "--models", models], *said)
    if kind != "nowhere":
        refused(tmp_path, ["query", "classes", *asked], *said)
        refused(tmp_path, ["map", "--out", tmp_path / "m.png", *asked], *said)


def test_a_database_that_is_not_there_is_not_made_by_asking(tmp_path):
    asked = ["--db", tmp_path / "none.db"]
    for query in (["classes"], ["class", "sand"], ["at", "1", "2"], ["near", "1", "2", "--radius", "3"]):
        refused(tmp_path, ["query", *query, *asked], "none.db", "no such file")
    refused(tmp_path, ["map", "--out", tmp_path / "m.png", *asked], "none.db", "no such file")


def test_queries_that_mean_nothing(tmp_path):
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
def test_models_that_are_none(sense, drive, tmp_path, models):
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
        asked = ["classify", sense, file, "--model", model, "--json", tmp_path / "o.json"]
        refused(tmp_path, asked, model.name, said)
        refused(tmp_path, run(tmp_path, drive, "--models", chosen), model.name, said)
    refused(tmp_path, run(tmp_path, drive, "--models", tmp_path / "none"), "none", "no model")
    refused(tmp_path, ["classify", sense, file, "--model", tmp_path], "expected a model")


CLASSIFY_FAULTS = {
    "half a JPEG": ("vision", lambda path: picture(path / "x.jpg", 0.5), ("x.jpg", "a JPEG cut off")),
    "empty image": ("vision", lambda path: picture(path / "x.jpg", 0.0), ("x.jpg", "an empty file")),
    "text image": ("vision", lambda path: text_of(path / "x.png"), ("x.png", "b'Dear dia'", "JPEG or PNG")),
    "missing image": ("vision", lambda path: path / "x.jpg", ("x.jpg", "no such file")),
    "folder": ("vision", lambda path: folder_of(path / "x"), ("x", "no such file")),
    "empty sound": ("audio", lambda path: sound(path / "x.wav", 0.0), ("x.wav", "no sample")),
    "text sound": ("audio", lambda path: text_of(path / "x.flac"), ("x.flac", "no sound that can be read")),
    "missing sound": ("audio", lambda path: path / "x.wav", ("x.wav", "no such file")),
}


@pytest.mark.parametrize("fault", CLASSIFY_FAULTS)
def test_classifying_what_is_no_file_of_the_sense(fault, tmp_path, models):
    sense, make, said = CLASSIFY_FAULTS[fault]
    asked = ["classify", sense, make(tmp_path), "--model", models / f"{sense}.skops"]
    refused(tmp_path, [*asked, "--json", tmp_path / "o.json"], *said)


def test_half_a_wav_does_not_pass_for_a_whole_one(tmp_path, models):
    whole = sound(tmp_path / "x.wav").read_bytes()
    (tmp_path / "x.wav").write_bytes(whole[: len(whole) // 2])
    asked = ["classify", "audio", tmp_path / "x.wav", "--model", models / "audio.skops"]
    refused(tmp_path, asked, "x.wav", "cut off", "a whole sound file")


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
    asked = ["train", "audio", folder, "--out", tmp_path / "m.skops", "--json", tmp_path / "o.json"]
    refused(tmp_path, [*asked, "--report", tmp_path / "r.html"], *said)


@pytest.mark.parametrize(
    ("sense", "content"), [("vision", b"\xff\xd8\xff"), ("audio", b"RIFF"), ("vibration", b"a,b\n")]
)
def test_training_on_a_bad_file(sense, content, tmp_path):
    suffix = {"vision": "jpg", "audio": "wav", "vibration": "csv"}[sense]
    for name in ("a", "b"):
        (tmp_path / "data" / name).mkdir(parents=True)
        (tmp_path / "data" / name / f"x.{suffix}").write_bytes(content)
    asked = ["train", sense, tmp_path / "data", "--out", tmp_path / "m.skops"]
    refused(tmp_path, asked, f"x.{suffix}")


@pytest.mark.parametrize("option", ["--out", "--json", "--report"])
def test_a_result_that_cannot_be_written_is_said_first(option, drive, tmp_path):
    asked = {"--out": tmp_path / "m.skops", option: tmp_path / "nowhere" / "x"}
    arguments = ["train", "audio", tmp_path / "none", *(part for pair in asked.items() for part in pair)]
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
    refused(tmp_path, ["scenario", "short", tmp_path / "full"], "full")
    refused(tmp_path, ["scenario", "short", tmp_path / "file"], "file")
    for duration in ("-5", "nan", "0"):
        refused(tmp_path, ["scenario", "short", tmp_path / "s", "--duration", duration], "duration")


def test_the_real_command_says_one_line_and_leaves_nothing(drive, tmp_path):
    """As a user's shell sees it: no traceback, no warning of a library, no database, no part of a file."""
    (drive / "wheel.csv").write_text(edited(9, "0.7,", "0.35,"))
    before = everything(tmp_path)
    for arguments in (run(tmp_path, drive), identify(tmp_path, drive)):
        command = [sys.executable, "-m", "bevameter.framework.cli.main", *map(str, arguments)]
        done = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path)
        assert done.returncode == 2
        assert done.stdout == ""
        assert len(done.stderr.splitlines()) == 1
        assert done.stderr.startswith(f"bevameter: {drive / 'wheel.csv'}, row 9, column time_s: time runs backwards")
    assert everything(tmp_path) == before


N = range(300)
ODD = {
    "five rows": WHEEL.split("\n")[:6],
    "constant": [HEADER, *(f"{0.1 * i:.1f},500,0.2,12,0.01" for i in N)],
    "standing": [HEADER, *(f"{0.1 * i:.1f},500,0,0,0.01" for i in N)],
    "no load": [HEADER, *(f"{0.1 * i:.1f},0,0.2,0,0" for i in N)],
    "huge": [HEADER, *(f"{0.1 * i:.1f},{5 + i % 7}e290,0.2,{1 + i % 5}e300,{i % 3}e305" for i in N)],
    "far in time": [HEADER, *(f"{1.7e9 + 0.1 * i:.1f},{500 + i % 9},{0.1 + i % 30 / 60},12,0.01" for i in N)],
    "half missing": [HEADER, *(f"{0.1 * i:.1f},{500 + i % 9},{0.1 + i % 30 / 60},,{'0.01' * (i % 2)}" for i in N)],
}  # fmt: skip


@pytest.mark.parametrize("kind", ODD)
def test_odd_numbers_get_an_answer_without_a_warning(kind, drive, tmp_path):
    """Nothing is wrong with the file: there is an answer, if only that the soil cannot be told."""
    (drive / "wheel.csv").write_text("\n".join(ODD[kind]) + "\n")
    for arguments in (
        identify(tmp_path, drive),
        ["identify", drive, "--method", "linear"],
        ["run", drive / "wheel.csv", "--db", tmp_path / "t.db"],
    ):
        result = CliRunner().invoke(app, [str(argument) for argument in arguments])
        one_line = result.exit_code == 2 and len(result.stderr.splitlines()) == 1
        assert one_line or (result.exit_code == 0 and result.stderr == ""), (result.output, result.exception)
