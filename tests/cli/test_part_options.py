"""`--from`, `--to`, `--on` and `--wheel` of `identify` and `explain`."""

from __future__ import annotations

import json

import numpy as np
import pytest
from bevameter.framework.cli.main import app
from slow_drive import CLAY, SAND, drive
from typer.testing import CliRunner


@pytest.fixture
def folder(tmp_path, rng):
    """Thirty seconds of sand and thirty of clay, labelled, of a wheel without a name."""
    table = drive(rng, (SAND, CLAY))
    names = list(table.columns)
    np.savetxt(
        tmp_path / "wheel.csv", np.column_stack([table[name] for name in names]), "%.9g", ",", header=",".join(names),
        comments="",
    )  # fmt: skip
    (tmp_path / "vehicle.toml").write_text('[wheel]\nradius_m = 0.15\nwidth_m = 0.12\nname = "only"\n')
    (tmp_path / "labels.csv").write_text("start_s,end_s,class\n0,30,sand\n30,60,clay\n")
    return tmp_path


def test_identify_uses_the_part_and_says_which(folder):
    out = folder / "soil.json"
    arguments = ["identify", folder, "--from", 32, "--to", 55, "--on", "clay", "--wheel", "only", "--json", out]
    result = CliRunner().invoke(app, [str(each) for each in arguments])
    assert result.exit_code == 0, result.output
    assert "note: used of the recording: 33.4 to 55.0 s, wheel only, on clay; 217 of 600 rows" in result.stdout
    page = json.loads(out.read_text())
    assert page["segments"][0]["start_s"] == pytest.approx(33.4)
    assert page["overall"]["c_Pa"]["low"] < CLAY.c_Pa < page["overall"]["c_Pa"]["high"]


def test_the_report_of_identify_is_one_page(folder):
    out = folder / "soil.html"
    arguments = ["identify", folder, "--from", 48, "--to", 55, "--report", out]
    result = CliRunner().invoke(app, [str(each) for each in arguments])
    assert result.exit_code == 0, result.output
    page = out.read_text()
    value = next(line for line in result.stdout.splitlines() if line.startswith("cohesion")).split()[3]
    assert f"cohesion c {float(value):.2f}" in page.replace("&nbsp;", " ")
    assert page.count("data:image/png;base64,") == 2
    assert 'src="http' not in page


@pytest.mark.parametrize("command", ["identify", "explain"])
def test_a_class_that_is_not_there_is_one_line(folder, command):
    result = CliRunner().invoke(app, [command, str(folder), "--on", "peat"])
    assert result.exit_code == 2
    assert result.stderr.endswith(f"bevameter: {folder}: no ground of class 'peat' (expected one of clay, sand)\n")
    assert result.stdout == ""
