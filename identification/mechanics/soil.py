"""Soils for the forward models, and the coordinates that their parameters are estimated in."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ...framework.core.errors import InputError
from ...framework.core.soil import PARAMETERS, SoilKnowledge


@dataclass(frozen=True)
class Soil:
    """A soil for the forward model: c [Pa], phi [rad], Janosi shear modulus k [m], stiffness k1 + k2 b [Pa], n [-]."""

    c_Pa: float
    phi_rad: float
    k_m: float
    stiffness_Pa: float
    n: float

    def __post_init__(self) -> None:
        for name in PARAMETERS:
            value = getattr(self, name)
            least_ok = value >= 0 if name in ("c_Pa", "phi_rad") else value > 0
            if not (math.isfinite(value) and least_ok):
                raise InputError("soil", f"{value!r}", expected="a finite, positive number", place=name)

    @staticmethod
    def from_knowledge(known: SoilKnowledge, source: str = "soil") -> Soil:
        """Build a soil from known parameters; raises `InputError` naming those that are missing."""
        missing = [name for name in PARAMETERS if name not in known.values]
        if missing:
            raise InputError(source, f"{', '.join(missing)} missing", expected="c_Pa, phi_deg, k_m, stiffness_Pa and n")
        return Soil(**{name: float(value) for name, value in known.values.items()})

    @property
    def numbers(self) -> tuple[float, ...]:
        """The five numbers that determine the stresses: c [Pa], tan phi, k [m], stiffness [Pa], n."""
        return self.c_Pa, math.tan(self.phi_rad), self.k_m, self.stiffness_Pa, self.n


def soil_vector(soil: Soil | Mapping[str, float]) -> np.ndarray:
    """Return a soil as the leading entries of a model's vector: c [Pa], tan phi, ln k, ln stiffness, ln n."""
    values = vars(soil) if isinstance(soil, Soil) else soil
    return np.array([to_internal(name, values[name]) for name in PARAMETERS])


def to_internal(name: str, value: float) -> float:
    """Coordinate in which a soil parameter is estimated: c [Pa], tan phi [-], logarithms of k, stiffness and n."""
    if name == "c_Pa":
        return value
    return math.tan(value) if name == "phi_rad" else math.log(value)


def from_internal(name: str, value: float) -> float:
    """Inverse of `to_internal`."""
    if name == "c_Pa":
        return value
    return math.atan(value) if name == "phi_rad" else math.exp(value)


def slope_of_internal(name: str, value: float) -> float:
    """Derivative of the SI value by the internal coordinate, at the SI value."""
    return {"c_Pa": 1.0, "phi_rad": math.cos(value) ** 2}.get(name, value)
