"""The forward model as estimators see it: every sensed channel from load, slip and soil, with derivatives."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from ..framework.core.soil import PARAMETERS
from ..framework.core.vehicle import Wheel
from . import stress_kernel as kernel
from .wheel_soil import LARGEST_ENTRY_ANGLE, PEAK_SHARE, Soil

CHANNELS = ("load_N", "torque_Nm", "sinkage_m", "slip", "drawbar_pull_N")
"""Channels that the wheel can sense, in the order of every array of predictions."""

SMALLEST_ENTRY_ANGLE = 1e-4
_LOAD_TOLERANCE = 1e-3
"""Relative error of the load up to which one linear correction of the entry angle suffices: it leaves about 1e-6."""


@dataclass(frozen=True)
class Prediction:
    """Channels (n, 5), derivatives by (load, slip) (n, 5, 2) and by the parameters (n, 5, p), entry angle (n,) [rad].

    Rows whose load the soil does not carry are NaN.
    """

    channels: np.ndarray
    by_latent: np.ndarray
    by_parameter: np.ndarray
    theta_1: np.ndarray


class ForwardModel(Protocol):
    """What predicts the channels from imposed load [N] and slip (n, 2) and a parameter vector (p,)."""

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters."""
        ...

    def predict(self, imposed: np.ndarray, vector: np.ndarray, theta_1: np.ndarray) -> Prediction:
        """Predict all channels; `theta_1` (n,) is where the search for the entry angle starts [rad]."""
        ...


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


@dataclass(frozen=True)
class TextbookWheel:
    """The paper's Eq. 1-9 for one wheel: five soil parameters, theta_2 = 0, theta_m = theta_1 / 2."""

    wheel: Wheel
    names: tuple[str, ...] = PARAMETERS

    def to_vector(self, values: dict[str, float]) -> np.ndarray:
        """Lay out c, phi, k, stiffness, n as (c, tan phi, ln k, ln stiffness, ln n)."""
        return np.array([to_internal(name, values[name]) for name in self.names])

    def from_vector(self, vector: np.ndarray) -> dict[str, float]:
        """Give the SI values of a vector."""
        return {name: from_internal(name, float(value)) for name, value in zip(self.names, vector, strict=True)}

    def soil(self, vector: np.ndarray) -> Soil:
        """Give the soil of a vector whose cohesion and friction are not negative."""
        return Soil(**self.from_vector(vector))

    def predict(self, imposed: np.ndarray, vector: np.ndarray, theta_1: np.ndarray) -> Prediction:
        """Predict W [N], T [N m], z [m], i [-], DP [N]: see `Prediction`."""
        r, b = self.wheel.radius_m, self.wheel.width_m
        soil = np.array([vector[0], vector[1], *np.exp(vector[2:])])
        rows = len(imposed)
        forces, jacobian = np.empty((rows, 3)), np.empty((rows, 3, 2 + len(soil)))
        angle = np.ascontiguousarray(theta_1, dtype=float).copy()
        kernel.carry(
            np.ascontiguousarray(imposed), soil, PEAK_SHARE, r, b, kernel.FEW_NODES, kernel.FEW_WEIGHTS,
            SMALLEST_ENTRY_ANGLE, LARGEST_ENTRY_ANGLE, _LOAD_TOLERANCE, angle, forces, jacobian,
        )  # fmt: skip
        # jacobian columns: theta_1, slip, then the soil. The entry angle answers so that W stays what is imposed.
        by_angle = jacobian[:, :, 0]
        stiffness = by_angle[:, 0]
        angle_by_latent = np.stack([1.0 / stiffness, -jacobian[:, 0, 1] / stiffness], axis=1)
        chain = np.array([1.0, 1.0, *soil[2:]])
        angle_by_parameter = -jacobian[:, 0, 2:] * chain / stiffness[:, None]

        channels, by_latent = np.empty((rows, 5)), np.zeros((rows, 5, 2))
        by_parameter = np.zeros((rows, 5, len(soil)))
        channels[:, 0], by_latent[:, 0, 0] = imposed[:, 0], 1.0
        channels[:, 3], by_latent[:, 3, 1] = imposed[:, 1], 1.0
        missing_load = imposed[:, 0] - forces[:, 0]
        angle += missing_load / stiffness
        for force, channel in ((1, 1), (2, 4)):
            slope = by_angle[:, force]
            channels[:, channel] = forces[:, force] + slope * missing_load / stiffness
            by_latent[:, channel] = slope[:, None] * angle_by_latent
            by_latent[:, channel, 1] += jacobian[:, force, 1]
            by_parameter[:, channel] = jacobian[:, force, 2:] * chain + slope[:, None] * angle_by_parameter
        slope = r * np.sin(angle)
        channels[:, 2] = r * (1.0 - np.cos(angle))
        by_latent[:, 2] = slope[:, None] * angle_by_latent
        by_parameter[:, 2] = slope[:, None] * angle_by_parameter
        return Prediction(channels, by_latent, by_parameter, angle)
