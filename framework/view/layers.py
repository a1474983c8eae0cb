"""What the map colours cells by; the numbers are those that a planner is answered."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np

from ...database.answer import GroundAnswer
from ...database.snapshot import DEFAULT_NORMAL_STRESS, Snapshot
from ...database.speed import speed_limit_of_each
from ..core.pooling import cells_from_keys
from ..core.vehicle import Vehicle

DEFAULT_CONFIDENCE = 0.95

_UNITS = ((365.25 * 86400.0, "years"), (86400.0, "days"), (3600.0, "hours"), (60.0, "minutes"))
"""Units of age [s], and when each is used: from two of it on."""


@dataclass(frozen=True)
class Question:
    """What is asked of the ground.

    Parameters
    ----------
    normal_stress
        At which shear strength is wanted [Pa].
    confidence
        Of lower bounds [-].
    vehicle
        Whose speed is limited; None where none was chosen.
    sight_m, most_m_s
        Distance that it sees ahead [m], and its own greatest speed [m/s].
    """

    normal_stress: float = DEFAULT_NORMAL_STRESS
    confidence: float = DEFAULT_CONFIDENCE
    vehicle: Vehicle | None = None
    sight_m: float = 6.0
    most_m_s: float = 5.0


@dataclass(frozen=True)
class Layer:
    """One number of each of m cells, as the map shows it.

    Parameters
    ----------
    title
        What it is, with unit and conditions.
    unit
        Empty for classes.
    values : (m,)
        In that unit, or the number of the class; NaN where unknown.
    shown
        What a pixel shows that covers several cells: the ``"least"`` or the ``"greatest"`` of their values, or the
        class that ``"most"`` of them are of.
    low, high
        Ends of the colour scale; both 0 where nothing is known.
    """

    title: str
    unit: str
    values: np.ndarray
    shown: Literal["least", "greatest", "most"]
    low: float = 0.0
    high: float = 0.0

    @property
    def unknown(self) -> np.ndarray:
        """(m,) bool: where there is no number."""
        return np.isnan(self.values)

    def text(self, row: int) -> str:
        """Write the number of a cell with its unit; ``"unknown"`` where there is none."""
        value = float(self.values[row])
        return "unknown" if np.isnan(value) else f"{value:.3g} {self.unit}"


LAYERS: Mapping[str, str] = {
    "class": "class of ground",
    "confidence": "confidence in the class",
    "age": "age of the newest look",
    "strength": "shear strength, lower bound",
    "speed": "speed limit of a vehicle",
}
"""Layers by name, with what they are called."""


def layer(snapshot: Snapshot, name: str, question: Question) -> Layer:
    """Compute a layer for all cells of a snapshot, in their order.

    Raises
    ------
    InputError
        A stress, confidence or other number out of range, or a vehicle without wheels or load.
    """
    centres = (cells_from_keys(snapshot.cells.key) + 0.5) * snapshot.cell_size_m
    answer = snapshot.along(centres, normal_stress=question.normal_stress, confidence=question.confidence)
    return _OF[name](answer, question)


def _class(answer: GroundAnswer, question: Question) -> Layer:
    return Layer("class of ground", "", np.where(answer.class_index >= 0, answer.class_index, np.nan), "most")


def _confidence(answer: GroundAnswer, question: Question) -> Layer:
    best = 100.0 * answer.class_probability.max(axis=1, initial=-np.inf)
    least = 100.0 / max(len(answer.class_names), 1)
    values = np.where(answer.class_index >= 0, best, np.nan)
    return Layer("probability of the most probable class", "%", values, "least", least, 100.0)


def _age(answer: GroundAnswer, question: Question) -> Layer:
    oldest = np.nanmax(answer.age, initial=0.0)
    scale, unit = next((each for each in _UNITS if oldest >= 2.0 * each[0]), _UNITS[-1])
    return _scaled("time since the newest look", unit, answer.age / scale, "greatest")


def _strength(answer: GroundAnswer, question: Question) -> Layer:
    title = (
        f"shear strength at {question.normal_stress / 1e3:g} kPa normal stress, lower bound at "
        f"{100 * question.confidence:g} %"
    )
    return _scaled(title, "kPa", answer.shear_strength_lower / 1e3, "least")


def _speed(answer: GroundAnswer, question: Question) -> Layer:
    if question.vehicle is None:
        return Layer("speed limit: choose a vehicle", "m/s", np.full(len(answer), np.nan), "least")
    found = speed_limit_of_each(
        answer, question.vehicle, sight_m=question.sight_m, most_m_s=question.most_m_s
    ).limit_m_s  # fmt: skip
    title = (
        f"speed from which {question.vehicle.name} stops within {question.sight_m:g} m, at most {question.most_m_s:g} "
        f"m/s, lower bound at {100 * question.confidence:g} %"
    )
    return _scaled(title, "m/s", found, "least")


def _scaled(title: str, unit: str, values: np.ndarray, shown: Literal["least", "greatest"]) -> Layer:
    """Give a layer whose colour scale reaches from zero to the greatest value."""
    finite = values[np.isfinite(values)]
    return Layer(title, unit, np.where(np.isfinite(values), values, np.nan), shown, 0.0, float(finite.max(initial=0.0)))


_OF: Mapping[str, Callable[[GroundAnswer, Question], Layer]] = {
    "class": _class, "confidence": _confidence, "age": _age, "strength": _strength, "speed": _speed,
}  # fmt: skip
