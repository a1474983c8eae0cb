"""What every ground cell can bear at one normal stress and one confidence, computed once: an answer gathers from it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property

import numpy as np
from scipy.special import stdtr

from ..framework.core.evidence import UNKNOWN
from .belief import NO_PLACE, NOT_SEEN, Cells
from .mixture import MixtureTable
from .narrowing import WEAK, narrowed_by
from .posterior import ClassSoil

FAR_FROM_DRIVEN = 2.0
"""Beyond so many times the greatest normal stress driven, or as much below the least, strength is extrapolated [-]: the
bound holds the error of the line through c and tan phi there, and not that soils' strength bends away from it."""

EXTRAPOLATED = "the normal stress is far from those driven: the strength is extrapolated along a straight line"

LOW_BOUND = "the lower bound is less than half of the expected strength"

_ROUNDING = 1e-12
"""Rounding error of a sum of probabilities [-]."""


class GroundTable:
    """Columns over the m cells, each computed when first read, then one row for a place that is no number and one for
    ground that nobody has seen: the negative rows of `CellIndex.rows`.

    Parameters
    ----------
    cells
        Belief over the classes.
    class_names
        The k classes.
    soils
        Soil by class; a class whose soil was not measured is absent.
    normal_stress, confidence
        [Pa], [-].
    """

    def __init__(
        self, cells: Cells, class_names: Sequence[str], soils: Mapping[str, ClassSoil], normal_stress: float,
        confidence: float,
    ) -> None:  # fmt: skip
        self.cells, self.class_names, self.soils = cells, tuple(class_names), soils
        self.normal_stress, self.confidence = normal_stress, confidence
        self.has_soil = np.array([name in soils for name in class_names], dtype=bool)

    @cached_property
    def known(self) -> np.ndarray:
        """(m + 2,) bool: is the soil known? Classes without soil must weigh less than 1 - confidence."""
        lacking = self._lacking.sum(axis=1) <= 1.0 - self.confidence + _ROUNDING
        return _padded(self._recognised & lacking & bool(self.has_soil.any()), False)

    @cached_property
    def reason(self) -> np.ndarray:
        """(m + 2,) str: why the soil is not known; empty where it is."""
        code, first = self.cells.reason.copy(), len(self.cells.reasons)
        texts = [*self.cells.reasons, *(f"no soil data for class {name}" for name in self.class_names)]
        unmeasured = np.flatnonzero(self._recognised & ~self.known[:-2])
        if len(unmeasured):
            lacking = self._lacking[unmeasured]
            which = np.argmax(lacking, axis=1)
            code[unmeasured] = first + which
            # What is most probably another class only may be of this one: in steps of a thousandth there are few texts.
            unlikely = which != self.class_index[unmeasured]
            share = np.floor(1000.0 * lacking.sum(axis=1)).astype(int)
            found, text = np.unique(np.column_stack([which, share])[unlikely], axis=0, return_inverse=True)
            code[unmeasured[unlikely]] = len(texts) + text.ravel()
            texts += [self._may_be(each, thousandths) for each, thousandths in found.tolist()]
        texts += [NO_PLACE, NOT_SEEN]
        return np.array(texts, dtype=object)[np.append(code, [len(texts) - 2, len(texts) - 1])]

    @cached_property
    def class_index(self) -> np.ndarray:
        """(m + 2,) int: number of the most probable class, -1 where not seen or not recognised."""
        best = np.full(len(self.cells.key), -1, dtype=np.int16)
        seen = np.flatnonzero(np.isfinite(self.cells.probability).all(axis=1)) if self.class_names else []
        if len(seen):
            best[seen] = np.argmax(self.cells.probability[seen], axis=1)
        return _padded(best, -1)

    @cached_property
    def label(self) -> np.ndarray:
        """(m + 2,) str: the most probable class, or ``"unknown"``."""
        return np.array([*self.class_names, UNKNOWN], dtype=object)[self.class_index]

    @property
    def mean(self) -> np.ndarray:
        """(m + 2, 2): expected c [Pa] and tan phi [-]."""
        mean = np.array([self.soils[name].strength.mean for name in self._with_soil]).reshape(-1, 2)
        return self._filled(self._weight[0] @ mean)

    @cached_property
    def covariance(self) -> np.ndarray:
        """(m + 2, 2, 2): covariance of (c, tan phi) of the place."""
        strengths = [self.soils[name].strength for name in self._with_soil]
        second = [each.predictive_covariance + np.outer(each.mean, each.mean) for each in strengths]
        mean = self.mean[:-2]
        about = self._weight[0] @ np.reshape(second, (-1, 4)) - (mean[:, :, None] * mean[:, None, :]).reshape(-1, 4)
        return self._filled(about.reshape(-1, 2, 2))

    @cached_property
    def cohesion(self) -> np.ndarray:
        """(m + 2,): expected c [Pa]."""
        return np.ascontiguousarray(self.mean[:, 0])

    @cached_property
    def friction_angle(self) -> np.ndarray:
        """(m + 2,): phi of the expected tan phi [rad]."""
        return np.arctan(self.mean[:, 1])

    @cached_property
    def shear_strength(self) -> np.ndarray:
        """(m + 2,): expected c + sigma tan phi [Pa]."""
        return self.mean[:, 0] + self.normal_stress * self.mean[:, 1]

    @cached_property
    def shear_strength_lower(self) -> np.ndarray:
        """(m + 2,): what the shear strength exceeds with the confidence [Pa].

        The mass without soil counts as no strength at all: it takes its share of the 1 - confidence.
        """
        lower = np.full(len(self.cells.key), np.nan)
        if self._with_soil:
            gradient = np.array([1.0, self.normal_stress])
            predicted = [self.soils[name].strength.predict(gradient) for name in self._with_soil]
            location, scale, freedom = np.array(predicted).T
            table = MixtureTable.of_student(location, scale, freedom, 1.0 - self.confidence)
            weight, measured = self._weight
            level = 1.0 - self.confidence - (1.0 - measured)
            lower = np.maximum(table.lower_bound(weight * measured[:, None], level), 0.0)
        return self._filled(lower)

    @cached_property
    def extrapolated(self) -> np.ndarray:
        """(m + 2,) bool: is the normal stress far from those driven on a class that may well be there?"""
        far = np.array([self._far(self.soils[name]) for name in self._with_soil], dtype=bool)
        return _padded(np.any(self._weight[0][:, far] > 1.0 - self.confidence, axis=1), False)

    @cached_property
    def note(self) -> np.ndarray:
        """(m + 2,) str: what to know of what is known, `EXTRAPOLATED` and what holds a low bound down; else empty."""
        note = np.where(self.extrapolated, EXTRAPOLATED, "").astype(object)
        weak = np.flatnonzero(self.known & (self.shear_strength_lower < WEAK * self.shear_strength))
        if len(weak):
            gradient = np.array([1.0, self.normal_stress])
            soils = [self.soils[name] for name in self._with_soil]
            location, scale, freedom = np.array([soil.strength.predict(gradient) for soil in soils]).T
            # The class that has most of what lies below half of the expected strength.
            half = WEAK * self.shear_strength[weak]
            below = self._weight[0][weak] * stdtr(freedom, (half[:, None] - location) / scale)
            number = np.flatnonzero(self.has_soil)[np.argmax(below, axis=1)]
            likeliest = number == self.class_index[weak]
            for each in np.unique(number).tolist():
                name = self.class_names[each]
                why = f"{name} bounds it: {narrowed_by(self.soils[name], gradient, self.confidence)}"
                mixed = f"{why}; or look at this ground again, which is probably another class"
                mine = number == each
                for rows, text in ((mine & likeliest, why), (mine & ~likeliest, mixed)):
                    said = f"{LOW_BOUND}: {text}"
                    note[weak[rows]] = [f"{old}; {said}" if old else said for old in note[weak[rows]]]
        return note

    def _may_be(self, number: int, thousandths: int) -> str:
        """Why ground that is probably of another class is not known."""
        name, allowed = self.class_names[number], 100.0 * (1.0 - self.confidence)
        others = " or others without" if (~self.has_soil).sum() > 1 else ""
        return (
            f"no soil data for class {name}, and this may be {name}{others}: {thousandths / 10.0:.1f} %, where "
            f"{allowed:.4g} % are allowed; drive slowly on {name}, or look at this ground again"
        )

    @property
    def _recognised(self) -> np.ndarray:
        return self.cells.reason == 0

    @property
    def _with_soil(self) -> list[str]:
        return [name for name in self.class_names if name in self.soils]

    @property
    def _lacking(self) -> np.ndarray:
        """(m, k) probabilities of the classes without soil, zero elsewhere."""
        return np.where(self._recognised[:, None] & ~self.has_soil, self.cells.probability, 0.0)

    @property
    def _weight(self) -> tuple[np.ndarray, np.ndarray]:
        """Probabilities of the classes with soil among these, and their sum, (m,): 0 and 1 where unknown."""
        known = self.known[:-2]
        share = np.where(known[:, None], self.cells.probability[:, self.has_soil], 0.0)
        measured = np.where(known, np.minimum(share.sum(axis=1), 1.0), 1.0)
        return share / measured[:, None], measured

    def _filled(self, values: np.ndarray) -> np.ndarray:
        """Values of the cells, NaN where unknown, padded."""
        answer = _padded(values, np.nan)
        answer[~self.known] = np.nan
        return answer

    def _far(self, soil: ClassSoil) -> bool:
        """Whether the normal stress is beyond those driven by `FAR_FROM_DRIVEN`; False where these are not known."""
        least, greatest = soil.normal_stress_Pa
        return self.normal_stress > FAR_FROM_DRIVEN * greatest or self.normal_stress * FAR_FROM_DRIVEN < least


def _padded(values: np.ndarray, missing: float | bool) -> np.ndarray:
    return np.concatenate([values, np.full((2, *values.shape[1:]), missing, dtype=values.dtype)])
