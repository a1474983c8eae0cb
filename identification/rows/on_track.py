"""Where each row of a drive was driven, from the vehicle's track and the wheels' places on it: position and ground."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from ...framework.core.recording.types import WheelTable
from ...framework.core.track.grounds import CHANGE_MARGIN_M, Ground
from ...framework.core.track.way import RECORDED, Track, moved
from ...framework.core.vehicle import Vehicle, Wheel
from ..effects.drive import GROUND
from .gate import LIMITS


def with_places(table: WheelTable, vehicle: Vehicle, track: Track | None) -> WheelTable:
    """Add the positions of the wheels, unless they were recorded.

    Parameters
    ----------
    table
        Rows of wheels of one geometry, with `time_s`.
    vehicle
        The vehicle, for the places of its wheels.
    track
        Where the reference point was; None, or dead reckoning, gives no positions.
    """
    if track is None or track.origin != RECORDED or {"x_m", "y_m"} & set(table.columns):
        return table
    forward, left = np.array([wheel.position_m for wheel in _wheels(table, vehicle)]).T
    x_m, y_m = moved(*track.place_at(table["time_s"]), forward, left)
    return WheelTable({**table.columns, "x_m": x_m, "y_m": y_m}, table.wheel, table.run, table.source)


def _wheels(table: WheelTable, vehicle: Vehicle) -> list[Wheel]:
    """Return the wheel of each row."""
    if table.wheel is None:
        return len(table) * [vehicle.wheel()]
    by_name = {name: vehicle.wheel(name) for name in np.unique(table.wheel).tolist()}
    return [by_name[name] for name in table.wheel]


def with_grounds(table: WheelTable, vehicle: Vehicle, track: Track | None, grounds: Sequence[Ground]) -> WheelTable:
    """Add the number of the ground that each row is on.

    A wheel is ahead of the vehicle's reference point, or behind it. A row near a border is on no ground: where ground
    changes is known to about a cell.

    Parameters
    ----------
    table
        Rows of wheels of one geometry, with `time_s`.
    vehicle
        The vehicle, for the places of its wheels.
    track
        Where the reference point was; borders are compared in time where absent.
    grounds
        Grounds in order of time.
    """
    time_s = table["time_s"]
    starts, ends = (np.array([getattr(each, name) for each in grounds]) for name in ("start_s", "end_s"))
    where, margin = time_s, 0.0
    if track is not None:
        where = _way_at(track, time_s) + np.array([wheel.position_m[0] for wheel in _wheels(table, vehicle)])
        starts, ends, margin = _way_at(track, starts), _way_at(track, ends), CHANGE_MARGIN_M
    first, last = np.append(-math.inf, starts[1:] + margin), np.append(ends[:-1] - margin, math.inf)
    number = np.full(len(table), math.nan)
    for each in range(len(grounds)):
        number[(where >= first[each]) & (where <= last[each])] = each
    return WheelTable({**table.columns, GROUND: number}, table.wheel, table.run, table.source)


def _way_at(track: Track, time_s: np.ndarray) -> np.ndarray:
    return np.interp(time_s, track.time_s, track.way_m)


def without_hard_ground(
    table: WheelTable, wheel: Wheel, grounds: Sequence[Ground]
) -> tuple[WheelTable, list[str]]:  # fmt: skip
    """Leave out grounds that do not yield: the textbook wheel is on soil."""
    notes, number = [], table[GROUND].copy()
    for each, ground in enumerate(grounds):
        rows = number == each
        if "sinkage_m" in table and rows.any():
            sinkage_m = float(np.nanmedian(table["sinkage_m"][rows]))
            if sinkage_m < LIMITS.least_sinkage * wheel.radius_m:
                number[rows] = math.nan
                name = ground.class_name or "ground"
                notes.append(
                    f"{int(rows.sum())} rows on {name} from {ground.start_s:.0f} s to {ground.end_s:.0f} s are left "
                    f"out: too hard to sink into (median sinkage {1000.0 * sinkage_m:.1f} mm)"
                )
    return WheelTable({**table.columns, GROUND: number}, table.wheel, table.run, table.source), notes
