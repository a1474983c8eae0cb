"""Wheel and vehicle accelerate: torque and pull are not those of a steady state."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.constants import g as GRAVITY_M_S2

from ..effect import PULL, TORQUE, Contact, Drive, Effect, Parameter, Situation
from ..registry import register


@register
class Inertia(Effect):
    """Moment of inertia of the wheel, and mass that it pulls along."""

    slug = "inertia"
    title = "inertia"
    what_happens = "wheel and vehicle accelerate: torque and pull are not those of a steady state"
    check = "accelerate and brake on a hard floor and compare torque and pull with steady driving"
    equation = "T += J d(omega)/dt, DP -= m dV/dt"
    source = "I. Newton, Principia (1687), second law"
    changes = (TORQUE, PULL)

    def __init__(self, load_N: float, radius_m: float, torque: bool, pull: bool) -> None:
        mass = load_N / GRAVITY_M_S2
        turning = Parameter(
            "J", "kg m2", 0.0, 20.0 * mass * radius_m**2, 0.0, mass * radius_m**2,
            "engineering judgement: a rim of the mass that the wheel carries; geared motors add rotor inertia",
        )  # fmt: skip
        travelling = Parameter(
            "m", "kg", 0.0, 20.0 * mass, 0.0, 2.0 * mass, "engineering judgement: twice the mass that the wheel carries"
        )
        self._torque, self._pull = torque, pull
        self.needs = ("angular_acceleration_rad_s2",) * torque + ("acceleration_m_s2",) * pull
        self.parameters = (turning,) * torque + (travelling,) * pull

    @classmethod
    def forms(cls, situation: Situation) -> Sequence[Effect]:
        """Give the form of the accelerations that are known and of torque and drawbar pull, as far as measured."""
        torque = situation.measures(TORQUE) and situation.drive.has("angular_acceleration_rad_s2")
        pull = situation.measures(PULL) and situation.drive.has("acceleration_m_s2")
        return _forms(situation, [(torque, pull)])

    @classmethod
    def forms_by_name(cls, situation: Situation) -> Sequence[Effect]:
        """Give the wheel's inertia, the mass pulled along, and both."""
        turning, travelling = (
            situation.drive.has(name) for name in ("angular_acceleration_rad_s2", "acceleration_m_s2")
        )
        both = turning and travelling
        return _forms(situation, [(turning, False), (False, travelling), (both, both)])

    def act(self, channels: np.ndarray, contact: Contact, drive: Drive, values: np.ndarray) -> None:
        if self._torque:
            channels[:, TORQUE] += values[0] * np.nan_to_num(drive.angular_acceleration_rad_s2)
        if self._pull:
            channels[:, PULL] -= values[-1] * np.nan_to_num(drive.acceleration_m_s2)


def _forms(situation: Situation, parts: Sequence[tuple[bool, bool]]) -> Sequence[Effect]:
    load_N, radius_m = float(np.nanmean(situation.drive.load_N)), situation.wheel.radius_m
    return [Inertia(load_N, radius_m, torque, pull) for torque, pull in parts if torque or pull]
