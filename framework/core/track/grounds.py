"""Grounds: stretches of a track on each of which the soil is one."""

from __future__ import annotations

import math
from dataclasses import dataclass

CHANGE_MARGIN_M = 0.5
"""Rows so near to a change of ground are not used [m]: the change is known to about a cell, and a stretch that holds
two soils is of neither."""


@dataclass(frozen=True)
class Ground:
    """A stretch of the track of one class.

    Parameters
    ----------
    class_name
        Class of terrain; ``""`` where it is not known.
    start_s, end_s
        When the vehicle's reference point was on it [s].
    """

    class_name: str = ""
    start_s: float = -math.inf
    end_s: float = math.inf
