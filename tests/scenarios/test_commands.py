"""Commands in sequence: machine-readable output, second runs, interrupts, two runs at once."""

from __future__ import annotations

import csv
import io
import json
import math
import os
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest
import soundfile
from bevameter.audio import train as audio_train
from bevameter.audio import vibration_train
from bevameter.database.store import TerrainDatabase
from bevameter.framework import traverse
from bevameter.framework.cli.main import app
from bevameter.framework.scenario.write import write_scenario
from bevameter.vision import train as vision_train
from typer.testing import CliRunner

COMMAND = [sys.executable, "-m", "bevameter.framework.cli.main"]
ROW = {"file", "start_s", "end_s", "class", "probabilities", "quality", "unknown", "reasons"}


def said(*arguments, status: int = 0) -> str:
    """Run a command in this process; give its stdout. Nothing may be on stderr where all is well."""
    result = CliRunner().invoke(app, [str(argument) for argument in arguments])
    assert result.exit_code == status, result.output
    assert status or result.stderr == ""
    return result.stdout


def page_of(path: Path) -> dict:
    return json.loads(path.read_text(encoding="utf-8"))


def everything(folder: Path) -> list[str]:
    return sorted(str(path.relative_to(folder)) for path in folder.rglob("*"))


@pytest.fixture(scope="module")
def wheels(tmp_path_factory):
    """Twelve seconds of a wheel on sand, without senses: what needs no model."""
    return write_scenario("testbed", tmp_path_factory.mktemp("wheels") / "testbed", seed=2, duration_s=12.0)


@pytest.fixture(scope="module")
def stored(short_drive, small_models, tmp_path_factory):
    """A database of the short drive."""
    path = tmp_path_factory.mktemp("stored") / "terrain.db"
    said("run", short_drive, "--db", path, "--models", small_models)
    return path


def track(folder: Path) -> list[dict[str, str]]:
    with (folder / "pose.csv").open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


@pytest.fixture
def questions(short_drive, tmp_path):
    """Every query of places, around a place that was driven over."""
    rows = track(short_drive)
    path = tmp_path / "path.csv"
    path.write_text("x_m,y_m\n" + "".join(f"{row['x_m']},{row['y_m']}\n" for row in rows[::100]) + "900,900\n")
    x, y = rows[400]["x_m"], rows[400]["y_m"]
    return {"at": ["at", x, y], "near": ["near", x, y, "--radius", "2"], "along": ["along", path]}


@pytest.mark.parametrize("query", ["at", "near", "along"])
def test_places_in_every_format(query, questions, stored):
    command = ["query", *questions[query], "--db", stored]
    page = json.loads(said(*command, "--format", "json"))
    assert (page["schema"], page["query"]) == (1, query)
    places = page["places"]
    assert {"known", "unknown", "class_probabilities", "c_Pa", "tan_phi", "covariance_c_tan_phi", "shear_strength_Pa",
            "shear_strength_lower_Pa", "age_s", "observations"} <= set(places[0])  # fmt: skip
    assert any(place["known"] for place in places)
    for place in places:
        assert place["known"] == (place["unknown"] is None) == (place["shear_strength_lower_Pa"] is not None)
    rows = list(csv.DictReader(io.StringIO(said(*command, "--format", "csv"))))
    assert len(rows) == len(places)
    assert float(rows[0]["x_m"]) == places[0]["x_m"]
    collection = json.loads(said(*command, "--format", "geojson"))
    assert collection["type"] == "FeatureCollection"
    assert len(collection["features"]) == len(places)
    table = said(*command)
    assert "lower bound at confidence 0.95" in table
    if query == "along":
        assert places[-1]["unknown"] == "nobody has seen this ground"
        assert "unknown: nobody has seen this ground" in table


def test_classes_in_every_format(stored):
    page = json.loads(said("query", "classes", "--db", stored, "--format", "json"))
    assert page["schema"] == 1
    classes = {row["class"]: row for row in page["classes"]}
    assert classes["sand"]["known"]
    assert not classes["grass"]["known"]
    assert classes["grass"]["unknown"] == "no soil data for class grass"
    rows = list(csv.DictReader(io.StringIO(said("query", "classes", "--db", stored, "--format", "csv"))))
    assert {row["class"] for row in rows} == set(classes)
    (unknown,) = [line for line in said("query", "classes", "--db", stored).splitlines() if line.startswith("unknown")]
    assert unknown == "unknown: no soil data for class clay, grass"
    assert json.loads(said("query", "class", "sand", "--db", stored, "--format", "json"))["classes"] == [
        classes["sand"]
    ]
    wider = json.loads(said("query", "class", "sand", "--db", stored, "--format", "json", "--confidence", "0.6"))
    assert wider["classes"][0]["shear_strength_lower_Pa"] > classes["sand"]["shear_strength_lower_Pa"]


def test_a_table_of_classes_fits_a_terminal_of_80_columns(stored):
    lines = said("query", "classes", "--db", stored).splitlines()
    table = [line.rstrip() for line in lines if not line.startswith(("±", "unknown", "not seen"))]
    assert [line.split()[0] for line in table] == ["class", "clay", "grass", "loam", "sand"]  # one line each
    assert max(map(len, table)) <= 80
    (unseen,) = [line for line in lines if line.startswith("not seen")]
    assert unseen == "not seen yet: asphalt, gravel"


def test_a_known_drive_is_not_processed_again(short_drive, stored, small_models, tmp_path, monkeypatch):
    def observe(*arguments, **options):
        raise AssertionError("the senses were run again")

    monkeypatch.setattr(traverse, "observe", observe)
    with TerrainDatabase(stored) as database:
        before = database.drives()
    out = tmp_path / "o.json"
    text = said("run", short_drive, "--db", stored, "--models", small_models, "--json", out)
    assert "nothing added" in text
    page = page_of(out)
    assert page["schema"] == 1
    assert page["known"]
    assert page["observations_new"] == 0
    assert page["observations_known"] > 100
    assert [soil["class_name"] for soil in page["soils"]] == ["sand", "loam"]
    assert page["used_s"] > 40
    with TerrainDatabase(stored) as database:
        assert len(database.drives()) == len(before) == 1


def test_a_vehicle_that_was_put_right_makes_a_processing_that_replaces_the_old_one(wheels, tmp_path):
    db, vehicle = tmp_path / "t.db", tmp_path / "vehicle.toml"
    text = (wheels / "vehicle.toml").read_text(encoding="utf-8")
    assert "width_m = 0.2\n" in text

    def run(content: str) -> dict:
        vehicle.write_text(content)
        said("run", wheels, "--db", db, "--vehicle", vehicle, "--json", tmp_path / "o.json")
        return page_of(tmp_path / "o.json")

    def in_use() -> str:
        with TerrainDatabase(db) as database:
            assert database.snapshot().drives == 1
            (drive,) = database.drives(newest=True)
            return drive.method

    first = run(text)
    assert first["observations_new"] > 0
    method = in_use()
    second = run(text.replace("width_m = 0.2\n", "width_m = 0.3\n"))
    assert second["observations_new"] > 0
    assert not second["known"]
    assert in_use() != method
    assert run(text.replace("load_N = 7.0", "load_N = 9.0"))["observations_new"] > 0  # noise shapes the result too
    # Back to the first: it was known, and is in use again.
    again = run(text)
    assert (again["known"], again["observations_new"]) == (True, 0)
    assert in_use() == method
    with TerrainDatabase(db) as database:
        assert len(database.drives()) == 3


def test_the_same_drive_in_another_folder_is_known(wheels, tmp_path):
    shutil.copytree(wheels, tmp_path / "copy")
    said("run", wheels, "--db", tmp_path / "t.db")
    assert "nothing added" in said("run", tmp_path / "copy", "--db", tmp_path / "t.db")


def test_a_database_of_another_program_is_refused_before_the_work(wheels, tmp_path, monkeypatch):
    (tmp_path / "t.db").write_text("my diary")
    monkeypatch.setattr(traverse, "find_models", lambda *a, **k: pytest.fail("models were looked for first"))
    said("run", wheels, "--db", tmp_path / "t.db", status=2)
    assert (tmp_path / "t.db").read_text() == "my diary"


def test_a_stretch_of_nan_is_left_out_and_reported(wheels, tmp_path):
    """Missing values are no fault: the other rows are used, and the summary says how many."""
    folder = tmp_path / "drive"
    shutil.copytree(wheels, folder)
    with (folder / "wheel.csv").open(newline="", encoding="utf-8") as file:
        header, *rows = csv.reader(file)
    column = header.index("torque_Nm")
    for row in rows[50:80]:
        row[column] = "nan"
    with (folder / "wheel.csv").open("w", newline="", encoding="utf-8") as file:
        csv.writer(file).writerows([header, *rows])
    out = tmp_path / "o.json"
    said("identify", folder, "--json", out)
    whole = tmp_path / "w.json"
    said("identify", wheels, "--json", whole)
    assert page_of(out)["overall"] is not None
    assert page_of(out)["n"] <= page_of(whole)["n"]


def test_half_a_jpeg_among_the_images_costs_that_image_alone(short_drive, small_models, tmp_path):
    folder = tmp_path / "drive"
    (folder / "camera").mkdir(parents=True)
    shutil.copy(short_drive / "vehicle.toml", folder)
    (folder / "pose.csv").write_text("time_s,x_m,y_m,yaw_rad\n0,0,0,0\n3,6,0,0\n")
    rows = ["time_s,file"]
    for index in range(10):
        name = f"{index:06d}.jpg"
        data = (short_drive / "camera" / name).read_bytes()
        (folder / "camera" / name).write_bytes(data if index != 4 else data[: len(data) // 2])
        rows.append(f"{0.2 * index},{name}")
    (folder / "camera" / "camera.csv").write_text("\n".join(rows) + "\n")
    text = said("run", folder, "--db", tmp_path / "t.db", "--models", small_models, "--json", tmp_path / "o.json")
    camera = page_of(tmp_path / "o.json")["senses"][0]
    assert "a JPEG cut off" in text
    looks = camera["items"] / 10  # at each image, at the patches of ground ahead
    assert [count for reason, count in camera["closed"].items() if "JPEG" in reason] == [looks]
    assert camera["trusted_share"] > 0.5
    # With every image broken it is still an answer: nothing was seen, and why.
    for file in (folder / "camera").glob("*.jpg"):
        file.write_bytes(file.read_bytes()[:1000])
    said("run", folder, "--db", tmp_path / "n.db", "--models", small_models, "--json", tmp_path / "n.json")
    page = page_of(tmp_path / "n.json")
    assert page["senses"][0]["trusted_share"] == 0.0
    assert set(page["cells"]) == {"unknown"}


@pytest.mark.filterwarnings("error")
def test_simulated_soil_is_identified(tmp_path):
    rows = ["time_s,load_N,slip"]
    for index in range(240):
        load = 450 + 250 * math.sin(0.23 * index)
        rows.append(f"{0.1 * index:.1f},{load:.2f},{0.05 + 0.4 * (index % 40) / 40:.4f}")
    (tmp_path / "drive.csv").write_text("\n".join(rows) + "\n")
    (tmp_path / "vehicle.toml").write_text("[wheel]\nradius_m = 0.25\nwidth_m = 0.2\n")
    soil = "c_Pa = 900.0\nphi_deg = 31.0\nk_m = 0.018\nstiffness_Pa = 9e5\nn = 1.0\n"
    (tmp_path / "soil.toml").write_text(soil)
    sim, out = tmp_path / "sim.csv", tmp_path / "o.json"
    vehicle = ["--vehicle", tmp_path / "vehicle.toml"]
    assert "240 rows written" in said(
        "simulate", tmp_path / "drive.csv", *vehicle, "--soil", tmp_path / "soil.toml", "--out", sim
    )
    with sim.open(newline="", encoding="utf-8") as file:
        header = next(csv.reader(file))
    assert {"time_s", "load_N", "slip", "torque_Nm", "sinkage_m", "drawbar_pull_N"} == set(header)
    said("identify", sim, *vehicle, "--json", out)
    page = page_of(out)
    assert (page["schema"], page["method"]) == (1, "ml")
    overall = page["overall"]
    for name, truth in (("c_Pa", 900.0), ("phi_rad", math.radians(31.0)), ("k_m", 0.018), ("n", 1.0)):
        assert overall[name]["low"] <= truth <= overall[name]["high"]
    assert overall["phi_rad"]["value"] == pytest.approx(math.radians(31.0), rel=0.05)
    assert set(overall) >= {"correlation", "shear_strength", "separable", "advice", "stiffness_Pa"}
    assert set(overall["shear_strength"][0]) == {"normal_stress_Pa", "value_Pa", "low_Pa", "high_Pa"}
    assert {"start_s", "end_s", "used", "reason"} <= set(page["segments"][0])


def test_four_wheels_are_run(small_models, tmp_path):
    folder = write_scenario("rover4", tmp_path / "rover4", seed=3, duration_s=16.0)
    said("run", folder, "--db", tmp_path / "t.db", "--models", small_models, "--json", tmp_path / "o.json")
    page = page_of(tmp_path / "o.json")
    assert page["vehicle"] == "four-wheeled rover"
    assert page["track_m"]["sand"] > 0.7 * page["distance_m"]
    (soil,) = page["soils"]
    assert soil["class_name"] == "sand"
    assert soil["n"] > 300
    truth = next(one for one in page_of(folder / "truth.json")["stretches"] if one["class"] == "sand")["soil"]
    low, high = (soil["parameters"]["phi_rad"][end] for end in ("low", "high"))
    assert low - math.radians(3) <= truth["phi_rad"] <= high + math.radians(3)  # the rear wheels run in stiffer ruts


def ground(path: Path, rng: np.random.Generator, coarse: bool) -> None:
    """A picture of a fine or of a coarse ground."""
    noise = cv2.GaussianBlur(rng.normal(size=(200, 260, 3)), (0, 0), 6.0 if coarse else 0.8)
    image = 110 + 10 * rng.normal() + 40 * noise / noise.std()
    cv2.imwrite(str(path), np.clip(image, 0, 255).astype(np.uint8))


def crackle(path: Path, rng: np.random.Generator, coarse: bool) -> None:
    """A deep or a bright sound."""
    white = rng.normal(size=33075)
    frequency = np.fft.rfftfreq(len(white), 1 / 22050)
    gain = 1 / (1 + (frequency / 600) ** 2) if coarse else frequency / (frequency + 3000)
    sound = np.fft.irfft(np.fft.rfft(white) * gain, len(white))
    soundfile.write(path, (0.1 * rng.uniform(0.5, 1.5) * sound / sound.std()).astype(np.float32), 22050)


def shake(path: Path, rng: np.random.Generator, coarse: bool) -> None:
    """Ten seconds of an inertial sensor."""
    time = np.arange(0, 10, 0.01)
    table = np.column_stack([time, *(rng.normal(size=(len(time), 3)) * (1.0 if coarse else 0.2)).T])
    if coarse:
        table[:, 1:] += np.sin(2 * np.pi * 7 * time)[:, None]
    np.savetxt(path, table, delimiter=",", header="time_s,wz,ax,az", comments="", fmt="%.5f")


MADE = {"vision": (ground, "png"), "audio": (crackle, "wav"), "vibration": (shake, "csv")}


@pytest.mark.parametrize("sense", MADE)
def test_a_sense_is_trained_and_used(sense, tmp_path, rng, monkeypatch):
    for module in (vision_train, audio_train, vibration_train):
        monkeypatch.setattr(module, "CANDIDATES", ("logistic",))
    make, suffix = MADE[sense]
    for coarse in (False, True):
        folder = tmp_path / "data" / ("coarse" if coarse else "fine")
        folder.mkdir(parents=True)
        for index in range(8):
            make(folder / f"{index}.{suffix}", rng, coarse)
        make(tmp_path / f"{folder.name}.{suffix}", rng, coarse)
    model, report, html, out = (tmp_path / name for name in ("m.skops", "r.json", "r.html", "o.json"))
    said("train", sense, tmp_path / "data", "--out", model, "--json", report, "--report", html, "--seed", 5)
    page = page_of(report)
    assert page["schema"] == 1
    assert page["modality"] == sense
    assert page["classes"] == ["coarse", "fine"]
    assert page["groups"] == 16
    assert page["balanced_accuracy"]["value"] > 0.9
    assert "<html" in html.read_text(encoding="utf-8")
    if os.name == "posix":  # a model is as readable as any file that its user makes
        assert model.stat().st_mode & 0o777 == report.stat().st_mode & 0o777
    new = [tmp_path / f"{name}.{suffix}" for name in ("coarse", "fine")]
    text = said("classify", sense, *new, "--model", model, "--json", out)
    assert f"coarse.{suffix}" in text
    page = page_of(out)
    assert (page["schema"], page["modality"]) == (1, sense)
    assert {row["file"] for row in page["rows"]} == set(map(str, new))
    for row in page["rows"]:
        assert set(row) == ROW
        assert set(row["probabilities"]) == {"coarse", "fine"}
        assert row["unknown"] == (row["class"] == "unknown")
        assert row["unknown"] or row["class"] in row["file"]
        assert bool(row["reasons"]) or not row["unknown"]
        assert (row["start_s"] is None) == (sense == "vision")
    assert sum(not row["unknown"] for row in page["rows"]) > len(page["rows"]) / 2
    # A whole and a damaged file together: the damaged one is named and no answer is written.
    out.unlink()
    (tmp_path / f"bad.{suffix}").write_bytes(b"\xff\xd8 no more")
    said("classify", sense, *new, tmp_path / f"bad.{suffix}", "--model", model, "--json", out, status=2)
    assert not out.exists()


@pytest.fixture(scope="module")
def moments(tmp_path_factory):
    """The shortest drive that there is."""
    return write_scenario("testbed", tmp_path_factory.mktemp("moments") / "testbed", seed=2, duration_s=5.0)


@pytest.mark.slow
def test_two_at_once_on_one_database(moments, tmp_path):
    """Two runs over the same drive start together: both succeed, and the drive is stored once."""
    db = tmp_path / "t.db"
    runs = [
        subprocess.Popen(
            [*COMMAND, "--quiet", "run", str(drive), "--db", str(db)], stdout=subprocess.PIPE, stderr=subprocess.PIPE
        )
        for drive in (moments, moments)
    ]
    done = [run.communicate(timeout=120) for run in runs]
    assert [run.returncode for run in runs] == [0, 0], done
    assert [error for _, error in done] == [b"", b""]
    with TerrainDatabase(db) as database:
        assert sorted(drive.name for drive in database.drives()) == ["testbed-2"]
    assert everything(tmp_path) == ["t.db"]


# A shell's background job hands SIGINT down as ignored, to the tests and from them to what they start.
BEGUN = "import signal, sys; signal.signal(signal.SIGINT, signal.default_int_handler)\n"
BEGUN += "from bevameter.framework.cli.main import app; import {module} as module; was = module.{name}\n"
BEGUN += "def begun(*a, **k):\n    print('begun', flush=True)\n    return was(*a, **k)\n"
BEGUN += "module.{name} = begun; app()"


@pytest.mark.skipif(os.name != "posix", reason="signals are sent as POSIX has them")
@pytest.mark.parametrize(
    ("stage", "arguments"),
    [
        # A process that imports all packages: that alone takes 4 s.
        pytest.param(
            ("bevameter.framework.traverse", "observe"), ["run", "{drive}", "--db", "t.db", "--models", "{models}"],
            marks=pytest.mark.end_to_end,
        ),
        (("bevameter.framework.scenario.write", "_write_camera"), ["scenario", "short", "out/deep"]),
        (
            ("bevameter.vision.train", "training_patches"),
            ["train", "vision", "{data}", "--out", "m", "--json", "o.json"],
        ),
    ],
    ids=["run", "scenario", "train"],
)  # fmt: skip
def test_ctrl_c_leaves_nothing(stage, arguments, short_drive, small_models, tmp_path, rng):
    """A real process is interrupted in the middle of its work."""
    (tmp_path / "data").mkdir()
    for coarse in (False, True):
        (tmp_path / "data" / str(coarse)).mkdir()
        for index in range(4):
            ground(tmp_path / "data" / str(coarse) / f"{index}.png", rng, coarse)
    places = {"drive": short_drive, "models": small_models, "data": tmp_path / "data"}
    code = BEGUN.format(module=stage[0], name=stage[1])
    before = everything(tmp_path)
    process = subprocess.Popen(
        [sys.executable, "-c", code, "--quiet", *(argument.format(**places) for argument in arguments)],
        cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    assert process.stdout is not None
    assert process.stdout.readline() == "begun\n"
    process.send_signal(signal.SIGINT)
    _, error = process.communicate(timeout=60)
    assert process.returncode in (130, -signal.SIGINT)  # a shell shows 130 for both
    assert error == "bevameter: interrupted; what was stored is whole\n"
    assert everything(tmp_path) == before
