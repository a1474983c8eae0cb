"""Soil slips on the rim before it shears within."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..effect import Contact, Drive, Effect, Parameter, Situation
from ..registry import register

_STARTS = 0.95, 0.7
"""Shares of the soil's own strength from which fits start [-]."""

_USUAL = 0.3
"""Adhesion to a rim, as a share of the soil's strength below it [-]."""


@register
class RimAdhesion(Effect):
    """The rim's adhesion and friction cap the shear strength, or cut the soil's shear stress off."""

    slug = "rim_adhesion"
    title = "slip on the rim"
    what_happens = "soil slips on the rim before it shears within"
    check = "measure cohesion and friction of the soil by a shear test, and those on the rim's material by another"
    of_any_wheel = True
    belongs_to = "ground"
    nested = False
    source = (
        "M. G. Bekker, Theory of Land Locomotion (1956), external friction; adhesion and friction as in A. R. Reece, "
        "Proc. Inst. Mech. Eng. 179(6) (1964), 16-22"
    )
    required = ("c_a", "tan_delta")

    def __init__(self, c_Pa: float, tan_phi: float, usual_Pa: float, *, cuts_off: bool = False) -> None:
        self._cuts_off = cuts_off
        self.form = "cut off" if cuts_off else "strength"
        self.equation = (
            "tau = min((c + sigma tan phi)(1 - exp(-j / k)), c_a + sigma tan delta)"
            if cuts_off
            else "tau_max = min(c + sigma tan phi, c_a + sigma tan delta)"
        )
        self.parameters = (
            Parameter(
                "c_a", "Pa", 0.0, 1e5, 0.8 * c_Pa, usual_Pa,
                "engineering judgement: adhesion is below a third of the soil's strength at the rim's pressure",
            ),
            Parameter(
                "tan_delta", "", 0.0, 1.5, 0.9 * tan_phi, 0.2,
                "soil on steel: delta of 15 to 30 degrees, as usual in tables of earth pressure", null=0.45,
            ),
        )  # fmt: skip
        self._within = c_Pa, tan_phi

    @classmethod
    def forms(cls, situation: Situation) -> Sequence[Effect]:
        soil = situation.c_Pa, situation.tan_phi, _USUAL * situation.strength_Pa
        return tuple(cls(*soil, cuts_off=cuts_off) for cuts_off in (False, True))

    def starts(self) -> list[np.ndarray]:
        # Just below the soil's own strength, where the rim acts: a cap far below would hide the soil from the fit.
        c_Pa, tan_phi = self._within
        return [np.array([share * c_Pa, share * tan_phi]) for share in _STARTS] + [
            np.array([1.5 * c_Pa + 200.0, 0.8 * tan_phi])
        ]

    def contact(self, contact: Contact, drive: Drive, values: np.ndarray) -> None:
        contact.adhesion_Pa, contact.tan_delta = values[0], values[1]
        contact.rim_cuts_off = float(self._cuts_off)
