"""Physics that was found before, on a later drive: what the wheels would have measured without it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..framework.core.recording.types import WheelTable
from ..framework.core.vehicle import Vehicle
from .effects.catalogue import effect_class
from .effects.stored import AugmentedSimulator
from .mechanics.textbook import ANSWERS
from .simulate import simulate


def for_later_drives(physics: AugmentedSimulator, vehicle: str) -> AugmentedSimulator:
    """Return the soil and those effects that act again when a vehicle, by name, drives on the class.

    Effects of a place or of a recording's clock do not, nor do those of another vehicle or its instruments.
    """
    kept = []
    for effect in physics.effects:
        known = effect_class(effect.slug)
        own = known.belongs_to == "ground" or (bool(vehicle) and vehicle == physics.vehicle)
        if own and not known.of_one_drive:
            kept.append(effect)
    return replace(physics, effects=tuple(kept), correlation=())


def without_effects(physics: AugmentedSimulator, vehicle: Vehicle, table: WheelTable) -> WheelTable:
    """Subtract from torque, sinkage and drawbar pull what the effects add on the soil that they were fitted with.

    Parameters
    ----------
    physics
        Soil and effects (`for_later_drives`).
    vehicle
        The vehicle that drove.
    table
        Its rows, with load and slip or both speeds.

    Returns
    -------
    WheelTable
        NaN where the soil does not carry the load.

    Raises
    ------
    InputError
        As `simulate`: an effect needs a column that was not recorded, for example.
    """
    soil = physics.soil_values
    textbook = simulate(vehicle, soil, table)
    augmented = simulate(vehicle, soil, table, [effect.named for effect in physics.effects])
    changed = {
        name: table[name] - (augmented[name] - textbook[name])
        for name in ANSWERS
        if name in table and not np.array_equal(augmented[name], textbook[name], equal_nan=True)
    }
    return table.adding(changed)
