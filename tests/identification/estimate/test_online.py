"""Identification while driving: the same answer as the batch, and it follows the soil."""

from __future__ import annotations

import numpy as np
import pytest
from bevameter.framework.core.soil import SoilKnowledge
from bevameter.framework.core.vehicle import Wheel
from bevameter.identification.estimate.estimate import solve
from bevameter.identification.estimate.online import LEAST_SAMPLES, OnlineIdentifier
from bevameter.identification.estimate.solution import Measured
from bevameter.identification.mechanics.soil import Soil
from bevameter.identification.mechanics.textbook import CHANNELS, equilibrium

WHEEL = Wheel(radius_m=0.15, width_m=0.12)
SAND = Soil(c_Pa=300.0, phi_rad=np.radians(33.0), k_m=0.012, stiffness_Pa=9e4, n=0.9)
LOAM = Soil(c_Pa=3e3, phi_rad=np.radians(22.0), k_m=0.010, stiffness_Pa=1.6e5, n=0.7)


def drive(rng, soil, samples):
    time_s = np.arange(samples) / 10.0
    load, slip = 110.0 + 45.0 * np.sin(time_s / 2.0), 0.3 + 0.2 * np.sin(time_s / 1.3)
    state = equilibrium(WHEEL, soil, load, slip)
    truth = np.column_stack([load, state.torque_Nm, state.sinkage_m, slip, state.drawbar_pull_N])
    noise = 0.02 * np.abs(truth).max(axis=0)
    return truth + noise * rng.normal(size=truth.shape), noise


def feed(identifier, rows):
    for row in rows:
        estimate = identifier.update(**dict(zip(CHANNELS, row, strict=True)))
    return estimate


def test_a_window_gives_what_the_batch_gives(rng):
    rows, noise = drive(rng, SAND, 140)
    identifier = OnlineIdentifier(WHEEL, dict(zip(CHANNELS, noise, strict=True)), window=100)
    assert feed(identifier, rows[: LEAST_SAMPLES - 1]) is None
    estimate = feed(identifier, rows[LEAST_SAMPLES - 1 :])
    batch = solve(Measured(rows[-100:], noise, np.arange(100)), WHEEL, SoilKnowledge())
    sd = np.sqrt(np.diag(batch.fit.covariance(batch.free)))
    assert estimate.n == 100
    assert np.tan(estimate.parameters["phi_rad"].value) == pytest.approx(batch.fit.vector[1], abs=0.2 * sd[1])
    assert estimate.parameters["phi_rad"].low < SAND.phi_rad < estimate.parameters["phi_rad"].high


def test_it_follows_a_change_of_soil(rng):
    sand, noise = drive(rng, SAND, 80)
    loam, _ = drive(rng, LOAM, 100)
    identifier = OnlineIdentifier(WHEEL, dict(zip(CHANNELS, noise, strict=True)), window=80)
    before, after = feed(identifier, sand), feed(identifier, loam)
    for estimate, soil in ((before, SAND), (after, LOAM)):
        phi = estimate.parameters["phi_rad"]
        assert abs(phi.value - soil.phi_rad) < 4.0 * phi.sd
        assert phi.sd < np.radians(3.0)


def test_samples_without_information_are_left_out(rng):
    rows, noise = drive(rng, SAND, 60)
    identifier = OnlineIdentifier(WHEEL, dict(zip(CHANNELS, noise, strict=True)))
    estimate = feed(identifier, rows)
    assert identifier.update(load_N=np.nan, slip=0.3, torque_Nm=1.0) == estimate
    assert estimate.n == 60
