"""Parts of a recording: which rows they hold, what is said of them, and that nothing takes them for the whole."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from bevameter import InputError, explain, identify
from bevameter.framework.core.recording.types import Recording, WheelTable
from bevameter.framework.core.track.grounds import CHANGE_MARGIN_M
from bevameter.framework.core.track.way import track_of
from bevameter.framework.part import part_of
from bevameter.identification.rows.on_track import with_places
from ground_drive import LOAM, NOISE, SAND, SPEED_M_S, ground_drive

DRIVE = ground_drive({"sand": SAND, "loam": LOAM}, places=(0.3, -0.3))
TRIALS = Recording(
    "trials", Path("trials.csv"), None, None, "", "", wheel=WheelTable({"slip": np.ones(3)}, None, None, Path("t"))
)


def test_rows_of_a_span_a_wheel_and_a_class_are_chosen():
    part = part_of(DRIVE, from_s=5.0, to_s=30.0, wheels="w1", on="sand")
    time_s, margin_s = part.wheel["time_s"], (CHANGE_MARGIN_M + 0.3) / SPEED_M_S
    assert set(part.wheel.wheel) == {"w1"}
    # The rear wheel is 0.3 m behind the reference point, whose labels these are, and a change is known to half a metre.
    assert (time_s.min(), time_s.max()) == (5.0, pytest.approx(20.0 - margin_s + 2 * 0.3 / SPEED_M_S, abs=0.2))
    assert part.part == f"5.0 to {time_s.max():.1f} s, wheel w1, on sand"
    assert part.notes[-1] == f"used of the recording: {part.part}; {len(time_s)} of 800 rows"
    assert part.described == f"drive, {part.part}"


def test_a_part_has_a_digest_of_its_own_and_the_whole_stays_what_it_is():
    assert part_of(DRIVE) is DRIVE
    digests = {
        DRIVE.digest,
        *(part_of(DRIVE, to_s=end).digest for end in (10.0, 11.0)),
        part_of(DRIVE, on="sand").digest,
    }
    assert len(digests) == 4


@pytest.mark.parametrize(
    ("part", "said"),
    [
        ({"wheels": ["w0", "w7"]}, "no row of a wheel 'w7' .expected one of w0, w1"),
        ({"on": "mud"}, "no ground of class 'mud' .expected one of loam, sand"),
        ({"from_s": 9.0, "to_s": 9.0}, "from 9 s to 9 s .*start before the end, within the recording's 0.0 to 39.9 s"),
        ({"from_s": 41.0}, "from 41 s"),
        ({"to_s": float("nan")}, "to nan s"),
        ({"to_s": "9"}, "to_s: '9'"),
        ({"wheels": 3}, "wheels: 3"),
        ({"on": 3}, "on: 3"),
        ({"on": "loam", "to_s": 10.0}, "no row is in every part named"),
    ],
)
def test_a_part_that_is_not_there_is_one_error_that_names_what_is(part, said):
    with pytest.raises(InputError, match=said):
        part_of(DRIVE, **part)


def test_what_a_recording_lacks_is_said():
    with pytest.raises(InputError, match="no column time_s"):
        part_of(TRIALS, from_s=1.0)
    with pytest.raises(InputError, match="the rows name no wheels"):
        part_of(TRIALS, wheels="left")
    with pytest.raises(InputError, match=r"labels\.csv, a database"):
        part_of(replace(DRIVE, labels=None, pose=None), on="sand")


def test_ruts_of_rows_outside_the_part_count():
    """A rear wheel by itself, late in the drive, still runs in the rut of the front one."""
    whole = with_places(DRIVE.wheel, DRIVE.vehicle, track_of(DRIVE))
    late = (DRIVE.wheel["time_s"] >= 25.0) & (DRIVE.wheel.wheel == "w1")
    part = part_of(DRIVE, from_s=25.0, wheels="w1")
    alone = with_places(part.wheel, part.vehicle, track_of(part))
    np.testing.assert_array_equal(alone["pass"], whole["pass"][late])
    assert set(alone["pass"]) == {2.0}


def test_identify_takes_the_soil_of_the_part():
    result = identify(DRIVE, on="loam", wheels="w0")
    (segment,) = [each for each in result.segments if each.used]
    cohesion = segment.estimate.parameters["c_Pa"]
    assert cohesion.low <= LOAM.c_Pa <= cohesion.high
    assert cohesion.low > SAND.c_Pa
    assert "wheel w0, on loam" in result.findings[0].values["text"]


def test_explain_says_of_which_part_its_answer_is(tmp_path):
    wrong = ground_drive({"sand": SAND, "loam": LOAM}, zeros={"w0": {"torque_Nm": 25.0 * NOISE["torque_Nm"]}})
    soil = tmp_path / "soil.toml"
    soil.write_text("k_m = {value = 0.015, sd = 0.002}\n")
    answer = explain(wrong, on="sand", catalogue=("torque_offset",), soil=soil)
    assert answer.source == "drive, 0.0 to 17.5 s, on sand"
    assert [each.class_name for each in answer.grounds] == ["sand"]
    assert any("used of the recording: 0.0 to 17.5 s, on sand; 176 of 400 rows" in note for note in answer.notes)
