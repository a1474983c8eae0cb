"""Ground that varies along the track, roughly or smoothly: what is varied, how, and what the sensors' noise is then."""

from __future__ import annotations

import math

import numpy as np
import pytest
from bevameter import Vehicle, Wheel
from bevameter.framework.core.recording.types import WheelTable
from bevameter.identification.mechanics.soil import Soil
from bevameter.identification.mechanics.textbook import equilibrium
from bevameter.identification.mismatch.fit.memory import rho_shown
from bevameter.identification.mismatch.fit.remembering import ground_apart
from bevameter.identification.mismatch.fit.samples import gather
from bevameter.identification.mismatch.fit.textbook import fit_textbook
from bevameter.identification.mismatch.fit.trial import textbook_trial
from bevameter.identification.mismatch.name.evidence import repetition
from bevameter.identification.mismatch.name.tries import Search
from bevameter.identification.noise import in_time
from scipy.signal import lfilter

WHEEL = Wheel(radius_m=0.15, width_m=0.1)
ROWS, LENGTH_M, SPREAD = 500, 0.4, np.array([0.05, 0.03])
NOISE = {"load_N": 0.1, "slip": 0.0005, "torque_Nm": 0.02, "sinkage_m": 5e-5, "drawbar_pull_N": 0.15}


def bells(far: np.ndarray) -> np.ndarray:
    """Correlation of ground smoothed by a bell curve."""
    return np.exp(-(far**2))


def rough(far: np.ndarray) -> np.ndarray:
    """Correlation of ground that forgets at a constant rate."""
    return np.exp(-far)


def crossed(correlation, seed: int):
    """Samples of two passes over one track whose ln stiffness and ln strength vary with a correlation."""
    rng = np.random.default_rng(seed)
    place = np.tile(np.linspace(0.0, 6.0, ROWS // 2), 2)
    time_s = 0.2 * np.arange(ROWS)
    where, back = np.unique(place, return_inverse=True)
    alike = correlation(np.abs(where[:, None] - where) / LENGTH_M) + 1e-9 * np.eye(len(where))
    varied = (np.linalg.cholesky(alike) @ rng.normal(size=(len(where), 2)) * SPREAD)[back]
    load = 90.0 + 40.0 * np.sin(time_s / 3.1)
    slip = 0.3 + 0.2 * np.sin(time_s / 7.3)
    answers = np.empty((ROWS, 3))
    for row, (stiffer, stronger) in enumerate(np.exp(varied)):
        soil = Soil(800.0 * stronger, math.atan(0.6 * stronger), 0.012, 2.5e5 * stiffer, 0.95)
        state = equilibrium(WHEEL, soil, load[row : row + 1], slip[row : row + 1])
        answers[row] = state.torque_Nm[0], state.sinkage_m[0], state.drawbar_pull_N[0]
    values = dict(zip(NOISE, (load, slip, *answers.T), strict=True))
    columns = {name: value + NOISE[name] * rng.normal(size=ROWS) for name, value in values.items()}
    lap = {"time_s": time_s, "x_m": place, "pass": 1.0 + (np.arange(ROWS) >= ROWS // 2)}
    vehicle = Vehicle(name="made", wheels=(WHEEL,), noise={name: NOISE[name] for name in ("load_N", "slip")})
    return gather(WheelTable({**lap, **columns}, None, None, "made"), WHEEL, vehicle)


@pytest.mark.parametrize(("correlation", "derivatives"), [(rough, {0}), (bells, {1, 2})])
@pytest.mark.parametrize("seed", [0, 1])
def test_how_smoothly_ground_varies_is_found_and_so_is_the_noise(correlation, derivatives, seed):
    problem, fitted = fit_textbook(crossed(correlation, seed))
    noise = fitted.noise
    assert noise.smooth in derivatives
    assert problem.first_noise.smooth == noise.smooth
    # A track of a dozen lengths tells neither closely.
    assert np.all((noise.spread > 0.5 * SPREAD) & (noise.spread < 2.0 * SPREAD))
    assert 0.5 < noise.length / LENGTH_M < 2.0
    sensors = [NOISE[name] for name in ("torque_Nm", "sinkage_m", "drawbar_pull_N")]
    assert noise.answers == pytest.approx(sensors, rel=0.15)


def test_ground_that_varies_is_no_memory_of_the_noise_where_another_pass_bears_it_out():
    samples = crossed(rough, 0)
    stretch, sinkage = samples.drive.stretch, 1
    problem, textbook = textbook_trial(samples)
    assert rho_shown(in_time(textbook.fitted.residuals[:, sinkage], stretch)) > 0.5
    assert ground_apart(problem, textbook.fitted, sinkage).all()
    assert repetition(problem, Search(textbook, (), (), textbook), textbook.fitted.innovations) < 1.3
    # Crossed once, the same differences may be the noise's.
    problem, textbook = textbook_trial(samples.select(np.flatnonzero(stretch == stretch[0])))
    assert not ground_apart(problem, textbook.fitted, sinkage).any()


def test_noise_with_a_memory_is_told_beside_ground_that_varies():
    """Differences that are the ground's are taken off, and what is left tells the memory of the noise."""
    rng, rho, rows = np.random.default_rng(3), 0.6, 4000
    noise = lfilter([math.sqrt(1.0 - rho**2)], [1.0, -rho], rng.normal(size=rows))
    ground = 3.0 * lfilter([0.1], [1.0, -math.sqrt(0.99)], rng.normal(size=rows))
    of_ground = np.array([np.mean((ground[step:] - ground[:-step]) ** 2) for step in (1, 2, 3)])
    assert rho_shown([noise + ground], of_ground) == pytest.approx(rho, abs=0.06)
    white = rng.normal(size=rows)
    assert rho_shown([white + ground], of_ground) == 0.0
