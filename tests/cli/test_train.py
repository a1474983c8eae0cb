"""`bevameter train` and `bevameter classify`, there and back, and what bad input gives."""

from __future__ import annotations

import csv
import json

import numpy as np
import pytest
import soundfile
from bevameter.framework.cli.main import app
from typer.testing import CliRunner

RATE_HZ = 22050


def noise(rng, colour, seconds=1.5):
    """Coloured noise: deep for one class, bright for the other, at a level of its own."""
    white = rng.normal(size=int(seconds * RATE_HZ))
    spectrum = np.fft.rfft(white)
    frequency = np.fft.rfftfreq(len(white), 1 / RATE_HZ)
    gain = 1 / (1 + (frequency / 600) ** 2) if colour == "deep" else frequency / (frequency + 3000)
    sound = np.fft.irfft(spectrum * gain, len(white))
    return (0.1 * rng.uniform(0.5, 1.5) * sound / sound.std()).astype(np.float32)


@pytest.fixture(scope="module")
def labelled(tmp_path_factory):
    folder = tmp_path_factory.mktemp("labelled")
    rng = np.random.default_rng(7)
    for name in ("deep", "bright"):
        (folder / name).mkdir()
        for index in range(8):
            soundfile.write(folder / name / f"{index}.wav", noise(rng, name), RATE_HZ)
    return folder


@pytest.fixture(scope="module")
def trained(labelled, tmp_path_factory):
    """A folder with a model, its report as JSON and as a page."""
    folder = tmp_path_factory.mktemp("trained")
    result = CliRunner().invoke(
        app,
        ["train", "audio", str(labelled), "--out", str(folder / "audio.skops"), "--json", str(folder / "audio.json"),
         "--report", str(folder / "audio.html"), "--seed", "3"],
    )  # fmt: skip
    assert result.exit_code == 0, result.output
    return folder, result


def test_the_report_states_its_data(trained):
    folder, result = trained
    page = json.loads((folder / "audio.json").read_text())
    assert page["schema"] == 1
    assert page["seed"] == 3
    assert page["classes"] == ["bright", "deep"]
    assert page["groups"] == 16
    assert len(page["version"]) == 64
    assert page["balanced_accuracy"]["value"] > 0.8
    assert page["balanced_accuracy"]["low"] <= page["balanced_accuracy"]["value"]
    assert "balanced accuracy" in result.output
    assert "truth \\ said" in result.output
    html = (folder / "audio.html").read_text()
    assert html.startswith("<!doctype html>")
    assert "16 more groups" in html
    assert "bright" in html


def test_classify_distinguishes_new_sounds(trained, tmp_path):
    rng = np.random.default_rng(99)
    files = []
    for name in ("deep", "bright"):
        files.append(tmp_path / f"{name}.wav")
        soundfile.write(files[-1], noise(rng, name), RATE_HZ)
    out = tmp_path / "out.json"
    arguments = ["classify", "audio", *map(str, files), "--model", str(trained[0] / "audio.skops"), "--json", str(out)]
    result = CliRunner().invoke(app, arguments)
    assert result.exit_code == 0, result.output
    page = json.loads(out.read_text())
    assert page["schema"] == 1
    keys = {"file", "start_s", "end_s", "class", "probabilities", "quality", "unknown", "reasons"}
    for row in page["rows"]:
        assert keys <= set(row)
        if not row["unknown"]:
            assert row["class"] in row["file"]
            assert sum(row["probabilities"].values()) == pytest.approx(1.0, abs=1e-6)
    assert {row["file"] for row in page["rows"]} == {str(file) for file in files}
    assert sum(not row["unknown"] for row in page["rows"]) >= len(page["rows"]) / 2
    assert "deep.wav" in result.output


def bad(*arguments):
    result = CliRunner().invoke(app, list(map(str, arguments)))
    assert result.exit_code == 2, result.output
    assert len(result.stderr.splitlines()) == 1
    assert result.stderr.startswith("bevameter: ")
    return result.stderr


def test_bad_labelled_folders_give_one_line_and_no_model(labelled, tmp_path):
    out = tmp_path / "m.skops"
    assert "missing" in bad("train", "audio", tmp_path / "missing", "--out", out)
    broken = tmp_path / "broken"
    for name in ("a", "b"):
        (broken / name).mkdir(parents=True)
        (broken / name / "x.wav").write_text("no sound at all")
    assert "x.wav" in bad("train", "audio", broken, "--out", out)
    unindexed = tmp_path / "unindexed"
    unindexed.mkdir()
    with open(unindexed / "index.csv", "w", newline="", encoding="utf-8") as file:
        csv.writer(file).writerows([["file", "klass", "group"], ["x.wav", "a", "1"]])
    assert "index.csv" in bad("train", "audio", unindexed, "--out", out)
    assert not out.exists()


def test_an_output_that_cannot_be_written_is_refused_before_training(labelled, tmp_path):
    assert "no folder" in bad("train", "audio", labelled, "--out", tmp_path / "nowhere" / "no" / "m.skops")
    assert "is a folder" in bad("train", "audio", labelled, "--out", tmp_path)


def test_a_sense_that_does_not_exist_is_refused(labelled, tmp_path):
    result = CliRunner().invoke(app, ["train", "smell", str(labelled), "--out", str(tmp_path / "m.skops")])
    assert result.exit_code == 2
    assert "vibration" in result.stderr
