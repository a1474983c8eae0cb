"""Lanes that lie aslant to the axes: where another soil begins is no one place along them, but may be one x or y."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from bevameter import Vehicle, Wheel, explain
from bevameter.framework.core.recording.types import Recording, WheelTable
from bevameter.identification.effects.soil_patch import tracks_of
from bevameter.identification.mechanics.soil import Soil
from bevameter.identification.mechanics.textbook import equilibrium
from bevameter.identification.mismatch.explanation import Explanation
from bevameter.identification.mismatch.fit.samples import gather
from bevameter.identification.mismatch.locate.variables import names_of

WHEEL = Wheel(radius_m=0.15, width_m=0.1)
VEHICLE = Vehicle(name="made", wheels=(WHEEL,))
SOIL = Soil(c_Pa=800.0, phi_rad=math.radians(31.0), k_m=0.012, stiffness_Pa=2.5e5, n=0.95)
LANES, ROWS, LENGTH_M, APART_M = 4, 150, 6.0, 0.8


def lanes(degrees: float, stronger: float = 0.0, inside: tuple[float, float] = (2.0, 3.4)) -> WheelTable:
    """Lanes side by side in a direction, over soil that is stronger between two x, in ground that varies by itself."""
    rng = np.random.default_rng(2)
    way, lane = np.tile(np.linspace(0.0, LENGTH_M, ROWS), LANES), np.repeat(np.arange(LANES), ROWS)
    ahead, aside = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    x, y = way * ahead, way * aside + APART_M * lane
    time = 0.4 * np.arange(LANES * ROWS) + 60.0 * lane
    load = 90.0 + 40.0 * np.sin(time / 3.1) + 15.0 * np.sin(time / 1.3)
    slip = 0.3 + 0.18 * np.sin(time / 2.3) + 0.08 * np.sin(time / 0.7)
    there = (x > inside[0]) & (x < inside[1])
    channels = np.empty((len(x), 3))
    strong = replace(
        SOIL, c_Pa=SOIL.c_Pa * math.exp(stronger), phi_rad=math.atan(math.tan(SOIL.phi_rad) * math.exp(stronger))
    )
    for rows, soil in ((~there, SOIL), (there, strong)):
        state = equilibrium(WHEEL, soil, load[rows], slip[rows])
        channels[rows] = np.column_stack([state.torque_Nm, state.sinkage_m, state.drawbar_pull_N])
    grain = np.repeat(rng.normal(size=(LANES * ROWS // 5, 1)), 5, axis=0)
    channels = channels * (1.0 + 0.015 * grain) + 0.01 * np.ptp(channels, axis=0) * rng.normal(size=channels.shape)
    answers = dict(zip(("torque_Nm", "sinkage_m", "drawbar_pull_N"), channels.T, strict=True))
    measured = {"load_N": load, "slip": slip, "x_m": x, "y_m": y, **answers}
    return WheelTable({"time_s": time, **measured}, None, np.array([f"lane {each}" for each in lane]), "made")


def explained(table: WheelTable) -> Explanation:
    return explain(Recording("table", Path("table.csv"), VEHICLE, None, "", "0" * 64, wheel=table))


@pytest.mark.parametrize(
    ("degrees", "along"),
    [(0.0, ["place_m"]), (3.0, ["place_m"]), (25.0, ["place_m", "x_m"]), (45.0, ["place_m", "x_m", "y_m"])],
)
def test_places_along_an_axis_are_places_of_their_own_where_lanes_lie_aslant(degrees, along):
    drive = gather(lanes(degrees), WHEEL, VEHICLE).drive
    assert tracks_of(drive) == along
    assert set(along) <= set(names_of(drive).values())
    one = gather(lanes(degrees).select(np.arange(ROWS)), WHEEL, VEHICLE).drive
    assert tracks_of(one) == ["place_m"], "of a single lane they say the same"


def test_soil_that_begins_at_one_x_is_found_across_lanes_aslant():
    found = explained(lanes(25.0, stronger=0.12))
    (patch,) = (each for each in found.missing if each.effect == "soil_patch")
    assert found.verdict == "physics"
    assert patch.form.startswith("x")
    assert [patch.parameters[end].value for end in ("from", "to")] == pytest.approx([2.0, 3.4], abs=0.15)
    assert "x_m" in {region.variable for region in found.located}


def test_the_same_ground_all_over_has_no_patch():
    assert explained(lanes(25.0)).verdict == "none"
