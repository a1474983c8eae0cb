"""The specimen drive on which effects are tried, and what an effect does to it."""

from __future__ import annotations

import math

import numpy as np
from bevameter.identification.effects.catalogue import SLUGS, forms_by_name
from bevameter.identification.effects.effect import Effect, Situation
from bevameter.identification.effects.parse import choose, parse_effect, pinned, specimen, values_of
from bevameter.identification.mechanics.augmented import AugmentedWheel
from bevameter.identification.mechanics.soil import Soil
from bevameter.identification.mechanics.textbook import equilibrium
from bevameter.identification.simulate import soil_vector

SITUATION = specimen()
WHEEL, DRIVE = SITUATION.wheel, SITUATION.drive
SOIL = Soil(c_Pa=500.0, phi_rad=math.radians(32.0), k_m=0.012, stiffness_Pa=2e5, n=0.9)
IMPOSED = np.column_stack([DRIVE.load_N, DRIVE.slip])
FORMS = [effect for slug in SLUGS for effect in forms_by_name(slug, SITUATION)]
JANOSI = 1.0 / (1.0 - math.exp(-1.0))
"""K_r from which on the humped law has no hump."""


def identity(effect: Effect) -> str:
    return effect.name + "".join(f"-{parameter.name}" for parameter in effect.parameters)


def textbook() -> np.ndarray:
    state = equilibrium(WHEEL, SOIL, DRIVE.load_N, DRIVE.slip)
    return np.column_stack([state.load_N, state.torque_Nm, state.sinkage_m, state.slip, state.drawbar_pull_N])


def predict(named: str, situation: Situation = SITUATION, soil: Soil = SOIL) -> np.ndarray:
    """Channels (n, 5) with effects named as on the command line, joined by " + "."""
    parsed = [parse_effect(each) for each in named.split(" + ")]
    effects = [choose(each, forms_by_name(each.slug, situation)) for each in parsed]
    values = [values_of(effect, each) for effect, each in zip(effects, parsed, strict=True)]
    model = AugmentedWheel(situation.wheel, tuple(map(pinned, effects, parsed)))
    drive = situation.drive
    imposed = np.column_stack([drive.load_N, drive.slip])
    return model.predict(drive, imposed, np.concatenate([soil_vector(soil), *values])).channels


def change(named: str) -> np.ndarray:
    """What an effect adds to the channels (n, 5) of the textbook wheel."""
    return predict(named) - AugmentedWheel(WHEEL).predict(DRIVE, IMPOSED, soil_vector(SOIL)).channels


def untouched(difference: np.ndarray, *channels: int) -> bool:
    """Say whether nothing happened to these channels, the solver's tolerance apart."""
    return bool(np.all(np.abs(difference[:, channels]) <= 1e-5 * np.abs(textbook()[:, channels]).max(axis=0)))
