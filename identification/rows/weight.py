"""Load on the wheels from the vehicle's weight, where no cell senses it.

Statics of a rigid vehicle on wheels that yield alike, each in proportion to its load: slope and acceleration move
weight to the rear, a bend to its outer side (J. Y. Wong, "Theory of Ground Vehicles", 4th ed. (2008), Sec. 3.1).
"""

from __future__ import annotations

import math

import numpy as np
from scipy.constants import g as GRAVITY
from scipy.signal import savgol_filter

from ...framework.core.findings import Finding, note, warning
from ...framework.core.recording.clock import interpolate
from ...framework.core.recording.types import Pose, WheelTable
from ...framework.core.track.positions import runs_of
from ...framework.core.vehicle import Vehicle
from ..effects.drive import order_of
from .travel import slopes

_USUAL_SHARE = 0.05
"""Standard deviation of a computed load where the vehicle states none, relative to it [-]: engineering judgement."""

_OVER_S = 1.0
"""Slope, roll and acceleration are taken over this time [s]: their noise would move load and pull together."""

_PULL_SHARE = 0.02
"""Standard deviation of a wheel's share of the vehicle's pull, relative to its load [-]: an attitude within a degree.
The shares are right within 0.003 in simulated drives on slopes up to 9 deg, ruts up to 1.8 times as stiff."""

_RESISTANCE, _RESISTANCE_SD = 0.15, 0.1
"""Rolling resistance of a wheel that is not driven, over its load, and its standard deviation [-]: 0.05 on an unpaved
road, 0.1 to 0.35 on a field (Bosch, *Automotive Handbook*, 9th ed. (2014), "Rolling resistance")."""


def loads(table: WheelTable, vehicle: Vehicle, pose: Pose | None = None) -> np.ndarray | None:
    """Compute the load on the wheel of each row [N], (n,); None where the vehicle does not state its weight.

    Parameters
    ----------
    table
        Rows, with `pitch_rad`, `roll_rad`, `travel_speed_m_s` and `time_s` where they were recorded. A slope or an
        acceleration that is not known is taken as none.
    vehicle
        Its mass, places of wheels and centre of mass; or the load that each wheel carries on level ground.
    pose
        Its heading, whose rate times the travel speed is the acceleration in a bend; taken as none where absent.
    """
    names, row = (np.array([""]), np.zeros(len(table), dtype=int))
    if table.wheel is not None:
        names, row = np.unique(table.wheel.astype(str), return_inverse=True)
    wheels = [vehicle.wheel(name or None) for name in names]
    if vehicle.mass_kg is None:
        stated = np.array([math.nan if wheel.load_N is None else wheel.load_N for wheel in wheels])
        return None if np.isnan(stated).any() else stated[row]
    of_each = _of_every_wheel(table, vehicle, pose)
    of_row = of_each[np.array([vehicle.wheels.index(wheel) for wheel in wheels])[row], np.arange(len(table))]
    return np.where(of_row > 0.0, of_row, math.nan)


def _of_every_wheel(table: WheelTable, vehicle: Vehicle, pose: Pose | None) -> np.ndarray:
    """Compute the loads of all wheels of a vehicle of known mass at each row, (k, n) [N]."""
    pitch, roll = (np.nan_to_num(_over_a_second(table, name)) for name in ("pitch_rad", "roll_rad"))
    along = _acceleration(table)
    height_m = 0.0 if vehicle.centre_of_mass_m is None else vehicle.centre_of_mass_m[2]
    # Slope and acceleration act as if the centre of mass were further back.
    back_m = height_m * (np.tan(pitch) + along / (GRAVITY * np.cos(pitch)))
    right_m = height_m * (np.tan(roll) + _to_the_left(table, pose) / (GRAVITY * np.cos(roll)))
    shares = vehicle.shares_of_weight(-back_m, -right_m)
    assert shares is not None
    assert vehicle.mass_kg is not None
    return vehicle.mass_kg * GRAVITY * np.cos(pitch) * np.cos(roll) * shares


def with_loads(
    table: WheelTable, vehicle: Vehicle, pose: Pose | None = None
) -> tuple[WheelTable, Vehicle, Finding | None]:  # fmt: skip
    """Return the rows with their loads, the vehicle with the loads' noise, and a finding; all as they are where loads
    were sensed or the weight is not stated. The finding is a warning where the slope is not known.
    """
    load = None if table.observed("load_N").size else loads(table, vehicle, pose)
    if load is None:
        return table, vehicle, None
    noise = vehicle.noise.get("load_N", _USUAL_SHARE * float(np.nanmean(load)))
    weighed = vehicle.model_copy(update={"noise": {**vehicle.noise, "load_N": noise}})
    height = vehicle.centre_of_mass_m[2] if vehicle.centre_of_mass_m and vehicle.mass_kg is not None else 0.0
    transfer = [name for name in ("pitch_rad", "roll_rad", "travel_speed_m_s") if height > 0.0 and name in table]
    if height > 0.0 and _to_the_left(table, pose).any():
        transfer.append("yaw_rad")
    if vehicle.mass_kg is not None and not table.observed("pitch_rad").size:
        found = warning("load_without_slope", load_N=float(np.nanmean(load)), sd_N=noise)
        return table.adding({"load_N": load}), weighed, found
    found = note("load_computed", load_N=float(np.nanmean(load)), sd_N=noise, transfer=transfer)
    return table.adding({"load_N": load}), weighed, found


def _acceleration(table: WheelTable) -> np.ndarray:
    """Acceleration of the vehicle (n,) [m/s^2]; none where it is not known."""
    return np.nan_to_num(_over_a_second(table, "travel_speed_m_s", rate=True))


def _to_the_left(table: WheelTable, pose: Pose | None) -> np.ndarray:
    """Acceleration to the left in a bend (n,) [m/s^2], travel speed times rate of turning; none where not known."""
    if pose is None or "time_s" not in table:
        return np.zeros(len(table))
    time_s, rows = np.unique(pose.time_s[np.isfinite(pose.yaw_rad)], return_index=True)
    yaw = np.unwrap(pose.yaw_rad[np.isfinite(pose.yaw_rad)][rows])
    turning = interpolate(time_s, slopes(time_s, yaw, _OVER_S)[0], table["time_s"], _OVER_S)
    return np.nan_to_num(turning * _over_a_second(table, "travel_speed_m_s"))


def _over_a_second(table: WheelTable, name: str, *, rate: bool = False) -> np.ndarray:
    """A channel (n,), or its rate of change [1/s], by straight lines over about `_OVER_S`; as it is where rows are too
    far apart or have no time, and NaN where it was not observed, or no rate is known.

    The time is fixed: channels that were interpolated onto the wheel's clock have noise that looks like change.
    """
    values = table.get(name)
    nothing = np.full(len(table), math.nan)
    answer = nothing if values is None or rate else values.copy()
    if values is None or "time_s" not in table:
        return answer
    time_s, (order, stretch) = table["time_s"], order_of(table)
    for rows in (order[run] for run in runs_of(stretch)):
        rows = rows[np.isfinite(values[rows])]
        step_s = float(np.median(np.diff(time_s[rows]))) if len(rows) > 2 else 0.0
        window = max(2 * round(0.5 * _OVER_S / step_s) + 1, 3) if step_s > 0.0 else 0
        if 0 < window <= len(rows):
            answer[rows] = savgol_filter(values[rows], window, polyorder=1, deriv=int(rate), delta=step_s)
    return answer


def with_pull(
    table: WheelTable, vehicle: Vehicle, pose: Pose | None = None
) -> tuple[WheelTable, Vehicle, Finding | None]:  # fmt: skip
    """Return the rows with each wheel's share of the pull that carries the vehicle along, the vehicle with its noise,
    and a finding; all as they are where pull was sensed, or mass, slope or speed is not known.

    A vehicle that tows nothing needs m (g sin pitch + dV/dt) of its driven wheels together, and the resistance of
    those that are not driven (J. Y. Wong, "Theory of Ground Vehicles", 4th ed. (2008), Eq. 3.2). Each driven wheel is
    taken to pull in proportion to its load, as wheels of one size and one slip do but for what deeper sinkage costs:
    within `_PULL_SHARE` of the load. Where it is not known whether a wheel is driven, the finding is a warning, and the
    pull is left out.

    Parameters
    ----------
    table
        Rows with the computed loads of the wheels.
    vehicle
        With its mass.
    pose
        As in `loads`.
    """
    needed = ("load_N", "pitch_rad", "travel_speed_m_s", "time_s")
    pulled = any(table.observed(name).size for name in ("drawbar_pull_N", "sinkage_m"))
    there = set() if table.wheel is None else set(table.wheel.astype(str).tolist())
    driven = np.array([wheel.driven or (wheel.driven is None and wheel.name in there) for wheel in vehicle.wheels])
    alike = len({(each.radius_m, each.width_m) for each, pulls in zip(vehicle.wheels, driven, strict=True) if pulls})
    if vehicle.mass_kg is None or pulled or alike != 1 or any(name not in table for name in needed):
        return table, vehicle, None
    unknown = [each.name for each in vehicle.wheels if each.driven is None and each.name not in there]
    if unknown:
        return table, vehicle, warning("driven_not_known", wheels=unknown)
    load = _of_every_wheel(table, vehicle, pose)
    dragged, carried = load[~driven].sum(axis=0), load[driven].sum(axis=0)
    along = vehicle.mass_kg * (GRAVITY * np.sin(_over_a_second(table, "pitch_rad")) + _acceleration(table))
    pull = table["load_N"] / carried * (along + _RESISTANCE * dragged)
    if not np.isfinite(pull).any():
        return table, vehicle, None
    mean_N, towed_share, by_N = _by_load(dragged / carried, table["load_N"])
    noise = vehicle.noise.get("drawbar_pull_N", math.hypot(_PULL_SHARE, _RESISTANCE_SD * towed_share) * mean_N)
    known = vehicle.model_copy(update={"noise": {**vehicle.noise, "drawbar_pull_N": noise}})
    towed = [each.name for each, pulls in zip(vehicle.wheels, driven, strict=True) if not pulls]
    found = note(
        "pull_computed", sd_N=noise, towed=towed, share=_PULL_SHARE, load_N=mean_N, resistance=_RESISTANCE,
        resistance_sd=_RESISTANCE_SD if towed else 0.0, towed_over_driven=towed_share, towed_over_driven_by_N=by_N,
    )  # fmt: skip
    return table.adding({"drawbar_pull_N": pull}), known, found


def _by_load(share: np.ndarray, load_N: np.ndarray) -> tuple[float, float, float]:
    """Give the mean load [N], and the straight line by it of a share (n,) [-]: its value there, and its slope [1/N]."""
    rows = np.isfinite(share) & np.isfinite(load_N)
    away = load_N[rows] - load_N[rows].mean()
    slope = float(away @ share[rows] / max(away @ away, 1e-300))
    return float(load_N[rows].mean()), float(share[rows].mean()), slope
