"""`bevameter models`: the list, a card, the check, and bad input."""

from __future__ import annotations

import shutil

import pytest
from bevameter.framework.cli.main import app
from bevameter.framework.core.classifier import shipped
from bevameter.framework.core.classifier.shipped import shipped_model, shipped_models
from typer.testing import CliRunner


def run(*arguments):
    return CliRunner().invoke(app, ["models", *arguments])


def test_all_are_listed():
    said = run()
    assert said.exit_code == 0
    for name in shipped_models():
        assert name in said.stdout


def test_a_card_is_printed():
    said = run("vision-real")
    assert (said.exit_code, said.stdout) == (0, shipped_model("vision-real").card)


def test_a_model_is_verified_and_a_damaged_one_is_exit_status_1(tmp_path, monkeypatch):
    assert run("audio-synthetic", "--verify").stdout.startswith("audio-synthetic: in order")
    shutil.copytree(shipped.FOLDER, tmp_path / "trained")
    (tmp_path / "trained" / "audio-synthetic-example.flac").write_bytes(b"no sound")
    monkeypatch.setattr(shipped, "FOLDER", tmp_path / "trained")
    said = run("--verify")
    assert said.exit_code == 1
    assert "audio-synthetic: " in said.stdout
    assert "SHA-256" in said.stdout
    assert "vision-real: in order" in said.stdout


@pytest.mark.parametrize("arguments", [("vision-unreal",), ("vision-unreal", "--verify")])
def test_a_model_that_does_not_exist(arguments):
    said = run(*arguments)
    assert said.exit_code == 2
    assert said.stderr.startswith(
        "bevameter: model: no 'vision-unreal' comes with the package (expected one of audio-real,"
    )


def test_files_are_classified_by_a_model_of_the_package(tmp_path):
    model = shipped_model("vision-real")
    example = str(shipped.FOLDER / model.example)
    said = CliRunner().invoke(app, ["classify", "vision", example, "--model", "vision-real"])
    assert model.answers[0]["class"] in said.stdout
    said = CliRunner().invoke(app, ["classify", "audio", example, "--model", "vision-real"])
    assert (said.exit_code, said.stderr) == (
        2,
        "bevameter: vision-real: a model for vision (expected a model for audio)\n",
    )
