"""The catalogue: every effect by its public name."""

from __future__ import annotations

from collections.abc import Iterable

from ...framework.core.errors import InputError
from . import (
    bulldozing,
    drivetrain_friction,
    exit_angle,
    grousers,
    hard_layer,
    inertia,
    instruments,
    multipass_compaction,
    rate_dependence,
    rim_adhesion,
    shear_hump,
    side_wall_friction,
    slip_sinkage,
    slope_gravity,
    soil_patch,
    stress_peak_shift,
    time_faults,
    tyre_deflection,
    uncatalogued,
)
from .effect import Effect, Situation

PHYSICS = (
    "slip_sinkage", "stress_peak_shift", "exit_angle", "shear_hump", "rate_dependence", "multipass_compaction",
    "hard_layer", "soil_patch", "rim_adhesion", "bulldozing", "side_wall_friction", "grousers", "tyre_deflection",
    "slope_gravity", "inertia", "drivetrain_friction",
)  # fmt: skip
INSTRUMENTS = (
    "torque_offset", "torque_gain", "load_gain", "sinkage_offset", "rolling_radius", "time_lag", "drift",
)  # fmt: skip
SLUGS = (*PHYSICS, *INSTRUMENTS)
STORED = (*SLUGS, uncatalogued.SLUG)
"""What a simulator that was found may hold."""

_MODULES = (
    slip_sinkage, stress_peak_shift, exit_angle, shear_hump, rate_dependence, multipass_compaction, hard_layer,
    soil_patch, rim_adhesion, bulldozing, side_wall_friction, grousers, tyre_deflection, slope_gravity, inertia,
    drivetrain_friction, instruments, time_faults,
)  # fmt: skip


FROM_RESIDUALS = ("grousers", "soil_patch")
"""Effects whose forms are laid out where residuals show something: anew once other effects are found."""


def effects_for(situation: Situation, slugs: Iterable[str] = SLUGS) -> list[Effect]:
    """Give all forms of the effects named that a recording can show.

    Raises
    ------
    InputError
        A name is not in the catalogue.
    """
    wanted = set(slugs)
    for slug in sorted(wanted - set(SLUGS)):
        raise InputError("effects", repr(slug), expected="one of " + ", ".join(SLUGS))
    return [effect for module in _MODULES for effect in module.forms(situation) if effect.slug in wanted]


_BY_NAME = (
    slip_sinkage, multipass_compaction, stress_peak_shift, soil_patch, grousers, tyre_deflection, inertia, time_faults,
)  # fmt: skip
_NAMED = {module: module.named for module in _BY_NAME}
"""Modules whose forms depend on more than on which columns there are."""


def forms_by_name(slug: str, situation: Situation) -> list[Effect]:
    """Give all forms of one effect that a simulation may ask for, where the situation's drive has what they need.

    Raises
    ------
    InputError
        The name is not in the catalogue.
    """
    if slug not in STORED:
        raise InputError("effects", repr(slug), expected="one of " + ", ".join(SLUGS))
    every = [effect for module in (*_MODULES, uncatalogued) for effect in _NAMED.get(module, module.forms)(situation)]
    found = [effect for effect in every if effect.slug == slug]
    return found + [freer for effect in found for freer in effect.freer()]
