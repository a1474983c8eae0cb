"""The soil differs over a stretch of the track."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ....framework.core.track.place import coordinate
from ..effect import Contact, Drive, Effect, Parameter, Situation
from ..registry import register

_ALONG = {"place": "place_m", "time": "time_s", "x": "x_m", "y": "y_m"}
"""What a patch may lie along, by the form's name, and the covariate that locates a sample."""

_SYMBOL = {"place": "x", "time": "t"}
"""Symbol of a form's covariate, where it is not the form's name."""

CELLS = 200
"""Cells of the track between which the edges of a patch are searched."""

_EDGE = 0.003
"""Width of a patch's edges as a share of the track [-]: sharp, yet with a derivative."""

_ALONG_AXIS, _OBLIQUE = 0.5, 0.02
"""Direction cosine of the track along an axis, and scatter of the positions along that axis between lanes as a share of
the track's length, above which positions along the axis are considered too [-]."""

_FACTOR = "engineering judgement: places of one site differ by factors of 1.3 to 1.7"
_PLACE = "engineering judgement: anywhere along the track"

_FURTHER = {
    ", cohesion apart": (Parameter("C", "", -3.0, 3.0, 0.0, 0.5, _FACTOR),),
    ", another class": (
        Parameter("C", "", -3.0, 3.0, 0.0, 0.5, _FACTOR),
        Parameter("D", "", -3.0, 3.0, 0.0, 0.5, _FACTOR),
        Parameter("E", "", -1.0, 1.0, 0.0, 0.3, _FACTOR),
    ),
}
"""Further parameters by the end of the form's name: of cohesion, of the shear modulus, of the exponent."""

_EQUATION = {
    "": "ln strength += B",
    ", cohesion apart": "ln tan phi += B, ln c += B + C",
    ", another class": "ln tan phi += B, ln c += B + C, ln k += D, ln n += E",
}


@register
class SoilPatch(Effect):
    """Between two places the soil differs."""

    slug = "soil_patch"
    title = "soil patch"
    what_happens = "the soil differs over a stretch of the track"
    check = "drive the same stretch again, and sample the soil inside and outside of it"
    nested = False
    of_ground = True
    belongs_to = "ground"
    by_place = True
    of_one_drive = True
    source = "definition"
    required = ("from", "to")
    change = (
        Parameter("A", "", -3.0, 3.0, 0.0, 0.5, _FACTOR), Parameter("B", "", -2.0, 2.0, 0.0, 0.3, _FACTOR),
    )  # fmt: skip
    """Differences of ln stiffness and ln strength."""

    def __init__(
        self, along: str, values: np.ndarray, starts: Sequence[np.ndarray] = (), *, further: str = "", among: int = 1
    ) -> None:
        self.choices = among
        self.form = along + further
        self.equation = f"from < {_SYMBOL.get(along, along)} < to: ln stiffness += A, {_EQUATION[further]}"
        self._along = _ALONG[along]
        low, high = float(np.nanmin(values)), float(np.nanmax(values))
        unit = "s" if along == "time" else "m"
        wide = high - low
        # A wheel at standstill has no track: its one place is inside or outside.
        edge = max(_EDGE * wide, 1e-9)
        self.constants = {"edge": edge}
        self.needs = (self._along,)
        self._starts = [np.concatenate([start, np.zeros(len(_FURTHER.get(further, ())))]) for start in starts]
        self.parameters = (
            *self.change,
            Parameter("from", unit, low - edge, high, low + 0.4 * wide, wide, _PLACE, null=low + 0.4 * wide),
            Parameter("to", unit, low, high + edge, low + 0.6 * wide, wide, _PLACE, null=low + 0.6 * wide),
            *_FURTHER.get(further, ()),
        )
        self._further: list[Effect] = (
            [] if further else [SoilPatch(along, values, starts, further=each, among=among) for each in _FURTHER]
        )

    @classmethod
    def forms(cls, situation: Situation) -> Sequence[Effect]:
        """Give the forms that these data can show, starting where the ground seems to differ."""
        drive, tracks = situation.drive, tracks_of(situation.drive)
        form = {name: along for along, name in _ALONG.items()}
        return [
            cls(form[name], getattr(drive, name), situation.places.get(name, ()), among=len(tracks)) for name in tracks
        ]

    @classmethod
    def forms_by_name(cls, situation: Situation) -> Sequence[Effect]:
        """Give the forms along the track, in time, or along an axis."""
        drive = situation.drive
        return [cls(along, getattr(drive, name)) for along, name in _ALONG.items() if drive.has(name)]

    def starts(self) -> list[np.ndarray]:
        return list(self._starts)

    def extent(self, values: np.ndarray) -> tuple[str, float, float]:
        return self._along, float(values[2]), float(values[3])

    def extensions(self) -> list[Effect]:
        return list(self._further)

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
    """Attributes of the drive along which a patch may lie: the track, or time where that is not known.

    Either axis, too, where the track turns, for what lies across its legs is no one interval along it, or where its
    lanes are oblique to the axis: a patch need not begin at right angles to them.
    """
    present = [name for name in ("place_m", "time_s") if drive.has(name) and (drive.timed or name == "place_m")]
    return present[:1] + [
        name
        for index, name in enumerate(("x_m", "y_m"))
        if drive.timed and drive.has(name) and (drive.axis is None or _oblique(drive, drive.axis[index], name))
    ]


def _oblique(drive: Drive, cosine: float, name: str) -> bool:
    """Say whether lanes are oblique to an axis with which the track has a direction `cosine`."""
    if abs(cosine) < _ALONG_AXIS or not drive.has("place_m") or coordinate(drive.axis) != "distance_m":
        return False
    away = getattr(drive, name) - cosine * drive.place_m
    return float(np.nanstd(away)) > _OBLIQUE * float(np.nanmax(drive.place_m) - np.nanmin(drive.place_m))
