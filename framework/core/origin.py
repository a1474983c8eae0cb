"""Where frames lie: a site's on Earth, and one frame in another."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from .arguments import number, refused

SEMI_MAJOR_M, ECCENTRICITY2 = 6_378_137.0, 6.694_379_990_14e-3
"""WGS 84."""

FARTHEST_M = 1e8
"""Places on Earth are nearer to the origin of any frame that maps have [m], and cells of a map can be counted there."""

_WITHIN = f"a number within +-{FARTHEST_M:g}"


@dataclass(frozen=True)
class Offset:
    """The place of one frame's x = y = 0 in another frame, and how its axes are turned there.

    Parameters
    ----------
    x_m, y_m
        [m].
    yaw_rad
        From the other's x axis to this one's, counter-clockwise [rad].

    Raises
    ------
    InputError
        A number that is not finite, or places beyond any frame on Earth.
    """

    x_m: float
    y_m: float
    yaw_rad: float = 0.0

    def __post_init__(self) -> None:
        for name in ("x_m", "y_m", "yaw_rad"):
            if not abs(number(name, getattr(self, name), _WITHIN)) <= FARTHEST_M:  # nor is NaN
                raise refused(name, getattr(self, name), _WITHIN)

    def moved(self, x_m: np.ndarray, y_m: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Turn places (n,) each in this frame into places in the other one [m]."""
        c, s = math.cos(self.yaw_rad), math.sin(self.yaw_rad)
        return self.x_m + c * x_m - s * y_m, self.y_m + s * x_m + c * y_m


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

    def __str__(self) -> str:
        turned = f", y axis {self.heading_deg:.2f} deg from north" if abs(self.heading_deg) >= 0.005 else ""
        return f"latitude {self.latitude_deg:.7f}, longitude {self.longitude_deg:.7f}{turned}"

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

    def from_local(self, east_m: np.ndarray, north_m: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Turn metres east and north of the origin, (n,) each, into x and y of the site's frame [m]."""
        turn = math.radians(self.heading_deg)
        c, s = math.cos(turn), math.sin(turn)
        return c * east_m - s * north_m, s * east_m + c * north_m

    def east_north(self, latitude_deg: np.ndarray, longitude_deg: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Metres east and north of the origin, (n,) each, as the transverse Mercator projection about it has them.

        To second order about the origin (J. P. Snyder, "Map Projections: A Working Manual" (1987), Eq. 8-9 and 8-10):
        within a centimetre at 5 km and latitudes below 70 deg.
        """
        here = math.radians(self.latitude_deg)
        east_deg = (longitude_deg - self.longitude_deg + 180.0) % 360.0 - 180.0
        north_rad, east_rad = np.radians(latitude_deg) - here, np.radians(east_deg)
        latitude, middle = here + north_rad, here + 0.5 * north_rad
        across = SEMI_MAJOR_M / np.sqrt(1.0 - ECCENTRICITY2 * np.sin(latitude) ** 2)
        along = SEMI_MAJOR_M * (1.0 - ECCENTRICITY2) / (1.0 - ECCENTRICITY2 * np.sin(middle) ** 2) ** 1.5
        east_m = across * np.cos(latitude) * east_rad
        return east_m, along * north_rad + 0.5 * east_m * east_rad * np.sin(latitude)

    def offset_in(self, other: Origin) -> Offset:
        """Where the frame of this origin lies in that of another one, a few kilometres away at most.

        True north is turned against the other's grid by the convergence of the meridians (Snyder, Eq. 8-15, to first
        order).
        """
        if self == other:
            return Offset(0.0, 0.0)
        x, y = other.from_local(*other.east_north(np.array([self.latitude_deg]), np.array([self.longitude_deg])))
        across = math.radians((self.longitude_deg - other.longitude_deg + 180.0) % 360.0 - 180.0)
        convergence = across * math.sin(math.radians(self.latitude_deg))
        clockwise = math.radians(self.heading_deg - other.heading_deg) - convergence
        turned = -math.remainder(clockwise, 2.0 * math.pi)
        # Rounded, for the last digits are the processor's.
        return Offset(round(float(x[0]), 4), round(float(y[0]), 4), round(turned, 8))
