"""What a misfit may depend on: nothing that was held."""

from __future__ import annotations

import numpy as np
from bevameter import Vehicle, Wheel
from bevameter.framework.core.recording.types import WheelTable
from bevameter.identification.mismatch.fit.samples import gather
from bevameter.identification.mismatch.locate.variables import rank, variables

WHEEL = Wheel(radius_m=0.15, width_m=0.1)


def named(unsteadiness: float, speed_m_s: float = 0.01) -> set[str]:
    rows = 200
    columns = {
        "time_s": 0.1 * np.arange(rows), "load_N": 80.0 + 20.0 * np.sin(0.1 * np.arange(rows)),
        "slip": 0.2 + 0.15 * np.cos(0.07 * np.arange(rows)), "torque_Nm": 5.0 + np.cos(0.03 * np.arange(rows)),
        "travel_speed_m_s": speed_m_s * (1.0 + unsteadiness * np.sin(0.05 * np.arange(rows))),
    }  # fmt: skip
    samples = gather(WheelTable(columns, None, None, "made"), WHEEL, Vehicle(name="made", wheels=(WHEEL,)))
    return {each.name for each in variables(samples, np.full(len(samples), 0.02))}


def test_a_speed_that_the_rig_holds_explains_nothing():
    assert {"slip", "load_N"} <= named(0.001)
    assert "travel_speed_m_s" not in named(0.001)
    assert "travel_speed_m_s" in named(0.03)


def test_an_acceleration_that_no_channel_feels_explains_nothing():
    assert "acceleration_m_s2" not in named(0.1)
    assert "acceleration_m_s2" in named(0.1, speed_m_s=1.0)


def test_a_place_is_preferred_where_the_found_effect_lies_along_it():
    for name in ("x_m", "y_m"):
        assert rank(name, (name,)) < rank("slip", (name,)) < rank(name, ())
    assert all(rank(name, ("place_m",)) < 0 for name in ("x_m", "y_m", "distance_m"))
