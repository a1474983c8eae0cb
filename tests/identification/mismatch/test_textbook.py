"""The textbook wheel refitted: where its form is wrong, no soil may run away with ground that varies."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from bevameter import InputError, Vehicle, Wheel, explain
from bevameter.framework.core.recording.types import WheelTable
from bevameter.identification.effects.catalogue import effects_for
from bevameter.identification.effects.named import parse_effect
from bevameter.identification.mechanics.soil import Soil
from bevameter.identification.mechanics.textbook import equilibrium
from bevameter.identification.mismatch.fit.fitting import Problem, fit
from bevameter.identification.mismatch.fit.gained_by_none import of_gross_errors
from bevameter.identification.mismatch.fit.samples import Samples, gather
from bevameter.identification.mismatch.fit.soil_variation import NoiseModel
from bevameter.identification.mismatch.fit.steps import step_of
from bevameter.identification.mismatch.fit.textbook import coarse_fit, fit_textbook
from bevameter.identification.mismatch.fit.trial import (
    _by_chance,
    least_errors,
    situation,
    textbook_trial,
    try_adding,
)
from bevameter.identification.simulate import simulate
from concealed.conceal import conceal
from scipy.optimize import brentq
from scipy.signal import lfilter


def samples_of(seed: int, slugs: tuple[str, ...], level: str, protocol: str) -> Samples:
    made = conceal(seed, slugs, level, protocol=protocol)
    keys = ("radius_m", "width_m", "grouser_height_m", "grouser_count")
    wheel = Wheel(**{key: made.vehicle[key] for key in keys})
    columns = WheelTable(made.recorded.columns, None, made.recorded.run, "made")
    return gather(columns, wheel, Vehicle(name="made", wheels=(wheel,), noise=made.vehicle["noise"]))


@pytest.fixture(scope="module")
def late() -> Samples:
    """A recording with two effects: fitted without them, noise was once expected to fall by what no step could gain."""
    return samples_of(250105, ("time_lag", "exit_angle"), "buried", "field")


def test_a_wrong_form_does_not_drive_the_soil_away(late):
    problem, fitted = fit_textbook(late)
    start = coarse_fit(problem, fitted.vector, fitted.theta_1)
    problem.weights, problem.most = None, replace(problem.unbounded, spread=np.full(2, 0.01))
    quiet = fit(problem, fitted.model, start.vector, None, start.theta_1)
    assert fitted.score >= quiet.score - 1.0
    assert fitted.noise.spread.max() < 0.1
    assert np.abs(fitted.vector[1:] - start.vector[1:]).max() < 0.5


@pytest.mark.parametrize("spread", [0.005, 0.02, 0.2])
def test_noise_is_never_expected_to_explain_more_than_a_step_can(late, spread):
    """What the noise is fitted to gain is there once the soil has followed: no fit ends below where it began."""
    problem = Problem(late)
    start = coarse_fit(problem, fit_textbook(late)[1].vector, None)
    noise = replace(problem.first_noise, spread=np.full(2, spread))
    held = fit(problem, start.model, start.vector, noise, start.theta_1, settle=False)
    settled = fit(problem, start.model, held.vector, noise, held.theta_1)
    assert settled.score > held.score


def test_a_fit_goes_on_where_other_noise_that_is_as_likely_moves_it(late, monkeypatch):
    problem, textbook = fit_textbook(late)
    rest = partial(fit, problem, textbook.model, theta_1=textbook.theta_1)

    def noisy(channel: int, wider: float) -> NoiseModel:
        answers = textbook.noise.answers.copy()
        answers[channel] *= wider
        return replace(textbook.noise, answers=answers)

    held = rest(textbook.vector, noisy(0, 20.0), settle=False)
    prior = problem.prior(textbook.model)

    def likelier(wider: float) -> float:
        there = rest(held.vector, noisy(1, wider), iterations=0)
        return there.score + problem.noise_loss(there.noise) - held.score - problem.noise_loss(held.noise)

    noise = noisy(1, brentq(likelier, 1.0, 1e3))
    started = rest(held.vector, noise, iterations=0)
    assert step_of(started.innovations, started.jacobian, prior, held.vector, 0.0)[1] > 1.0
    monkeypatch.setattr(Problem, "best_noise", lambda *_: noise)
    moved = rest(held.vector, held.noise)
    assert step_of(moved.innovations, moved.jacobian, prior, moved.vector, 0.0)[1] < 0.3


def test_errors_without_what_was_left_out_are_those_of_the_soil_that_errs_less():
    samples = samples_of(270072, ("torque_offset",), "buried", "field")
    problem, textbook = textbook_trial(samples)
    plain = coarse_fit(problem, textbook.fitted.vector, textbook.fitted.theta_1)
    own, least = (np.sqrt(np.nanmean(each**2, axis=0)) for each in (plain.residuals, least_errors(problem, textbook)))
    assert (least < 1.3 * own).all()


def test_a_layer_under_stiff_soil_is_found():
    """Layers are looked for that are stiffer than the soil, whatever the soil: a tractor's is as stiff as rock is to
    a rover's wheel.
    """
    rng = np.random.default_rng(5)
    rows = 500
    wheel, soil = Wheel(radius_m=0.69, width_m=0.46), Soil(3300.0, 0.54, 0.022, 2.5e6, 1.0)
    load = 2.0e4 * (1.0 + 0.45 * np.sin(np.linspace(0.0, 25.0, rows)))
    drive = {"time_s": 0.1 * np.arange(rows), "load_N": load, "slip": 0.2 + 0.15 * np.sin(np.linspace(0.0, 40.0, rows))}
    vehicle = Vehicle(name="tractor", wheels=(wheel,))
    answer = simulate(
        vehicle, soil, WheelTable(drive, None, None, "made"), effects=[parse_effect("hard_layer:d=0.045,ln_S_L=16.6")]
    )
    noisy = {
        name: answer[name] + rng.normal(size=rows) * sd
        for name, sd in (("sinkage_m", 1e-3), ("torque_Nm", 200.0), ("drawbar_pull_N", 200.0))
    }
    problem, textbook = textbook_trial(gather(WheelTable(drive | noisy, None, None, "made"), wheel, vehicle))
    (layer,) = effects_for(situation(problem, textbook.fitted), ["hard_layer"])
    found = try_adding(problem, textbook, textbook, layer)
    assert found.gain > 25.0
    assert found.fitted.vector[-2] == pytest.approx(0.045, abs=0.006)


def test_loads_that_nothing_carries_are_refused():
    made = samples_of(404, (), "plain", "field")
    drive = replace(made.drive, load_N=1e9 * made.drive.load_N)
    measured = made.measured.copy()
    measured[:, 0] *= 1e9
    with pytest.raises(InputError, match=r"column load_N: no soil carries .* N, the median of"):
        fit_textbook(replace(made, drive=drive, measured=measured))


def test_nothing_is_gained_on_a_few_gross_errors(tmp_path):
    """One sinkage 13 noises off: a tyre that brought it to 7 had gained 19 nats."""
    assert explain(conceal(280030, (), "plain", protocol="steady").write(tmp_path)).verdict == "none"
    before, after = np.zeros((100, 2)), np.zeros((100, 2))
    before[:, 0] = after[:, 0] = 1.0
    before[7, 1], after[7, 1] = 13.0, 7.0
    assert of_gross_errors(before, after) == pytest.approx(4.0 * (13.0 - 7.0))
    assert of_gross_errors(after, before) == 0.0, "nor is anything lost"
    after[:, 1] = 7.0
    assert of_gross_errors(np.full((100, 2), 13.0), after) == 0.0, "where most are gross the model is wrong"


@pytest.mark.parametrize(("wrong", "repeats"), [(0, 3), (2, 3), (2, 2)])
def test_a_repeat_that_is_grossly_wrong_is_no_ground_that_varies(wrong, repeats):
    """Of three trials of one kind the one far off is wrong; of two nobody knows which."""
    rng = np.random.default_rng(4)
    wheel, soil = Wheel(radius_m=0.2, width_m=0.15), Soil(1000.0, 0.52, 0.015, 3e5, 1.0)
    load, slip = (
        each.ravel() for each in np.meshgrid(np.repeat([150.0, 300.0, 450.0], repeats), np.linspace(0.05, 0.6, 8))
    )
    state = equilibrium(wheel, soil, load, slip)
    answers = np.column_stack([state.torque_Nm, state.sinkage_m, state.drawbar_pull_N])
    answers *= 1.0 + 0.01 * rng.normal(size=answers.shape)
    rows = rng.choice(len(load), wrong, replace=False)
    answers[rows, 0] *= 3.0
    columns = dict(zip(("torque_Nm", "sinkage_m", "drawbar_pull_N"), answers.T, strict=True))
    run = np.array([f"trial {row}" for row in range(len(load))])
    table = WheelTable({"load_N": load, "slip": slip, **columns}, None, run, "made")
    samples = gather(table, wheel, Vehicle(name="made", wheels=(wheel,)))
    problem, fitted = fit_textbook(samples)
    blanked = np.flatnonzero(~np.isfinite(problem.samples.measured[:, 1]))
    if repeats == 3:
        np.testing.assert_array_equal(blanked, np.sort(rows))
        assert any("stand alone far from trials" in note for note in problem.samples.notes) == bool(wrong)
        assert fitted.noise.spread.max() < 0.05
    else:
        assert blanked.size == 0


def test_a_delay_on_which_stretches_disagree_is_none():
    """Averaged errors of slip favour another delay in each stretch: one of them had gained 36 nats on nothing."""
    problem, textbook = textbook_trial(samples_of(360081, (), "plain", "field"))
    lags = {each.form: each for each in effects_for(situation(problem, textbook.fitted), ["time_lag"])}
    trial = try_adding(problem, textbook, textbook, lags["slip"])
    gained, sd = trial.held_out.gain(textbook.held_out)
    assert gained > 25.0
    assert gained < 2.0 * sd
    assert trial.gain <= 0.0
    # Where they agree the same gain counts.
    alike = replace(trial.held_out, nats=textbook.held_out.nats + gained / len(trial.held_out.nats))
    assert not _by_chance(textbook, replace(trial, held_out=alike))


def going_on(rng: np.random.Generator, count: int, sd: float, rows: float) -> np.ndarray:
    """Noise (count,) that is forgotten within so many rows."""
    keep = np.exp(-1.0 / rows)
    return lfilter([sd * np.sqrt(1.0 - keep**2)], [1.0, -keep], rng.normal(size=count))


@pytest.mark.parametrize("seed", [2, 3])
def test_rows_that_are_better_off_apart_are_not_late(seed, monkeypatch):
    """Slow ramps of slip whose load and slip are measured with errors that go on for rows: any delay does better."""
    rng, rows, wheel = np.random.default_rng(seed), 1500, Wheel(radius_m=0.15, width_m=0.1)
    vehicle = Vehicle(name="made", wheels=(wheel,))
    part = np.repeat((0, 1, 2), rows // 3)
    slip = 0.05 + 0.5 * np.tile(np.arange(rows // 3), 3) / (rows // 3) + going_on(rng, rows, 0.004, 60.0)
    load = np.array([60.0, 90.0, 130.0])[part] * (1.0 + going_on(rng, rows, 0.004, 60.0))
    clean = {"time_s": 0.05 * np.arange(rows) + 60.0 * part, "load_N": load, "slip": slip, "pass": part + 1.0}
    sand = Soil(c_Pa=300.0, phi_rad=np.radians(31.0), k_m=0.012, stiffness_Pa=9e4, n=0.9)
    answer = simulate(vehicle, sand, WheelTable(clean, None, None, "made"))
    measured = {**clean, "load_N": load * (1.0 + going_on(rng, rows, 0.006, 6.0))}
    measured["slip"] = slip + going_on(rng, rows, 0.004, 6.0)
    for name, noise in (("torque_Nm", 0.005), ("sinkage_m", 0.02), ("drawbar_pull_N", 0.02)):
        measured[name] = answer[name] + noise * np.abs(answer[name]).max() * rng.normal(size=rows)
    problem, textbook = textbook_trial(gather(WheelTable(measured, None, None, "made"), wheel, vehicle))
    lags = {each.form: each for each in effects_for(situation(problem, textbook.fitted), ["time_lag"])}
    assert try_adding(problem, textbook, textbook, lags["load_N"]).gain <= 0.0
    monkeypatch.setattr("bevameter.identification.mismatch.fit.trial._either_way", lambda *_: False)
    assert try_adding(problem, textbook, textbook, lags["load_N"]).gain > 30.0
