"""`simulate`: what a wheel would sense on a known soil, sample by sample."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ..framework.core.errors import InputError
from ..framework.core.recording.types import WheelTable
from ..framework.core.recording.wheel_file import derive, read_wheel_file
from ..framework.core.soil import SoilKnowledge, load_soil
from ..framework.core.vehicle import Vehicle, load_vehicle
from .wheel_soil import Soil, equilibrium

ANSWERS = ("torque_Nm", "sinkage_m", "drawbar_pull_N")
"""Channels that a simulation adds."""


def simulate(
    vehicle: Vehicle | str | Path,
    soil: Soil | SoilKnowledge | str | Path,
    drive: WheelTable | str | Path,
    effects: Sequence[str] = (),
) -> WheelTable:
    """Simulate the wheels of a drive on a soil, free of noise.

    Parameters
    ----------
    vehicle
        The vehicle, or its TOML file.
    soil
        The soil, all five parameters of it, or its TOML file.
    drive
        Wheel rows with `load_N` and `slip` (or both speeds), or their file.
    effects
        Physics beyond the paper's Eq. 1-9; none is known yet.

    Returns
    -------
    WheelTable
        The drive's columns, with torque [N m], sinkage [m] and drawbar pull [N] replaced or added; NaN where load or
        slip is not known or the soil does not carry the load.

    Raises
    ------
    InputError
        A file or value is bad, or load and slip are missing.
    """
    if effects:
        raise InputError("effects", f"{effects[0]!r}", expected="none: this version simulates the paper's Eq. 1-9 only")
    vehicle = vehicle if isinstance(vehicle, Vehicle) else load_vehicle(vehicle)
    if not isinstance(soil, Soil):
        known = soil if isinstance(soil, SoilKnowledge) else load_soil(soil)
        soil = Soil.from_knowledge(known, "soil" if isinstance(soil, SoilKnowledge) else str(soil))
    table = drive if isinstance(drive, WheelTable) else read_wheel_file(drive)
    answers = {name: np.full(len(table), np.nan) for name in ANSWERS}
    slips = np.full(len(table), np.nan)
    names = [None] if table.wheel is None else list(np.unique(table.wheel))
    for name in names:
        wheel = vehicle.wheel(name)
        rows = np.ones(len(table), dtype=bool) if name is None else np.asarray(table.wheel) == name
        part = derive(table.select(rows), wheel)
        for column in ("load_N", "slip"):
            if column not in part:
                raise InputError(table.source, f"no column {column}", expected="load_N, and slip or both speeds")
        state = equilibrium(wheel, soil, part["load_N"], part["slip"])
        slips[rows] = part["slip"]
        for column, values in zip(ANSWERS, (state.torque_Nm, state.sinkage_m, state.drawbar_pull_N), strict=True):
            answers[column][rows] = values
    return WheelTable({**table.columns, "slip": slips, **answers}, table.wheel, table.run, table.source)
