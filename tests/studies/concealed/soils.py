"""Wheels and soils of the concealed recordings: ranges from the literature, sand to clay, rover to tractor."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from .mechanics import Body, Ground


@dataclass(frozen=True)
class SoilRange:
    """Typical soil of a kind: c [Pa], phi [deg], k [m], Bekker's k_c [N/m^(n+1)], k_phi [N/m^(n+2)] and n [-]."""

    c_Pa: float
    phi_deg: float
    k_m: float
    k_c: float
    k_phi: float
    n: float


SOIL_RANGES = {
    "dry sand": SoilRange(1040.0, 28.0, 0.015, 0.99e3, 1528.43e3, 1.10),
    "coarse sand": SoilRange(1300.0, 31.1, 0.012, 102e3, 5301e3, 0.79),
    "sandy loam": SoilRange(1720.0, 29.0, 0.025, 5.27e3, 1515.04e3, 0.70),
    "clayey soil": SoilRange(4140.0, 13.0, 0.010, 13.19e3, 692.15e3, 0.50),
    "regolith": SoilRange(170.0, 35.0, 0.018, 1.4e3, 820e3, 1.00),
    "snow": SoilRange(1030.0, 19.7, 0.025, 4.37e3, 196.72e3, 1.60),
}
"""J. Y. Wong, *Terramechanics and Off-Road Vehicle Engineering* (2010), Table 2.3, with its shear parameters;
regolith after G. Heiken et al., *Lunar Sourcebook* (1991), Table 9.14. Where k is not given there, it is chosen."""


def draw_body(rng: np.random.Generator, lugs: bool) -> Body:
    """Draw a wheel of 0.05 to 0.5 m radius, smooth or with 8 to 24 lugs of 3 to 10 % of its radius."""
    radius = float(np.exp(rng.uniform(math.log(0.05), math.log(0.5))))
    radius, width = round(radius, 4), round(radius * float(rng.uniform(0.5, 1.1)), 4)
    if not lugs:
        return Body(radius, width)
    return Body(radius, width, round(radius * float(rng.uniform(0.03, 0.10)), 4), int(rng.integers(8, 25)))


def draw_ground(rng: np.random.Generator, body: Body) -> tuple[str, Ground]:
    """Draw a soil of one of the kinds, scattered around its typical values, for a wheel of that width."""
    kind = str(rng.choice(list(SOIL_RANGES)))
    return kind, scattered(rng, SOIL_RANGES[kind], body)


def scattered(rng: np.random.Generator, typical: SoilRange, body: Body) -> Ground:
    """Draw a soil around typical values for a wheel of that width."""
    c, friction, k, stiffness, n = np.exp(rng.normal(0.0, [0.25, 0.06, 0.2, 0.2, 0.06])).tolist()
    exponent = typical.n * n
    return Ground(
        c_Pa=typical.c_Pa * c,
        phi_rad=math.atan(math.tan(math.radians(typical.phi_deg)) * friction),
        k_m=typical.k_m * k * min(1.0, (body.radius_m / 0.15) ** 0.5),  # thinner shear zones under small wheels
        stiffness_Pa=(typical.k_c / body.width_m + typical.k_phi) * body.width_m**exponent * stiffness,
        n=exponent,
    )
