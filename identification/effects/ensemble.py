"""Ensembles of soils for predictions with effects: a planner's draws from a terrain class.

Predictions are for level, fresh ground and steady driving at the speed of the fit. Only effects of the ground on any
wheel are included (`Effect.of_any_wheel`), not those of the vehicle that drove there or of its instruments. Effects of
slope, pass number or speed vanish.
"""

from __future__ import annotations

import math

import numpy as np

from ...framework.core.soil import PARAMETERS, PLAUSIBLE
from ...framework.core.track.place import ALONG_X
from ...framework.core.vehicle import Wheel
from ..mechanics.augmented import SOIL_COUNT, AugmentedWheel
from ..mechanics.soil import Soil, slope_of_internal
from .catalogue import effect_class, forms_by_name
from .drive import PresentDrive
from .effect import COVARIATES, Effect
from .parse import lugs_of, pinned, situation_of, smallest_form, specimen
from .stored import AugmentedSimulator, StoredEffect

_FURTHEST = 50.0
"""Largest error of a logarithm [-]: beyond it every value is out of bounds."""


def error_count(physics: AugmentedSimulator) -> int:
    """Number of parameters in a planner's prediction: of the soil and of the effects that are included."""
    return SOIL_COUNT + sum(len(effect.parameters) for effect in _of_the_ground(physics))


def errors_of_fit(physics: AugmentedSimulator, normal: np.ndarray) -> np.ndarray:
    """Draw correlated errors of the parameters of a fit.

    Parameters
    ----------
    physics
        Soil, with its standard deviations, and effects; parameters of these whose error is unknown have the standard
        deviation of their prior.
    normal : (s, `error_count`)
        Standard normal numbers.

    Returns
    -------
    (s, `error_count`)
        Errors of c [Pa], tan phi, ln k, ln stiffness, ln n, and of the parameters of the effects that are included.
    """
    soil = {name: physics.soil[name] for name in PARAMETERS}
    sd = [entry.sd / slope_of_internal(name, entry.value) for name, entry in soil.items()]
    taken, start = list(range(SOIL_COUNT)), SOIL_COUNT
    for stored in physics.effects:
        if effect_class(stored.slug).of_any_wheel:
            taken += range(start, start + len(stored.parameters))
            scale = _usual_scales(stored)
            sd += [entry.sd if math.isfinite(entry.sd) else scale[name] for name, entry in stored.parameters.items()]
        start += len(stored.parameters)
    correlation = np.array(physics.correlation)[np.ix_(taken, taken)] if physics.correlation else np.eye(len(taken))
    values, axes = np.linalg.eigh(correlation)
    return normal @ (axes * np.sqrt(np.maximum(values, 0.0))).T * np.array(sd)


def soils_off(soils: np.ndarray, errors: np.ndarray) -> np.ndarray:
    """Add errors (s, 5 or more) of `errors_of_fit` to soils (s, 5), columns as `PARAMETERS`, within `PLAUSIBLE`."""
    tan_phi = np.tan(soils[:, 1]) + errors[:, 1]
    logarithmic = soils[:, 2:] * np.exp(np.clip(errors[:, 2:SOIL_COUNT], -_FURTHEST, _FURTHEST))
    answer = np.column_stack([soils[:, 0] + errors[:, 0], np.arctan(tan_phi), logarithmic])
    low, high = np.array([PLAUSIBLE[name] for name in PARAMETERS]).T
    return np.clip(answer, low, high)


def channels(
    wheel: Wheel,
    soils: np.ndarray,
    load_N: float,
    slips: np.ndarray,
    physics: AugmentedSimulator | None = None,
    errors: np.ndarray | None = None,
) -> np.ndarray:
    """What one wheel does on many soils at many slips.

    Parameters
    ----------
    wheel
        The wheel.
    soils : (s, 5)
        Columns as `PARAMETERS`, SI.
    load_N
        Load on the wheel [N].
    slips : (k,)
        Slips [-].
    physics
        Effects; the textbook wheel where absent.
    errors : (s, `error_count`)
        Errors of the fit (`errors_of_fit`): those of the effects' parameters are added, within bounds; `soils` include
        theirs already.

    Returns
    -------
    (s, k, 5)
        Channels as `textbook.CHANNELS`, SI; NaN where the load is not carried.
    """
    drive = _level_drive(np.full(len(soils) * len(slips), load_N), np.tile(slips, len(soils)))
    vectors, effects = [soils[:, 0], np.tan(soils[:, 1]), *np.log(soils[:, 2:].T)], []
    if physics is not None and errors is not None:
        middle = Soil(**dict(zip(PARAMETERS, np.median(soils, axis=0).tolist(), strict=True)))
        situation, column = situation_of(wheel, middle, drive), SOIL_COUNT
        for stored in _of_the_ground(physics):
            off = errors[:, column : column + len(stored.parameters)]
            column += len(stored.parameters)
            effect = smallest_form(stored.form, set(stored.parameters), forms_by_name(stored.slug, situation))
            if effect is not None:
                effects.append(pinned(effect, stored.named))
                vectors += list(_drawn(effect, stored, off))
    model = AugmentedWheel(wheel, tuple(effects))
    vector = np.repeat(np.array(vectors), len(slips), axis=1)
    answer = model.predict(drive, np.column_stack([drive.load_N, drive.slip]), vector).channels
    return answer.reshape(len(soils), len(slips), -1)


def _usual_scales(stored: StoredEffect) -> dict[str, float]:
    """Standard deviations of the priors of an effect's parameters, by name."""
    known = forms_by_name(stored.slug, specimen(lugs_of(stored.form)))
    effect = smallest_form(stored.form, set(stored.parameters), known)
    assert effect is not None, "stored effects were checked when read"
    return {parameter.name: parameter.scale for parameter in effect.parameters}


def _of_the_ground(physics: AugmentedSimulator) -> list[StoredEffect]:
    return [effect for effect in physics.effects if effect_class(effect.slug).of_any_wheel]


def _drawn(effect: Effect, stored: StoredEffect, off: np.ndarray) -> np.ndarray:
    """Parameters (k, s) in the effect's order, with errors (s, k) in the stored effect's order added."""
    order = list(stored.parameters)
    values = []
    for parameter in effect.parameters:
        entry = stored.parameters.get(parameter.name)
        if entry is None:
            values.append(np.full(len(off), parameter.null))
            continue
        # The bounds are this wheel's, which may exclude the fitted value.
        low, high = min(parameter.low, entry.value), max(parameter.high, entry.value)
        values.append(np.clip(entry.value + off[:, order.index(parameter.name)], low, high))
    return np.array(values)


def _level_drive(load_N: np.ndarray, slip: np.ndarray) -> PresentDrive:
    numbers = np.arange(len(load_N))
    columns = dict.fromkeys(COVARIATES, np.full(len(load_N), math.nan))
    columns |= {"load_N": load_N, "slip": slip, "stretch": numbers, "run": numbers}
    columns |= dict.fromkeys(("ground", "wheel"), np.zeros_like(numbers))
    return PresentDrive(**columns, axis=ALONG_X)
