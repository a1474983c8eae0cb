"""What an answer adds in words."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from bevameter import Vehicle, Wheel
from bevameter.framework.core.recording.types import Labels, WheelTable
from bevameter.identification.effects.catalogue import SLUGS
from bevameter.identification.effects.drive import select_rows
from bevameter.identification.effects.effect import PULL, SINKAGE, TORQUE
from bevameter.identification.mismatch.fit.samples import gather
from bevameter.identification.mismatch.show.notes import _not_considered, several_grounds
from bevameter.identification.mismatch.show.outside import LOOK_ALIKES, outside, unstated_lugs
from effects_tried import DRIVE

TIME_S = np.arange(0.0, 100.0, 0.5)


def labels(*stretches: tuple[float, float, str]) -> Labels:
    start, end, classes = zip(*stretches, strict=True)
    return Labels(np.array(start), np.array(end), tuple(classes))


def test_several_kinds_of_ground_are_named():
    (note,) = several_grounds(labels((0.0, 50.0, "sand"), (50.0, 90.0, "loam")), TIME_S)
    assert "loam, sand" in note
    assert "cut the recording" in note


def test_one_kind_of_ground_is_no_word_worth():
    assert several_grounds(None, TIME_S) == []
    assert several_grounds(labels((0.0, 99.0, "sand"), (99.0, 100.0, "loam")), TIME_S) == []
    assert several_grounds(labels((0.0, 50.0, "sand"), (60.0, 90.0, "sand")), TIME_S) == []
    assert several_grounds(labels((0.0, 50.0, "sand"), (50.0, 90.0, "loam")), np.empty(0)) == []


def test_drifts_that_bend_are_said_to_be_left_out_where_slip_and_load_foretell_them():
    third = np.repeat([0.0, 1.0, 2.0], 100)
    along = 3.0 * np.arange(len(third)) / len(third) - third
    rows = {"slip": 0.05 + 0.5 * along, "load_N": 50.0 + 25.0 * third, "time_s": 0.1 * np.arange(len(third))}

    def note(passed="drift[torque_Nm]", **changed):
        drive = replace(select_rows(DRIVE, np.arange(len(third)) % len(DRIVE)), **{**rows, **changed})
        found = SimpleNamespace(trials=(), passed=((passed, 1.0),))
        return _not_considered(SimpleNamespace(samples=SimpleNamespace(drive=drive)), found)

    assert "drive the first load again" in note()[0]
    assert note("load_gain") == []
    assert note(load_N=np.full(len(third), 50.0)) == []
    assert note(time_s=np.full(len(third), np.nan)) == []


def test_a_delay_of_slip_is_said_to_be_left_out_where_slip_rises_at_one_rate():
    rise = np.linspace(0.05, 0.55, 300)

    def note(slip: np.ndarray, passed: str):
        drive = replace(select_rows(DRIVE, np.arange(len(slip)) % len(DRIVE)), slip=slip, stretch=np.zeros(len(slip)))
        found = SimpleNamespace(trials=(), passed=((passed, 1.0),))
        return _not_considered(SimpleNamespace(samples=SimpleNamespace(drive=drive)), found)

    assert "let slip fall" in note(rise, "time_lag[torque_Nm]")[-1]
    assert not any("let slip fall" in each for each in note(rise, "load_gain"))
    assert not any("let slip fall" in each for each in note(np.concatenate([rise, rise[::-1]]), "time_lag[torque_Nm]"))


@pytest.mark.parametrize(("lost", "told"), [(0, False), (20, False), (60, True), (300, False)])
def test_places_that_were_lost_for_long_are_told(lost, told):
    """One stretch without positions took all others' places from the ground that varies, and nothing said so."""
    rows, wheel = 300, Wheel(radius_m=0.15, width_m=0.1)
    along = np.arange(rows)
    columns = {
        "time_s": 0.1 * along, "load_N": 80.0 + 20.0 * np.sin(0.1 * along), "slip": 0.2 + 0.15 * np.cos(0.07 * along),
        "torque_Nm": 5.0 + np.cos(0.03 * along), "x_m": np.where(along < rows - lost, 0.01 * along, np.nan),
    }  # fmt: skip
    samples = gather(WheelTable(columns, None, None, "made"), wheel, Vehicle(name="made", wheels=(wheel,)))
    assert any("rows have no place" in note for note in samples.notes) == told
    assert np.array_equal(samples.position, samples.drive.place_m) == (lost < 30)


def test_causes_beyond_the_catalogue_that_look_alike_are_told():
    assert set(LOOK_ALIKES) < set(SLUGS)
    answers = (TORQUE, SINKAGE, PULL)
    (note,) = outside(["rim_adhesion", "hard_layer", "soil_patch"], answers)
    assert "a crust that breaks" in note
    assert "strength grows by less" in note
    assert note.index("hard") < note.index("rim")
    assert outside(["soil_patch"], answers) == outside([], answers) == []


def test_causes_in_channels_that_a_recording_lacks_are_not_told():
    (note,) = outside(["torque_gain", "load_gain"], (TORQUE, SINKAGE))
    assert note.endswith("like torque gain a torque's sensor that saturates")
    (note,) = outside(["torque_gain", "load_gain"], (TORQUE, PULL))
    assert "load gain a wrong gain of the pull's sensor; like torque gain a wrong gain of the pull's sensor or" in note


def test_lugs_of_which_the_vehicle_says_nothing_may_look_like_a_torque_gain():
    silent, smooth = Wheel(radius_m=0.1, width_m=0.05), Wheel(radius_m=0.1, width_m=0.05, grouser_height_m=0.0)
    (note,) = unstated_lugs({"torque_gain", "drift"}, silent)
    assert "grouser_height_m" in note
    assert unstated_lugs({"torque_gain"}, smooth) == []
    assert unstated_lugs({"drift"}, silent) == []


def test_what_comes_round_with_a_wheel_of_which_no_lugs_are_stated_may_be_teeth():
    smooth = Wheel(radius_m=0.1, width_m=0.05, grouser_height_m=0.0)
    (note,) = unstated_lugs({"grousers"}, smooth)
    assert "teeth of gears" in note
    assert unstated_lugs({"grousers"}, smooth.model_copy(update={"grouser_height_m": 0.01})) == [note]
    assert unstated_lugs({"grousers"}, smooth.model_copy(update={"grouser_count": 9})) == []
