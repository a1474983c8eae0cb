"""Rows that can be compared, and tables that hold too little."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from bevameter.framework.core.errors import InputError
from bevameter.framework.core.recording.types import WheelTable
from bevameter.framework.core.track.grounds import Ground
from bevameter.framework.core.vehicle import Vehicle, Wheel
from bevameter.identification.explain.samples import GROUND, MOST_ROWS, gather

WHEEL = Wheel(radius_m=0.15, width_m=0.12)


def test_four_values_of_each_channel_are_too_few(rng):
    """In eight rows torque and sinkage take turns."""
    rows = np.arange(8)
    columns = {
        "time_s": 0.1 * rows, "load_N": 100.0 + rng.normal(size=8), "slip": np.linspace(0.1, 0.5, 8),
        "torque_Nm": np.where(rows % 2, np.nan, 5.0 + rng.normal(size=8)),
        "sinkage_m": np.where(rows % 2, 0.02 + 0.001 * rng.normal(size=8), np.nan),
    }  # fmt: skip
    table = WheelTable(columns, None, None, Path("sparse.csv"))
    with pytest.raises(InputError, match=r"sparse\.csv.*at most 4 usable values.*at least 5"):
        gather(table, WHEEL, Vehicle(name="made", wheels=(WHEEL,)))


def test_thinned_rows_are_of_every_wheel_on_every_ground(rng):
    """Of grounds that take turns some once vanished from the answer."""
    count, wheels, grounds = 3000, ("left", "right"), 15
    time_s = np.tile(0.1 * np.arange(count), 2)
    columns = {
        "time_s": time_s, "load_N": 100.0 + rng.normal(size=2 * count), "slip": 0.3 + 0.2 * np.sin(time_s),
        "torque_Nm": 5.0 + rng.normal(size=2 * count), GROUND: time_s // 20.0,
    }  # fmt: skip
    table = WheelTable(columns, np.repeat(wheels, count), None, Path("long.csv"))
    vehicle = Vehicle(name="made", wheels=tuple(Wheel(radius_m=0.15, width_m=0.12, name=name) for name in wheels))
    stated = [Ground(("sand", "loam")[number % 2], 20.0 * number, 20.0 * number + 20.0) for number in range(grounds)]
    samples = gather(table, vehicle.wheels[0], vehicle, stated)
    assert len(samples) <= MOST_ROWS
    assert [each.start_s for each in samples.grounds] == [each.start_s for each in stated]
    rows = np.bincount(2 * samples.drive.ground + samples.drive.wheel, minlength=2 * grounds)
    assert rows.min() >= 40
    assert samples.follows.mean() > 0.95
    np.testing.assert_array_equal(np.unique(samples.drive.ground[samples.of_class_of(np.array([0]))] % 2), [0])
    of_one_class = gather(table, vehicle.wheels[0], vehicle, [replace(each, class_name="sand") for each in stated])
    np.testing.assert_array_equal(of_one_class.of_class_of(np.arange(9)), np.arange(9), "no other class predicts these")
