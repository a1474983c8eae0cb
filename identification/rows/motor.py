"""Torque at the wheels from the current of their motors, where no torque is sensed."""

from __future__ import annotations

import math

import numpy as np

from ...framework.core.errors import InputError
from ...framework.core.findings import Finding, note
from ...framework.core.recording.types import WheelTable
from ...framework.core.vehicle import Motor, Vehicle

SPINS_RAD_S = 0.1
"""A wheel that turns faster than this spins [rad/s]."""

_FEWEST = 10
"""Fewest rows of a free spin."""


def torque_of_current(current_A: np.ndarray, wheel_speed_rad_s: np.ndarray | None, motor: Motor) -> np.ndarray:
    """Torque at the wheel (n,) [N m] of a motor's current (n,) [A].

    The gear's losses lie with the wheel where the motor drives it, and with the motor where the wheel drives that
    (R. Isermann, *Mechatronic Systems* (2005), Sec. 5.3). Friction opposes the rotation; none is known of a wheel that
    does not turn, or whose speed is not known: it is then taken to turn as its motor drives it.
    """
    motors = motor.torque_constant_Nm_A * motor.gear_ratio * current_A
    turns = motors if wheel_speed_rad_s is None else np.where(np.isnan(wheel_speed_rad_s), motors, wheel_speed_rad_s)
    driving = motors * turns >= 0.0
    return np.where(driving, motors * motor.efficiency, motors / motor.efficiency) - motor.friction_Nm * np.sign(turns)


def _with_friction(table: WheelTable, motor: Motor) -> Motor:
    """Give the motor the friction [N m] that a free spin shows, where the vehicle states when there was one.

    Raises
    ------
    InputError
        The wheels do not turn then, or nothing says so.
    """
    if motor.free_spin_s is None:
        return motor
    start_s, end_s = motor.free_spin_s
    nothing = np.full(len(table), np.nan)
    time_s, rate = (table.get(name) for name in ("time_s", "wheel_speed_rad_s"))
    spins = np.abs(nothing if rate is None else rate) > SPINS_RAD_S
    if time_s is not None:
        spins &= (time_s >= start_s) & (time_s <= end_s)
    taken = np.abs(table["current_A"][spins])
    taken = taken[np.isfinite(taken)]
    if time_s is None or len(taken) < _FEWEST:
        raise InputError(
            table.source, f"{len(taken)} rows in which wheels turn from {start_s:g} s to {end_s:g} s",
            expected=f"{_FEWEST} or more, with time_s, wheel_speed_rad_s and current_A, for [motor] free_spin_s",
        )  # fmt: skip
    lost = motor.torque_constant_Nm_A * motor.gear_ratio * motor.efficiency * float(np.median(taken))
    return motor.model_copy(update={"friction_Nm": lost, "free_spin_s": None})


def with_torque(table: WheelTable, vehicle: Vehicle) -> tuple[WheelTable, Finding | None]:
    """Return the rows with the torque of their `current_A`, and a note; as they are where torque was sensed, no current
    was, or the vehicle states no motor.
    """
    current = table.get("current_A")
    if current is None or table.observed("torque_Nm").size or vehicle.motor is None:
        return table, None
    motor = _with_friction(table, vehicle.motor)
    torque = torque_of_current(current, table.get("wheel_speed_rad_s"), motor)
    if not np.isfinite(torque).any():
        return table, None
    constant = motor.torque_constant_Nm_A * motor.gear_ratio * motor.efficiency
    found = note(
        "torque_computed", Nm_A=constant, friction_Nm=motor.friction_Nm, torque_Nm=float(np.nanmean(torque)),
        lossless=math.isclose(motor.efficiency, 1.0) and motor.friction_Nm == 0.0,
    )  # fmt: skip
    return table.adding({"torque_Nm": torque}), found
