"""The augmented simulator as an object that outlives its fit: soil and effects as numbers, written as JSON.

Nothing in it depends on the wheel that it was found with: effects are built anew for the wheel and the drive asked
about. What the formulas of effects take from the drive that they were found on (`Effect.constants`) is kept.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from ...framework.core.errors import InputError
from ...framework.core.recording.types import WheelTable
from ...framework.core.soil import PARAMETERS, PLAUSIBLE
from ...framework.core.vehicle import Vehicle
from ..augmented import SOIL_COUNT, AugmentedWheel
from ..forward import from_internal, slope_of_internal
from ..simulate import simulate
from ..wheel_soil import Soil
from .catalogue import SLUGS, forms_by_name
from .effect import Effect
from .named import NamedEffect, follows_drive, lugs_of, smallest_holding, specimen

SCHEMA = 1
"""Version of the document's meaning."""

MOST_EFFECTS = 32
"""No ground needs more; a document that names more is refused before it costs time."""


@dataclass(frozen=True)
class Estimated:
    """A number and its standard deviation, NaN where nobody knows it."""

    value: float
    sd: float = math.nan


@dataclass(frozen=True)
class StoredEffect:
    """An effect that was found: slug, form, its parameters that were fitted, constants of the formula; by name [SI]."""

    slug: str
    form: str
    parameters: Mapping[str, Estimated]
    constants: Mapping[str, float] = field(default_factory=dict)

    @property
    def named(self) -> NamedEffect:
        """The effect as it is asked for by name."""
        values = {name: entry.value for name, entry in self.parameters.items()}
        return NamedEffect(self.slug, {**values, **self.constants}, self.form, bounded=False)


@dataclass(frozen=True)
class AugmentedSimulator:
    """A soil and the effects that the textbook wheel lacked on it.

    Parameters
    ----------
    soil
        By name, all of `PARAMETERS` [SI], fitted together with the effects.
    effects
        Those found, in the order in which they act; instruments' faults among them.
    """

    soil: Mapping[str, Estimated]
    effects: tuple[StoredEffect, ...] = ()

    @staticmethod
    def of(model: AugmentedWheel, vector: np.ndarray, covariance: np.ndarray | None = None) -> AugmentedSimulator:
        """Take over what was fitted.

        Parameters
        ----------
        model, vector : (p,)
            The simulator fitted and its parameters.
        covariance : (p, p), optional
            Of the vector.

        Raises
        ------
        InputError
            An effect is none of the catalogue's.
        """
        spread = np.full(len(vector), math.nan) if covariance is None else np.sqrt(np.diag(covariance))
        soil = {}
        for name, inside, sd in zip(
            PARAMETERS, vector[:SOIL_COUNT].tolist(), spread[:SOIL_COUNT].tolist(), strict=True
        ):
            value = from_internal(name, inside)
            soil[name] = Estimated(value, sd * slope_of_internal(name, value))
        effects = []
        for effect, where in model.slices():
            if effect.slug not in SLUGS:
                raise InputError("effects", repr(effect.slug), expected="one of " + ", ".join(SLUGS))
            numbers = zip(effect.parameters, vector[where].tolist(), spread[where].tolist(), strict=True)
            parameters = {parameter.name: Estimated(value, sd) for parameter, value, sd in numbers}
            effects.append(StoredEffect(effect.slug, effect.form, parameters, dict(effect.constants)))
        return AugmentedSimulator(MappingProxyType(soil), tuple(effects))

    @property
    def soil_values(self) -> Soil:
        """The soil, without its uncertainty."""
        return Soil(**{name: self.soil[name].value for name in PARAMETERS})

    def simulate(self, vehicle: Vehicle | str | Path, drive: WheelTable | str | Path) -> WheelTable:
        """Simulate a drive, faults of instruments included; see `identification.simulate.simulate`."""
        return simulate(vehicle, self.soil_values, drive, [effect.named for effect in self.effects])

    def to_json(self) -> dict[str, Any]:
        """Give the document that `from_json` reads; what is not known is None."""
        return {
            "schema": SCHEMA,
            "soil": {name: _packed(self.soil[name]) for name in PARAMETERS},
            "effects": [
                {
                    "slug": effect.slug,
                    "form": effect.form,
                    "parameters": {name: _packed(entry) for name, entry in effect.parameters.items()},
                    "constants": {name: float(value) for name, value in effect.constants.items()},
                }
                for effect in self.effects
            ],
        }

    @staticmethod
    def from_json(document: Any, source: str = "physics") -> AugmentedSimulator:
        """Read a document, whoever wrote it.

        Raises
        ------
        InputError
            It is not of `to_json`'s form, or holds an unknown effect, form or parameter, a number that is not finite
            or is out of bounds.
        """
        page = _table(document, {"schema", "soil", "effects"}, source, "document")
        if isinstance(page["schema"], bool) or page["schema"] != SCHEMA:
            raise InputError(source, f"schema {page['schema']!r}", expected=str(SCHEMA))
        soil = _table(page["soil"], set(PARAMETERS), source, "soil")
        effects = page["effects"]
        if not isinstance(effects, list) or len(effects) > MOST_EFFECTS:
            raise InputError(source, "no list of effects", expected=f"at most {MOST_EFFECTS} of them", place="effects")
        return AugmentedSimulator(
            MappingProxyType({
                name: _estimated(soil[name], PLAUSIBLE[name], source, f"soil, {name}") for name in PARAMETERS
            }),
            tuple(_effect(entry, source, f"effect {index + 1}") for index, entry in enumerate(effects)),
        )  # fmt: skip


def _effect(document: Any, source: str, place: str) -> StoredEffect:
    page = _table(document, {"slug", "form", "parameters", "constants"}, source, place)
    slug, form = page["slug"], page["form"]
    if not isinstance(slug, str) or slug not in SLUGS:
        raise InputError(source, f"effect {slug!r}"[:80], expected="one of " + ", ".join(SLUGS), place=place)
    if not isinstance(form, str):
        raise InputError(source, f"form {form!r}"[:80], expected="text", place=place)
    known = [effect for effect in forms_by_name(slug, specimen(lugs_of(form))) if effect.form == form]
    if not known:
        raise InputError(source, f"form {form!r} of {slug}"[:120], expected="a form of the catalogue", place=place)
    names = set(page["parameters"]) if isinstance(page["parameters"], dict) else set()
    effect = smallest_holding(names, known)
    if effect is None:
        shown = " or ".join(", ".join(parameter.name for parameter in each.parameters) for each in known)
        raise InputError(source, f"parameters {sorted(map(str, names))}"[:120], expected=shown, place=place)
    free = follows_drive(effect)
    parameters = {}
    for parameter in effect.parameters:
        if parameter.name not in names:
            continue
        bounds = (-math.inf, math.inf) if parameter.name in free else (parameter.low, parameter.high)
        where = f"{place}, {parameter.name}"
        parameters[parameter.name] = _estimated(page["parameters"][parameter.name], bounds, source, where)
    constants = _constants(page["constants"], effect, source, place)
    return StoredEffect(slug, form, MappingProxyType(parameters), MappingProxyType(constants))


def _constants(document: Any, effect: Effect, source: str, place: str) -> dict[str, float]:
    page = _table(document, set(effect.constants), source, f"{place}, constants")
    # Speeds and widths are what a formula divides by; moments of time may be anything.
    lowest = {name: -math.inf if name.startswith("t_") else math.ulp(0.0) for name in effect.constants}
    return {
        name: _finite(page[name], (lowest[name], math.inf), source, f"{place}, constants, {name}") for name in page
    }  # fmt: skip


def _packed(entry: Estimated) -> dict[str, float | None]:
    return {"value": float(entry.value), "sd": float(entry.sd) if math.isfinite(entry.sd) else None}


def _table(document: Any, keys: set[str], source: str, place: str) -> dict[str, Any]:
    """Give a JSON object that has exactly these keys."""
    if not isinstance(document, dict) or set(document) != keys:
        shown = sorted(map(str, document)) if isinstance(document, dict) else type(document).__name__
        raise InputError(source, f"{shown}"[:120], expected="an object with " + ", ".join(sorted(keys)), place=place)
    return document


def _estimated(document: Any, bounds: tuple[float, float], source: str, place: str) -> Estimated:
    page = _table(document, {"value", "sd"}, source, place)
    value = _finite(page["value"], bounds, source, place)
    sd = math.nan if page["sd"] is None else _finite(page["sd"], (0.0, math.inf), source, f"{place}, sd")
    return Estimated(value, sd)


def _finite(number: Any, bounds: tuple[float, float], source: str, place: str) -> float:
    low, high = bounds
    usable = isinstance(number, int | float) and not isinstance(number, bool)
    # Rounding on the way through JSON and logarithms may pass a bound by a hair.
    slack = 1e-9 * max(abs(low) if math.isfinite(low) else 0.0, abs(high) if math.isfinite(high) else 0.0)
    if not usable or not -1e300 < number < 1e300 or not low - slack <= number <= high + slack:
        span = f"a number from {low:g} to {high:g}" if math.isfinite(low + high) else "a finite number in range"
        raise InputError(source, f"{number!r}"[:80], expected=span, place=place)
    return min(max(float(number), low), high)
