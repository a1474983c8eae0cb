"""A stiffer layer lies beneath the soil."""

from __future__ import annotations

import math

import numpy as np

from .effect import SINKAGE, Contact, Drive, Effect, Parameter, Situation

_FELT = 0.75
"""Depth of a layer, as a share of the sinkage from which on it is felt [-]."""

_STIFFER = 5.0
"""How many times as stiff as the soil above it a layer usually is [-]."""


class HardLayer(Effect):
    """Below its depth a layer adds its own pressure-sinkage curve.

    z is the rim's depth in the law of the front zone, r (cos theta - cos theta_1): the layer is felt once the point of
    the stress peak reaches it, with theta_m midway at a sinkage of about 4/3 d.
    """

    slug = "hard_layer"
    nested = False
    equation = "sigma = S (z/b)^n + S_L ((z - d)/b)^n for z > d"
    source = "after M. G. Bekker, Introduction to Terrain-Vehicle Systems (1969), layered media"
    required = ("d", "ln_S_L")

    def __init__(self, sinkages: np.ndarray, stiffness_Pa: float) -> None:
        deepest = float(np.nanmax(sinkages))
        self._depths = _FELT * np.nanpercentile(sinkages, [10.0, 40.0, 70.0])
        self._stiff = math.log(_STIFFER * stiffness_Pa)
        # A layer that stiffens without limit is a floor: beyond this nothing changes any more.
        self.parameters = (
            Parameter("d", "m", 0.02 * deepest, 1.2 * deepest, float(self._depths[1]), 0.5 * deepest, deepest),
            Parameter("ln_S_L", "ln Pa", 4.0, 20.0, self._stiff, 2.0, self._stiff),
        )

    def starts(self) -> list[np.ndarray]:
        return [np.array([depth, self._stiff]) for depth in self._depths]

    def contact(self, contact: Contact, drive: Drive, values: np.ndarray) -> None:
        contact.layer_depth_m = values[0]
        contact.layer_stiffness_Pa = np.exp(values[1])


def forms(situation: Situation) -> tuple[Effect, ...]:
    """Give the form that these data can show: sinkage has to be measured."""
    if not situation.seen(SINKAGE):
        return ()
    return (HardLayer(situation.sinkage_m, situation.stiffness_Pa),)
