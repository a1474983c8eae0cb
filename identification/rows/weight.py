"""Load on the wheels from the vehicle's weight, where no cell senses it.

Statics of a rigid vehicle on wheels that yield alike, each in proportion to its load: slope and acceleration move
weight to the rear (J. Y. Wong, "Theory of Ground Vehicles", 4th ed. (2008), Sec. 3.1).
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from scipy.constants import g as GRAVITY

from ...framework.core.findings import Finding, note
from ...framework.core.recording.types import WheelTable
from ...framework.core.vehicle import Vehicle
from ..effects.drive import order_of, rate_of_change

_USUAL_SHARE = 0.05
"""Standard deviation of a computed load where the vehicle states none, relative to it [-]: engineering judgement."""


def loads(table: WheelTable, vehicle: Vehicle) -> np.ndarray | None:
    """Compute the load on the wheel of each row [N], (n,); None where the vehicle does not state its weight.

    Parameters
    ----------
    table
        Rows, with `pitch_rad`, `travel_speed_m_s` and `time_s` where they were recorded. A slope or an acceleration
        that is not known is taken as none.
    vehicle
        Its mass, places of wheels and centre of mass; or the load that each wheel carries on level ground. Wheels that
        it describes by a single one share the mass equally.
    """
    names, row = (np.array([""]), np.zeros(len(table), dtype=int))
    if table.wheel is not None:
        names, row = np.unique(table.wheel.astype(str), return_inverse=True)
    wheels = [vehicle.wheel(name or None) for name in names]
    if vehicle.mass_kg is None:
        stated = np.array([math.nan if wheel.load_N is None else wheel.load_N for wheel in wheels])
        return None if np.isnan(stated).any() else stated[row]
    pitch, along = np.nan_to_num(table.columns.get("pitch_rad", np.zeros(len(table)))), _acceleration(table)
    down = vehicle.mass_kg * GRAVITY * np.cos(pitch)
    if len(vehicle.wheels) == 1:
        return down / len(names)
    place = np.array([wheel.position_m for wheel in vehicle.wheels])
    x_m, y_m, height_m = vehicle.centre_of_mass_m or (*place.mean(axis=0), 0.0)
    back = vehicle.mass_kg * (GRAVITY * np.sin(pitch) + along) * height_m
    # Of all loads that balance the weight the smallest, which are a plane over the wheels' places.
    shares = np.linalg.pinv(np.vstack([np.ones(len(place)), place.T]))
    shares = shares[[vehicle.wheels.index(wheel) for wheel in wheels]][row]
    answer = shares[:, 0] * down + shares[:, 1] * (x_m * down - back) + shares[:, 2] * y_m * down
    return np.where(answer > 0.0, answer, math.nan)


def with_loads(table: WheelTable, vehicle: Vehicle) -> tuple[WheelTable, Vehicle, Finding | None]:
    """Return the rows with their loads, the vehicle with the loads' noise, and a note; all as they are where loads were
    sensed or the weight is not stated.
    """
    load = None if "load_N" in table else loads(table, vehicle)
    if load is None:
        return table, vehicle, None
    noise = vehicle.noise.get("load_N", _USUAL_SHARE * float(np.nanmean(load)))
    weighed = vehicle.model_copy(update={"noise": {**vehicle.noise, "load_N": noise}})
    height = vehicle.centre_of_mass_m[2] if vehicle.centre_of_mass_m and vehicle.mass_kg is not None else 0.0
    transfer = [name for name in ("pitch_rad", "travel_speed_m_s") if height > 0.0 and name in table]
    found = note("load_computed", load_N=float(np.nanmean(load)), sd_N=noise, transfer=transfer)
    return replace(table, columns={**table.columns, "load_N": load}), weighed, found


def _acceleration(table: WheelTable) -> np.ndarray:
    """Acceleration of the vehicle (n,) [m/s^2]; none where it is not known."""
    answer = np.zeros(len(table))
    speed, time_s = table.get("travel_speed_m_s"), table.get("time_s")
    if speed is None or time_s is None:
        return answer
    order, stretch = order_of(table)
    answer[order] = np.nan_to_num(rate_of_change(speed[order], time_s[order], stretch))
    return answer
