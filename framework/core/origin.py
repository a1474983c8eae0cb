"""Where on Earth a site's frame lies."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from .arguments import number, refused


@dataclass(frozen=True)
class Origin:
    """The place of a site's x = y = 0, and the direction of its axes.

    Parameters
    ----------
    latitude_deg, longitude_deg
        WGS 84 [deg]: -90 to 90, north positive; -180 to 180, east positive.
    heading_deg
        Direction of the site's y axis, clockwise from true north [deg]; x points 90 degrees clockwise of it.

    Raises
    ------
    InputError
        A number out of range.
    """

    latitude_deg: float
    longitude_deg: float
    heading_deg: float = 0.0

    def __post_init__(self) -> None:
        for name, limit in (("latitude", 90.0), ("longitude", 180.0), ("heading", 360.0)):
            value, expected = getattr(self, f"{name}_deg"), f"{-limit:g} to {limit:g} [deg]"
            if not abs(number(name, value, expected)) <= limit:  # nor is NaN
                raise refused(name, value, expected)

    @property
    def crs(self) -> str:
        """The local map projection as a PROJ string: transverse Mercator about the origin, metres east and north.

        Its scale is exact at the origin, and off by (distance to the meridian)^2 / (2 R^2): 1e-6 at 10 km (J. P.
        Snyder, "Map Projections: A Working Manual" (1987), Ch. 8).
        """
        return (
            f"+proj=tmerc +lat_0={self.latitude_deg!r} +lon_0={self.longitude_deg!r} +k=1 +x_0=0 +y_0=0 "
            "+datum=WGS84 +units=m +no_defs"
        )

    def to_local(self, places: np.ndarray) -> np.ndarray:
        """Turn places in the site's frame (..., 2) [m] into metres east and north of the origin."""
        turn = math.radians(self.heading_deg)
        return places @ np.array([[math.cos(turn), -math.sin(turn)], [math.sin(turn), math.cos(turn)]])
