"""Variables that a residual may depend on, and basis functions of them."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from ...framework.core.track.place import coordinate
from ..effects.catalogue.soil_patch import tracks_of
from ..effects.effect import Drive
from .samples import Samples

_NAMES = {
    "slip": "slip",
    "load_N": "load_N",
    "rim_speed_m_s": "rim_speed_m_s",
    "travel_speed_m_s": "travel_speed_m_s",
    "pitch_rad": "pitch_rad",
    "pass": "pass_number",
    "acceleration_m_s2": "acceleration_m_s2",
    "angular_acceleration_rad_s2": "angular_acceleration_rad_s2",
    "x_m": "place_m",
    "time_s": "time_s",
}
"""Public name of a variable, and the attribute of `Drive` that holds it."""

_TURNING = {"distance_m": "place_m", "x_m": "x_m", "y_m": "y_m"}
"""The same for positions where the track turns, or does not run along x."""

CONSTANT = "constant"
"""Public name of an offset: it depends on no variable."""

LAG = "lag_s"
"""Public name of a delay: a residual in proportion to a channel's rate of change."""

_ORDER = (
    CONSTANT, "slip", "load_N", "sinkage_m", "pitch_rad", "wheel_angle_rad", "pass", LAG, "rim_speed_m_s",
    "travel_speed_m_s", "x_m", "y_m", "distance_m", "acceleration_m_s2", "angular_acceleration_rad_s2", "time_s",
)  # fmt: skip
"""Variables in order of preference among those that explain a misfit equally well."""

_BINS = 10
_LEAST_IN_BIN = 4
MOST_CYCLES = 60

_RATIO_SCALE, _HELD = ("load_N", "rim_speed_m_s", "travel_speed_m_s"), 0.02
"""Variables on a ratio scale, and the variation relative to the median below which they are held constant [-]."""

_LEAST_ACCELERATION_M_S2 = 1e-3
"""Negligible acceleration of the wheel or its rim: a ten-thousandth of the weight [m/s^2]."""


@dataclass(frozen=True)
class Variable:
    """A variable: its values (n,), and the edges (k + 1,) of the cells that it is divided into."""

    name: str
    values: np.ndarray
    edges: np.ndarray


def variables(samples: Samples, sinkage_m: np.ndarray) -> list[Variable]:
    """Return the variables that vary in these samples.

    Sinkage is the predicted one, (n,) [m]: the measured one has errors in common with the residuals.
    """
    answer = []
    for name, attribute in names_of(samples.drive).items():
        values = getattr(samples.drive, attribute)
        if not samples.drive.has(attribute) or (name in _RATIO_SCALE and _is_held(values)):
            continue
        if not _is_negligible(name, values, samples.wheel.radius_m):
            answer.append(Variable(name, values, _edges(values)))
    carried = sinkage_m[np.isfinite(sinkage_m)]
    if carried.size and np.ptp(carried) > 0.0:
        answer.append(Variable("sinkage_m", sinkage_m, _edges(sinkage_m)))
    return answer


def _is_held(values: np.ndarray) -> bool:
    """Return whether a variable (n,) on a ratio scale is held constant."""
    low, middle, high = np.nanquantile(np.abs(values), [0.05, 0.5, 0.95])
    return bool(high - low < _HELD * middle)


def _is_negligible(name: str, values: np.ndarray, radius_m: float) -> bool:
    """Return whether a variable (n,) is an acceleration that is negligible throughout."""
    lever_m = {"acceleration_m_s2": 1.0, "angular_acceleration_rad_s2": radius_m}.get(name)
    return lever_m is not None and bool(np.nanmax(np.abs(values)) * lever_m < _LEAST_ACCELERATION_M_S2)


def names_of(drive: Drive) -> dict[str, str]:
    """Public names of the variables of a drive, and the attribute of `Drive` that holds each."""
    if drive.axis is None:
        return _NAMES | _TURNING
    aslant = {name: name for name in tracks_of(drive) if name in _TURNING}
    others = {name: attribute for name, attribute in _NAMES.items() if name != "x_m"}
    return others | {coordinate(drive.axis): "place_m"} | aslant


def public_name(drive: Drive, attribute: str) -> str:
    """Public name of the variable that an attribute of a drive holds."""
    return next(name for name, held in names_of(drive).items() if held == attribute)


def rank(name: str, through: Collection[str]) -> int:
    """Rank a variable among those that explain a misfit equally well: those that a fitted effect depends on, first.

    Parameters
    ----------
    name
        Public name.
    through
        Attributes of `Drive` that the fitted effects need.
    """
    order = _ORDER.index(name)
    names = {name, _NAMES.get(name, name), "place_m" if name in _TURNING else name}
    of_effect = not names.isdisjoint(through) or (name == LAG and "time_s" in through)
    return order - len(_ORDER) if of_effect else order


def _edges(values: np.ndarray) -> np.ndarray:
    """Edges of cells: between levels if these are few, else quantiles."""
    known = np.sort(values[np.isfinite(values)])
    span = known[-1] - known[0]
    gaps = np.flatnonzero(np.diff(known) > 0.04 * span)
    if len(gaps) < _BINS:
        starts = np.concatenate([[0], gaps + 1, [len(known)]])
        widths = [np.ptp(known[low:high]) for low, high in pairwise(starts)]
        if len(gaps) and max(widths) < 0.25 * span and min(np.diff(starts)) >= _LEAST_IN_BIN:
            middles = 0.5 * (known[gaps] + known[gaps + 1])
            return np.concatenate([[known[0]], middles, [known[-1]]])
    bins = int(np.clip(len(known) // (3 * _LEAST_IN_BIN), 2, _BINS))
    return np.unique(np.quantile(known, np.linspace(0.0, 1.0, bins + 1)))


def span_of(angle: np.ndarray) -> float:
    """Range of angles (n,), unwrapped if they restart each turn [rad]."""
    known = angle[np.isfinite(angle)]
    return float(np.ptp(np.unwrap(known))) if known.size else 0.0


def cycles(angle: np.ndarray) -> np.ndarray:
    """Cosines and sines (n, 60, 2) of 1 to 60 cycles a turn of the wheel; zero where the angle was not observed."""
    phase = np.outer(angle, np.arange(1, MOST_CYCLES + 1))
    return np.nan_to_num(np.stack([np.cos(phase), np.sin(phase)], axis=-1))
