"""Soil slips on the rim before it shears within."""

from __future__ import annotations

import numpy as np

from .effect import Contact, Drive, Effect, Parameter, Situation

_STARTS = 0.95, 0.7
"""Shares of the soil's own strength to start from [-]."""

_USUAL = 0.3
"""Adhesion to a rim, as a share of the soil's strength below it [-]."""


class RimAdhesion(Effect):
    """The rim's own adhesion and friction cap the shear strength, or cut the soil's shear stress off."""

    slug = "rim_adhesion"
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
            Parameter("c_a", "Pa", 0.0, 1e5, 0.8 * c_Pa, usual_Pa),
            Parameter("tan_delta", "", 0.0, 1.5, 0.9 * tan_phi, 0.2, 0.45),
        )
        self._within = c_Pa, tan_phi

    def starts(self) -> list[np.ndarray]:
        # Below the soil's own strength, where the rim is felt: a cap far below would hide the soil from the search.
        c_Pa, tan_phi = self._within
        return [np.array([share * c_Pa, share * tan_phi]) for share in _STARTS] + [
            np.array([1.5 * c_Pa + 200.0, 0.8 * tan_phi])
        ]

    def contact(self, contact: Contact, drive: Drive, values: np.ndarray) -> None:
        contact.adhesion_Pa, contact.tan_delta = values[0], values[1]
        contact.rim_cuts_off = float(self._cuts_off)


def forms(situation: Situation) -> tuple[Effect, ...]:
    """Give the forms that these data can show."""
    soil = situation.c_Pa, situation.tan_phi, _USUAL * situation.strength_Pa
    return tuple(RimAdhesion(*soil, cuts_off=cuts_off) for cuts_off in (False, True))
