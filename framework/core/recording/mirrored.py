"""Wheels whose joints turn backwards while the vehicle drives forwards: one side is often mounted mirrored."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .clock import interpolate
from .types import Pose, WheelTable

OF_A_JOINT = ("wheel_speed_rad_s", "wheel_angle_rad", "torque_Nm", "current_A")
"""Channels whose sign is that of the joint's axis."""

_CLEARLY = 0.95
"""Share of the way of a wheel's rim on which it turns against the vehicle's travel, from which on its axis does [-]."""

_FEWEST = 20
"""Least number of rows for a decision."""

_SLOWEST_M_S = 0.02
"""Slower travel may be noise of a speed [m/s]."""


def with_axes_forward(table: WheelTable, pose: Pose | None = None) -> tuple[WheelTable, tuple[str, ...]]:
    """Turn the signs of wheels that turn against the vehicle's travel; where all do, leave them as they are.

    Parameters
    ----------
    table
        Rows of wheels with names and `wheel_speed_rad_s`.
    pose
        Where the vehicle was; its way along the heading is the travel where no `travel_speed_m_s` was recorded.

    Returns
    -------
    WheelTable, names
        The rows, and the wheels that turn against the travel: all of them where nothing was turned, for then the travel
        may be what is the wrong way round.
    """
    rate, travel = table.get("wheel_speed_rad_s"), _travel(table, pose)
    if rate is None or travel is None or table.wheel is None:
        return table, ()
    drives = np.abs(travel) > _SLOWEST_M_S
    names = sorted({str(name) for name in table.wheel})
    against = []
    for name in names:
        rows = (table.wheel == name) & drives & np.isfinite(rate)
        way = np.abs(rate[rows])
        if rows.sum() >= _FEWEST and way[rate[rows] * travel[rows] < 0.0].sum() > _CLEARLY * way.sum() > 0.0:
            against.append(name)
    if not against or len(against) == len(names):
        return table, tuple(against)
    sign = np.where(np.isin(table.wheel.astype(str), against), -1.0, 1.0)
    turned = {name: sign * table[name] for name in OF_A_JOINT if name in table}
    return table.adding(turned), tuple(against)


def mirrored_of(table: WheelTable | None, against: Sequence[str]) -> frozenset[str]:
    """Give the wheels whose signs were turned, of those that turn against the travel."""
    every = table is not None and table.wheel is not None and len(against) == len(set(table.wheel))
    return frozenset(() if every else against)


def about_axes(against: Sequence[str], *, every: bool) -> str:
    """Say which wheels turn against the vehicle's travel, and what was made of it or is to be done."""
    if every:
        return (
            "every wheel turns against the vehicle's travel, and is used as it is. One of the two has the other sign: "
            'state it in a topic map, such as travel_speed_m_s = { field = "twist.twist.linear.x", scale = -1.0 }'
        )
    are = f"wheel {against[0]} turns" if len(against) == 1 else f"wheels {', '.join(against)} turn"
    return (
        f"{are} backwards while the vehicle drives forwards, as mirrored joints do: speed, angle, torque and current "
        "are taken with their signs turned"
    )


def _travel(table: WheelTable, pose: Pose | None) -> np.ndarray | None:
    """Travel of the vehicle (n,) [m/s], forwards positive; roughly, where it is by the poses."""
    if "travel_speed_m_s" in table:
        return table["travel_speed_m_s"]
    if pose is None or "time_s" not in table or len(pose.time_s) < 2:
        return None
    step_s = np.diff(pose.time_s)
    middle = 0.5 * (pose.yaw_rad[1:] + pose.yaw_rad[:-1])
    way = np.diff(pose.x_m) * np.cos(middle) + np.diff(pose.y_m) * np.sin(middle)
    with np.errstate(divide="ignore", invalid="ignore"):
        speed = np.where(step_s > 0.0, way / step_s, np.nan)
    return interpolate(0.5 * (pose.time_s[1:] + pose.time_s[:-1]), speed, table["time_s"], 1.0)
