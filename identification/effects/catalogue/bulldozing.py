"""Soil is pushed up in front of the wheel."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..effect import PULL, Contact, Drive, Effect, Parameter, Situation
from ..registry import register

UNIT_WEIGHT_N_M3 = 15.7e3
"""Of dry sand, 1600 kg/m3: the scale of the resistance, whose share is estimated."""

_SHARE = "engineering judgement: 1 by definition; theories of passive pressure differ by a factor of two"


@register
class Bulldozing(Effect):
    """A wedge of soil fails passively before the wheel's front, its strength that of the soil."""

    slug = "bulldozing"
    title = "bulldozing"
    what_happens = "soil is pushed up in front of the wheel, which costs pull"
    check = "look for a wave of soil ahead of the wheel; measure the pull with the soil ahead taken away"
    of_any_wheel = True
    belongs_to = "ground"
    form = "wedge"
    equation = "R_b = s b [cot X + tan(X + phi)] [c z + (cot X + cot^2 X tan phi) gamma z^2 / 2], X = 45 deg - phi / 2"
    source = (
        "E. Hegedus, Land Locomotion Laboratory report 61 (1960), as in G. Ishigami et al., J. Field Robotics 24 (2007)"
    )
    changes = (PULL,)
    parameters = (Parameter("s", "", 0.0, 20.0, 0.5, 2.0, _SHARE),)

    @classmethod
    def forms(cls, situation: Situation) -> Sequence[Effect]:
        """Give the forms where the drawbar pull was measured."""
        return (Bulldozing(), PassivePressure(), RankinePressure()) if situation.measures(PULL) else ()

    def act(self, channels: np.ndarray, contact: Contact, drive: Drive, values: np.ndarray) -> None:
        phi = np.arctan(np.maximum(contact.tan_phi, 0.0))
        failure = np.pi / 4.0 - phi / 2.0
        cot = 1.0 / np.tan(failure)
        spread = cot + np.tan(failure + phi)
        depth = contact.sinkage_m
        weight = (cot + cot**2 * np.tan(phi)) * UNIT_WEIGHT_N_M3 * depth**2 / 2.0
        resistance = contact.wheel.width_m * spread * (np.maximum(contact.c_Pa, 0.0) * depth + weight)
        channels[:, PULL] -= values[0] * resistance


class PassivePressure(Bulldozing):
    """Passive earth pressure on the front that grows with the square of sinkage alone."""

    form = "pressure"
    equation = "R_b = N b z^2 gamma"
    source = "after E. McKyes, Soil Cutting and Tillage (1985), weight term of the passive earth pressure"
    parameters = (
        Parameter("N", "", 0.0, 100.0, 3.0, 10.0, "E. McKyes (1985): N_gamma of 1 to 10 for blades of usual rakes"),
    )

    def act(self, channels: np.ndarray, contact: Contact, drive: Drive, values: np.ndarray) -> None:
        channels[:, PULL] -= values[0] * UNIT_WEIGHT_N_M3 * contact.wheel.width_m * contact.sinkage_m**2


class RankinePressure(Bulldozing):
    """Passive earth pressure of soil with cohesion on the front, over the wheel's width."""

    form = "Rankine"
    equation = "R_b = share b [2 c z sqrt(K_p) + K_p gamma z^2 / 2], K_p = tan^2(45 deg + phi / 2)"
    source = "W. J. M. Rankine, Phil. Trans. R. Soc. 147 (1857), 9-27; with cohesion J.-Y. Wong (2010), Sec. 2.2"
    parameters = (Parameter("share", "", 0.0, 20.0, 0.5, 2.0, _SHARE),)

    def act(self, channels: np.ndarray, contact: Contact, drive: Drive, values: np.ndarray) -> None:
        phi = np.arctan(np.maximum(contact.tan_phi, 0.0))
        root = np.tan(np.pi / 4.0 + phi / 2.0)
        depth = contact.sinkage_m
        pressure = 2.0 * np.maximum(contact.c_Pa, 0.0) * depth * root + root**2 * UNIT_WEIGHT_N_M3 * depth**2 / 2.0
        channels[:, PULL] -= values[0] * contact.wheel.width_m * pressure
