"""Rows that can be compared, and tables that hold too little."""

from pathlib import Path

import numpy as np
import pytest
from bevameter.framework.core.errors import InputError
from bevameter.framework.core.recording.types import WheelTable
from bevameter.framework.core.vehicle import Vehicle, Wheel
from bevameter.identification.explain.samples import gather

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
