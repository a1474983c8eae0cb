"""`bevameter explain` on whole recordings: a physical effect, a fault of an instrument, and nothing, each named right.

How often it is right is a study (`tests/studies/judge.py`).
"""

from __future__ import annotations

import json
import math

import pytest
from bevameter.framework.cli.main import app
from concealed.conceal import conceal
from typer.testing import CliRunner

pytestmark = pytest.mark.end_to_end


def explained(tmp_path, seed: int, *effects: str, level: str = "plain") -> tuple[dict, dict]:
    """Drive over a field with effects in it, explain the recording; give the answer and the truth."""
    made = conceal(seed, effects, level, "field", samples=300)
    made.write(tmp_path / "drive")
    page, report = tmp_path / "answer.json", tmp_path / "answer.html"
    command = ["explain", tmp_path / "drive", "--json", page, "--report", report]
    done = CliRunner().invoke(app, list(map(str, command)))
    assert done.exit_code == 0, done.output
    assert report.stat().st_size > 0
    answer = json.loads(page.read_text(encoding="utf-8"))
    names = [each["effect"] for each in answer["candidates"]]
    assert len(names) == len(set(names))
    assert sum(each["probability"] for each in answer["candidates"]) < 1.0 + 1e-9
    return answer, made.truth


def test_compaction_by_earlier_passes_is_named(tmp_path):
    answer, truth = explained(tmp_path, 7, "multipass_compaction")
    assert answer["verdict"] == "physics"
    assert [each["effect"] for each in answer["missing"]] == ["multipass_compaction"]
    right = set(truth["effects"][0]["channels"])
    assert {each["channel"] for each in answer["located"]} & right
    errors = answer["fit"]["channels"].values()
    assert all(each["rmse_after"] < 1.3 * each["noise"] for each in errors)
    assert math.prod(each["rmse_after"] / each["rmse_before"] for each in errors) < 1.0


def test_the_zero_of_a_torque_sensor_is_named(tmp_path):
    answer, truth = explained(tmp_path, 5, "torque_offset")
    assert answer["verdict"] == "instrument"
    (found,) = answer["missing"]
    assert found["effect"] == "torque_offset"
    offset = found["parameters"]["T_0"]
    assert abs(offset["value"] - truth["effects"][0]["comparable"]["T_0"]) < 4.0 * offset["sd"]


def test_a_drive_that_the_textbook_describes_has_nothing_missing(tmp_path):
    answer, _ = explained(tmp_path, 41, level="hidden")
    assert answer["verdict"] == "none"
    assert answer["missing"] == []
