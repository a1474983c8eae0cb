"""Whether the recorded slip is the one that the two speeds give."""

from __future__ import annotations

import numpy as np

from ..framework.core.recording.types import WheelTable
from ..framework.core.recording.wheel_file import slip_from_speeds
from ..framework.core.vehicle import Wheel

_FAR, _PARTS, _LEAST_ROWS = 0.02, 10, 20
"""A difference of slip that matters [-], parts of the rows in each of which it has to lie to the same side, so that it
is not noise (by chance once in 512), and how many rows that takes."""

_NEARLY_SPINNING = 0.8
"""Slip from which on the speeds say little of the radius [-]."""


def slip_disagreement(table: WheelTable, wheel: Wheel) -> str | None:
    """Say, in words, that the recorded slip is not what the speeds of rim and travel give; None where it is.

    A radius that is stated wrongly shows so, and a slip of another definition.
    """
    slip, rim, travel = (table.get(name) for name in ("slip", "wheel_speed_rad_s", "travel_speed_m_s"))
    if slip is None or rim is None or travel is None:
        return None
    difference = slip - slip_from_speeds(rim * wheel.radius_m, travel)
    known = np.flatnonzero(np.isfinite(difference))
    if len(known) < _LEAST_ROWS:
        return None
    middle = float(np.median(difference[known]))
    to_one_side = np.array([np.median(part) * middle > 0.0 for part in np.array_split(difference[known], _PARTS)])
    if abs(middle) < _FAR or not to_one_side.all():
        return None
    told = (
        f"the recorded slip is {abs(middle):.2g} {'above' if middle > 0.0 else 'below'} what the two speeds give with "
        f"a radius of {wheel.radius_m:g} m (median of {len(known)} rows)"
    )
    driving = known[(slip[known] >= 0.0) & (slip[known] < _NEARLY_SPINNING) & (rim[known] != 0.0)]
    if len(driving) >= _LEAST_ROWS:
        radii = travel[driving] / (rim[driving] * (1.0 - slip[driving]))
        told += f"; {np.median(radii):.3g} m would make them agree"
    return f"{told}: check the radius, and which slip is meant; the recorded one is used"
