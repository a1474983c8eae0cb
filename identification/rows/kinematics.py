"""Whether the recorded slip is the one that the two speeds give, and whether these can be in their units."""

from __future__ import annotations

import math

import numpy as np

from ...framework.core.recording.types import WheelTable
from ...framework.core.recording.wheel_file import slip_from_speeds
from ...framework.core.vehicle import Wheel

_FAR, _PARTS, _LEAST_ROWS = 0.02, 10, 20
"""A difference of slip that matters [-]; parts of the rows in each of which it has to lie to the same side, so that it
is not noise (by chance once in 512, where parts err independently); and how many rows that takes."""

_STRANGE, _USUAL, _MOST = (-0.5, 0.8), (-0.3, 0.75), 0.95
"""Slips beyond which hardly any drive stays all along, slips that drives have, and the share of rows that do [-]."""

_UNITS = (
    ("wheel_speed_rad_s", "revolutions per minute", math.pi / 30.0),
    ("wheel_speed_rad_s", "degrees per second", math.pi / 180.0),
    ("wheel_speed_rad_s", "revolutions per second", 2.0 * math.pi),
    ("travel_speed_m_s", "km/h", 1.0 / 3.6),
    ("travel_speed_m_s", "cm/s", 0.01),
    ("travel_speed_m_s", "mm/s", 0.001),
)
"""Units that speeds are recorded in, and what makes SI of each."""


def speeds_in_another_unit(table: WheelTable, wheel: Wheel) -> str | None:
    """Say, in words, in which unit a speed probably is, where the slip that follows from the two is hardly any drive's
    all along, and would be a usual one; None where it is not so, or slip was recorded (`slip_disagreement`).

    Parameters
    ----------
    table
        Channels of one wheel as recorded: `wheel_speed_rad_s` [rad/s] and `travel_speed_m_s` [m/s].
    wheel
        Its radius [m].
    """
    rim, travel = table.get("wheel_speed_rad_s"), table.get("travel_speed_m_s")
    if "slip" in table or rim is None or travel is None:
        return None
    moving = ((rim * travel) > 0.0) & np.isfinite(slip_from_speeds(rim * wheel.radius_m, travel))
    speeds = {"wheel_speed_rad_s": rim[moving], "travel_speed_m_s": travel[moving]}
    if moving.sum() < _LEAST_ROWS or _share_within(speeds, wheel, _STRANGE) > 1.0 - _MOST:
        return None
    likely = [
        f"{name} in {unit}"
        for name, unit, to_si in _UNITS
        if _share_within({**speeds, name: to_si * speeds[name]}, wheel, _USUAL) >= _MOST
    ]
    if not likely:
        return None
    slip = float(np.median(slip_from_speeds(speeds["wheel_speed_rad_s"] * wheel.radius_m, speeds["travel_speed_m_s"])))
    return (
        f"the two speeds give slips about {slip:.2g} all along, which would be usual ones were {' or '.join(likely)}: "
        "check the units; the speeds are used as they are"
    )


def _share_within(speeds: dict[str, np.ndarray], wheel: Wheel, limits: tuple[float, float]) -> float:
    """Share of rows [-] whose slip, by speeds (n,) [rad/s, m/s], lies within limits."""
    slip = slip_from_speeds(speeds["wheel_speed_rad_s"] * wheel.radius_m, speeds["travel_speed_m_s"])
    slip = slip[np.isfinite(slip)]
    return float(np.mean((slip >= limits[0]) & (slip <= limits[1]))) if len(slip) else 0.0


def slip_disagreement(table: WheelTable, wheel: Wheel) -> str | None:
    """Say, in words, that the recorded slip is not what the speeds of rim and travel give; None where it is.

    A radius that is stated wrongly shows so, and a slip of another definition. The definition is that of
    `wheel_file.derive` (J. Y. Wong, *Theory of Ground Vehicles*, 2010, Eq. 4.44 and 4.47).

    Parameters
    ----------
    table
        Channels of one wheel as recorded: `slip` [-], `wheel_speed_rad_s` [rad/s] and `travel_speed_m_s` [m/s].
    wheel
        Its radius [m].
    """
    slip, rim, travel = (table.get(name) for name in ("slip", "wheel_speed_rad_s", "travel_speed_m_s"))
    if slip is None or rim is None or travel is None:
        return None
    difference = slip - slip_from_speeds(rim * wheel.radius_m, travel)
    known = np.isfinite(difference)
    if known.sum() < _LEAST_ROWS:
        return None
    middle, parts = float(np.median(difference[known])), _by_part(difference[known])
    if abs(middle) < _FAR or np.any(parts * middle <= 0.0):
        return None
    told = (
        f"the recorded slip is {abs(middle):.2g} {'above' if middle > 0.0 else 'below'} what the two speeds give with "
        f"a radius of {wheel.radius_m:g} m (median of {known.sum()} rows)"
    )
    radius = _radius_of(slip[known], rim[known], travel[known])
    if radius is not None:
        told += f"; {radius:.3g} m would make them agree"
    return f"{told}: check the radius, and which slip is meant; the recorded one is used"


def _radius_of(slip: np.ndarray, rim: np.ndarray, travel: np.ndarray) -> float | None:
    """Radius [m] with which the two speeds (n,) [rad/s, m/s] give the slip (n,) all along; None where none does."""
    with np.errstate(divide="ignore", invalid="ignore"):
        radii = np.where(slip >= 0.0, travel / (rim * (1.0 - slip)), travel * (1.0 + slip) / rim)
    radii = radii[np.isfinite(radii) & (radii > 0.0)]
    if len(radii) < _LEAST_ROWS:
        return None
    radius = float(np.median(radii))
    left = slip - slip_from_speeds(rim * radius, travel)
    return radius if np.all(np.abs(_by_part(left[np.isfinite(left)])) < _FAR) else None


def _by_part(values: np.ndarray) -> np.ndarray:
    """Medians of the parts of values (n,) in their order."""
    return np.array([np.median(part) for part in np.array_split(values, _PARTS)])
