"""Rows held out are predicted as by a fit that never saw them, also where the soil's parameters trade off."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from bevameter import Vehicle, Wheel
from bevameter.framework.core.recording.types import WheelTable
from bevameter.identification.effects.catalogue import effects_for
from bevameter.identification.effects.shear_hump import ShearHump
from bevameter.identification.effects.slip_sinkage import SinkageExponent, SinkageRatio
from bevameter.identification.mechanics.augmented import Entry
from bevameter.identification.mechanics.soil import Soil
from bevameter.identification.mismatch.fit.fitting import Fitted, Problem, fit
from bevameter.identification.mismatch.fit.held_out import hold_out
from bevameter.identification.mismatch.fit.samples import gather, levels
from bevameter.identification.mismatch.fit.trial import situation, textbook_trial, try_adding
from bevameter.identification.mismatch.locate.noise_floor import noise_floor, swallowed
from bevameter.identification.mismatch.locate.regions import locate
from bevameter.identification.simulate import simulate
from scipy.signal import lfilter

WHEEL = Wheel(radius_m=0.15, width_m=0.1)
SAND = Soil(c_Pa=300.0, phi_rad=math.radians(31.0), k_m=0.008, stiffness_Pa=6e4, n=0.9)
ROWS, STEP_S = 400, 0.1


def drive(
    effects: tuple[str, ...], seed: int, wheel: Wheel = WHEEL, load_N: float = 100.0, load_varies: float = 0.0,
    noise: float = 0.01, slip_noise: float = 0.002,
) -> WheelTable:  # fmt: skip
    """Give a drive whose slip swings, with noise as a share of each channel's largest value."""
    rng = np.random.default_rng(seed)
    time_s = STEP_S * np.arange(ROWS)
    slip = 0.25 + 0.23 * np.sin(time_s / 2.7)
    load = load_N * (1.0 + load_varies * np.sin(time_s / 4.1))
    clean = WheelTable({"time_s": time_s, "load_N": load, "slip": slip}, None, None, "made")
    answer = simulate(Vehicle(name="made", wheels=(wheel,)), SAND, clean, effects)
    measured = {"load_N": load + noise * 0.4 * load_varies * load_N * rng.normal(size=ROWS)}
    measured["slip"] = slip + slip_noise * rng.normal(size=ROWS)
    for name in ("torque_Nm", "sinkage_m", "drawbar_pull_N"):
        measured[name] = answer[name] + noise * np.abs(answer[name]).max() * rng.normal(size=ROWS)
    return WheelTable({"time_s": time_s, **measured}, None, None, "made")


def trials(table: WheelTable, wheel: Wheel = WHEEL):
    return textbook_trial(gather(table, wheel, Vehicle(name="made", wheels=(wheel,))))


def without(table: WheelTable, *names: str) -> WheelTable:
    return WheelTable({k: v for k, v in table.columns.items() if k not in names}, None, None, "made")


def refitted(problem: Problem, fitted: Fitted) -> np.ndarray:
    """Nats of each block by a whole fit to a recording that lacks it, (blocks,)."""
    samples, nats = problem.samples, []
    slopes, at_fit = fitted.response.by_parameter[:, problem.answers], problem.residuals(fitted.response)
    for block in np.unique(samples.block):
        rows = samples.block == block
        measured = samples.measured.copy()
        measured[np.ix_(rows, problem.answers)] = np.nan
        lacking = Problem(replace(samples, measured=measured))
        lacking.weights, lacking.most, lacking.first_noise = problem.weights, problem.most, problem.first_noise
        found = fit(lacking, fitted.model, fitted.vector, fitted.noise, fitted.theta_1, iterations=60, settle=False)
        channels = problem.linearise(fitted.model, found.vector, Entry(fitted.theta_1)).channels
        there = at_fit - slopes @ (found.vector - fitted.vector)
        there[rows] = at_fit[rows] - (channels - fitted.response.channels)[rows][:, problem.answers]
        nats.append(-problem.loss(there, fitted)[rows].sum())
    return np.array(nats)


@pytest.mark.parametrize("seed", [1, 6])
def test_blocks_are_held_out_as_by_a_fit_that_never_saw_them(seed):
    """At one load, from torque and sinkage, friction and cohesion trade off and cohesion ends at its bound."""
    made = drive(("shear_hump:K_r=0.6",), seed, noise=0.02, slip_noise=0.01)
    problem, textbook = trials(without(made, "drawbar_pull_N"))
    trial = try_adding(problem, textbook, textbook, ShearHump(WHEEL.radius_m))
    gained = (refitted(problem, trial.fitted) - refitted(problem, textbook.fitted)).sum()
    assert gained > 40.0
    assert trial.held_out.gain(textbook.held_out)[0] == pytest.approx(gained, abs=0.15 * gained)
    # One step without a block, of parameters that trade off, leads astray.
    once = [hold_out(problem, each.fitted, again=False) for each in (trial, textbook)]
    assert once[0].gain(once[1])[0] < 0.6 * gained


def test_one_step_is_enough_where_load_and_slip_vary():
    problem, textbook = trials(drive(("slip_sinkage:n1=0.1",), 2, load_varies=0.4))
    once = hold_out(problem, textbook.fitted, again=False)
    assert textbook.held_out.nats == pytest.approx(once.nats, abs=2.0)


def test_the_true_form_is_not_lost_for_a_rival_that_was_fitted_first():
    wheel = Wheel(radius_m=0.05, width_m=0.04)
    problem, textbook = trials(drive(("slip_sinkage:n1=0.25",), 3, wheel, load_N=12.0, load_varies=0.3), wheel)
    rival = try_adding(problem, textbook, textbook, SinkageRatio())
    alone = try_adding(problem, textbook, textbook, SinkageExponent())
    second = try_adding(problem, textbook, textbook, SinkageExponent(), rival.fitted.score)
    assert second.gain == pytest.approx(alone.gain, abs=5.0)
    assert second.gain > rival.gain


def test_what_a_fit_misses_is_not_passed_off_as_the_sensor_s_noise():
    table = drive((), 4, load_varies=0.4)
    problem, textbook = trials(table)
    assert not any(swallowed(problem, textbook.fitted, each) for each in range(3))
    # A swing that nothing in the model follows, of which neighbouring rows show nothing.
    swing = 0.05 * np.max(table["torque_Nm"]) * np.sin(table["time_s"] / 0.9)
    swung = WheelTable({**table.columns, "torque_Nm": table["torque_Nm"] + swing}, None, None, "made")
    problem, textbook = trials(swung)
    position = problem.answers.index(1)
    assert swallowed(problem, textbook.fitted, position)
    assert noise_floor(problem, textbook.fitted, position) < 0.8 * textbook.fitted.noise.answers[position]
    # Noise with a memory shows little of itself between neighbours, and is noise all the same.
    memory = lfilter([1.0], [1.0, -0.85], np.random.default_rng(5).normal(size=ROWS))
    slow = WheelTable(
        {**table.columns, "torque_Nm": table["torque_Nm"] + 0.02 * np.max(table["torque_Nm"]) * memory},
        None,
        None,
        "made",
    )
    problem, textbook = trials(slow)
    assert not swallowed(problem, textbook.fitted, position)


def test_values_at_a_sensor_s_end_are_left_out():
    table = drive((), 6, load_varies=0.4)
    most = float(np.quantile(table["torque_Nm"], 0.85))
    clipped = WheelTable({**table.columns, "torque_Nm": np.minimum(table["torque_Nm"], most)}, None, None, "made")
    samples = gather(clipped, WHEEL, Vehicle(name="made", wheels=(WHEEL,)))
    assert np.isnan(samples.measured[:, 1]).sum() == pytest.approx(0.15 * ROWS, abs=2)
    assert any("torque_Nm" in note and "at its end" in note for note in samples.notes)
    # A coarse sensor has many rows at its largest value, and as many at others.
    coarse = WheelTable({**table.columns, "torque_Nm": np.round(table["torque_Nm"] / 0.4) * 0.4}, None, None, "made")
    samples = gather(coarse, WHEEL, Vehicle(name="made", wheels=(WHEEL,)))
    assert np.isfinite(samples.measured[:, 1]).all()


@pytest.mark.parametrize(("stated", "kind"), [(12, "physics"), (0, "physics"), (6, "physics"), (10, "instrument")])
def test_lugs_that_are_not_those_of_the_vehicle_are_a_fault_of_what_is_configured(stated, kind):
    wheel = Wheel(radius_m=0.15, width_m=0.1, grouser_height_m=0.01, grouser_count=stated)
    table = drive((), 7, load_varies=0.4)
    angle = 2.0 * table["time_s"]
    torque = table["torque_Nm"] + 0.05 * np.max(table["torque_Nm"]) * np.cos(12.0 * angle)
    turned = WheelTable({**table.columns, "wheel_angle_rad": angle, "torque_Nm": torque}, None, None, "made")
    problem, textbook = trials(turned, wheel)
    ripples = [e for e in effects_for(situation(problem, textbook.fitted), ["grousers"]) if "ripple, 12" in e.form]
    assert ripples
    for effect in ripples:
        assert effect.kind == kind
        assert ("12 times a turn" in effect.remark) == (kind == "instrument")
        assert (effect.sought > 0.0) == (stated != 12)


def test_lugs_that_ripple_whatever_the_torque_are_found_to_and_what_they_gain_is_rippled():
    wheel, table = Wheel(radius_m=0.15, width_m=0.1, grouser_height_m=0.01, grouser_count=12), drive((), 7)
    angle = 2.0 * table["time_s"]
    torque = table["torque_Nm"] + 0.1 * np.max(table["torque_Nm"]) * np.cos(12.0 * angle)
    turned = WheelTable({**table.columns, "wheel_angle_rad": angle, "torque_Nm": torque}, None, None, "made")
    problem, textbook = trials(turned, wheel)
    lugs = effects_for(situation(problem, textbook.fitted), ["grousers"])
    gained = {form: try_adding(problem, textbook, textbook, form) for form in lugs}
    even = next(trial for form, trial in gained.items() if form.form == "radius and ripple, 12 lugs")
    assert even.effects[0].form == "radius and even ripple, 12 lugs"
    assert even.gain > 100.0
    assert even.rippled > 0.9 * even.gain
    assert next(trial for form, trial in gained.items() if form.form == "radius").rippled == 0.0


@pytest.mark.parametrize("wrapped", [False, True])
def test_lugs_are_located_on_the_wheel_s_angle_however_it_is_counted(wrapped):
    wheel, table = Wheel(radius_m=0.15, width_m=0.1), drive((), 7, load_varies=0.4)
    angle = 2.0 * table["time_s"]
    torque = table["torque_Nm"] + 0.05 * np.max(table["torque_Nm"]) * np.cos(12.0 * angle)
    columns = {**table.columns, "wheel_angle_rad": angle % (2.0 * np.pi) if wrapped else angle, "torque_Nm": torque}
    problem, textbook = trials(WheelTable(columns, None, None, "made"), wheel)
    region = locate(problem, textbook.fitted)[0]
    assert region.channel == "torque_Nm"
    assert region.variable.startswith("wheel_angle_rad")


def test_how_rows_are_held_out_is_told_of_those_that_are_left():
    samples = gather(drive((), seed=1), WHEEL, Vehicle(name="made", wheels=(WHEEL,)))
    assert samples.split == f"{samples.block.max() + 1} stretches of time held out in turn"
    left = samples.select(np.flatnonzero(samples.block > 1))
    assert left.split == f"{samples.block.max() - 1} stretches of time held out in turn"


@pytest.mark.parametrize(
    ("lost", "told"), [(1, "1 row without load or slip is left"), (2, "2 rows without load or slip are")]
)
def test_one_row_that_is_left_out_is_one_row(lost, told):
    table = drive((), seed=1)
    table.columns["load_N"][5 : 5 + lost] = np.nan
    samples = gather(table, WHEEL, Vehicle(name="made", wheels=(WHEEL,)))
    assert any(note.startswith(told) for note in samples.notes)


def test_levels_keep_repeats_together_and_chains_apart():
    """Slips that scatter until each is near the next are no single level: nothing could be held out."""
    rng = np.random.default_rng(0)
    set_points = np.repeat(np.arange(-0.9, 0.91, 0.1), 3)
    repeats = levels(set_points + 0.003 * rng.normal(size=len(set_points)), widest=0.09)
    assert np.array_equal(repeats, np.repeat(np.arange(19), 3))
    scattered = rng.uniform(0.0, 0.4, 80)
    assert not levels(scattered).any()
    level = levels(scattered, widest=0.09)
    assert level.max() + 1 >= 5
    assert all(np.ptp(scattered[level == each]) <= 0.09 for each in range(level.max() + 1))
    assert np.all(np.diff(level[np.argsort(scattered)]) >= 0)
    # Repeats within a chain stay together where the gaps between set points are the widest.
    chain = np.repeat([0.0, 0.028, 0.056, 0.084, 0.112, 0.14], 4) + 0.0005 * rng.normal(size=24)
    divided = levels(chain, widest=0.09).reshape(6, 4)
    assert divided.max() >= 1
    assert np.all(divided == divided[:, :1])
