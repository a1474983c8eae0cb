"""`simulate`: what a wheel would sense on a known soil, sample by sample."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from ..framework.core.arguments import path_of, refused
from ..framework.core.errors import InputError
from ..framework.core.recording.types import WheelTable
from ..framework.core.recording.wheel_file import derive, read_wheel_file
from ..framework.core.soil import SoilKnowledge, as_knowledge
from ..framework.core.vehicle import Vehicle, Wheel, as_vehicle
from .effects.drive import PresentDrive, drive_of, order_of, select_rows
from .effects.effect import PULL, SINKAGE, TORQUE
from .effects.parse import NamedEffect, build, parse_effect, situation_of
from .mechanics.augmented import AugmentedWheel
from .mechanics.soil import Soil, soil_vector
from .mechanics.textbook import ANSWERS, equilibrium
from .rows.signs import check_signs
from .rows.weight import with_loads


def simulate(
    vehicle: Vehicle | str | Path,
    soil: Soil | SoilKnowledge | str | Path,
    drive: WheelTable | str | Path,
    effects: Sequence[str | NamedEffect] = (),
) -> WheelTable:
    """Simulate the wheels of a drive on a soil, free of noise.

    Parameters
    ----------
    vehicle
        The vehicle, or its TOML file.
    soil
        The soil, all five parameters of it, or its TOML file.
    drive
        Wheel rows with `load_N` (or a vehicle that states its weight) and `slip` (or both speeds), as their instruments
        report them, or their file.
    effects
        What is added to the paper's Eq. 1-9, each ``"slug:parameter=value,..."``: see docs/effects.md. They act in the
        order given.

    Returns
    -------
    WheelTable
        The drive's columns, with torque [N m], sinkage [m] and drawbar pull [N] replaced or added; NaN where load or
        slip, or what an effect needs, is not known, or the soil does not carry the load.

    Raises
    ------
    InputError
        A file or value is bad, load and slip are missing, an effect or one of its parameters is not known or out of
        bounds, or an effect needs a column that the drive lacks.
    """
    named = _named(effects)
    vehicle = as_vehicle(vehicle)
    if not isinstance(soil, Soil):
        if soil is None:
            raise refused("soil", soil, "a Soil, a SoilKnowledge of all five parameters, or the path of its TOML file")
        soil = Soil.from_knowledge(as_knowledge(soil), "soil" if isinstance(soil, SoilKnowledge) else str(soil))
    wanted = "a WheelTable, or the path of a wheel file"
    table = drive if isinstance(drive, WheelTable) else read_wheel_file(path_of("drive", drive, wanted))
    table, vehicle, _ = with_loads(table, vehicle)
    answers = {name: np.full(len(table), np.nan) for name in ANSWERS}
    slips = np.full(len(table), np.nan)
    names = [None] if table.wheel is None else list(np.unique(table.wheel))
    if names == [None] and len(vehicle.wheels) > 1:
        which = " or ".join(wheel.name for wheel in vehicle.wheels)
        raise InputError(
            table.source, "no column wheel", expected=f"which wheel of the vehicle each row is of: {which}"
        )
    parts = []
    for name in names:
        wheel = vehicle.wheel(name)
        rows = np.ones(len(table), dtype=bool) if name is None else np.asarray(table.wheel) == name
        part = derive(table.select(rows), wheel)
        for column in ("load_N", "slip"):
            if column not in part:
                raise InputError(
                    table.source,
                    f"no column {column}",
                    expected="load_N or the vehicle's mass_kg, and slip or both speeds",
                )
        check_signs(part, wheel)
        slips[rows] = part["slip"]
        parts.append((wheel, rows, part))
    before = _slip_before(table.adding({"slip": slips}), parts[0][0]) if named else None
    for wheel, rows, part in parts:
        channels = (
            _textbook(wheel, soil, part) if before is None else _augmented(wheel, soil, part, named, before[rows])
        )
        for column, values in zip(ANSWERS, channels, strict=True):
            answers[column][rows] = values
    return table.adding({"slip": slips, **answers})


def notes(vehicle: Vehicle, simulated: WheelTable, effects: Sequence[str | NamedEffect] = ()) -> list[str]:
    """Say in words in how many rows of a simulation there is no answer and why, and what was left out of it.

    Parameters
    ----------
    vehicle, effects
        As in `simulate`.
    simulated
        What it gave.
    """
    load, slip = simulated["load_N"], simulated["slip"]
    left = ~np.all([np.isfinite(simulated[name]) for name in ANSWERS], axis=0)
    found = []
    for why, rows in (
        ("load or slip is missing", ~(np.isfinite(load) & np.isfinite(slip))),
        ("the load is not above 0 N", load <= 0.0),
        ("slip is beyond -1 to 1", np.abs(slip) > 1.0),
        ("the soil does not carry the load, or an effect lacks what it needs", left),
    ):
        count = int(np.sum(left & rows))
        left &= ~rows
        if count:
            found.append(f"{count} of {len(simulated)} rows have no answer: {why}")
    slugs = [(parse_effect(each) if isinstance(each, str) else each).slug for each in effects]
    if any(wheel.grouser_count and wheel.grouser_height_m for wheel in vehicle.wheels) and "grousers" not in slugs:
        found.append("the vehicle's lugs are left out, as the textbook wheel has none: --effect grousers adds them")
    return found


def _named(effects: Sequence[str | NamedEffect]) -> list[NamedEffect]:
    """Read the effects that are stated; raises `InputError` where something is none."""
    wanted = "a list of effects, each SLUG:NAME=VALUE,..."
    if isinstance(effects, str) or not isinstance(effects, Iterable):
        raise refused("effects", effects, wanted)
    named = [parse_effect(effect) if isinstance(effect, str) else effect for effect in effects]
    for effect in named:
        if not isinstance(effect, NamedEffect):
            raise refused("effects", effect, wanted)
    return named


def _textbook(wheel: Wheel, soil: Soil, table: WheelTable) -> tuple[np.ndarray, ...]:
    """Torque [N m], sinkage [m] and drawbar pull [N] of the paper's Eq. 1-9, each (n,)."""
    state = equilibrium(wheel, soil, table["load_N"], table["slip"])
    return state.torque_Nm, state.sinkage_m, state.drawbar_pull_N


def _slip_before(table: WheelTable, wheel: Wheel) -> np.ndarray:
    """Size of the slip of the wheel that ran before at the same place, whichever it was (n,) [-]."""
    order, stretch = order_of(table)
    answer = np.empty(len(table))
    answer[order] = drive_of(table.select(order), wheel, stretch, PresentDrive).slip_before
    return answer


def _augmented(
    wheel: Wheel, soil: Soil, table: WheelTable, named: Sequence[NamedEffect], before: np.ndarray
) -> np.ndarray:  # fmt: skip
    """Torque [N m], sinkage [m] and drawbar pull [N] with effects, (3, n), where a slip `before` (n,) has been [-]."""
    order, stretch = order_of(table)
    table = table.select(order)
    load, slip = table["load_N"], table["slip"]
    with np.errstate(invalid="ignore"):
        usable = (load > 0.0) & np.isfinite(load) & (np.abs(slip) <= 1.0)
    answers = np.full((3, len(table)), np.nan)
    if not usable.any():
        raise InputError(table.source, "no row with load and slip", expected="rows that an effect can act on")
    drive = replace(drive_of(table, wheel, stretch, PresentDrive), slip_before=before[order])
    drive = select_rows(drive, usable)
    situation = situation_of(wheel, soil, drive)
    pairs = [build(effect, situation, str(table.source)) for effect in named]
    model = AugmentedWheel(wheel, tuple(effect for effect, _ in pairs))
    vector = np.concatenate([soil_vector(soil), *(values for _, values in pairs)])
    channels = model.predict(drive, np.column_stack([drive.load_N, drive.slip]), vector).channels
    for effect, _ in pairs:
        for need in effect.needs:
            channels[~np.isfinite(getattr(drive, need))] = np.nan
    answers[:, order[usable]] = channels[:, [TORQUE, SINKAGE, PULL]].T
    return answers
