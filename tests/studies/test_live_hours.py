"""The study of a long drive with faults, on ten minutes of it."""

from __future__ import annotations

import pytest
from bevameter import read_recording, run_traverse
from bevameter.framework.default_models import find_models
from live_six_hours import MODELS, Endless, compare, driven, recording_of

HOURS = 1.0 / 6.0


@pytest.mark.slow
def test_a_drive_that_is_killed_and_locked_out_is_that_of_a_run(short_drive, tmp_path):
    live, run = tmp_path / "live.db", tmp_path / "run.db"
    figures = driven(short_drive, live, HOURS, kills=1, seed=3, jump=False)
    assert "database is locked" in figures["locked"]
    assert figures["problems"] == []
    run_traverse(recording_of(Endless(read_recording(short_drive), HOURS)), run, models=find_models(MODELS, run))
    found = compare(run, live)
    assert found["same_drive"]
    assert found["cells"][0] == found["cells"][1] == found["cells_of_one_class"] > 300
    assert found["soils"][0] == found["soils"][1] >= 2
    assert found["greatest_difference_of_probability"] < 1e-9
    assert found["greatest_difference_of_c_and_tan_phi_share"] < 1e-9
