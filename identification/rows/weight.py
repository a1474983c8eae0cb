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
        Its mass, places of wheels and centre of mass; or the load that each wheel carries on level ground.
    """
    names, row = (np.array([""]), np.zeros(len(table), dtype=int))
    if table.wheel is not None:
        names, row = np.unique(table.wheel.astype(str), return_inverse=True)
    wheels = [vehicle.wheel(name or None) for name in names]
    if vehicle.mass_kg is None:
        stated = np.array([math.nan if wheel.load_N is None else wheel.load_N for wheel in wheels])
        return None if np.isnan(stated).any() else stated[row]
    pitch, along = np.nan_to_num(table.columns.get("pitch_rad", np.zeros(len(table)))), _acceleration(table)
    height_m = 0.0 if vehicle.centre_of_mass_m is None else vehicle.centre_of_mass_m[2]
    # Slope and acceleration act as if the centre of mass were further back.
    shares = vehicle.shares_of_weight(-height_m * (np.tan(pitch) + along / (GRAVITY * np.cos(pitch))))
    assert shares is not None
    of_row = shares[np.array([vehicle.wheels.index(wheel) for wheel in wheels])[row], np.arange(len(table))]
    return np.where(of_row > 0.0, vehicle.mass_kg * GRAVITY * np.cos(pitch) * of_row, math.nan)


def with_loads(table: WheelTable, vehicle: Vehicle) -> tuple[WheelTable, Vehicle, Finding | None]:
    """Return the rows with their loads, the vehicle with the loads' noise, and a note; all as they are where loads were
    sensed or the weight is not stated.
    """
    load = None if table.observed("load_N").size else loads(table, vehicle)
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
