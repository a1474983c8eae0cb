"""What is left of slip and load in all channels together speaks against a look-alike, and not against a right form."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from bevameter import Vehicle, Wheel, explain
from bevameter.framework.core.recording.types import WheelTable
from bevameter.identification.effects.catalogue import SLUGS, effects_for
from bevameter.identification.felt_rows import felt_rows
from bevameter.identification.identify import open_recording
from bevameter.identification.mechanics.soil import Soil
from bevameter.identification.mismatch.fit.fitting import fit
from bevameter.identification.mismatch.fit.held_out import hold_out
from bevameter.identification.mismatch.fit.samples import gather
from bevameter.identification.mismatch.fit.trial import situation, textbook_trial, try_adding
from bevameter.identification.mismatch.locate.joint_misfit import joint_correction, nats_in_all
from bevameter.identification.mismatch.locate.smooth_correction import smooth_correction
from bevameter.identification.mismatch.name.evidence import doubts
from bevameter.identification.mismatch.name.tries import Search
from bevameter.identification.simulate import simulate
from concealed.conceal import conceal

WHEEL = Wheel(radius_m=0.15, width_m=0.1)
VEHICLE = Vehicle(name="made", wheels=(WHEEL,))
SAND = Soil(c_Pa=300.0, phi_rad=math.radians(31.0), k_m=0.008, stiffness_Pa=6e4, n=0.9)
ROWS, MOST = 400, 13.0


def driven(seed: int, bent: float = 0.0):
    """Fit the textbook wheel to its own answers under noise, each channel bent with slip by a share of that noise."""
    rng, time_s = np.random.default_rng(seed), 0.1 * np.arange(ROWS)
    slip, load = 0.25 + 0.23 * np.sin(time_s / 2.7), 100.0 * (1.0 + 0.2 * np.sin(time_s / 4.1))
    clean = WheelTable({"time_s": time_s, "load_N": load, "slip": slip}, None, None, "made")
    answer = simulate(VEHICLE, SAND, clean)
    measured = {"time_s": time_s, "load_N": load, "slip": slip}
    for number, name in enumerate(("torque_Nm", "sinkage_m", "drawbar_pull_N")):
        course = bent * np.cos((number + 2.0) * np.pi * (slip - 0.02) / 0.46)
        noise = 0.01 * np.abs(answer[name]).max()
        measured[name] = answer[name] + noise * (rng.normal(size=ROWS) + course)
    return textbook_trial(gather(WheelTable(measured, None, None, "made"), WHEEL, VEHICLE))


def test_of_noise_nothing_is_left_on_average():
    """Twenty fits: half a chi-square of about 20 degrees less its mean, whose standard deviation is about 3 nats."""
    left = [nats_in_all(problem, textbook.fitted) for problem, textbook in map(driven, range(20))]
    assert abs(np.mean(left)) < 3.0 * 3.2 / math.sqrt(20)
    assert 1.5 < np.std(left) < 5.0
    assert max(left) < MOST


def test_what_is_too_little_in_each_channel_shows_in_all():
    problem, textbook = driven(1, bent=0.4)
    assert smooth_correction(problem, textbook.fitted, textbook.held_out).terms == ()
    left = nats_in_all(problem, textbook.fitted)
    assert left > MOST
    assert nats_in_all(problem, textbook.fitted, repeated=4.0) < 0.0, "four rows that say the same count as one"


@pytest.mark.parametrize(
    ("seed", "hidden", "like", "level", "protocol"),
    [
        (600501, "shear_hump", "rim_adhesion", "hidden", "bench"),
        (600503, "side_wall_friction", "bulldozing", "hidden", "bench"),
        # Ground that varies more than it does would make up for what bulldozing leaves.
        (720028, "side_wall_friction", "bulldozing", "plain", "steady"),
    ],
)
def test_a_look_alike_leaves_more_than_the_right_effect_in_another_form(
    tmp_path, seed, hidden, like, level, protocol
):  # fmt: skip
    rows = felt_rows(open_recording(conceal(seed, (hidden,), level, protocol).write(tmp_path), None))
    problem, textbook = textbook_trial(gather(rows.table, rows.wheel, rows.vehicle))

    def doubted(slug: str) -> bool:
        forms = effects_for(situation(problem, textbook.fitted), [slug])
        trial = max((try_adding(problem, textbook, textbook, form) for form in forms), key=lambda each: each.gain)
        assert trial.gain > MOST
        return any("leaves more" in each for each in doubts(problem, Search(textbook, (trial,), (), trial), 0.0, 1.0))

    assert doubted(like)
    assert not doubted(hidden)


def test_one_load_and_one_slip_are_no_course():
    """Columns that are alike, or one number, count once or not at all."""
    problem, textbook = driven(2)
    rows = len(problem.samples)
    drive = replace(problem.samples.drive, load_N=np.full(rows, 100.0), slip=np.full(rows, 0.2))
    problem.samples = replace(problem.samples, drive=drive)
    assert math.isfinite(nats_in_all(problem, textbook.fitted))


def test_a_joint_correction_is_found_where_no_channel_shows_one():
    problem, textbook = driven(7, bent=0.4)
    assert smooth_correction(problem, textbook.fitted, textbook.held_out).terms == ()
    found = joint_correction(problem, textbook.fitted, textbook.held_out)
    assert found is not None
    assert {term.variable for term in found.terms} == {"slip"}, "the load has no part in it"
    assert sum(term.gain for term in found.terms) == pytest.approx(found.gain)
    left = replace(textbook.held_out, residuals=textbook.held_out.residuals - found.held_out)
    assert left.error(problem) < textbook.held_out.error(problem)


def test_of_noise_no_joint_correction_is_made():
    for problem, textbook in map(driven, range(8)):
        assert joint_correction(problem, textbook.fitted, textbook.held_out) is None


def test_noise_that_was_taken_for_too_much_is_no_correction():
    """What the likeliest noise gains by itself depends on nothing."""
    problem, textbook = driven(0)
    wide = replace(textbook.fitted.noise, answers=4.0 * textbook.fitted.noise.answers)
    there = textbook.fitted
    fitted = fit(problem, there.model, there.vector, wide, there.theta_1, iterations=0, settle=False)
    assert joint_correction(problem, fitted, hold_out(problem, fitted)) is None


def test_a_load_that_each_level_takes_otherwise_is_seen_though_the_ground_is_taken_to_vary(tmp_path):
    """A flattened tyre at four loads, which a hard layer follows with errors of either sign in turn."""
    folder = conceal(730039, ("tyre_deflection",), "plain", "steady").write(tmp_path / "drive")
    answer = explain(folder, catalogue=[slug for slug in SLUGS if slug != "tyre_deflection"])
    assert answer.missing
    assert all(each.probability <= 0.5 for each in answer.missing if each.effect != "unknown")


@pytest.mark.parametrize(
    ("seed", "hidden", "protocol", "told"),
    [(710036, "hard_layer", "steady", False), (710001, "rim_adhesion", "steady", True)],
)
def test_what_the_catalogue_lacks_is_no_nothing(tmp_path, seed, hidden, protocol, told):
    """Ground that varies, or another soil than the one that was measured, would make up for it."""
    folder = conceal(seed, (hidden,), "hidden", protocol).write(tmp_path / "drive")
    soil = folder / "soil.toml"
    assert soil.is_file() == told
    others = [slug for slug in SLUGS if slug != hidden]
    answer = explain(folder, catalogue=others, soil=soil if told else None)
    assert answer.verdict in ("cannot_tell", "unknown")
    assert [each.effect for each in answer.missing] == ["unknown"]
    assert answer.missing[0].description
    assert answer.missing[0].would_tell
