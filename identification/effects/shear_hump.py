"""Shear stress peaks, then falls to a residual value."""

from __future__ import annotations

import math

import numpy as np

from ...framework.core.soil import PARAMETERS
from .effect import Contact, Drive, Effect, Parameter, Situation

_LATER = math.log(3.0)
"""ln of the share by which k is larger than that of the law without a peak that rises as fast: e / (1 - 1/e) - (e - 1)
K_r, for K_r = 0.75 [-]."""

_SHORT, _LONGER = 0.003, math.log(10.0)
"""Share of the radius below which a displacement is too short for a peak to be told there [-], and ln of how many times
longer one is that is told."""


_LATER_SECH = math.log(1.5)
"""The same for Kacigin & Guskov's law, (1 + h) over the greatest value of f: 1.4 for h = 0.6, 1.7 for h = 2 [-]."""


class ShearHump(Effect):
    """Dense or brittle soil: the share of the strength that is left after the peak; k is where the peak lies.

    From K_r = 1 / (1 - 1/e) = 1.58 on there is no peak: the law is then Janosi & Hanamoto's with c and tan phi 1.58
    times as large. Below, the stress passes a maximum, about tau_max, and falls to K_r tau_max.
    """

    slug = "shear_hump"
    nested = False
    equation = "tau = tau_max K_r {1 + [1 / (K_r (1 - 1/e)) - 1] exp(1 - j/k)} [1 - exp(-j/k)]"
    source = "J. Y. Wong, J. Preston-Thomas, J. Terramechanics 19 (1983), 225-234"
    required = ("K_r",)
    later = _LATER
    """ln of the share by which k is larger than that of the law without a peak that rises as fast [-]."""

    parameters = (Parameter("K_r", "", 0.05, 1.3, 0.7, 0.3, 1.0),)

    def __init__(self, radius_m: float) -> None:
        self._shortest = math.log(_SHORT * radius_m)

    def contact(self, contact: Contact, drive: Drive, values: np.ndarray) -> None:
        contact.residual = values[0]

    def starts(self) -> list[np.ndarray]:
        return [np.array([0.75]), np.array([0.4])]

    def beside(self, soil: np.ndarray) -> np.ndarray:
        answer = soil.copy()
        where = PARAMETERS.index("k_m")
        answer[where] += self.later
        if answer[where] < self._shortest:
            # A law without a peak makes up for one by rising at once: where it lies is then not to be seen from it.
            answer[where] = self._shortest + _LONGER
        return answer


class SechHump(ShearHump):
    """Peat and undisturbed ground: the more h, the higher the peak above what is left; it lies at k to 4 k."""

    form = "sech"
    equation = "tau = tau_max f(j/k) / max f, f(x) = [1 + h / cosh(x)] tanh(x)"
    source = "V. V. Kacigin, V. V. Guskov, J. Terramechanics 5(3) (1968), 43-66"
    required = ("h",)
    later = _LATER_SECH
    parameters = (Parameter("h", "", 0.05, 8.0, 0.8, 0.5),)

    def contact(self, contact: Contact, drive: Drive, values: np.ndarray) -> None:
        contact.hump = values[0]

    def starts(self) -> list[np.ndarray]:
        return [np.array([0.6]), np.array([2.0])]


def forms(situation: Situation) -> tuple[Effect, ...]:
    """Give the forms that these data can show."""
    return ShearHump(situation.wheel.radius_m), SechHump(situation.wheel.radius_m)
