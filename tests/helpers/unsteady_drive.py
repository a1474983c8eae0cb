"""Drives whose true load and slip change from row to row, measured with noise."""

from __future__ import annotations

import numpy as np
from bevameter import Wheel
from bevameter.framework.core.recording.types import WheelTable
from bevameter.identification.mechanics.soil import Soil
from bevameter.identification.mechanics.textbook import equilibrium

WHEEL = Wheel(radius_m=0.14, width_m=0.1)
SOIL = Soil(900.0, 0.52, 0.012, 4e5, 0.95)
ROWS = 600


def drive(
    seed: int, unsteady: tuple[float, float], noise: tuple[float, float], friction_Nm: float = 0.0
) -> WheelTable:  # fmt: skip
    """Load and slip that change by `unsteady` from row to row, measured with `noise`, both [share, -]."""
    rng = np.random.default_rng(seed)
    time = 0.2 * np.arange(ROWS)
    load = 150.0 * (1.0 + 0.3 * np.sin(0.11 * time)) * (1.0 + unsteady[0] * rng.normal(size=ROWS))
    slip = 0.25 + 0.18 * np.sin(0.17 * time + 1.0) + unsteady[1] * rng.normal(size=ROWS)
    state = equilibrium(WHEEL, SOIL, load, slip)
    answers = {
        "torque_Nm": state.torque_Nm + friction_Nm + 0.05 * rng.normal(size=ROWS),
        "sinkage_m": state.sinkage_m + 2e-4 * rng.normal(size=ROWS),
        "drawbar_pull_N": state.drawbar_pull_N + 0.4 * rng.normal(size=ROWS),
    }
    measured = {
        "load_N": load * (1.0 + noise[0] * rng.normal(size=ROWS)),
        "slip": slip + noise[1] * rng.normal(size=ROWS),
    }
    return WheelTable({"time_s": time, "true_slip": slip, **measured, **answers}, None, None, "test")
