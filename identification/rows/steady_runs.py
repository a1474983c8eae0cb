"""Runs at constant load, slip and speed, as of a test on a rig: from where the wheel is at work until it stops."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from scipy.signal import find_peaks

from ...framework.core.recording.types import WheelTable
from ...framework.core.track.positions import runs_of
from ..effects.drive import order_of
from .noise import NORMAL_MAD, noise_of_series, running_median
from .standstill import stands

_HELD_LOAD, _HELD_SLIP, _HELD_SPEED = 0.1, 0.03, 0.1
"""Tolerances of load and speeds that are held constant, relative, and of slip, absolute [-]."""

_FEWEST_ROWS = 15
"""Fewest rows of a run."""

FEWEST_RUNS = 6
"""Fewest runs in which a common course is distinguished from ground that varies along each."""

_MOST_RUNS = 0.8
"""Least share of the rows of a test at constant slips that are in such runs [-]."""

_STARTING = 2
"""Rows in which a wheel may reach its speed."""

_EACH_SIDE, _ABOVE_NOISE = 5, 4.0
"""Rows before and after a step whose medians are compared, and their least difference in standard deviations of a row:
five of that difference."""

_NEAR_END, _SHARE_NEAR_END = 40, 0.05
"""Rows at an end of a run, or share of it [-] where that is more, whose median is the level of a rolling wheel."""

_AT_REST, _SHORT_OF, _SCATTER = 0.5, 0.02, 2.0
"""Share of that level below which load or a speed begins or ends where a wheel starts or stops, and the tolerance of a
rolling wheel: a share of it [-], or standard deviations of its scatter."""

_STANDS = 0.1
"""Share of its usual value in a run below which a speed is that of a longer standstill [-]."""


@dataclass(frozen=True)
class Runs:
    """Runs at constant conditions.

    Parameters
    ----------
    each : (s,)
        Rows of the table of each run, in order of time.
    after : (s,)
        The run from which each goes on by a step, where most runs do; else -1.
    step_s : (s,)
        Time from row to row of each [s].
    starts, stops : (s,)
        Rows of the table before and after each run in which the wheel is got going or stopped, or stands.
    """

    each: tuple[np.ndarray, ...]
    after: np.ndarray
    step_s: np.ndarray
    starts: tuple[np.ndarray, ...]
    stops: tuple[np.ndarray, ...]

    @property
    def stepped(self) -> bool:
        """Whether the runs are steps of drives."""
        return bool((self.after >= 0).any())

    def of(self, values: np.ndarray) -> np.ndarray:
        """Give a channel (n,) by run (s, k), NaN where there is no row."""
        return np.where(self.rows >= 0, values[self.rows], math.nan)

    @cached_property
    def rows(self) -> np.ndarray:
        """Rows of the table by run, (s, k) with k as usual, -1 where there is none."""
        usual = int(np.median([len(rows) for rows in self.each]))
        answer = np.full((len(self.each), usual), -1)
        for number, rows in enumerate(self.each):
            answer[number, : len(rows)] = rows[:usual]
        return answer


def steady_runs(table: WheelTable) -> Runs | None:
    """Find the runs in which load, slip and speeds are held; None where there are none, or most rows are in others."""
    if "time_s" not in table:
        return None
    order, stretch = order_of(table)
    imposed, conditions = _conditions(table)
    still = stands(table)
    held: list[np.ndarray] = []
    after: list[int] = []
    starts: list[np.ndarray] = []
    stops: list[np.ndarray] = []
    driven = 0
    for whole in (order[run] for run in runs_of(stretch)):
        first, end = _at_work(table, whole, still)
        driven += end - first
        pieces, before = np.split(whole[first:end], _steps(imposed, whole[first:end])), -1
        for number, piece in enumerate(pieces):
            good = len(piece) >= _FEWEST_ROWS and _is_held(conditions, piece)
            if good:
                held.append(piece)
                after.append(before)
                starts.append(whole[:first] if number == 0 else whole[:0])
                stops.append(whole[end:] if number == len(pieces) - 1 else whole[:0])
            before = len(held) - 1 if good else -1
    if not held or sum(map(len, held)) < _MOST_RUNS * driven:
        return None
    stepped = np.mean(np.array(after) >= 0) > 0.5
    follows = np.array(after) if stepped else np.full(len(held), -1)
    step_s = np.array([np.median(np.diff(table["time_s"][piece])) for piece in held])
    return Runs(tuple(held), follows, step_s, tuple(starts), tuple(stops))


def _at_work(table: WheelTable, rows: np.ndarray, still: np.ndarray) -> tuple[int, int]:
    """Give the first of consecutive rows (k,) in which a wheel rolls, and the one after the last.

    `still` (n,): rows of the table in which it is at standstill.
    """
    going = np.flatnonzero(~still[rows])
    if not len(going):
        return 0, 0
    first, end = int(going[0]), int(going[-1]) + 1
    speeds = ("wheel_speed_rad_s", "travel_speed_m_s")
    # A load that is small for long is one of several loads.
    driven = [(np.abs(table[name][rows[first:end]]), name in speeds) for name in ("load_N", *speeds) if name in table]
    got_going = max((_rows_at_rest(values, for_long=long) for values, long in driven), default=0)
    stopping = max((_rows_at_rest(values[::-1], for_long=long) for values, long in driven), default=0)
    return first + got_going, end - stopping


def _rows_at_rest(values: np.ndarray, *, for_long: bool) -> int:
    """Count the first rows of a load or speed (k,) in which a wheel starts, or is at standstill `for_long`."""
    near = max(_NEAR_END, math.ceil(_SHARE_NEAR_END * len(values)))
    long = _rows_short(values, len(values), _STANDS) if for_long else 0
    return long or _rows_short(values, near, _AT_REST)


def _rows_short(values: np.ndarray, near_rows: int, at_rest: float) -> int:
    """Count the first rows of a load or speed (k,) short of those near the end, if it begins below a share of
    these.
    """
    near = running_median(values, 3)[:near_rows]
    if not np.isfinite(near).all() or not len(near):
        return 0
    usual = float(np.median(near))
    if not min(near[0], values[0]) < at_rest * usual:
        return 0
    scatter = NORMAL_MAD * float(np.median(np.abs(near - usual)))
    rows = int(np.argmax(near >= usual - max(_SHORT_OF * usual, _SCATTER * scatter)))
    return max(rows, 1) if rows < len(near) // 2 else 0


def _conditions(table: WheelTable) -> tuple[list[np.ndarray], list[np.ndarray]]:
    """Give load and slip, and these with the speeds: (n,) each, in units of their tolerances."""
    rim, travel = table.get("wheel_speed_rad_s"), table.get("travel_speed_m_s")
    imposed = []
    if "load_N" in table:
        imposed.append(np.log(np.maximum(np.abs(table["load_N"]), 1e-9)) / _HELD_LOAD)
    if "slip" in table:
        imposed.append(table["slip"] / _HELD_SLIP)
    elif rim is not None and travel is not None:
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = np.where(rim != 0.0, travel / rim, math.nan)
        # 1 - slip, but for the radius.
        imposed.append(ratio / max(float(np.nanmax(np.abs(ratio), initial=1e-9)), 1e-9) / _HELD_SLIP)
    speeds = [np.log(np.maximum(np.abs(each), 1e-9)) / _HELD_SPEED for each in (rim, travel) if each is not None]
    return imposed, imposed + speeds


def _steps(imposed: list[np.ndarray], rows: np.ndarray) -> np.ndarray:
    """Find the steps of what is imposed (n,) in consecutive rows (k,): the numbers of rows."""
    if len(rows) < 2 * _EACH_SIDE:
        return np.empty(0, dtype=int)
    size, leap = np.zeros(len(rows) - 2 * _EACH_SIDE + 1), np.zeros(len(rows))
    for values in imposed:
        middles = np.median(sliding_window_view(values[rows], _EACH_SIDE), axis=1)
        noise = float(np.nan_to_num(noise_of_series([values[rows]])))
        size = np.fmax(size, np.abs(middles[_EACH_SIDE:] - middles[:-_EACH_SIDE]) / max(1.0, _ABOVE_NOISE * noise))
        leap = np.fmax(leap, np.abs(np.diff(values[rows], prepend=values[rows[:1]])))
    about = find_peaks(size, height=1.0, distance=_EACH_SIDE)[0] + _EACH_SIDE
    # Medians locate a step to two rows.
    near = about[:, None] + np.arange(-_STARTING, _STARTING + 1)
    return about - _STARTING + np.argmax(leap[near], axis=1)


def _is_held(conditions: list[np.ndarray], rows: np.ndarray) -> bool:
    """Say whether the conditions, (n,) each, are constant over the rows of a run (k,) but for its first."""
    for values in conditions:
        parts = [values[part] for part in np.array_split(rows[_STARTING:], 6)]
        if not all(np.isfinite(part).any() for part in parts):
            return False
        if np.ptp([np.nanmedian(part) for part in parts]) > 1.0:
            return False
    return True
