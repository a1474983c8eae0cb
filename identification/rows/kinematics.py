"""Whether recorded slip and wheel angle agree with the speeds of rim and travel."""

from __future__ import annotations

import math

import numpy as np

from ...framework.core.findings import Finding, warning
from ...framework.core.recording.types import WheelTable
from ...framework.core.recording.wheel_file import slip_from_speeds
from ...framework.core.vehicle import Wheel
from .trials import is_of_trials

_PARTS, _LEAST_ROWS = 10, 20
"""Parts of a drive in each of which a disagreement has to show (by chance to the same side once in 512), and fewest
rows, or pairs of rows."""

_FAR = 0.02
"""Least difference of slip for a finding [-]."""

_TURNED_RAD, _MOST_TURNED_RAD = 0.8, 4.0
"""Least rotation between the rows compared, many steps of an encoder, and the largest, where rows lie farther apart. Of
an angle that returns to zero each turn a quarter of the pairs or more then disagree, and there is no finding."""

_FACTOR, _STEADY = 1.25, 0.1
"""Factor, or its inverse, beyond the resolution of an encoder; largest relative deviation from the median of the middle
half of the pairs, and of each part of the drive [-]."""

_ALIKE = 0.1
"""Share within which a factor is that of a unit [-]."""

_OF_ANGLE = {"degrees": 180.0 / math.pi, "turns": 0.5 / math.pi}
_OF_SPEED = {
    "turns a second": 2.0 * math.pi,
    "turns a minute": math.pi / 30.0,
    "degrees a second": math.pi / 180.0,
}
"""Ratio of the angle's rate to the speed where the angle, or the speed, is in another unit [-]."""

_FROM_TRAVEL = "travel_speed_m_s and slip"


def slip_disagreement(table: WheelTable, wheel: Wheel) -> Finding | None:
    """Doubt a recorded slip that is not what the speeds of rim and travel give: ``slip_disagrees``.

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
    return warning(
        "slip_disagrees", difference=middle, radius_m=wheel.radius_m, n=int(known.sum()),
        agreeing_radius_m=_radius_of(slip[known], rim[known], travel[known]),
    )  # fmt: skip


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


def angle_disagreement(table: WheelTable, wheel: Wheel) -> Finding | None:
    """Doubt an angle that goes on faster or slower than the wheel turns by a constant factor: ``angle_disagrees``.

    An angle that returns to zero each turn, or is counted backwards, agrees.

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
    off = np.abs(np.concatenate([quartiles, _by_part(factors)]) - factor)
    if 1.0 / _FACTOR < abs(factor) < _FACTOR or np.any(off >= _STEADY * abs(factor)):
        return None
    channel, unit = _likely_unit(abs(factor), source)
    return warning("angle_disagrees", factor=abs(factor), speed=source, n=len(factors), channel=channel, unit=unit)


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


def _likely_unit(factor: float, source: str) -> tuple[str | None, str | None]:
    """Give the channel, and its unit, that make for a factor; None where none does."""
    units = [("wheel_angle_rad", unit, of_it) for unit, of_it in _OF_ANGLE.items()]
    if source != _FROM_TRAVEL:
        units += [(source, unit, of_it) for unit, of_it in _OF_SPEED.items()]
    likely = ((name, unit) for name, unit, of_it in units if abs(factor / of_it - 1.0) < _ALIKE)
    return next(likely, (None, None))
