"""A soil stated from elsewhere that is not the one under the wheel."""

from __future__ import annotations

import math
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from bevameter import Vehicle, Wheel
from bevameter.framework.core.recording.types import WheelTable
from bevameter.framework.core.soil import SoilKnowledge
from bevameter.identification.augmented import AugmentedWheel
from bevameter.identification.effects.soil_patch import SoilPatch
from bevameter.identification.mismatch.places import everywhere
from bevameter.identification.mismatch.samples import gather
from bevameter.identification.mismatch.told_soil import disagreement
from bevameter.identification.mismatch.trial import textbook_trial, try_adding
from bevameter.identification.wheel_soil import Soil, equilibrium

WHEEL = Wheel(radius_m=0.15, width_m=0.1)
SOIL = Soil(c_Pa=800.0, phi_rad=math.radians(31.0), k_m=0.012, stiffness_Pa=2.5e5, n=0.95)
ROWS = 300


@pytest.fixture(scope="module")
def samples():
    """A drive of one metre and a half over the soil, with noise of a hundredth of the channels' ranges."""
    rng = np.random.default_rng(5)
    time_s = 0.1 * np.arange(ROWS)
    load, slip = 90.0 + 40.0 * np.sin(time_s / 3.1), 0.3 + 0.2 * np.sin(time_s / 2.3)
    state = equilibrium(WHEEL, SOIL, load, slip)
    channels = np.column_stack([state.torque_Nm, state.sinkage_m, state.drawbar_pull_N])
    channels = channels + 0.01 * np.ptp(channels, axis=0) * rng.normal(size=(ROWS, 3))
    names = ("torque_Nm", "sinkage_m", "drawbar_pull_N")
    columns = {"time_s": time_s, "load_N": load, "slip": slip, "x_m": 0.05 * time_s}
    columns |= dict(zip(names, channels.T, strict=True))
    table = WheelTable(columns, None, None, Path("drive"))
    return gather(table, WHEEL, Vehicle(wheels=(WHEEL,)))


def stated(stiffness_Pa: float) -> SoilKnowledge:
    values = {"phi_rad": SOIL.phi_rad, "stiffness_Pa": stiffness_Pa, "n": SOIL.n}
    return SoilKnowledge(values, {"phi_rad": 0.02, "stiffness_Pa": 0.1 * stiffness_Pa, "n": 0.02})


def test_a_soil_stated_otherwise_than_the_wheel_finds_it_is_said(samples):
    said = disagreement(samples, stated(SOIL.stiffness_Pa / WHEEL.width_m**SOIL.n))
    assert said is not None
    # that of (sinkage / width)^n is 250 kPa, that of sinkage^n 2228 kPa
    assert "stiffness k1 + k2 b 2230 ± 220 kPa stated" in said
    assert "friction angle phi 31.0 ± 1.1 deg stated" in said
    assert "(sinkage / width)^n" in said


def test_nothing_is_said_of_a_soil_stated_rightly_or_not_at_all(samples):
    assert disagreement(samples, stated(SOIL.stiffness_Pa)) is None
    assert disagreement(samples, SoilKnowledge()) is None


def test_another_soil_all_along_is_no_place(samples):
    along = samples.drive.place_m
    patch = SoilPatch("place", along)
    model = AugmentedWheel(WHEEL, (patch,))

    def covers(first: float, last: float) -> bool:
        vector = np.array([800.0, 0.6, -4.4, 12.4, 0.0, -0.5, 0.0, first, last])
        return everywhere(SimpleNamespace(model=model, vector=vector), samples.drive)

    assert covers(along.min() - 0.01, along.max() + 0.01)
    assert not covers(along.min() + 0.2 * np.ptp(along), along.max())


def test_a_soil_stated_wrongly_is_not_called_a_patch_of_the_whole_track(samples):
    problem, textbook = textbook_trial(samples, stated(8.0 * SOIL.stiffness_Pa))
    whole = SoilPatch("place", samples.drive.place_m, [np.array([-2.0, 0.0, -0.001, 1.5])])
    trial = try_adding(problem, textbook, textbook, whole)
    assert trial.fitted.score > textbook.fitted.score + 50.0
    assert everywhere(trial.fitted, samples.drive)
    assert trial.gain <= 0.0
