"""The augmented simulator as a stored object: soil and effects as numbers, in JSON.

Apart from the number of lugs in the name of a ripple, it does not depend on the wheel of the fit: effects are built for
the wheel and the drive that are simulated. Constants of a formula that depend on the drive of the fit
(`Effect.constants`) are stored.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from ...framework.core.arguments import shown
from ...framework.core.errors import InputError
from ...framework.core.explanation import UNKNOWN, Estimate
from ...framework.core.quantities import finite_or_none
from ...framework.core.recording.types import WheelTable
from ...framework.core.soil import PARAMETERS, PLAUSIBLE
from ...framework.core.vehicle import Vehicle
from ..mechanics.augmented import SOIL_COUNT, AugmentedWheel
from ..mechanics.soil import Soil, from_internal, slope_of_internal
from ..simulate import simulate
from .catalogue import SLUGS, effect_class, forms_by_name
from .effect import Effect
from .grouped import GroupedEffect
from .parse import NamedEffect, follows_drive, lugs_of, smallest_form, specimen

SCHEMA = 3
"""Version of the document: the second adds correlations and probabilities, the third the vehicle; all can be read."""

_ROUNDING = 1e-9
"""Tolerance for negative eigenvalues of correlations due to rounding, per row [-]."""

_LONGEST_NAME = 200
"""Letters of a vehicle's name."""

MOST_EFFECTS = 32
"""Most effects in a document: a longer one is an error."""

_FORMER = {
    "zero of drawbar_pull_N": ("pull_offset", ""),
    "gain of drawbar_pull_N": ("pull_gain", ""),
    "gain of sinkage_m": ("sinkage_gain", ""),
    "zero of load_N": ("load_offset", ""),
    "load in drawbar_pull_N": ("load_in_pull", ""),
    "drawbar_pull_N in torque_Nm": ("torque_pull_crosstalk", "pull in torque"),
    "torque_Nm in drawbar_pull_N": ("torque_pull_crosstalk", "torque in pull"),
    "drawbar_pull_N in sinkage_m": ("frame_compliance", ""),
    "torque_Nm saturates softly": ("torque_saturation", "soft"),
    "torque_Nm saturates": ("torque_saturation", "hard"),
}
"""Slugs and forms of effects that are ``unknown`` in documents of earlier versions, by the form there."""


@dataclass(frozen=True)
class StoredEffect:
    """A fitted effect: slug, form, parameters and constants of the formula by name [SI].

    `probability` is that of the effect, NaN if unknown.
    """

    slug: str
    form: str
    parameters: Mapping[str, Estimate]
    constants: Mapping[str, float] = field(default_factory=dict)
    probability: float = math.nan

    @property
    def named(self) -> NamedEffect:
        """The effect as simulated by name."""
        values = {name: entry.value for name, entry in self.parameters.items()}
        return NamedEffect(self.slug, {**values, **self.constants}, self.form, bounded=False)


@dataclass(frozen=True)
class AugmentedSimulator:
    """A soil, and the effects that the textbook wheel omits.

    Parameters
    ----------
    soil
        All of `PARAMETERS` by name [SI], fitted together with the effects.
    effects
        In the order in which they act, including faults of instruments.
    correlation : (p, p)
        Of the errors of c, tan phi, ln k, ln stiffness, ln n and the effects' parameters, in order; empty if unknown.
    vehicle
        Name of the vehicle that drove; empty if unknown.
    """

    soil: Mapping[str, Estimate]
    effects: tuple[StoredEffect, ...] = ()
    correlation: tuple[tuple[float, ...], ...] = ()
    vehicle: str = ""

    @staticmethod
    def of(
        model: AugmentedWheel, vector: np.ndarray, covariance: np.ndarray | None = None,
        probabilities: Mapping[str, float] = MappingProxyType({}), ground: int = 0, vehicle: str = "",
    ) -> AugmentedSimulator:  # fmt: skip
        """Convert a fit on one ground, without effects that describe the runs of its recording (`Effect.by_run`), one
        wheel or other grounds.

        Parameters
        ----------
        model, vector : (p,)
            The fitted simulator and its parameters.
        covariance : (p, p), optional
            Of the vector.
        probabilities
            Of effects, by slug.
        ground
            Number of the ground.
        vehicle
            Name of the vehicle.

        Raises
        ------
        InputError
            An effect is not in the catalogue.
        """
        first = SOIL_COUNT * ground
        pairs = [_on_ground(effect, where, ground) for effect, where in model.slices()]
        kept = [pair for pair in pairs if pair is not None]
        own = np.concatenate([first + np.arange(SOIL_COUNT), *(where for _, where in kept)])
        model, vector = AugmentedWheel(model.wheel, tuple(effect for effect, _ in kept)), vector[own]
        covariance = None if covariance is None else covariance[np.ix_(own, own)]
        stored = np.ones(len(vector), dtype=bool)
        for effect, where in model.slices():
            stored[where] = not effect.by_run
        deviation = np.full(len(vector), math.nan) if covariance is None else np.sqrt(np.diag(covariance))
        soil = {}
        for name, inside, sd in zip(
            PARAMETERS, vector[:SOIL_COUNT].tolist(), deviation[:SOIL_COUNT].tolist(), strict=True
        ):
            value = from_internal(name, inside)
            soil[name] = Estimate(value, sd * slope_of_internal(name, value))
        effects = []
        for effect, where in model.slices():
            if effect.by_run:
                continue
            effect_class(effect.slug)
            numbers = zip(effect.parameters, vector[where].tolist(), deviation[where].tolist(), strict=True)
            parameters = {parameter.name: Estimate(value, sd) for parameter, value, sd in numbers}
            probability = probabilities.get(effect.slug, math.nan)
            effects.append(StoredEffect(effect.slug, effect.form, parameters, dict(effect.constants), probability))
        kept = None if covariance is None else covariance[np.ix_(stored, stored)]
        return AugmentedSimulator(MappingProxyType(soil), tuple(effects), _correlation_of(kept), vehicle)

    @property
    def soil_values(self) -> Soil:
        """The soil, without its uncertainty."""
        return Soil(**{name: self.soil[name].value for name in PARAMETERS})

    def simulate(self, vehicle: Vehicle | str | Path, drive: WheelTable | str | Path) -> WheelTable:
        """Simulate a drive, faults of instruments included; see `identification.simulate.simulate`."""
        return simulate(vehicle, self.soil_values, drive, [effect.named for effect in self.effects])

    def to_json(self) -> dict[str, Any]:
        """Return the document that `from_json` reads; unknown numbers are None.

        Without vehicle it is a document of the second version, without correlations and probabilities of the first.
        """
        second = bool(self.vehicle or self.correlation) or any(math.isfinite(each.probability) for each in self.effects)
        further: dict[str, Any] = {"correlation": [list(row) for row in self.correlation] or None} if second else {}
        if self.vehicle:
            further["vehicle"] = self.vehicle
        return {
            "schema": SCHEMA if self.vehicle else 2 if second else 1,
            "soil": {name: _packed(self.soil[name]) for name in PARAMETERS},
            "effects": [
                {
                    "slug": effect.slug,
                    "form": effect.form,
                    "parameters": {name: _packed(entry) for name, entry in effect.parameters.items()},
                    "constants": {name: float(value) for name, value in effect.constants.items()},
                    **({"probability": finite_or_none(effect.probability)} if second else {}),
                }
                for effect in self.effects
            ],
            **further,
        }

    @staticmethod
    def from_json(document: Any, source: str = "physics") -> AugmentedSimulator:
        """Read a document.

        Raises
        ------
        InputError
            It is not of the form of `to_json`, has an unknown effect, form or parameter, or a number that is not finite
            or out of bounds.
        """
        schema = document.get("schema") if isinstance(document, dict) else None
        if (
            isinstance(document, dict)
            and "schema" in document
            and (isinstance(schema, bool) or schema not in (1, 2, 3))
        ):
            raise InputError(source, f"schema {shown(schema)}", expected="1, 2 or 3")
        further = {1: set(), 2: {"correlation"}}.get(schema or 1, {"correlation", "vehicle"})
        page = _table(document, {"schema", "soil", "effects"} | further, source, "document")
        soil = _table(page["soil"], set(PARAMETERS), source, "soil")
        effects = page["effects"]
        if not isinstance(effects, list) or len(effects) > MOST_EFFECTS:
            raise InputError(source, "no list of effects", expected=f"at most {MOST_EFFECTS} of them", place="effects")
        known = tuple(_effect(entry, schema, source, f"effect {index + 1}") for index, entry in enumerate(effects))
        size = SOIL_COUNT + sum(len(effect.parameters) for effect in known)
        return AugmentedSimulator(
            MappingProxyType({
                name: _estimated(soil[name], PLAUSIBLE[name], source, f"soil, {name}") for name in PARAMETERS
            }),
            known,
            _correlation(page.get("correlation"), size, source),
            _vehicle(page.get("vehicle", ""), source),
        )  # fmt: skip


def _on_ground(effect: Effect, where: slice, ground: int) -> tuple[Effect, np.ndarray] | None:
    """Return an effect as it acts on a ground, and the places of its parameters in the vector; None if it does not."""
    places = np.arange(where.start, where.stop)
    if not isinstance(effect, GroupedEffect):
        return effect, places
    parts = zip(effect.groups, np.split(places, len(effect.groups)), strict=True)
    return next(
        ((effect.base, own) for each, own in parts if each.attribute == "ground" and ground in each.numbers), None
    )


def _correlation_of(covariance: np.ndarray | None) -> tuple[tuple[float, ...], ...]:
    """Correlations of a covariance (p, p), zero where a variance is zero; empty if it is not a covariance."""
    if covariance is None or not np.isfinite(covariance).all() or (np.diag(covariance) < 0.0).any():
        return ()
    sd = np.sqrt(np.diag(covariance))
    scale = np.divide(1.0, sd, out=np.zeros_like(sd), where=sd > 0.0)
    # Due to rounding a covariance may not be exactly symmetric, ...
    answer = np.clip(0.5 * (covariance + covariance.T) * np.outer(scale, scale), -1.0, 1.0)
    np.fill_diagonal(answer, 1.0)
    # ... and may have negative eigenvalues.
    short = max(-float(np.linalg.eigvalsh(answer)[0]), 0.0)
    answer = (answer + short * np.eye(len(sd))) / (1.0 + short)
    np.fill_diagonal(answer, 1.0)
    return tuple(map(tuple, answer.tolist()))


def _correlation(document: Any, size: int, source: str) -> tuple[tuple[float, ...], ...]:
    """Read correlations (size, size), or none."""
    if document is None:
        return ()
    square = isinstance(document, list) and len(document) == size
    if not square or not all(isinstance(row, list) and len(row) == size for row in document):
        raise InputError(source, "no square", expected=f"{size} rows of {size} numbers", place="correlation")
    answer = np.array([[_finite(each, (-1.0, 1.0), source, "correlation") for each in row] for row in document])
    sound = np.array_equal(answer, answer.T) and (np.diag(answer) == 1.0).all()
    if not sound or np.linalg.eigvalsh(answer)[0] < -_ROUNDING * size:
        raise InputError(source, "no correlations", expected="a symmetric matrix, ones on its diagonal, without "
                         "negative eigenvalues", place="correlation")  # fmt: skip
    return tuple(map(tuple, answer.tolist()))


def _vehicle(name: Any, source: str) -> str:
    if not isinstance(name, str) or len(name) > _LONGEST_NAME:
        raise InputError(source, shown(name), expected=f"a name of at most {_LONGEST_NAME} letters", place="vehicle")
    return name


def _effect(document: Any, schema: object, source: str, place: str) -> StoredEffect:
    further = {"probability"} if schema in (2, SCHEMA) else set()
    page = _table(document, {"slug", "form", "parameters", "constants"} | further, source, place)
    slug, form = page["slug"], page["form"]
    if not isinstance(form, str):
        raise InputError(source, f"form {shown(form)}", expected="text", place=place)
    if slug == UNKNOWN:
        slug, form = _FORMER.get(form, (slug, form))
    if not isinstance(slug, str) or slug not in SLUGS:
        raise InputError(source, f"effect {shown(slug)}", expected="one of " + ", ".join(SLUGS), place=place)
    known = [effect for effect in forms_by_name(slug, specimen(lugs_of(form))) if effect.form == form]
    if not known:
        raise InputError(source, f"form {form!r} of {slug}"[:120], expected="a form of the catalogue", place=place)
    names = set(page["parameters"]) if isinstance(page["parameters"], dict) else set()
    effect = smallest_form(form, names, known)
    if effect is None:
        wanted = " or ".join(", ".join(parameter.name for parameter in each.parameters) for each in known)
        raise InputError(source, f"parameters {sorted(map(str, names))}"[:120], expected=wanted, place=place)
    free = follows_drive(effect)
    parameters = {}
    for parameter in effect.parameters:
        if parameter.name not in names:
            continue
        bounds = (-math.inf, math.inf) if parameter.name in free else (parameter.low, parameter.high)
        where = f"{place}, {parameter.name}"
        parameters[parameter.name] = _estimated(page["parameters"][parameter.name], bounds, source, where)
    constants = _constants(page["constants"], effect, source, place)
    believed = page.get("probability")
    probability = math.nan if believed is None else _finite(believed, (0.0, 1.0), source, f"{place}, probability")
    return StoredEffect(slug, form, MappingProxyType(parameters), MappingProxyType(constants), probability)


def _constants(document: Any, effect: Effect, source: str, place: str) -> dict[str, float]:
    page = _table(document, set(effect.constants), source, f"{place}, constants")
    # Speeds and widths are divisors; times may have any value.
    lowest = {name: -math.inf if name.startswith("t_") else math.ulp(0.0) for name in effect.constants}
    return {
        name: _finite(page[name], (lowest[name], math.inf), source, f"{place}, constants, {name}") for name in page
    }  # fmt: skip


def _packed(entry: Estimate) -> dict[str, float | None]:
    """Give a number and its deviation without the unit, which the document's names state."""
    return {"value": float(entry.value), "sd": finite_or_none(entry.sd)}


def _table(document: Any, keys: set[str], source: str, place: str) -> dict[str, Any]:
    """Return a JSON object, which has to have exactly these keys."""
    if not isinstance(document, dict) or set(document) != keys:
        keys_found = sorted(map(str, document)) if isinstance(document, dict) else type(document).__name__
        raise InputError(
            source, f"{keys_found}"[:120], expected="an object with " + ", ".join(sorted(keys)), place=place
        )
    return document


def _estimated(document: Any, bounds: tuple[float, float], source: str, place: str) -> Estimate:
    page = _table(document, {"value", "sd"}, source, place)
    value = _finite(page["value"], bounds, source, place)
    sd = math.nan if page["sd"] is None else _finite(page["sd"], (0.0, math.inf), source, f"{place}, sd")
    return Estimate(value, sd)


def _finite(number: Any, bounds: tuple[float, float], source: str, place: str) -> float:
    low, high = bounds
    usable = isinstance(number, int | float) and not isinstance(number, bool)
    # Rounding in JSON and logarithms may exceed a bound slightly.
    slack = 1e-9 * max(abs(low) if math.isfinite(low) else 0.0, abs(high) if math.isfinite(high) else 0.0)
    if not usable or not -1e300 < number < 1e300 or not low - slack <= number <= high + slack:
        span = f"a number from {low:g} to {high:g}" if math.isfinite(low + high) else "a finite number in range"
        raise InputError(source, shown(number), expected=span, place=place)
    return min(max(float(number), low), high)
