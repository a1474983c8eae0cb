"""Ground that is another in all that a soil is made of: over a stretch, or where it has been run over before."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from bevameter import Vehicle, Wheel, explain
from bevameter.framework.core.recording.types import Recording, WheelTable
from bevameter.identification.mechanics.soil import Soil
from bevameter.identification.mechanics.textbook import equilibrium
from bevameter.identification.mismatch.explanation import Explanation

WHEEL = Wheel(radius_m=0.15, width_m=0.1)
SOIL = Soil(c_Pa=800.0, phi_rad=math.radians(31.0), k_m=0.015, stiffness_Pa=2.5e5, n=0.95)
LOOSE = replace(SOIL, k_m=SOIL.k_m * math.exp(-0.5))
OTHER = Soil(SOIL.c_Pa * math.exp(1.0), SOIL.phi_rad - 0.1, SOIL.k_m * math.exp(-0.6), SOIL.stiffness_Pa * 1.3, 1.05)
ROWS, PASSES = 200, 2
STEP_M = 0.02


def explained(other: Soil, where: str) -> Explanation:
    """Explain two passes over soil that is another one in a stretch, or in the second pass."""
    rng = np.random.default_rng(4)
    count = ROWS * PASSES
    row, late = np.arange(count), np.repeat(np.arange(PASSES), ROWS)
    time, x = 0.2 * row + 30.0 * late, STEP_M * (row % ROWS)
    load = 90.0 + 30.0 * np.sin(row / 11.0)
    slip = 0.26 + 0.2 * np.sin(row / 7.3)
    there = late == 1 if where == "later" else (x > 1.2) & (x < 2.4)
    channels = np.empty((count, 3))
    for rows, soil in ((~there, SOIL), (there, other)):
        state = equilibrium(WHEEL, soil, load[rows], slip[rows])
        channels[rows] = np.column_stack([state.torque_Nm, state.sinkage_m, state.drawbar_pull_N])
    grain = np.repeat(rng.normal(size=(count // 5, 1)), 5, axis=0)
    channels = channels * (1.0 + 0.005 * grain) + 0.01 * np.ptp(channels, axis=0) * rng.normal(size=channels.shape)
    columns = {
        "time_s": time, "load_N": load, "slip": slip, "x_m": x, "pass": late + 1.0,
        **dict(zip(("torque_Nm", "sinkage_m", "drawbar_pull_N"), channels.T, strict=True)),
    }  # fmt: skip
    table = WheelTable(columns, None, None, "made")
    vehicle = Vehicle(name="made", wheels=(WHEEL,))
    return explain(Recording("table", Path("table.csv"), vehicle, None, "", "0" * 64, wheel=table))


@pytest.mark.parametrize("other", [LOOSE, OTHER])
def test_a_patch_of_another_class_is_a_patch_and_nothing_besides(other):
    found = explained(other, "stretch")
    (patch,) = found.missing
    assert (found.verdict, patch.effect, patch.form) == ("physics", "soil_patch", "place, another class")
    modulus = patch.parameters["D"]
    assert abs(modulus.value - math.log(other.k_m / SOIL.k_m)) < 3.0 * modulus.sd < 0.5


@pytest.mark.parametrize("worked", [LOOSE, replace(OTHER, n=SOIL.n, phi_rad=SOIL.phi_rad)])
def test_passes_that_change_all_of_the_soil_are_compaction_and_nothing_besides(worked):
    found = explained(worked, "later")
    (compaction,) = found.missing
    assert (found.verdict, compaction.effect) == ("physics", "multipass_compaction")
    assert compaction.form.endswith("cohesion and shear modulus apart")
