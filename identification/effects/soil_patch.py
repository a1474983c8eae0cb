"""The soil itself is another over a stretch of the track."""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy

import numpy as np

from ...framework.core.track.place import coordinate
from .effect import Contact, Drive, Effect, Parameter, Situation

_ALONG = {"place": "place_m", "time": "time_s", "x": "x_m", "y": "y_m"}
"""What a patch may lie along, by its form's name, and the covariate that says where a sample is."""

_SYMBOL = {"place": "x", "time": "t"}
"""That of a form's covariate, where it is not the form's name."""

CELLS = 200
"""Cells of the track between which a patch's edges are sought."""

_EDGES = 0.003, 0.01, 0.001, 0.03
"""Widths of a patch's edges as a share of the track [-]: sharp, yet with a derivative; not so sharp; and others."""

_ALONG_AXIS, _ASLANT = 0.5, 0.02
"""Share of the way that a track has to go along an axis, and of its length by which places along that axis differ
between its lanes, from which on they are places of their own [-]."""

_FURTHER = {
    ", cohesion apart": (Parameter("C", "", -3.0, 3.0, 0.0, 0.5),),
    ", another class": (
        Parameter("C", "", -3.0, 3.0, 0.0, 0.5),
        Parameter("D", "", -3.0, 3.0, 0.0, 0.5),
        Parameter("E", "", -1.0, 1.0, 0.0, 0.3),
    ),
}
"""What else is another there, by the end of the form's name: of cohesion, of the shear modulus, of the exponent."""

_EQUATION = {
    "": "ln strength += B",
    ", cohesion apart": "ln tan phi += B, ln c += B + C",
    ", another class": "ln tan phi += B, ln c += B + C, ln k += D, ln n += E",
}


class SoilPatch(Effect):
    """Between two places the soil is another."""

    slug = "soil_patch"
    nested = False
    local = True
    edges = slice(2, 4)
    of_ground = True
    source = "definition"
    required = ("from", "to")
    change = Parameter("A", "", -3.0, 3.0, 0.0, 0.5), Parameter("B", "", -2.0, 2.0, 0.0, 0.3)
    """What is another there."""

    def __init__(
        self, along: str, values: np.ndarray, starts: Sequence[np.ndarray] = (), *, further: str = "", among: int = 1
    ) -> None:
        self.choices = among
        self.form = along + further
        self.freed = bool(further)
        self.equation = f"from < {_SYMBOL.get(along, along)} < to: ln stiffness += A, {_EQUATION[further]}"
        self._along = _ALONG[along]
        low, high = float(np.nanmin(values)), float(np.nanmax(values))
        unit = "s" if along == "time" else "m"
        # A standing wheel has no track: its one place is inside or outside, sharply.
        self._long = high - low
        edge = max(_EDGES[0] * (high - low), 1e-9)
        self.constants = {"edge": edge}
        self.needs = (self._along,)
        self._starts = [np.concatenate([start, np.zeros(len(_FURTHER.get(further, ())))]) for start in starts]
        wide = high - low
        self.parameters = (
            *self.change,
            Parameter("from", unit, low - edge, high, low + 0.4 * wide, wide, low + 0.4 * wide),
            Parameter("to", unit, low, high + edge, low + 0.6 * wide, wide, low + 0.6 * wide),
            *_FURTHER.get(further, ()),
        )
        self._freer = (
            [] if further else [SoilPatch(along, values, starts, further=each, among=among) for each in _FURTHER]
        )

    def starts(self) -> list[np.ndarray]:
        return list(self._starts)

    def extent(self, values: np.ndarray) -> tuple[str, float, float]:
        return self._along, float(values[2]), float(values[3])

    def variants(self) -> list[Effect]:
        answer: list[Effect] = []
        for edge in (max(share * self._long, 1e-9) for share in _EDGES):
            if edge != self.constants["edge"]:
                other = copy(self)
                other.constants = {"edge": edge}
                answer.append(other)
        return answer

    def freer(self) -> list[Effect]:
        answer: list[Effect] = []
        for each in self._freer:
            other = copy(each)
            other.constants = self.constants
            answer.append(other)
        return answer

    def contact(self, contact: Contact, drive: Drive, values: np.ndarray) -> None:
        where, edge = getattr(drive, self._along), self.constants["edge"]
        with np.errstate(over="ignore"):
            inside = 1.0 / (1.0 + np.exp(-(where - values[2]) / edge))
            inside = inside / (1.0 + np.exp((where - values[3]) / edge))
        inside = np.where(np.isfinite(where), inside, 0.0)
        contact.stiffness_Pa = contact.stiffness_Pa * np.exp(values[0] * inside)
        contact.tan_phi = contact.tan_phi * np.exp(values[1] * inside)
        cohesion, modulus, exponent = (*values[4:], 0.0, 0.0, 0.0)[:3]
        contact.c_Pa = contact.c_Pa * np.exp((values[1] + cohesion) * inside)
        contact.k_m = contact.k_m * np.exp(modulus * inside)
        contact.n = contact.n * np.exp(exponent * inside)


def tracks_of(drive: Drive) -> list[str]:
    """What a patch may lie along, attributes of the drive: the track, the clock where that is not known, and either
    axis where the track turns, for what lies across its legs is no one place along it, or where its lanes lie aslant
    to the axis: another soil need not begin square to them.
    """
    present = [name for name in ("place_m", "time_s") if drive.has(name) and (drive.timed or name == "place_m")]
    return present[:1] + [
        name
        for index, name in enumerate(("x_m", "y_m"))
        if drive.timed and drive.has(name) and (drive.axis is None or _aslant(drive, drive.axis[index], name))
    ]


def _aslant(drive: Drive, share: float, name: str) -> bool:
    """Say whether places along an axis, a `share` of which the track goes along, are others in each of its lanes."""
    if abs(share) < _ALONG_AXIS or not drive.has("place_m") or coordinate(drive.axis) != "distance_m":
        return False
    away = getattr(drive, name) - share * drive.place_m
    return float(np.nanstd(away)) > _ASLANT * float(np.nanmax(drive.place_m) - np.nanmin(drive.place_m))


def forms(situation: Situation) -> tuple[Effect, ...]:
    """Give the forms that these data can show, starting where the ground seems to be another."""
    drive, form, tracks = situation.drive, {name: along for along, name in _ALONG.items()}, tracks_of(situation.drive)
    return tuple(
        SoilPatch(form[name], getattr(drive, name), situation.places.get(name, ()), among=len(tracks))
        for name in tracks
    )


def named(situation: Situation) -> tuple[Effect, ...]:
    """Give the forms that a simulation may ask for: along the track, in time, or along an axis."""
    drive = situation.drive
    return tuple(SoilPatch(along, getattr(drive, name)) for along, name in _ALONG.items() if drive.has(name))
