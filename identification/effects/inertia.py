"""Wheel and vehicle accelerate: torque and pull are not those of a steady state."""

from __future__ import annotations

import numpy as np
from scipy.constants import g as GRAVITY_M_S2

from .effect import PULL, TORQUE, Contact, Drive, Effect, Parameter, Situation


class Inertia(Effect):
    """The wheel's moment of inertia and the mass that it pulls along."""

    slug = "inertia"
    equation = "T += J d(omega)/dt, DP -= m dV/dt"
    source = "I. Newton, Principia (1687), second law"

    def __init__(self, load_N: float, radius_m: float, torque: bool, pull: bool) -> None:
        mass = load_N / GRAVITY_M_S2
        turning = Parameter("J", "kg m2", 0.0, 20.0 * mass * radius_m**2, 0.0, mass * radius_m**2)
        travelling = Parameter("m", "kg", 0.0, 20.0 * mass, 0.0, 2.0 * mass)
        self._torque, self._pull = torque, pull
        self.needs = ("angular_acceleration_rad_s2",) * torque + ("acceleration_m_s2",) * pull
        self.parameters = (turning,) * torque + (travelling,) * pull

    def act(self, channels: np.ndarray, contact: Contact, drive: Drive, values: np.ndarray) -> None:
        if self._torque:
            channels[:, TORQUE] += values[0] * np.nan_to_num(drive.angular_acceleration_rad_s2)
        if self._pull:
            channels[:, PULL] -= values[-1] * np.nan_to_num(drive.acceleration_m_s2)


def forms(situation: Situation) -> tuple[Effect, ...]:
    """Give the form that these data can show: speeds in time, and torque or drawbar pull."""
    drive = situation.drive
    torque = situation.seen(TORQUE) and drive.has("angular_acceleration_rad_s2")
    pull = situation.seen(PULL) and drive.has("acceleration_m_s2")
    if not (torque or pull):
        return ()
    return (Inertia(float(np.nanmean(drive.load_N)), situation.wheel.radius_m, torque, pull),)


def named(situation: Situation) -> tuple[Effect, ...]:
    """Give the forms that a simulation may ask for: the wheel's inertia, the mass pulled along, or both."""
    drive = situation.drive
    turning, travelling = drive.has("angular_acceleration_rad_s2"), drive.has("acceleration_m_s2")
    load, radius = float(np.nanmean(drive.load_N)), situation.wheel.radius_m
    shown = ((turning, (True, False)), (travelling, (False, True)), (turning and travelling, (True, True)))
    return tuple(Inertia(load, radius, *parts) for seen, parts in shown if seen)
