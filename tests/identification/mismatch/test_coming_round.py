"""What comes round with the wheel or along the track is not left to ground that varies."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from bevameter import Recording, Vehicle, Wheel, explain
from bevameter.framework.core.recording.types import WheelTable
from bevameter.identification.mechanics.soil import Soil
from bevameter.identification.mismatch.explanation import Region
from bevameter.identification.mismatch.fit.samples import Samples, gather
from bevameter.identification.mismatch.fit.trial import textbook_trial
from bevameter.identification.mismatch.locate.coming_round import coming_round, located, turned
from bevameter.identification.mismatch.locate.joint_misfit import joint_correction
from bevameter.identification.mismatch.locate.smooth_correction import Term
from bevameter.identification.mismatch.show.shape import shape_of
from bevameter.identification.simulate import simulate

WHEEL = Wheel(radius_m=0.15, width_m=0.1)
VEHICLE = Vehicle(name="made", wheels=(WHEEL,))
SAND = Soil(c_Pa=300.0, phi_rad=math.radians(31.0), k_m=0.008, stiffness_Pa=6e4, n=0.9)
ROWS = 500


def made(seed: int, *, by_turn_m: float = 0.0, by_place_m: float = 0.0, varied: float = 0.0) -> WheelTable:
    """Answers of the textbook wheel under noise, the sinkage off by a wave with the wheel or the place."""
    rng, time_s = np.random.default_rng(seed), 0.25 * np.arange(ROWS)
    slip, load = np.linspace(0.03, 0.5, ROWS), 100.0 * (1.0 + 0.2 * np.sin(time_s / 9.1))
    angle = 0.3 * time_s
    place = np.cumsum(0.3 * 0.25 * WHEEL.radius_m * (1.0 - slip))
    columns = {"time_s": time_s, "load_N": load, "slip": slip, "wheel_angle_rad": angle, "x_m": place}
    answer = simulate(VEHICLE, SAND, WheelTable(columns, None, None, "made"))
    walk = np.convolve(rng.normal(size=ROWS + 40), np.hanning(41) / math.sqrt(np.sum(np.hanning(41) ** 2)), "valid")
    sinkage = answer["sinkage_m"] * (1.0 + varied * walk)
    sinkage = sinkage + by_turn_m * np.cos(angle + 1.0) + by_place_m * np.cos(2.0 * math.pi * place / 0.35)
    measured = {name: answer[name] for name in ("torque_Nm", "drawbar_pull_N")} | {"sinkage_m": sinkage}
    noise = {name: 0.01 * np.abs(answer[name]).max() for name in measured}
    noisy = {name: values + noise[name] * rng.normal(size=ROWS) for name, values in measured.items()}
    return WheelTable({**columns, **noisy}, None, None, "made")


def driven(seed: int, **hidden: float):
    return textbook_trial(gather(made(seed, **hidden), WHEEL, VEHICLE))


@pytest.mark.parametrize(
    ("hidden", "what"),
    [
        ({"by_turn_m": 4e-4}, "sinkage z ripples with wheel angle, 1 cycle a turn"),
        ({"by_place_m": 4e-4}, "sinkage z goes up and down along the track, every 0.3"),
    ],
)
def test_a_wave_is_found(hidden, what):
    problem, textbook = driven(1, **hidden)
    found = joint_correction(problem, textbook.fitted, textbook.held_out, turning=True)
    assert found is not None
    assert found.gain > 25.0
    told = [shape_of(term.channel, term.variable, term.at, term.values).words for term in found.terms]
    (words,) = [each for each in told if each.startswith(what)]
    if "every" in words:
        assert float(words.partition("every ")[2].partition(" m")[0]) == pytest.approx(0.35, abs=0.005)
    amplitude = 0.5 * float(words.rpartition(" by ")[2].removesuffix(" mm"))
    assert amplitude == pytest.approx(0.4, abs=0.06)


@pytest.mark.parametrize("varied", [0.0, 0.02])
def test_ground_that_varies_and_noise_do_not_come_round(varied):
    for seed in range(5):
        problem, textbook = driven(seed, varied=varied)
        found = joint_correction(problem, textbook.fitted, textbook.held_out, turning=True)
        assert found is None or not any("(" in term.variable for term in found.terms)


def test_the_answer_is_something_unknown_and_says_how_to_tell_a_wave_of_the_ground(tmp_path):
    table = made(1, by_place_m=5e-4)
    recording = Recording("rig", tmp_path, VEHICLE, None, "", "0" * 64, wheel=table)
    answer = explain(recording, catalogue=["slip_sinkage", "drift"])
    assert answer.verdict == "unknown"
    (unknown,) = answer.missing
    assert "sinkage z goes up and down along the track, every 0.3" in unknown.description
    assert "sinkage_m += a wave" in unknown.equation
    assert "a wave of the ground stays where it is" in unknown.would_tell
    assert "place_m" not in unknown.would_tell


def waves_along_track(samples, left, answers) -> list[float]:
    """Periods of the waves along the track [m] that stand out of what is left (n, m)."""
    fit = SimpleNamespace(innovations=left)
    waves = coming_round(SimpleNamespace(samples=samples, answers=answers), fit)  # pyright: ignore[reportArgumentType]
    return [
        float(each.variable.partition("every ")[2].partition(" m")[0]) for each in waves if "every" in each.variable
    ]


def test_a_wave_on_passes_over_the_same_places_is_no_shorter_than_their_rows_show():
    problem, textbook = driven(2, by_place_m=4e-4)
    stretch = np.arange(ROWS) % 2
    samples = replace(problem.samples, drive=replace(problem.samples.drive, stretch=stretch))
    order = np.lexsort((samples.drive.place_m, stretch))
    periods = waves_along_track(samples.select(order), textbook.fitted.innovations[order], problem.answers)
    assert periods == pytest.approx([0.35] * 3, abs=0.01)


def test_noise_in_load_and_slip_rules_out_no_wave():
    problem, textbook = driven(3, by_place_m=1e-3)
    rows = np.arange(0, ROWS, 5)
    few = problem.samples.select(rows)
    left = textbook.fitted.residuals[rows] / 2e-4
    for seed in range(10):
        rng = np.random.default_rng(seed)
        load, slip = 100.0 + rng.normal(size=len(rows)), 0.2 + 0.01 * rng.normal(size=len(rows))
        samples = replace(few, drive=replace(few.drive, load_N=load, slip=slip))
        assert waves_along_track(samples, left, problem.answers) == pytest.approx([0.35] * 3, abs=0.01)


def test_a_wave_with_the_wheel_is_located_where_it_was_found_and_not_where_its_remains_are():
    angle = np.linspace(0.0, 60.0, 400)
    wave = Term("sinkage_m", "wheel_angle_rad (1 cycle a turn)", angle, 1e-3 * np.cos(angle), 90.0)
    load = Term("torque_Nm", "load_N", angle, angle, 30.0)
    remains = Region("sinkage_m", "wheel_angle_rad", 0.0, 2.0 * np.pi / 55.0, 0.5, 5e-4, 0.8)
    other = Region("torque_Nm", "load_N", 50.0, 60.0, 0.5, 1e-9, 1.2)
    first, second = located((remains, other), (load, wave), {"sinkage_m": 5e-4, "torque_Nm": 0.1})
    assert (first.channel, first.variable, first.end) == ("sinkage_m", "wheel_angle_rad", pytest.approx(2.0 * np.pi))
    assert first.share == pytest.approx(0.75)
    assert first.mean == pytest.approx(2.0, rel=0.02)
    assert first.p_value < 1e-12
    assert (second.channel, second.share) == ("torque_Nm", pytest.approx(0.25))
    assert located((remains, other), (load,), {}) == (remains, other)


def with_runs(samples: Samples, turns: float, **changed) -> Samples:
    """Samples in runs of so many turns each, on ground of their own, their angles counted from each run's start."""
    angle = samples.drive.wheel_angle_rad
    run = (angle // (2.0 * np.pi * turns)).astype(int)
    drive = {"stretch": run, "wheel_angle_rad": angle - 2.0 * np.pi * turns * run, **changed}
    return replace(samples, lane=run, drive=replace(samples.drive, **drive))


def test_turns_in_several_runs_count_together():
    samples = driven(1)[0].samples
    angle, whole = samples.drive.wheel_angle_rad, np.ptp(samples.drive.wheel_angle_rad)
    assert whole > 5.0 * 2.0 * np.pi
    assert turned(samples) == pytest.approx(whole)
    assert turned(with_runs(samples, 2.0)) == pytest.approx(whole, rel=0.05)
    # A run in which the wheel does not come round tells nothing of what does.
    assert turned(with_runs(samples, 0.4)) < np.pi
    # Passes over one lane are on the same ground, and pauses of the clock leave the angle as it is counted.
    assert turned(replace(with_runs(samples, 2.0), lane=samples.lane)) == pytest.approx(4.0 * np.pi, rel=0.05)
    assert turned(with_runs(samples, 0.4, wheel_angle_rad=angle)) == pytest.approx(whole)
    trials = replace(samples, drive=replace(samples.drive, stretch=np.arange(ROWS)), lane=np.arange(ROWS))
    assert turned(trials) == pytest.approx(whole)


def test_angles_that_start_anew_each_turn_or_are_lost_for_a_run_tell_of_turns():
    samples = driven(1)[0].samples
    angle, whole = samples.drive.wheel_angle_rad, np.ptp(samples.drive.wheel_angle_rad)
    wrapped = replace(samples, drive=replace(samples.drive, wheel_angle_rad=np.mod(angle, 2.0 * np.pi)))
    assert turned(wrapped) == pytest.approx(whole)
    runs = with_runs(samples, 2.0)
    lost = np.where(runs.drive.stretch == 1, np.nan, runs.drive.wheel_angle_rad)
    there = replace(runs, drive=replace(runs.drive, wheel_angle_rad=lost))
    assert turned(there) == pytest.approx(whole - 4.0 * np.pi, rel=0.05)


def test_what_comes_round_is_looked_for_from_three_turns_on():
    problem, textbook = driven(1, by_turn_m=4e-4)
    for turns, found in ((2.0, True), (0.4, False)):
        there = SimpleNamespace(samples=with_runs(problem.samples, turns), answers=problem.answers)
        left = textbook.fitted.innovations
        waves = coming_round(there, SimpleNamespace(innovations=left))  # pyright: ignore[reportArgumentType]
        assert any(each.variable.startswith("wheel_angle_rad") for each in waves) == found
