"""The soil itself is another over a stretch of the track."""

from __future__ import annotations

import math
from copy import copy

import numpy as np

from .effect import Contact, Drive, Effect, Parameter, Situation

_GRID = 40
_SOFT_EDGE, _OTHER_EDGES = 0.01, (0.001, 0.003, 0.03)
"""Width of a patch's edges as a share of the track: sharp, yet with a derivative; and others, once it is found [-]."""


class SoilPatch(Effect):
    """Between two places stiffness and strength are others."""

    slug = "soil_patch"
    nested = False
    local = True
    sought = 2.0 * math.log(_GRID)
    equation = "from < x < to: ln stiffness += A, ln strength += B"
    source = "definition"
    required = ("from", "to")

    def __init__(self, along: str, drive: Drive, candidates: list[tuple[float, float]]) -> None:
        self.form = along
        self._along = "place_m" if along == "place" else "time_s"
        values = getattr(drive, self._along)
        low, high = float(np.nanmin(values)), float(np.nanmax(values))
        unit = "m" if along == "place" else "s"
        # A standing wheel has no track: its one place is inside or outside, sharply.
        self._long = high - low
        edge = max(_SOFT_EDGE * (high - low), 1e-9)
        self.constants = {"edge": edge}
        self.needs = (self._along,)
        self._candidates = candidates
        wide = high - low
        self.parameters = (
            Parameter("A", "", -3.0, 3.0, 0.0, 0.5),
            Parameter("B", "", -2.0, 2.0, 0.0, 0.3),
            Parameter("from", unit, low - edge, high, low + 0.4 * wide, wide, low + 0.4 * wide),
            Parameter("to", unit, low, high + edge, low + 0.6 * wide, wide, low + 0.6 * wide),
        )

    def starts(self) -> list[np.ndarray]:
        return [np.array([0.0, 0.0, start, end]) for start, end in self._candidates]

    def variants(self) -> list[Effect]:
        answer: list[Effect] = []
        for share in _OTHER_EDGES:
            other = copy(self)
            other.constants = {"edge": max(share * self._long, 1e-9)}
            answer.append(other)
        return answer

    def contact(self, contact: Contact, drive: Drive, values: np.ndarray) -> None:
        where, edge = getattr(drive, self._along), self.constants["edge"]
        with np.errstate(over="ignore"):
            inside = 1.0 / (1.0 + np.exp(-(where - values[2]) / edge))
            inside = inside / (1.0 + np.exp((where - values[3]) / edge))
        inside = np.where(np.isfinite(where), inside, 0.0)
        contact.stiffness_Pa = contact.stiffness_Pa * np.exp(values[0] * inside)
        factor = np.exp(values[1] * inside)
        contact.c_Pa, contact.tan_phi = contact.c_Pa * factor, contact.tan_phi * factor


def forms(situation: Situation) -> tuple[Effect, ...]:
    """Give the forms that these data can show, starting where the residuals' level changes."""
    drive = situation.drive
    along = "place" if drive.has("place_m") else "time" if drive.has("time_s") else ""
    if not along:
        return ()
    where = drive.place_m if along == "place" else drive.time_s
    return (SoilPatch(along, drive, _stretches_apart(where, situation.residuals)),)


def named(situation: Situation) -> tuple[Effect, ...]:
    """Give the forms that a simulation may ask for: along the track, or in time."""
    drive = situation.drive
    along = (("place", "place_m"), ("time", "time_s"))
    return tuple(SoilPatch(form, drive, []) for form, name in along if drive.has(name))


def _stretches_apart(where: np.ndarray, residuals: np.ndarray) -> list[tuple[float, float]]:
    """Two stretches over which the residuals' means differ most from elsewhere, for starts.

    All pairs of edges on a grid are compared by the gain of a piecewise constant mean (one change up, one back).
    """
    low, high = float(np.nanmin(where)), float(np.nanmax(where))
    edges = np.linspace(low, high, _GRID + 1)
    cell = np.clip(np.searchsorted(edges, where, side="right") - 1, 0, _GRID - 1)
    gain = np.zeros((_GRID + 1, _GRID + 1))
    for column in residuals.T:
        seen = np.isfinite(column) & np.isfinite(where)
        if not seen.any():
            continue
        sums = np.concatenate([[0.0], np.cumsum(np.bincount(cell[seen], column[seen], _GRID))])
        counts = np.concatenate([[0.0], np.cumsum(np.bincount(cell[seen], minlength=_GRID))])
        inner, size = sums[None, :] - sums[:, None], counts[None, :] - counts[:, None]
        outer, rest = sums[-1] - inner, counts[-1] - size
        with np.errstate(invalid="ignore", divide="ignore"):
            gain += np.nan_to_num(inner**2 / size) + np.nan_to_num(outer**2 / rest) - sums[-1] ** 2 / counts[-1]
    width = np.arange(_GRID + 1)[None, :] - np.arange(_GRID + 1)[:, None]
    gain = np.where((width >= 2) & (width <= 0.9 * _GRID), gain, -np.inf)
    answer = []
    for _ in range(2):
        start, end = np.unravel_index(int(np.argmax(gain)), gain.shape)
        answer.append((float(edges[start]), float(edges[end])))
        gain[max(start - 4, 0) : start + 5, max(end - 4, 0) : end + 5] = -np.inf
    return answer
