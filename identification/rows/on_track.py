"""Where each row of a drive was driven, from the vehicle's track and the wheels' places on it: position and ground."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from scipy.spatial import KDTree

from ...framework.core.recording.types import WheelTable
from ...framework.core.track.grounds import CHANGE_MARGIN_M, Ground
from ...framework.core.track.way import RECORDED, Track, moved
from ...framework.core.vehicle import Vehicle, Wheel
from ..effects.drive import GROUND
from .gate import LIMITS

_SILENT_S = 1.0
"""A wheel without a row for longer ran where the track says [s]."""

_REVISIT_M = 4.0
"""Way after which a wheel that comes back to a place runs over it once more [m]."""


def with_places(table: WheelTable, vehicle: Vehicle, track: Track | None) -> WheelTable:
    """Add the positions of the wheels, unless they were recorded, and of several wheels the number of the pass.

    Parameters
    ----------
    table
        Rows of wheels of one geometry, with `time_s`.
    vehicle
        The vehicle, for the places of its wheels.
    track
        Where the reference point was; None, or dead reckoning, gives no positions.
    """
    recorded = {"x_m", "y_m"} & set(table.columns)
    if track is None or track.origin != RECORDED or len(recorded) == 1:
        return table
    wheels, time_s = _wheels(table, vehicle), table["time_s"]
    forward, left = np.array([wheel.position_m for wheel in wheels]).T
    x_m, y_m = (table["x_m"], table["y_m"]) if recorded else moved(*track.place_at(time_s), forward, left)
    added = {"x_m": x_m, "y_m": y_m}
    if "pass" not in table and len(vehicle.wheels) > 1 and table.wheel is not None:
        # Wheels make ruts while they have no rows, too, such as those of another size.
        ways = [(x_m, y_m, time_s, _way_at(track, time_s) + forward, table.wheel)]
        for each in vehicle.wheels:
            silent = _far_from(track.time_s, np.sort(time_s[table.wheel == each.name]))
            when_s, names = track.time_s[silent], np.full(int(silent.sum()), each.name, dtype=object)
            there = moved(*track.place_at(when_s), *each.position_m)
            ways.append((*there, when_s, track.way_m[silent] + each.position_m[0], names))
        x, y, when_s, way_m, names = (np.concatenate(columns) for columns in zip(*ways, strict=True))
        passes = passes_at(np.column_stack([x, y]), when_s, way_m, names, 0.5 * wheels[0].width_m)
        added["pass"] = passes[: len(table)]
    return table.adding(added)


def _far_from(time_s: np.ndarray, others_s: np.ndarray) -> np.ndarray:
    """Times (n,) [s] that are further than `_SILENT_S` from every one of others (m,) [s], which ascend."""
    around = np.concatenate([[-math.inf], others_s, [math.inf]])
    after = np.searchsorted(others_s, time_s) + 1
    return (around[after] - time_s > _SILENT_S) & (time_s - around[after - 1] > _SILENT_S)


def passes_at(
    place: np.ndarray, time_s: np.ndarray, way_m: np.ndarray, wheel: np.ndarray, reach_m: float
) -> np.ndarray:  # fmt: skip
    """Count the wheels that have run over each place, (n,): 1 on fresh ground, NaN where the place is not known.

    Parameters
    ----------
    place : (n, 2)
        Positions of wheels in the plane [m].
    time_s, way_m : (n,)
        Time [s], and way along the track [m].
    wheel : (n,)
        Name of the wheel.
    reach_m
        Distance up to which two tracks are one [m].
    """
    known = np.flatnonzero(np.isfinite(place).all(axis=1))
    ran = [_closely(place[rows], time_s[rows], way_m[rows], 0.5 * reach_m) for rows in _by_wheel(wheel, known)]
    track = np.concatenate(ran)
    name = np.repeat(np.arange(len(ran)), [len(each) for each in ran])
    near = KDTree(place[known]).sparse_distance_matrix(KDTree(track[:, :2]), reach_m, output_type="coo_matrix")
    row, there = known[near.row], near.col
    since_m = way_m[row] - track[there, 3]
    own = np.unique(wheel, return_inverse=True)[1][row] == name[there]
    before = np.flatnonzero((track[there, 2] < time_s[row]) & (~own | (since_m > _REVISIT_M)))
    order = before[np.lexsort((since_m[before], name[there][before], row[before]))]
    new = np.append(True, np.diff(row[order]) != 0)
    new[1:] |= (np.diff(name[there][order]) != 0) | (np.diff(since_m[order]) > _REVISIT_M)
    answer = np.full(len(place), math.nan)
    answer[known] = 1.0
    np.add.at(answer, row[order][new[: len(order)]], 1.0)
    return answer


def _by_wheel(wheel: np.ndarray, rows: np.ndarray) -> list[np.ndarray]:
    """Split rows by wheel, in order of the wheels' names."""
    return [rows[wheel[rows] == name] for name in np.unique(wheel)]


def _closely(place: np.ndarray, time_s: np.ndarray, way_m: np.ndarray, step_m: float) -> np.ndarray:
    """Position, time and way (k, 4) of a wheel at steps of the way: at speed, rows are far apart."""
    if not len(time_s):
        return np.empty((0, 4))
    order = np.argsort(time_s, kind="stable")
    moving = order[np.diff(way_m[order], prepend=-math.inf) > 0.0]
    grid = np.arange(float(way_m[moving[0]]), float(way_m[moving[-1]]), step_m)
    columns = (place[:, 0], place[:, 1], time_s, way_m)
    return np.column_stack([np.interp(grid, way_m[moving], each[moving]) for each in columns])


def _wheels(table: WheelTable, vehicle: Vehicle) -> list[Wheel]:
    """Return the wheel of each row."""
    if table.wheel is None:
        return len(table) * [vehicle.wheel()]
    by_name = {name: vehicle.wheel(name) for name in np.unique(table.wheel).tolist()}
    return [by_name[name] for name in table.wheel]


def with_grounds(table: WheelTable, vehicle: Vehicle, track: Track | None, grounds: Sequence[Ground]) -> WheelTable:
    """Add the number of the ground that each row is on.

    A wheel is ahead of the vehicle's reference point, or behind it. A row near a border is on no ground: where ground
    changes is known to about a cell. Nor is one before the first ground or after the last.

    Parameters
    ----------
    table
        Rows of wheels of one geometry, with `time_s`.
    vehicle
        The vehicle, for the places of its wheels.
    track
        Where the reference point was; borders are compared in time where absent.
    grounds
        Grounds in order of time; where rows name their soil, these by name.
    """
    names = [ground.class_name for ground in grounds]
    if table.soil is not None and set(table.soil) <= set(names):
        return table.adding({GROUND: np.array([float(names.index(n)) for n in table.soil])})
    forward_m = np.array([wheel.position_m[0] for wheel in _wheels(table, vehicle)])
    number = ground_of_rows(table["time_s"], forward_m, track, grounds)
    return table.adding({GROUND: number})


def ground_of_rows(
    time_s: np.ndarray, forward_m: np.ndarray, track: Track | None, grounds: Sequence[Ground]
) -> np.ndarray:  # fmt: skip
    """Give the number of the ground that each row is on, (n,), NaN where on none; see `with_grounds`.

    `time_s` and `forward_m` (n,) are the rows' times [s], and how far ahead of the reference point their wheels are.
    """
    starts, ends = (np.array([getattr(each, name) for each in grounds]) for name in ("start_s", "end_s"))
    where, margin = time_s, 0.0
    if track is not None:
        where = _way_at(track, time_s) + forward_m
        starts, ends, margin = _way_at(track, starts), _way_at(track, ends), CHANGE_MARGIN_M
    # A wheel behind the reference point begins before the ground that the drive begins on, one ahead ends after it.
    begins, goes_on = grounds[0].start_s <= np.nanmin(time_s), grounds[-1].end_s >= np.nanmax(time_s)
    first = np.append(-math.inf if begins else starts[0] + margin, starts[1:] + margin)
    last = np.append(ends[:-1] - margin, math.inf if goes_on else ends[-1] - margin)
    number = np.full(len(time_s), math.nan)
    for each in range(len(grounds)):
        number[(where >= first[each]) & (where <= last[each])] = each
    return number


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
                span = f" from {ground.start_s:.0f} s to {ground.end_s:.0f} s" if math.isfinite(ground.start_s) else ""
                notes.append(
                    f"{int(rows.sum())} rows on {name}{span} are left out: too hard to sink into (median sinkage "
                    f"{1000.0 * sinkage_m:.1f} mm)"
                )
    return table.adding({GROUND: number}), notes
