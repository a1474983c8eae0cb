"""Soils of the synthetic world: for each terrain class, how its soil varies from place to place.

Pressure-sinkage is Bekker's p = (k_c / b + k_phi) z^n, so that one class suits wheels of any width b; in the paper's
Eq. 6 (Reece's form) its stiffness is (k_c / b + k_phi) b^n. Sources of the typical values are named class by class.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from .mechanics import Soil


@dataclass(frozen=True)
class SoilClass:
    """A terrain class as a distribution of soils.

    Parameters
    ----------
    c_Pa, phi_rad, k_m
        Typical cohesion [Pa], friction angle [rad] and Janosi shear modulus [m].
    bekker_k_c, bekker_k_phi, n
        Typical sinkage moduli [N/m^(n+1)], [N/m^(n+2)] and exponent [-].
    source
        Where the typical values are from.
    spread
        Relative standard deviations between places of c, tan phi, k, stiffness and n [-].
    """

    c_Pa: float
    phi_rad: float
    k_m: float
    bekker_k_c: float
    bekker_k_phi: float
    n: float
    source: str
    spread: tuple[float, float, float, float, float] = (0.18, 0.05, 0.15, 0.18, 0.04)

    def stiffness_Pa(self, width_m: float) -> float:
        """Stiffness k1 + k2 b of the paper's Eq. 6 [Pa] for a wheel of width b [m]."""
        return (self.bekker_k_c / width_m + self.bekker_k_phi) * width_m**self.n

    def draw(self, rng: np.random.Generator, width_m: float) -> Soil:
        """Draw the soil of one place: log-normal around the typical values."""
        c, tan_phi, k, stiffness, n = np.exp(rng.normal(0.0, self.spread)).tolist()
        return Soil(
            c_Pa=self.c_Pa * c,
            phi_rad=math.atan(math.tan(self.phi_rad) * tan_phi),
            k_m=self.k_m * k,
            stiffness_Pa=self.stiffness_Pa(width_m) * stiffness,
            n=self.n * n,
        )


SOILS: dict[str, SoilClass] = {
    "sand": SoilClass(
        1040.0, math.radians(28.0), 0.015, 0.99e3, 1528.43e3, 1.10,
        "Wong 2010, Table 2.3, dry sand (Land Locomotion Laboratory); k within the 0.01-0.025 m Wong gives for sand",
    ),
    "loam": SoilClass(
        1720.0, math.radians(29.0), 0.020, 5.27e3, 1515.04e3, 0.70,
        "Wong 2010, Table 2.3, sandy loam of 15 % moisture (Land Locomotion Laboratory); k chosen",
    ),
    "gravel": SoilClass(
        300.0, math.radians(36.0), 0.012, 5.0e3, 3200.0e3, 0.95,
        "phi: loose sandy gravel, about 35 deg (Terzaghi, Peck & Mesri 1996); the others chosen: firmer than dry sand",
        (0.30, 0.05, 0.15, 0.20, 0.04),
    ),
    "grass": SoilClass(
        4800.0, math.radians(31.0), 0.024, 30.0e3, 1900.0e3, 0.95,
        "between Wong 2010, Table 2.3, Upland and Rubicon sandy loam, cohesion raised for roots; chosen",
    ),
    "clay": SoilClass(
        4140.0, math.radians(13.0), 0.010, 13.19e3, 692.15e3, 0.75,
        "Wong 2010, Table 2.3, clayey soil of 38 % moisture (Thailand); n raised towards that of 55 %; k chosen",
        (0.18, 0.08, 0.15, 0.18, 0.04),
    ),
}  # fmt: skip
"""By class name; a class that is not here (asphalt) is hard: its wheels do not sink and it has no soil."""

HARD_FRICTION = 0.75
"""Peak friction coefficient of a wheel on hard ground [-]: chosen, a little below that of tyres on dry asphalt."""

HARD_SLIP_RATE = 20.0
"""How fast traction on hard ground builds up with slip [-]: exp(-20 i), a stiff tread."""

HARD_ROLLING = 0.015
"""Coefficient of rolling resistance on hard ground [-]: chosen, as of tyres on asphalt."""
