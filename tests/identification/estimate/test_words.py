"""Every finding of rows and estimates has its sentence."""

from __future__ import annotations

import re
from pathlib import Path

import bevameter.identification
import pytest
from bevameter.framework.core.findings import Finding, codes, note, warning
from bevameter.identification.estimate.words import SENTENCES, sentences

ROOMS = [Path(bevameter.identification.__file__).parent / room for room in ("rows", "estimate")]

VALUES = {
    "angle_disagrees": {"factor": 57.3, "speed": "wheel_speed_rad_s", "n": 90, "channel": None, "unit": None},
    "autocorrelated_noise": {"rows": 5.2, "larger": True},
    "bends": {"most_m_s": 0.04, "n": 200},
    "driven_not_known": {"wheels": ["castor"]},
    "duplicate_rows": {"n": 6, "rows": ["run a", "run b"], "more": 4},
    "grouser_count_missing": {"height_m": 0.012},
    "grouser_height_missing": {"count": 24},
    "ground_variation": {"misfit": 2.2},
    "load_computed": {"load_N": 147.0, "sd_N": 7.0, "transfer": ["pitch_rad"]},
    "load_without_slope": {"load_N": 147.0},
    "load_unit": {"channel": "torque_Nm", "ratio": 4.0, "ratio_if_kg": 0.41},
    "negative_cohesion": {"c_Pa": -120.0},
    "one_radius": {"geometries": 2, "radius_m": 0.15},
    "other_geometries": {"wheels": 2, "used": 24, "wheel": "wheel of radius 150 mm"},
    "other_wheels": {"columns": ["radius_m", "width_m"], "used": 24, "n": 48},
    "pull_computed": {"sd_N": 2.9, "towed": ["castor"], "resistance": 0.15, "resistance_sd": 0.1},
    "pull_sign": {"slope": -0.9, "correlation": -0.8, "mend": "scale = -1.0"},
    "pull_sign_by_slip": {"mend": "scale = -1.0"},
    "pull_unit": {"pull_N": 0.3, "load_N": 90.0, "units": ["load", "kN"]},
    "recording": {"text": "recording.toml: operator left out"},
    "rows_without_time": {"n": 100, "runs": 1},
    "settling_rows": {"seconds": 3.2, "runs": 18, "steps": True, "channels": ["torque_Nm", "sinkage_m"]},
    "several_soils": {"soils": ["sand", "loam"]},
    "several_wheels": {"wheels": 2},
    "slip_definition": {"channel": "torque_Nm", "mend": 'definition = "speed_ratio"'},
    "slip_disagrees": {"difference": 0.08, "radius_m": 0.15, "n": 200, "agreeing_radius_m": 0.165},
    "speed_unit": {"slip": 0.9, "likely": [{"channel": "travel_speed_m_s", "unit": "km/h"}]},
    "stated_noise": {"channel": "load_N", "stated": 1e-9, "shown": 0.1},
    "stop_rows": {"n": 90, "runs": 1},
    "stored": {"text": "as it was stored"},
    "stuck_rows": {"channel": "torque_Nm", "n": 20},
    "towed_wheels": {"wheels": ["castor"], "used": 80, "n": 120},
    "travel_speed_computed": {"window_s": 1.0, "sd_m_s": 0.01, "rim_m_s": 0.3, "place_sd_m": 0.02},
    "travel_speed_of_wheels": {"how": "within 0.1 % it is 1 times the mean speed of the rims"},
    "travel_speed_uncertain": {"window_s": 4.0, "sd_m_s": 0.2, "rim_m_s": 0.3, "place_sd_m": 0.6},
    "torque_computed": {"Nm_A": 2.4, "friction_Nm": 1.5, "torque_Nm": 7.3, "lossless": False},
    "stuck_channel": {"channel": "torque_Nm"},
    "thinned": {"rows": 1500},
    "time_unit": {"step_s": 100.0},
    "torque_sign": {"torque_Nm": 2.0, "share": 0.97, "slip": -0.2, "mend": "scale = -1.0"},
    "unsteady_input": {"channel": "load_N", "noise": 0.5, "shown": 5.0},
    "wrong_form": {"misfit": 2.0, "misfit_with_freedom": 1.8, "c_Pa": 900.0, "phi_rad": 0.5},
}  # fmt: skip


@pytest.mark.parametrize("code", SENTENCES)
def test_a_sentence_mentions_its_values(code):
    (text,) = sentences([Finding(code, "note", VALUES.get(code, {}))])
    assert "{" not in text
    assert not text.endswith(".")


def test_every_code_that_is_found_has_a_sentence():
    source = "".join(path.read_text() for room in ROOMS for path in room.glob("*.py"))
    found = set(re.findall(r'\b(?:note|warning)\(\s*"(\w+)"', source))
    assert len(found) > 20
    assert found <= set(SENTENCES)


def test_a_finding_of_one_of_several_wheels_begins_with_it():
    stuck = note("stuck_channel", channel="torque_Nm").with_values(of_wheel="wheel left")
    assert sentences([stuck])[0].startswith("wheel left: torque_Nm never changes")


def test_findings_are_plain_data():
    found = warning("pull_sign", slope=-0.9)
    assert found.to_json() == {"code": "pull_sign", "severity": "warning", "values": {"slope": -0.9}}
    assert codes([found]) == ["pull_sign"]
