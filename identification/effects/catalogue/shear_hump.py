"""Shear stress peaks, then falls to a residual value."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from ....framework.core.soil import PARAMETERS
from ..effect import Contact, Drive, Effect, Parameter, Situation
from ..registry import register

_SHORT, _LONGER = 0.003, math.log(10.0)
"""Share of the radius below which a displacement is too short for a peak to show [-], and ln of the factor by which a
fit then starts with a longer one."""


@register
class ShearHump(Effect):
    """Dense or brittle soil: the share of the strength that is left after the peak; k is where the peak lies.

    From K_r = 1 / (1 - 1/e) = 1.58 on there is no peak: the law is then Janosi & Hanamoto's with c and tan phi 1.58
    times as large. Below, the stress passes a maximum, about tau_max, and falls to K_r tau_max.
    """

    slug = "shear_hump"
    title = "shear hump"
    what_happens = "shear stress peaks, then falls to a residual value"
    check = (
        "shear the soil by an annulus or a plate at constant pressure to several times k: the stress falls after a peak"
    )
    of_any_wheel = True
    belongs_to = "ground"
    nested = False
    equation = "tau = tau_max K_r {1 + [1 / (K_r (1 - 1/e)) - 1] exp(1 - j/k)} [1 - exp(-j/k)]"
    source = "J. Y. Wong, J. Preston-Thomas, J. Terramechanics 19 (1983), 225-234"
    required = ("K_r",)
    later = math.log(3.0)
    """ln of the ratio of k to that of Janosi's law with the same initial slope: e / (1 - 1/e) - (e - 1) K_r, here for
    K_r = 0.75 [-]."""
    parameters = (
        Parameter(
            "K_r", "", 0.05, 1.3, 0.7, 0.3,
            "engineering judgement: dense sand falls from a friction angle of 42 to one of 33 degrees, a ratio of 0.7",
            null=1.0,
        ),
    )  # fmt: skip

    def __init__(self, radius_m: float) -> None:
        self._shortest = math.log(_SHORT * radius_m)

    @classmethod
    def forms(cls, situation: Situation) -> Sequence[Effect]:
        return tuple(form(situation.wheel.radius_m) for form in (ShearHump, SechHump, ExponentialHump))

    def contact(self, contact: Contact, drive: Drive, values: np.ndarray) -> None:
        contact.residual = values[0]

    def starts(self) -> list[np.ndarray]:
        return [np.array([0.75]), np.array([0.4])]

    def initial_soil(self, soil: np.ndarray) -> np.ndarray:
        answer = soil.copy()
        where = PARAMETERS.index("k_m")
        answer[where] += self.later
        if answer[where] < self._shortest:
            # A law without a peak imitates one by a short k, from which the peak cannot be found.
            answer[where] = self._shortest + _LONGER
        return answer


class SechHump(ShearHump):
    """Peat and undisturbed ground: the more h, the higher the peak above what is left; it lies at k to 4 k."""

    form = "sech"
    equation = "tau = tau_max f(j/k) / max f, f(x) = [1 + h / cosh(x)] tanh(x)"
    source = "V. V. Kacigin, V. V. Guskov, J. Terramechanics 5(3) (1968), 43-66"
    required = ("h",)
    later = math.log(1.5)
    """(1 + h) / max f is 1.4 for h = 0.6, and 1.7 for h = 2."""
    parameters = (
        Parameter(
            "h", "", 0.05, 8.0, 0.8, 0.5,
            "engineering judgement: h = 0.8 has a peak of 1.16 times what is left, h = 2 one of 1.7 times",
        ),
    )  # fmt: skip

    def contact(self, contact: Contact, drive: Drive, values: np.ndarray) -> None:
        contact.hump = values[0]

    def starts(self) -> list[np.ndarray]:
        return [np.array([0.6]), np.array([2.0])]


class ExponentialHump(ShearHump):
    """Brittle soil after Bekker: the stress rises over k, then decays slowly to nothing, m times as fast.

    With Bekker's constants m = (K2 - q) / (K2 + q) and k = 1 / [(K2 + q) K1], q = sqrt(K2^2 - 1); at m = 0 the law is
    Janosi & Hanamoto's.
    """

    form = "decay"
    equation = "tau = tau_max f(j/k) / max f, f(x) = exp(-m x) - exp(-x)"
    source = "M. G. Bekker, Theory of Land Locomotion (1956), shear stress of brittle soils"
    required = ("m",)
    later = math.log(1.3)
    """(1 - m) / max f is 1.3 for m = 0.1."""
    parameters = (
        Parameter(
            "m", "", 1e-3, 0.5, 0.1, 0.15,
            "engineering judgement: m = 0.1 leaves 0.8 of the peak after 5 k, m = 0.3 leaves 0.5 of it",
        ),
    )  # fmt: skip

    def contact(self, contact: Contact, drive: Drive, values: np.ndarray) -> None:
        contact.decay = values[0]

    def starts(self) -> list[np.ndarray]:
        return [np.array([0.05]), np.array([0.25])]
