"""The generator of whole drives: what is driven, where causes act, how strong they are, what is written."""

from __future__ import annotations

import json
from dataclasses import fields, replace
from itertools import pairwise

import numpy as np
import pytest
from bevameter.framework.core.recording.readers import read_recording
from concealed.effects_ground import SlipSinkage
from concealed.effects_instrument import TimeLag, TorqueOffset
from concealed.mechanics import simulate
from concealed.strength import LEVELS
from concealed.vehicle import study
from concealed.vehicle.conceal import conceal_drive, draw_scene, places_of
from concealed.vehicle.confined import Confined, rows_of
from concealed.vehicle.counting import count
from concealed.vehicle.faults import catalogue, needs
from concealed.vehicle.grounds import CLASSES, draw_classes

CHANNELS = ("load_N", "torque_Nm", "sinkage_m", "drawbar_pull_N", "slip")


def scene(seed, wheels, slugs=()):
    rng = np.random.default_rng(seed)
    drawn = None
    while drawn is None:
        drawn = draw_scene(rng, needs(slugs), wheels, 1.0)
    return drawn


@pytest.fixture(scope="module")
def two_wheels():
    return scene(1, 2)


def test_drives_are_those_of_a_vehicle(two_wheels):
    journey, radius = two_wheels.journey, two_wheels.vehicle.body.radius_m
    drive, slow = journey.drive, ~journey.fast
    assert 150.0 <= drive.time_s[-1] <= 300.0
    assert np.all((drive.slip >= 0.05) & (drive.slip <= 0.6))
    assert np.median(radius * drive.wheel_speed[slow]) == pytest.approx(0.3, abs=0.05)
    assert np.quantile(drive.travel_speed[journey.fast], 0.8) > 1.5
    assert two_wheels.counted.textbook.sinkage_m.max() < 0.5 * radius
    for number in range(len(two_wheels.stretches.classes)):  # slip and load are swept on each ground
        there = slow & (drive.ground == number)
        assert np.ptp(drive.slip[there]) > 0.25
        assert np.ptp(np.log(drive.load_N[there])) > 0.3


def test_front_wheels_reach_a_border_first_and_rear_ones_run_in_their_ruts(two_wheels):
    drive, borders = two_wheels.journey.drive, two_wheels.journey.borders_s
    front, rear = (drive.rows(np.flatnonzero(drive.wheel == number)) for number in (0, 1))
    for number, border in enumerate(borders[1:-1], start=1):
        entered = [each.time_s[np.argmax(each.ground >= number)] for each in (front, rear)]
        assert entered[0] <= border + 0.1
        assert entered[1] >= border
        assert entered[0] < entered[1]
    assert set(front.passes) == {1.0}
    assert set(rear.passes) == {2.0}
    varied = np.ravel(two_wheels.varied(np.random.default_rng(0)).stiffness_Pa)
    common = np.linspace(5.0, 20.0, 50)
    of_wheel = [np.interp(common, each.x_m, varied[drive.wheel == n]) for n, each in enumerate((front, rear))]
    np.testing.assert_allclose(of_wheel[1] / of_wheel[0], 1.0, atol=0.01)


def test_left_and_right_wheels_run_on_tracks_of_their_own():
    four = scene(3, 4)
    drive = four.journey.drive
    assert len(np.unique(drive.lane)) == 2
    rows = [np.flatnonzero((drive.wheel == n) & (drive.ground == 0))[:400] for n in (0, 1)]
    left, right = (np.log(np.ravel(four.varied(np.random.default_rng(0)).stiffness_Pa)[own]) for own in rows)
    assert np.std(left - right) > 0.5 * np.std(left)


def test_tracks_never_meet_themselves(two_wheels):
    way = np.arange(0.0, two_wheels.journey.borders_m[-1], 1.0)
    there = two_wheels.journey.path.at(way)
    apart = np.linalg.norm(there[:, None] - there[None], axis=2)
    assert np.all(apart > 0.7 * np.abs(way[:, None] - way[None]) - 1e-9)
    np.testing.assert_allclose(np.linalg.norm(np.diff(there, axis=0), axis=1), 1.0, atol=1e-3)


def test_classes_are_two_to_five_and_the_same_is_never_its_own_neighbour(rng):
    drawn = [draw_classes(rng) for _ in range(200)]
    assert {len(classes) for classes in drawn} == {2, 3, 4, 5}
    assert all(set(classes) <= set(CLASSES) and len(set(classes)) >= 2 for classes in drawn)
    assert all(a != b for classes in drawn for a, b in pairwise(classes))
    assert 0.15 < np.mean([len(set(classes)) < len(classes) for classes in drawn]) < 0.45


@pytest.mark.parametrize(
    ("effect", "where"),
    [
        (SlipSinkage("exponent", 0.2), "class"),
        (SlipSinkage("factor", 0.3), "class"),
        (TorqueOffset("constant", 0.2, 1.0, 10.0), "wheel"),
        (TimeLag("delay", 0.4, 1.0, "torque_Nm"), "wheel"),
    ],
)
def test_what_is_confined_touches_no_other_rows(two_wheels, effect, where):
    drive = two_wheels.journey.drive
    rows = drive.ground == 1 if where == "class" else drive.wheel == 1
    confined = Confined(effect, "", grounds=(1,)) if where == "class" else Confined(effect, "", wheel=1)
    seen = two_wheels.counted.reported([confined])
    everywhere = two_wheels.counted.reported([Confined(effect)])
    assert seen is not None
    assert everywhere is not None
    for name in CHANNELS:
        own, plain = getattr(seen[0], name), getattr(two_wheels.counted.textbook, name)
        np.testing.assert_allclose(own[~rows], plain[~rows], rtol=1e-6)
        np.testing.assert_allclose(own[rows], getattr(everywhere[0], name)[rows], rtol=1e-6)
    assert np.any(np.abs(seen[0].torque_Nm - two_wheels.counted.textbook.torque_Nm)[rows] > 1e-3)


def test_instruments_of_each_wheel_remember_their_own_rows(two_wheels):
    lag = TimeLag("delay", 1.0, 1.0, "torque_Nm")
    seen = two_wheels.counted.reported([Confined(lag)])
    drive, plain = two_wheels.journey.drive, two_wheels.counted.textbook.torque_Nm
    assert seen is not None
    for wheel in (0, 1):
        rows = drive.wheel == wheel
        np.testing.assert_allclose(seen[0].torque_Nm[rows][10:], plain[rows][:-10], rtol=1e-9)


def test_a_null_is_the_textbooks_wheel_on_each_ground():
    drive = conceal_drive(11)
    assert drive.truth["level"] == "null"
    assert drive.truth["nats"] == pytest.approx(0.0, abs=0.01)
    counted, rows = drive.scene.counted, drive.scene.journey.drive
    for number, ground in enumerate(drive.truth["grounds"]):
        there = np.flatnonzero(rows.ground == number)
        soil = drive.scene.stretches.soils[number]
        assert ground["soil"] == {each.name: getattr(soil, each.name) for each in fields(soil)}
        plain, _ = simulate(soil, counted.body, rows.rows(there))
        np.testing.assert_allclose(rows_of(drive.clean, there).answers(), plain.answers(), rtol=1e-7)
    # What is recorded differs from it by noise and by the soil's variation, of a few per cent, alone.
    noise = drive.truth["noise"]
    for name, error in drive.truth["oracle_rmse"].items():
        assert 0.9 * noise[name] < error < 2.0 * noise[name] + 0.05 * np.std(getattr(drive.clean, name))


@pytest.mark.parametrize(
    ("effects", "places", "level", "wheels"),
    [
        (("torque_offset",), ("everywhere",), "hidden", 1),
        (("slip_sinkage",), ("class",), "buried", 1),
        (("sinkage_offset",), ("wheel",), "plain", 2),
    ],
)
def test_the_strength_is_that_of_the_level_with_every_soil_refitted(effects, places, level, wheels):
    drive = conceal_drive(5, effects, places, level, wheels)
    assert drive.truth["reached"]
    assert drive.truth["nats"] == pytest.approx(LEVELS[level], rel=0.15)
    where = drive.truth["effects"][0]["where"]
    assert where == "everywhere" if places == ("everywhere",) else list(where) == list(places)
    assert {"everywhere": 0, "class": 1, "wheel": 1}[places[0]] == len(where if isinstance(where, dict) else {})
    # Another count, of other rows.
    own = drive.scene
    other = count(
        own.counted.body, own.journey, own.stretches, own.sensors, own.variations, own.counted.textbook,
        own.counted.theta_1, 2000,
    )  # fmt: skip
    fit = other.refit(drive.effects, other.start)
    assert fit is not None
    assert fit.nats == pytest.approx(LEVELS[level], rel=0.25)


def test_of_two_that_are_the_same_neither_explains_more(two_wheels):
    offset = Confined(TorqueOffset("constant", 0.02, 1.0, 10.0))
    twice = replace(offset, effect=offset.effect.scaled(0.04))
    assert two_wheels.few.shares([offset, twice]) == pytest.approx([0.0, 0.0], abs=1e-6)
    lag = Confined(TimeLag("filter", 0.03, 1.0, "torque_Nm"))
    assert min(two_wheels.few.shares([offset, lag])) > 0.9


FILES = ["labels.csv", "pose.csv", "recording.toml", "vehicle.toml", "wheel.csv"]


def test_the_same_seed_writes_the_same_bytes(tmp_path):
    folders = [conceal_drive(23).write(tmp_path / name / "drive", tmp_path / name / "truth") for name in "ab"]
    assert sorted(path.name for path in folders[0].iterdir()) == FILES
    for file in (*FILES, "../truth/drive.json"):
        assert (folders[0] / file).read_bytes() == (folders[1] / file).read_bytes()


def test_drives_are_read_and_do_not_reveal_their_causes(tmp_path):
    drive = conceal_drive(21, ("torque_offset",), ("wheel",), "hidden", wheels=2)
    folder = drive.write(tmp_path / "drive", tmp_path / "truth")
    recording = read_recording(folder)
    assert recording.problems == ()
    assert recording.vehicle is not None
    assert [wheel.name for wheel in recording.vehicle.wheels] == ["front", "rear"]
    assert recording.vehicle.wheels[0].position_m[0] > recording.vehicle.wheels[1].position_m[0]
    assert recording.wheel is not None
    assert recording.pose is not None
    assert recording.labels is not None
    truth = json.loads((tmp_path / "truth" / "drive.json").read_text())
    assert [each["class"] for each in truth["grounds"]] == list(recording.labels.classes)
    assert truth["effects"][0]["belongs_to"] == "vehicle"
    assert truth["effects"][0]["where"]["wheel"] in ("front", "rear")
    assert set(truth["oracle_rmse"]) <= set(CHANNELS)
    text = " ".join(path.read_text() for path in folder.iterdir() if path.suffix == ".toml")
    assert not any(slug in text for slug in catalogue())


def test_the_study_draws_every_effect_and_every_place():
    drawn = [study.draw(seed) for seed in range(800)]
    assert np.mean([not effects for effects, _, _ in drawn]) == pytest.approx(0.30, abs=0.01)
    assert np.mean([len(effects) == 2 for effects, _, _ in drawn]) == pytest.approx(0.15, abs=0.01)
    single = {(effects[0], places[0]) for effects, places, _ in drawn if len(effects) == 1}
    assert single == {(slug, place) for slug in catalogue() for place in places_of(slug)}
    levels = [level for effects, _, level in drawn if len(effects) == 1]
    assert {levels.count(level) for level in LEVELS} <= set(range(len(levels) // 3 - 2, len(levels) // 3 + 3))


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"effects": ("rim_adhesion",)}, "no effect 'rim_adhesion'"),
        ({"effects": ("drift", "drift")}, "one or two different"),
        ({"effects": ("drift",), "places": ("class",)}, "drift is not confined to one class"),
        ({"effects": ("inertia",), "places": ("wheel",)}, "inertia is not confined to one wheel"),
        ({"effects": ("drift",), "places": ("moon",)}, "no place 'moon'"),
        ({"effects": ("drift",), "places": ()}, "0 places for 1 effects"),
        ({"effects": ("multipass_compaction",), "wheels": 1}, "no wheel runs behind another"),
        ({"wheels": 3}, "3 wheels"),
        ({"level": "loud"}, "no level 'loud'"),
    ],
)
def test_a_bad_argument_is_refused(given, message):
    with pytest.raises(ValueError, match=message):
        conceal_drive(0, **given)
