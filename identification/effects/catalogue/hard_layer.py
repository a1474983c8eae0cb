"""A stiffer layer lies beneath the soil."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from ..effect import SINKAGE, Contact, Drive, Effect, Parameter, Situation
from ..registry import register

_REACHED = 0.75
"""Depth of a layer as a share of the sinkage at which the stress peak reaches it [-]."""

_STIFFER = 5.0
"""Usual ratio of the layer's stiffness to that of the soil above it [-]."""


@register
class HardLayer(Effect):
    """Below its depth a layer adds its own pressure-sinkage curve.

    z is the depth of the rim in the front zone, r (cos theta - cos theta_1): the layer acts once the point of the
    stress peak reaches it, with theta_m midway at a sinkage of about 4/3 d.
    """

    slug = "hard_layer"
    title = "hard layer"
    what_happens = "a stiffer layer lies beneath the soil"
    check = "dig, or push a penetrometer to below the rut: resistance jumps at the layer"
    of_any_wheel = True
    belongs_to = "ground"
    nested = False
    equation = "sigma = S (z/b)^n + S_L ((z - d)/b)^n for z > d"
    source = "after M. G. Bekker, Introduction to Terrain-Vehicle Systems (1969), layered media"
    required = ("d", "ln_S_L")

    def __init__(self, sinkages: np.ndarray, stiffness_Pa: float) -> None:
        deepest = float(np.nanmax(sinkages))
        self._depths = _REACHED * np.nanpercentile(sinkages, [10.0, 40.0, 70.0])
        self._stiff = math.log(_STIFFER * stiffness_Pa)
        # A layer that stiffens without limit is a floor: beyond the upper bound nothing changes any more.
        self.parameters = (
            Parameter(
                "d", "m", 0.02 * deepest, 1.2 * deepest, float(self._depths[1]), 0.5 * deepest,
                "engineering judgement: a layer that shows lies within the depths that the wheel reached", null=deepest,
            ),
            Parameter(
                "ln_S_L", "ln Pa", 4.0, 20.0, self._stiff, 2.0,
                "engineering judgement: five times as stiff as the soil above, within a factor of seven",
                null=self._stiff,
            ),
        )  # fmt: skip

    @classmethod
    def forms(cls, situation: Situation) -> Sequence[Effect]:
        """Give the form where sinkage was measured."""
        return (cls(situation.sinkage_m, situation.stiffness_Pa),) if situation.measures(SINKAGE) else ()

    def starts(self) -> list[np.ndarray]:
        return [np.array([depth, self._stiff]) for depth in self._depths]

    def contact(self, contact: Contact, drive: Drive, values: np.ndarray) -> None:
        contact.layer_depth_m = values[0]
        contact.layer_stiffness_Pa = np.exp(values[1])
