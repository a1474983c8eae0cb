"""Whether the recorded angle of the wheel goes on as fast as the wheel turns."""

from __future__ import annotations

import math

import numpy as np

from ...framework.core.recording.types import WheelTable
from ...framework.core.vehicle import Wheel
from .trials import is_of_trials

_TURNED_RAD, _MOST_TURNED_RAD = 0.8, 4.0
"""How far the wheel turns between the rows that are compared, far enough that an encoder's steps hardly matter; and at
most, where rows lie farther apart. Of an angle that starts anew with each turn a quarter of the pairs or more are then
at odds with the others, and nothing is said, unless it has done so in few of them."""

_FAR, _STEADY, _PARTS, _LEAST_ROWS = 1.25, 0.1, 10, 20
"""A factor, or one over it, that is no encoder's coarseness; how far from the median the middle half of the pairs lies
at most, and each of so many parts of the drive, as a share [-]; how many pairs that takes."""

_ALIKE = 0.1
"""Share within which a factor is that of a unit [-]."""

_OF_ANGLE = {"degrees": 180.0 / math.pi, "turns": 0.5 / math.pi}
_OF_SPEED = {
    "turns a second": 2.0 * math.pi,
    "turns a minute": math.pi / 30.0,
    "degrees a second": math.pi / 180.0,
}
"""What the angle's rate over the speed is where the angle, or the speed, is in another unit."""


_FROM_TRAVEL = "the wheel's speed by travel and slip"


def angle_disagreement(table: WheelTable, wheel: Wheel) -> str | None:
    """Say, in words, that the angle goes on faster or slower than the wheel turns by a constant factor; else None.

    An angle that starts anew with each turn, or is counted backwards, agrees.

    Parameters
    ----------
    table
        Rows of one wheel in order of time [s], slip derived: `wheel_angle_rad` [rad], and `wheel_speed_rad_s` [rad/s]
        or `travel_speed_m_s` [m/s].
    wheel
        Its radius [m].
    """
    angle, time_s = table.get("wheel_angle_rad"), table.get("time_s")
    speed, source = _speed(table, wheel)
    if angle is None or time_s is None or speed is None or is_of_trials(table):
        return None
    factors = _factors(table, angle, speed, time_s)
    if len(factors) < _LEAST_ROWS:
        return None
    factor = float(np.median(factors))
    quartiles = np.quantile(factors, [0.25, 0.75])
    parts = np.array([np.median(part) for part in np.array_split(factors, _PARTS)])
    off = np.abs(np.concatenate([quartiles, parts]) - factor)
    if 1.0 / _FAR < abs(factor) < _FAR or np.any(off >= _STEADY * abs(factor)):
        return None
    return (
        f"wheel_angle_rad goes on {abs(factor):.3g} times as fast as {source} says (median of {len(factors)} pairs of "
        f"rows): {_why(abs(factor), source)}; the recorded angle is used"
    )


def _speed(table: WheelTable, wheel: Wheel) -> tuple[np.ndarray | None, str]:
    """Speed of the wheel (n,) [rad/s], measured or from travel and slip, and what it comes from."""
    if "wheel_speed_rad_s" in table:
        return table["wheel_speed_rad_s"], "wheel_speed_rad_s"
    if "travel_speed_m_s" in table and "slip" in table:
        slip = table["slip"]
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = np.where(slip >= 0.0, 1.0 - slip, 1.0 / (1.0 + slip))
            return table["travel_speed_m_s"] / (wheel.radius_m * ratio), _FROM_TRAVEL
    return None, ""


def _factors(table: WheelTable, angle: np.ndarray, speed: np.ndarray, time_s: np.ndarray) -> np.ndarray:
    """How many times as far as the wheel turns its angle goes on, (k,), from rows to others far enough on; of (n,)
    angles [rad], speeds [rad/s] and times [s].
    """
    step_s = np.diff(time_s)
    turned = 0.5 * (speed[1:] + speed[:-1]) * step_s
    if not np.isfinite(turned).any():
        return np.empty(0)
    usual_s, usual = float(np.median(step_s)), float(np.nanmedian(np.abs(turned)))
    if not (usual_s > 0.0 and usual > 0.0):
        return np.empty(0)
    ahead = max(round(_TURNED_RAD / usual), 1)
    if ahead >= len(time_s):
        return np.empty(0)
    # A speed that was not seen leaves all pairs across it unknown.
    lost = np.concatenate([[0], np.cumsum(~np.isfinite(turned))])
    along = np.concatenate([[0.0], np.cumsum(np.nan_to_num(turned))])
    between = along[ahead:] - along[:-ahead]
    apart_s = time_s[ahead:] - time_s[:-ahead]
    good = (lost[ahead:] == lost[:-ahead]) & (apart_s > 0.0) & (apart_s < 1.5 * ahead * usual_s)
    good &= (np.abs(between) > 0.5 * _TURNED_RAD) & (np.abs(between) < _MOST_TURNED_RAD)
    good &= np.isfinite(angle[ahead:] - angle[:-ahead])
    if table.run is not None:
        good &= table.run[ahead:] == table.run[:-ahead]
    return ((angle[ahead:] - angle[:-ahead])[good]) / between[good]


def _why(factor: float, source: str) -> str:
    """Say which unit makes for a factor, if one does, and what is to be checked."""
    units = [("wheel_angle_rad", unit, of_it) for unit, of_it in _OF_ANGLE.items()]
    if source != _FROM_TRAVEL:
        units += [(source, unit, of_it) for unit, of_it in _OF_SPEED.items()]
    for name, unit, of_it in units:
        if abs(factor / of_it - 1.0) < _ALIKE:
            return f"{name} is probably in {unit}"
    other = (
        "the radius and the slip" if source == _FROM_TRAVEL else "that of the speed, and whether a gear lies between"
    )
    return f"check its unit, {other}"
