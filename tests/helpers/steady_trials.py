"""Steady trials of one wheel on sand, pull included."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from bevameter import WheelTable
from bevameter.identification.mechanics.textbook import equilibrium
from slow_drive import SAND, WHEEL

SLIPS = (0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6)


def trials(rng, slips=SLIPS, loads=(60.0, 90.0, 120.0)) -> WheelTable:
    """Every slip under every load."""
    load, slip = (each.ravel() for each in np.meshgrid(loads, slips))
    state = equilibrium(WHEEL, SAND, load, slip)
    channels = {
        "load_N": load + 0.3 * rng.normal(size=len(load)), "slip": slip, "torque_Nm": state.torque_Nm,
        "sinkage_m": state.sinkage_m, "drawbar_pull_N": state.drawbar_pull_N + 0.4 * rng.normal(size=len(load)),
    }  # fmt: skip
    return WheelTable(channels, None, np.array([f"t{i}" for i in range(len(load))], dtype=object), Path("wheel.csv"))


def without(table: WheelTable, *names: str) -> WheelTable:
    return replace(table, columns={name: each for name, each in table.columns.items() if name not in names})
