"""Soil parameters: what was estimated, how well, and what was known beforehand."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import BeforeValidator, ValidationInfo, field_validator, model_validator

from .arguments import refused
from .files import load_toml
from .findings import Finding
from .models import FileModel, Finite, checked

PARAMETERS = ("c_Pa", "phi_rad", "k_m", "stiffness_Pa", "n")
"""Cohesion c [Pa], friction angle phi [rad], Janosi shear modulus k [m], stiffness k1 + k2 b of the paper's Eq. 6
[Pa], sinkage exponent n [-]: Iagnemma & Dubowsky 2002, Eq. 5-6."""

PLAUSIBLE = {
    "c_Pa": (0.0, 200e3),
    "phi_rad": (0.0, math.radians(60.0)),
    "k_m": (1e-4, 0.2),
    "stiffness_Pa": (1e2, 1e9),
    "n": (0.1, 3.0),
}
"""Bounds beyond which no natural soil lies (Wong 2010, Table 2.3, widened)."""

PUBLISHED = {"phi_rad": (math.radians(5.0), math.radians(50.0)), "n": (0.105, 1.8)}
"""Within these lie the soils that have been measured: phi from 6 (heavy clay) to 34 degrees and n from 0.11 (the same)
to 1.6 (snow) in Wong 2010, Table 2.3; dense lunar soil has up to 50 degrees (G. Heiken et al., "Lunar Sourcebook"
(1991), Ch. 9)."""

WRONG_FORM = 1.5
"""A misfit beyond this many times the sensors' noise is reported as an error of the model's form [-]."""


_LEAST_SD = 1e-12
"""Of a parameter's largest plausible value [-]: a standard deviation below it is lost in the rounding of the value."""


@dataclass(frozen=True)
class Quantity:
    """An estimated number with its standard deviation and its 95 % interval, all in one unit."""

    value: float
    sd: float
    low: float
    high: float


@dataclass(frozen=True)
class ShearStrength:
    """Shear strength tau_max = c + sigma tan(phi) [Pa] at normal stress sigma [Pa], with its 95 % interval."""

    normal_stress_Pa: float
    value_Pa: float
    low_Pa: float
    high_Pa: float


@dataclass(frozen=True)
class SoilEstimate:
    """Soil parameters estimated from n samples of a wheel's drive.

    Parameters
    ----------
    parameters
        By name (`PARAMETERS`), each with its 95 % interval.
    mean_c_tan_phi : (2,)
        Estimate of (c [Pa], tan phi [-]), the pair that the shear strength is linear in.
    covariance_c_tan_phi : (2, 2)
        Its covariance; the error of the model's form, where found, is in it.
    correlation
        Correlations by ``"first,second"``.
    shear_strength
        At normal stresses that were driven.
    separable
        By parameter: do the data determine it by themselves?
    advice
        What driving would determine what these data do not; empty where nothing is missing.
    method
        ``"ml"`` or ``"linear"``.
    channels
        Columns used.
    n
        Samples used.
    misfit
        Root of the mean squared residual in units of the sensors' noise [-]: 1 where model and noise explain all.
    findings
        What has to be known to use it, such as a model that does not fit.
    """

    parameters: Mapping[str, Quantity]
    mean_c_tan_phi: np.ndarray
    covariance_c_tan_phi: np.ndarray
    correlation: Mapping[str, float]
    shear_strength: tuple[ShearStrength, ...]
    separable: Mapping[str, bool]
    advice: str
    method: str
    channels: tuple[str, ...]
    n: int
    misfit: float
    findings: tuple[Finding, ...] = ()


@dataclass(frozen=True)
class SoilKnowledge:
    """What is known of a soil from elsewhere: values, and standard deviations where they are uncertain.

    Parameters
    ----------
    values
        By name (`PARAMETERS`), SI.
    sd
        Standard deviations by name; a value without one is taken as exact.
    """

    values: Mapping[str, float] = field(default_factory=dict)
    sd: Mapping[str, float] = field(default_factory=dict)


_DEGREE = math.pi / 180.0
_OF_KEY = {"c_Pa": ("c_Pa", 1.0), "phi_deg": ("phi_rad", _DEGREE), "phi_rad": ("phi_rad", 1.0), "k_m": ("k_m", 1.0),
           "stiffness_Pa": ("stiffness_Pa", 1.0), "n": ("n", 1.0)}  # fmt: skip
"""Which parameter each key of `soil.toml` gives, and what makes SI of it."""


class _Entry(FileModel):
    value: Finite
    sd: Finite | None = None


def _entry(value: object) -> object:
    return value if isinstance(value, dict) else {"value": value}


Entry = Annotated[_Entry | None, BeforeValidator(_entry)]


class _SoilFile(FileModel):
    """`soil.toml`: a number, or a table of a value and its standard deviation, for each parameter that is known."""

    c_Pa: Entry = None
    phi_deg: Entry = None
    phi_rad: Entry = None
    k_m: Entry = None
    stiffness_Pa: Entry = None
    n: Entry = None

    @field_validator("*")
    @classmethod
    def _plausible(cls, entry: _Entry | None, info: ValidationInfo) -> _Entry | None:
        name, scale = _OF_KEY[str(info.field_name)]
        low, high = PLAUSIBLE[name]
        if entry is not None and not low <= entry.value * scale <= high:
            raise ValueError(f"{entry.value:g}, expected {low / scale:g} to {high / scale:g}")
        least = _LEAST_SD * high / scale
        if entry is not None and entry.sd is not None and entry.sd < least:
            raise ValueError(f"sd {entry.sd:g}, expected at least {least:.1g}, or no sd for a value that is exact")
        return entry

    @model_validator(mode="after")
    def _something(self) -> _SoilFile:
        if not self.model_fields_set:
            raise ValueError("no value, expected some of " + ", ".join(_OF_KEY))
        if self.phi_deg and self.phi_rad:
            raise ValueError("both phi_deg and phi_rad are given")
        return self


def load_soil(path: str | Path) -> SoilKnowledge:
    """Read `soil.toml`: ``c_Pa = 300.0`` or ``c_Pa = {value = 300.0, sd = 50.0}``, likewise for the others.

    Raises
    ------
    InputError
        Missing or empty file, unknown key, a value that is no number or lies outside `PLAUSIBLE`, or a
        standard deviation too small to compute with.
    """
    file = checked(_SoilFile, load_toml(path), path)
    entries = [(*_OF_KEY[key], entry) for key, entry in file if entry is not None]
    values = {name: entry.value * scale for name, scale, entry in entries}
    return SoilKnowledge(values, {name: entry.sd * scale for name, scale, entry in entries if entry.sd is not None})


def as_knowledge(soil: object) -> SoilKnowledge:
    """Give what is known of a soil that an argument is, or that its file says; nothing where it is None.

    Raises
    ------
    InputError
        It is neither a `SoilKnowledge` nor a path, or what is wrong with the file (`load_soil`).
    """
    if soil is None:
        return SoilKnowledge()
    if isinstance(soil, SoilKnowledge):
        return soil
    if not isinstance(soil, str | os.PathLike):
        raise refused("soil", soil, "a SoilKnowledge, or the path of its TOML file")
    return load_soil(Path(soil))
