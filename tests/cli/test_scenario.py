"""`bevameter scenario`: what it lists, and that a drive which conceals something is written as any other."""

from __future__ import annotations

import json

import pytest
from bevameter.framework.cli import main as cli
from bevameter.framework.scenario.presets import PRESETS
from typer.testing import CliRunner


def test_the_list_has_a_line_for_each_drive():
    result = CliRunner().invoke(cli.app, ["scenario", "--list"])
    assert result.exit_code == 0
    header, *lines = [line.rstrip() for line in result.stdout.splitlines()]
    assert header.split() == ["name", "duration", "about"]
    assert len(lines) == len(PRESETS)
    for line, (name, preset) in zip(lines, PRESETS.items(), strict=True):
        assert line.startswith(f"{name} ")
        assert f" {preset.duration_s:g} s " in line
        assert line.endswith(f" {preset.about}")
        assert preset.about.startswith("conceals ") == bool(preset.concealed)


@pytest.mark.parametrize("name", ["slip-sinkage", "torque-zero"])
def test_a_drive_that_conceals_something_is_written(name, tmp_path):
    out = tmp_path / "drive"
    result = CliRunner().invoke(cli.app, ["scenario", name, str(out), "--seed", "2", "--duration", "10"])
    assert result.exit_code == 0
    assert f"scenario {name}, seed 2" in result.stdout
    truth = json.loads((out / "truth.json").read_text(encoding="utf-8"))
    assert truth["concealed"][0] == PRESETS[name].concealed[0].truth()
    assert (truth["scenario"], truth["seed"], truth["duration_s"]) == (name, 2, 10.0)
