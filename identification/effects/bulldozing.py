"""Soil is pushed up in front of the wheel."""

from __future__ import annotations

import numpy as np

from .effect import PULL, Contact, Drive, Effect, Parameter, Situation

UNIT_WEIGHT_N_M3 = 15.7e3
"""Of dry sand, 1600 kg/m3: the scale of the resistance, whose share is estimated."""

_PUBLISHED = (0.0, 4.0)
"""Share of what the theory gives: some theories give twice what others do [-]."""


class PassiveWedge(Effect):
    """A wedge of soil fails passively before the wheel's front, its strength that of the soil."""

    slug = "bulldozing"
    form = "wedge"
    equation = "R_b = s b [cot X + tan(X + phi)] [c z + (cot X + cot^2 X tan phi) gamma z^2 / 2], X = 45 deg - phi / 2"
    source = (
        "E. Hegedus, Land Locomotion Laboratory report 61 (1960), as in G. Ishigami et al., J. Field Robotics 24 (2007)"
    )
    parameters = (Parameter("s", "", 0.0, 20.0, 0.5, 2.0, published=_PUBLISHED),)

    def act(self, channels: np.ndarray, contact: Contact, drive: Drive, values: np.ndarray) -> None:
        phi = np.arctan(np.maximum(contact.tan_phi, 0.0))
        failure = np.pi / 4.0 - phi / 2.0
        cot = 1.0 / np.tan(failure)
        spread = cot + np.tan(failure + phi)
        depth = contact.sinkage_m
        weight = (cot + cot**2 * np.tan(phi)) * UNIT_WEIGHT_N_M3 * depth**2 / 2.0
        resistance = contact.wheel.width_m * spread * (np.maximum(contact.c_Pa, 0.0) * depth + weight)
        channels[:, PULL] -= values[0] * resistance


class PassivePressure(Effect):
    """Passive earth pressure on the front, that grows with the square of sinkage alone."""

    slug = "bulldozing"
    form = "pressure"
    equation = "R_b = N b z^2 gamma"
    source = "after E. McKyes, Soil Cutting and Tillage (1985), weight term of the passive earth pressure"
    parameters = (Parameter("N", "", 0.0, 100.0, 3.0, 10.0),)

    def act(self, channels: np.ndarray, contact: Contact, drive: Drive, values: np.ndarray) -> None:
        channels[:, PULL] -= values[0] * UNIT_WEIGHT_N_M3 * contact.wheel.width_m * contact.sinkage_m**2


class RankinePressure(Effect):
    """Passive earth pressure of soil with cohesion on the front, over the wheel's width."""

    slug = "bulldozing"
    form = "Rankine"
    equation = "R_b = share b [2 c z sqrt(K_p) + K_p gamma z^2 / 2], K_p = tan^2(45 deg + phi / 2)"
    source = "W. J. M. Rankine, Phil. Trans. R. Soc. 147 (1857), 9-27; with cohesion J.-Y. Wong (2010), Sec. 2.2"
    parameters = (Parameter("share", "", 0.0, 20.0, 0.5, 2.0, published=_PUBLISHED),)

    def act(self, channels: np.ndarray, contact: Contact, drive: Drive, values: np.ndarray) -> None:
        phi = np.arctan(np.maximum(contact.tan_phi, 0.0))
        root = np.tan(np.pi / 4.0 + phi / 2.0)
        depth = contact.sinkage_m
        pressure = 2.0 * np.maximum(contact.c_Pa, 0.0) * depth * root + root**2 * UNIT_WEIGHT_N_M3 * depth**2 / 2.0
        channels[:, PULL] -= values[0] * contact.wheel.width_m * pressure


def forms(situation: Situation) -> tuple[Effect, ...]:
    """Give the forms that these data can show: drawbar pull has to be measured."""
    return (PassiveWedge(), PassivePressure(), RankinePressure()) if situation.seen(PULL) else ()
