"""Sensors whose errors last: how long is told and counted, and neither ripple nor rough ground passes for it."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from bevameter import Vehicle, Wheel, explain
from bevameter.framework.core.recording.types import Recording, WheelTable
from bevameter.framework.core.soil import SoilKnowledge
from bevameter.identification.effects.drive import drive_of
from bevameter.identification.mechanics.soil import Soil
from bevameter.identification.mechanics.textbook import equilibrium
from bevameter.identification.mismatch.explain import _as_remembered
from bevameter.identification.mismatch.fit.load_and_slip import gathered
from bevameter.identification.mismatch.fit.memory import Memory
from bevameter.identification.mismatch.fit.remembering import remembering
from bevameter.identification.mismatch.fit.samples import Samples, gather
from bevameter.identification.mismatch.fit.textbook import fit_textbook
from bevameter.identification.mismatch.fit.trial import textbook_trial
from bevameter.identification.mismatch.locate.noise_floor import swallowed
from scipy.linalg import block_diag, toeplitz
from scipy.signal import lfilter
from scipy.stats import multivariate_normal

WHEEL = Wheel(radius_m=0.15, width_m=0.1)
SOIL = Soil(c_Pa=800.0, phi_rad=math.radians(31.0), k_m=0.012, stiffness_Pa=2.5e5, n=0.95)
ROWS, STEP_S, SHARE = 700, 0.1, 0.02
ANSWERS = ("torque_Nm", "sinkage_m", "drawbar_pull_N")


def driven(
    seed: int, rho: tuple[float, float, float], varies: float = 0.0, stiffer: float = 0.0
) -> WheelTable:  # fmt: skip
    """A drive over ground that varies roughly and is stiffer for a while, its errors and slip's those of AR(1)s."""
    rng = np.random.default_rng(seed)
    time_s = STEP_S * np.arange(ROWS)
    load, slip = 90.0 + 40.0 * np.sin(time_s / 3.1) + 15.0 * np.sin(time_s / 1.3), 0.3 + 0.2 * np.sin(time_s / 2.3)
    keep = math.exp(-1.0 / 8.0)
    ground = varies * lfilter([math.sqrt(1.0 - keep**2)], [1.0, -keep], rng.normal(size=(ROWS, 2)), axis=0)
    ground[(time_s > 28.0) & (time_s < 41.0), 0] += stiffer
    channels = np.empty((ROWS, 3))
    for row, (more, stronger) in enumerate(np.exp(ground)):
        phi_rad = math.atan(stronger * math.tan(SOIL.phi_rad))
        soil = replace(SOIL, c_Pa=SOIL.c_Pa * stronger, phi_rad=phi_rad, stiffness_Pa=SOIL.stiffness_Pa * more)
        state = equilibrium(WHEEL, soil, load[row : row + 1], slip[row : row + 1])
        channels[row] = state.torque_Nm[0], state.sinkage_m[0], state.drawbar_pull_N[0]
    for position, share in enumerate(rho):
        error = lfilter([math.sqrt(1.0 - share**2)], [1.0, -share], rng.normal(size=ROWS))
        channels[:, position] += SHARE * np.ptp(channels[:, position]) * error
    return WheelTable(
        {
            "time_s": time_s, "load_N": load + 0.5 * rng.normal(size=ROWS),
            "slip": slip + 0.002 * rng.normal(size=ROWS),
            **dict(zip(ANSWERS, channels.T, strict=True)),
        },
        None, None, "made",
    )  # fmt: skip


def vehicle(**noise: float) -> Vehicle:
    return Vehicle(name="made", wheels=(WHEEL,), noise=noise)


def told(table: WheelTable, **noise: float) -> Samples:
    """Samples as they are once nothing was found."""
    samples = gathered(table, WHEEL, vehicle(**noise), SoilKnowledge())
    problem, textbook = textbook_trial(samples)
    remembered = _as_remembered(samples, problem, textbook, SoilKnowledge())
    return remembered[0] if remembered else samples


def test_what_is_new_in_rows_has_the_likelihood_of_the_full_covariance(rng):
    """One channel remembers, the other does not; a row is not seen, and the clock jumps once."""
    rows, rho, sd = 40, 0.7, np.array([2.0, 0.5])
    time_s = STEP_S * np.arange(rows)
    time_s[15:] += 0.4
    table = WheelTable({"time_s": time_s, "load_N": np.ones(rows), "slip": np.zeros(rows)}, None, None, "made")
    drive = drive_of(table, WHEEL, np.zeros(rows, dtype=int))
    seen = np.ones((rows, 2), dtype=bool)
    seen[25, 0] = False
    memory = Memory(np.array([rho, 0.0]), seen, drive)
    values = np.where(seen, sd * rng.normal(size=(rows, 2)), 0.0)
    new = memory.new_in(values)
    loss = np.sum(0.5 * (new / sd) ** 2 + (np.log(sd) + 0.5 * math.log(2.0 * math.pi)) * seen) + memory.log_scale.sum()
    pieces = block_diag(*(sd[0] ** 2 * toeplitz(rho ** np.arange(count)) for count in (15, 10, 14)))
    first = multivariate_normal(cov=pieces).logpdf(values[seen[:, 0], 0])
    second = multivariate_normal(cov=sd[1] ** 2 * np.eye(rows)).logpdf(values[:, 1])
    assert loss == pytest.approx(-(first + second))


def test_errors_that_do_not_last_are_left_as_they_are(rng):
    table = WheelTable({"time_s": np.arange(9.0), "load_N": np.ones(9), "slip": np.zeros(9)}, None, None, "made")
    memory = Memory(np.zeros(2), np.ones((9, 2), dtype=bool), drive_of(table, WHEEL, np.zeros(9, dtype=int)))
    values = rng.normal(size=(9, 2))
    assert memory.new_in(values) is values
    slopes = values[..., None]
    assert memory.of_independent(slopes) is slopes
    assert not memory.log_scale.any()


def test_independent_errors_of_load_and_slip_are_in_two_rows():
    table = WheelTable({"time_s": np.arange(9.0), "load_N": np.ones(9), "slip": np.zeros(9)}, None, None, "made")
    memory = Memory(np.array([0.6, 0.0]), np.ones((9, 2), dtype=bool), drive_of(table, WHEEL, np.zeros(9, dtype=int)))
    larger = memory.of_independent(np.ones((9, 2, 1)))[..., 0]
    assert larger[0] == pytest.approx([1.0, 1.0])
    assert larger[1:, 0] == pytest.approx(math.sqrt(1.36) / 0.8)
    assert larger[:, 1] == pytest.approx(1.0)


def test_each_run_has_a_step_of_its_own():
    time_s = np.concatenate([0.1 * np.arange(30), 100.0 + 0.5 * np.arange(20)])
    table = WheelTable({"time_s": time_s, "load_N": np.ones(50), "slip": np.zeros(50)}, None, None, "made")
    drive = drive_of(table, WHEEL, np.repeat([0, 1], [30, 20]))
    memory = Memory(np.array([0.5]), np.ones((50, 1), dtype=bool), drive)
    assert np.flatnonzero(memory.log_scale == 0.0).tolist() == [0, 30]


def test_held_out_rows_are_weighed_as_fitted_ones():
    samples = told(driven(6, (0.7, 0.0, 0.5), 0.02))
    assert samples.memory.any()
    problem, fitted = fit_textbook(samples)
    assert problem.loss(fitted.residuals, fitted) == pytest.approx(problem.whitened(fitted.response, fitted.noise)[2])


def test_noise_far_beyond_what_neighbours_show_is_swallowed_though_sensors_remember():
    problem, fitted = fit_textbook(told(driven(6, (0.7, 0.7, 0.7))))
    noisy = replace(fitted, noise=replace(fitted.noise, answers=3.0 * problem.first_noise.answers))
    assert all(swallowed(problem, noisy, each) for each in range(3))
    assert not any(swallowed(problem, fitted, each) for each in range(3))


@pytest.mark.parametrize("seed", [25, 26])
def test_no_memory_is_taken_where_ground_varies_over_a_few_rows(seed):
    """What is new in a row takes the row before to stand on the same ground."""
    assert not told(driven(seed, (0.8, 0.8, 0.7), 0.06)).memory.any()


@pytest.mark.parametrize("varies", [0.0, 0.02])
def test_how_long_errors_last_is_told_beside_ground_that_varies(varies):
    samples = told(driven(1, (0.7, 0.0, 0.5), varies))
    torque, sinkage, pull = samples.memory[list(samples.answers)]
    assert torque == pytest.approx(0.7, abs=0.12)
    assert sinkage == 0.0
    assert pull == pytest.approx(0.5, abs=0.12)
    problem, fitted = fit_textbook(samples)
    size = SHARE * np.ptp(problem.measured, axis=0)
    assert fitted.noise.answers == pytest.approx(size, rel=0.25)


@pytest.mark.parametrize("seed", range(3))
def test_rough_ground_and_independent_errors_are_no_memory(seed):
    assert not told(driven(seed, (0.0, 0.0, 0.0), 0.06)).memory.any()
    assert not told(driven(seed, (0.0, 0.0, 0.0))).memory.any()


def test_stated_noise_is_that_of_single_rows_whatever_they_remember():
    table = driven(2, (0.7, 0.7, 0.7))
    stated = {name: SHARE * float(np.ptp(table[name])) for name in ANSWERS}
    samples = told(table, load_N=0.5, slip=0.002, **stated)
    # Errors of load and slip, which are independent, hide some of it.
    assert np.all((samples.memory[list(samples.answers)] > 0.35) & (samples.memory[list(samples.answers)] < 0.75))
    assert samples.noise[list(samples.answers)] == pytest.approx(list(stated.values()))


def test_what_seemed_to_last_is_asked_again_of_a_better_fit():
    """Ripple of four rows looks like a memory; a fit that leaves none of it shows that there is none."""
    table = driven(3, (0.0, 0.0, 0.0))
    samples = told(table)
    problem, fitted = fit_textbook(samples)
    swings = SHARE * np.ptp(problem.measured[:, 2]) * 3.0 * np.sin(2.0 * math.pi * np.arange(ROWS) / 4.3)
    left = fitted.residuals.copy()
    left[:, 2] += swings
    seeming = remembering(samples, problem, replace(fitted, residuals=left))
    assert seeming is not None
    pull = samples.answers[2]
    assert seeming.memory[pull] > 0.5
    assert seeming.noise[pull] > samples.noise[pull]
    again = remembering(seeming, problem, fitted)
    assert again is not None
    assert not again.memory.any()
    assert again.noise == pytest.approx(samples.noise, nan_ok=True)
    assert remembering(samples, problem, fitted) is None


def test_ripple_of_lugs_that_the_vehicle_announces_is_no_memory_and_hides_none():
    lugged = WHEEL.model_copy(update={"grouser_count": 18, "grouser_height_m": 0.01})
    angle = 0.0795 * np.arange(ROWS)
    for rho in (0.0, 0.6):
        samples = gather(driven(3, (0.0, 0.0, rho)), WHEEL, vehicle())
        problem, fitted = fit_textbook(samples)
        pull = SHARE * np.ptp(problem.measured[:, 2])
        left = fitted.residuals.copy()
        left[:, 2] += pull * (3.0 * np.sin(18.0 * angle) + np.cos(36.0 * angle))
        rippled = replace(fitted, residuals=left)
        if rho == 0.0:
            assert remembering(samples, problem, rippled) is not None
        turning = replace(samples, wheel=lugged, drive=replace(samples.drive, wheel_angle_rad=angle))
        found = remembering(turning, problem, rippled)
        shown = 0.0 if found is None else found.memory[samples.answers[2]]
        assert shown == pytest.approx(rho, abs=0.15)


def test_a_patch_is_found_beside_sensors_that_remember_and_none_where_there_is_none():
    recording = Recording("made", Path(), vehicle(), None, "", "", wheel=driven(4, (0.8, 0.8, 0.7), 0.01, stiffer=0.35))
    answer = explain(recording)
    assert [each.effect for each in answer.missing] == ["soil_patch"]
    assert answer.missing[0].probability > 0.9
    assert any("torque" in note and "row before" in note for note in answer.notes)
    nothing = replace(recording, wheel=driven(5, (0.8, 0.8, 0.7), 0.01))
    assert explain(nothing).verdict == "none"
