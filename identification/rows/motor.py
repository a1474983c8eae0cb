"""Torque at the wheels from the current of their motors, where no torque is sensed."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from ...framework.core.findings import Finding, note
from ...framework.core.recording.types import WheelTable
from ...framework.core.vehicle import Motor, Vehicle


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


def with_torque(table: WheelTable, vehicle: Vehicle) -> tuple[WheelTable, Finding | None]:
    """Return the rows with the torque of their `current_A`, and a note; as they are where torque was sensed, no current
    was, or the vehicle states no motor.
    """
    current = table.get("current_A")
    if current is None or table.observed("torque_Nm").size or vehicle.motor is None:
        return table, None
    torque = torque_of_current(current, table.get("wheel_speed_rad_s"), vehicle.motor)
    if not np.isfinite(torque).any():
        return table, None
    motor = vehicle.motor
    constant = motor.torque_constant_Nm_A * motor.gear_ratio * motor.efficiency
    found = note(
        "torque_computed", Nm_A=constant, friction_Nm=motor.friction_Nm, torque_Nm=float(np.nanmean(torque)),
        lossless=math.isclose(motor.efficiency, 1.0) and motor.friction_Nm == 0.0,
    )  # fmt: skip
    return replace(table, columns={**table.columns, "torque_Nm": torque}), found
