"""What a snapshot answers: n places, each known or unknown with a reason."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..framework.core.evidence import UNKNOWN
from ..framework.core.vehicle import Vehicle
from .mixture import MixtureTable
from .posterior import ClassSoil

if TYPE_CHECKING:
    from .mobility import DrawbarPull, Mobility
    from .snapshot import Snapshot


FAR_FROM_DRIVEN = 2.0
"""Beyond so many times the greatest normal stress driven, or as much below the least, strength is extrapolated [-]: the
bound holds the error of the line through c and tan phi there, and not that soils' strength bends away from it."""


@dataclass(frozen=True)
class StrengthTable:
    """Every class's soil at one normal stress and one confidence, ready for mixing.

    Parameters
    ----------
    normal_stress
        [Pa].
    confidence
        [-].
    has_soil : (k,) bool
        Has soil of this class been measured?
    mean : (k, 2)
        (c [Pa], tan phi [-]); zero where there is no soil, which then has no weight.
    second_moment : (k, 4)
        Covariance of a new place plus the mean's outer product, flattened.
    mixture
        Distribution of the shear strength by class, only of those with soil; None where no class has.
    extrapolated : (k,) bool
        Is the normal stress far from those driven on this class (`FAR_FROM_DRIVEN`)?
    """

    normal_stress: float
    confidence: float
    has_soil: np.ndarray
    mean: np.ndarray
    second_moment: np.ndarray
    mixture: MixtureTable | None
    extrapolated: np.ndarray

    @staticmethod
    def of(
        class_names: Sequence[str], soils: Mapping[str, ClassSoil], normal_stress: float, confidence: float
    ) -> StrengthTable:
        """Tabulate."""
        has_soil = np.array([name in soils for name in class_names], dtype=bool)
        mean, second = np.zeros((len(class_names), 2)), np.zeros((len(class_names), 4))
        gradient = np.array([1.0, normal_stress])
        predicted = []
        for index in np.flatnonzero(has_soil).tolist():
            strength = soils[class_names[index]].strength
            mean[index] = strength.mean
            second[index] = (strength.predictive_covariance + np.outer(strength.mean, strength.mean)).ravel()
            predicted.append(strength.predict(gradient))
        mixture = None
        if predicted:
            location, scale, freedom = np.array(predicted).T
            mixture = MixtureTable.of_student(location, scale, freedom, 1.0 - confidence)
        far = np.array([name in soils and _far(normal_stress, soils[name]) for name in class_names], dtype=bool)
        return StrengthTable(normal_stress, confidence, has_soil, mean, second, mixture, far)


def _far(normal_stress: float, soil: ClassSoil) -> bool:
    """Say whether a normal stress [Pa] is far from those driven; where these are not known, nobody can say so."""
    least, greatest = soil.normal_stress_Pa
    return normal_stress > FAR_FROM_DRIVEN * greatest or normal_stress * FAR_FROM_DRIVEN < least


@dataclass(frozen=True)
class GroundAnswer:
    """What is known of n places, read-only. Numbers are NaN where nothing is known, with the reason.

    Parameters
    ----------
    x, y : (n,)
        The places [m]; centres of cells where a region was requested.
    known : (n,) bool
        Is the soil known? Classes whose soil was not measured must weigh less than 1 - confidence.
    reason : (n,) str
        Why not; empty where known.
    class_names
        The k classes.
    class_probability : (n, k)
        Belief over classes [-]; NaN where the ground was not seen or not recognised.
    cohesion, friction_angle : (n,)
        Expected c [Pa], and phi [rad] of the expected tan phi.
    covariance : (n, 2, 2)
        Covariance of (c, tan phi) of this place: which class it is, what place of its class, how well that is known.
    shear_strength, shear_strength_lower : (n,)
        Expected c + sigma tan phi, and its lower bound at the confidence [Pa]. The bound is that of the mixture of
        classes, each a Student t (few stretches bound little); classes without soil count as no strength.
    age : (n,)
        Time since the newest look [s]; NaN where unknown.
    observation_count : (n,) int
        Number of drives that recognised the place.
    normal_stress, confidence
        As requested [Pa], [-].
    """

    x: np.ndarray
    y: np.ndarray
    known: np.ndarray
    reason: np.ndarray
    class_names: tuple[str, ...]
    class_probability: np.ndarray
    cohesion: np.ndarray
    friction_angle: np.ndarray
    covariance: np.ndarray
    shear_strength: np.ndarray
    shear_strength_lower: np.ndarray
    age: np.ndarray
    observation_count: np.ndarray
    normal_stress: float
    confidence: float
    snapshot: Snapshot

    def __post_init__(self) -> None:
        for entry in fields(self):
            value = getattr(self, entry.name)
            if isinstance(value, np.ndarray):
                value.setflags(write=False)

    def __len__(self) -> int:
        return len(self.x)

    @property
    def soil_weight(self) -> np.ndarray:
        """Class probabilities among the classes with soil, (n, k), summing to one; zero where unknown."""
        table = self.snapshot._table(self.normal_stress, self.confidence)
        return _soil_weight(self.class_probability, self.known, table)[0]

    @property
    def extrapolated(self) -> np.ndarray:
        """(n,) bool: is the normal stress far from those driven on a class that may well be here?"""
        table = self.snapshot._table(self.normal_stress, self.confidence)
        return np.any(self.soil_weight[:, table.extrapolated] > 1.0 - self.confidence, axis=1)

    def labels(self) -> list[str]:
        """Give the most probable class of each place, or ``"unknown"``."""
        if not self.class_names:
            return [UNKNOWN] * len(self)
        seen = np.all(np.isfinite(self.class_probability), axis=1)
        best = np.argmax(np.where(seen[:, None], self.class_probability, 0.0), axis=1)
        return [self.class_names[index] if known else UNKNOWN for index, known in zip(best, seen, strict=True)]

    def drawbar_pull(
        self, vehicle: Vehicle | str | Path, slip: float, *, load_N: float | Sequence[float] | None = None
    ) -> DrawbarPull:
        """Predict the vehicle's drawbar pull at each place and slip; see `mobility.drawbar_pull`."""
        from .mobility import drawbar_pull

        return drawbar_pull(self, vehicle, slip, load_N)

    def mobility(self, vehicle: Vehicle | str | Path, *, load_N: float | Sequence[float] | None = None) -> Mobility:
        """Predict whether and how well the vehicle moves at each place; see `mobility.mobility`."""
        from .mobility import mobility

        return mobility(self, vehicle, load_N)

    @staticmethod
    def of(
        snapshot: Snapshot,
        table: StrengthTable,
        places: tuple[np.ndarray, np.ndarray],
        probability: np.ndarray,
        why: tuple[np.ndarray, tuple[str, ...]],
        age: np.ndarray,
        looks: np.ndarray,
    ) -> GroundAnswer:
        """Mix the classes' soils at n places by their class probabilities (n, k).

        `why` holds for each place an index into texts: the empty first one where the class is known.
        """
        code, texts = why
        recognised = code == 0
        names = snapshot.class_names
        filled = np.where(recognised[:, None], probability, 0.0)
        missing = filled * ~table.has_soil
        known = recognised & (missing.sum(axis=1) <= 1.0 - table.confidence + 1e-12) & bool(table.has_soil.any())
        if names:
            code = np.where(recognised & ~known, len(texts) + np.argmax(missing, axis=1), code)
        reasons = np.array([*texts, *(f"no soil data for class {name}" for name in names)], dtype=object)
        weight, measured = _soil_weight(probability, known, table)
        mean = weight @ table.mean
        covariance = weight @ table.second_moment - (mean[:, :, None] * mean[:, None, :]).reshape(-1, 4)
        strength = mean[:, 0] + table.normal_stress * mean[:, 1]
        lower = np.full(len(known), np.nan)
        if table.mixture is not None:
            # The mass without soil counts as no strength at all: it takes its share of the 1 - confidence.
            level = 1.0 - table.confidence - (1.0 - measured)
            bound = table.mixture.lower_bound((weight * measured[:, None])[:, table.has_soil], level)
            lower = np.maximum(bound, 0.0)
        unknown = ~known
        mean[unknown] = covariance[unknown] = strength[unknown] = lower[unknown] = np.nan
        return GroundAnswer(
            x=np.array(places[0]),  # a copy: the caller's path stays the caller's
            y=np.array(places[1]),
            known=known,
            reason=reasons[code],
            class_names=names,
            class_probability=probability,
            cohesion=mean[:, 0],
            friction_angle=np.arctan(mean[:, 1]),
            covariance=covariance.reshape(-1, 2, 2),
            shear_strength=strength,
            shear_strength_lower=lower,
            age=age,
            observation_count=looks,
            normal_stress=table.normal_stress,
            confidence=table.confidence,
            snapshot=snapshot,
        )


def _soil_weight(probability: np.ndarray, known: np.ndarray, table: StrengthTable) -> tuple[np.ndarray, np.ndarray]:
    """Probabilities among the classes with soil, (n, k), and the mass of those classes, (n,): 0 and 1 where unknown."""
    share = np.where(known[:, None] & table.has_soil, probability, 0.0)
    measured = share.sum(axis=1)
    measured = np.where(known, np.minimum(measured, 1.0), 1.0)
    return share / measured[:, None], measured
