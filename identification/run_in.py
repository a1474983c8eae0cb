"""First rows of runs at constant load, slip and speed that settle: where the wheel starts, nothing is steady yet."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..framework.core.recording.types import WheelTable
from .effects.drive import order_of

_ANSWERS = ("torque_Nm", "sinkage_m", "drawbar_pull_N")

_HELD = {"load_N": (0.0, 0.05), "slip": (0.03, 0.0), "wheel_speed_rad_s": (0.0, 0.1), "travel_speed_m_s": (0.0, 0.1)}
"""How far a condition may be off that is held: by so much, or by this share of it [-]."""

_FEWEST_ROWS, _FEWEST_RUNS = 15, 6
"""Rows of a run that can show it, and runs that tell a settling that all share from ground that varies along each."""

_MOST_RUNS = 0.8
"""Share of the rows that are in such runs at least [-]: else it is no test at constant slips."""

_STARTING = 2
"""Rows in which a wheel may be got up to its speed."""

_FIRST = 0.05
"""Share of a run by which it is told that its first rows are off [-]."""

_OFF, _ALIKE, _SURE = 2.0, 0.6, 2.4
"""Standard deviations by which first rows are off in the mean of their squares, the share of that by which all are off
the same way, and how many standard errors that share is [-]."""

_SETTLED = 0.3
"""Standard deviations that are no longer off [-]."""

_FALLS, _FLAT = 0.5, 0.12
"""How large what settles is at most in the second half of its time, where a patch of other ground stays as it is, and
what goes on in the rest of the run, as where a sensor drifts: shares of what it began with [-]."""

_MARGIN = 1.25
"""Times which so long is left out."""


@dataclass(frozen=True)
class _Runs:
    """Runs at constant conditions: rows of the table by run (s, k), -1 where there is none; the step of time [s]."""

    rows: np.ndarray
    step_s: float

    def of(self, values: np.ndarray) -> np.ndarray:
        """Give a channel (n,) by run (s, k), NaN where there is no row."""
        return np.where(self.rows >= 0, values[self.rows], math.nan)


def without_run_in(table: WheelTable) -> tuple[WheelTable, list[str]]:
    """Leave out the first rows of runs in which torque, sinkage or pull settle though nothing that drives them changes.

    A test at constant slip begins with a wheel that sinks in and shears its way to a steady state, which is all that
    the textbook describes. All runs have to settle alike, more than their ground varies: what one of them does alone
    may be the ground, and what goes on at load, slip or speed that change may be the wheel.

    Parameters
    ----------
    table
        Channels as recorded.

    Returns
    -------
    WheelTable
        The other rows.
    list
        A sentence, where rows are left out.
    """
    runs = _runs_at_constant_conditions(table)
    if runs is None:
        return table, []
    settling = {name: _settling(runs.of(table[name])) for name in _ANSWERS if name in table}
    longest = max(settling.values(), default=0)
    if longest == 0:
        return table, []
    first = runs.rows[:, : math.ceil(_MARGIN * longest)]
    kept = np.ones(len(table), dtype=bool)
    kept[first[first >= 0]] = False
    names = ", ".join(name for name, rows in settling.items() if rows)
    said = (
        f"the first {first.shape[1] * runs.step_s:.3g} s of {len(first)} runs are left out, where the wheel starts: "
        f"load, slip and speed stay the same there, and what follows from them still settles ({names})"
    )
    return table.select(kept), [said]


def _runs_at_constant_conditions(table: WheelTable) -> _Runs | None:
    """Find the runs in which load, slip and speeds are held; None where they are few, or most rows are in others."""
    if "time_s" not in table:
        return None
    order, stretch = order_of(table)
    pieces = np.split(order, np.flatnonzero(np.diff(stretch)) + 1)
    held = [piece for piece in pieces if len(piece) >= _FEWEST_ROWS and _is_held(table, piece)]
    if len(held) < _FEWEST_RUNS or sum(map(len, held)) < _MOST_RUNS * len(table):
        return None
    usual = int(np.median([len(piece) for piece in held]))
    rows = np.full((len(held), usual), -1)
    for number, piece in enumerate(held):
        rows[number, : len(piece)] = piece[:usual]
    return _Runs(rows, float(np.median(np.diff(table["time_s"][rows[:, :2]]))))


def _is_held(table: WheelTable, rows: np.ndarray) -> bool:
    """Say whether what drives the wheel stays the same in the rows of a run (k,), the very first aside."""
    parts = np.array_split(rows[_STARTING:], 6)
    for name, (absolute, relative) in _HELD.items():
        if name not in table:
            continue
        values = [table[name][part] for part in parts]
        if not all(np.isfinite(part).any() for part in values):
            return False
        middles = np.array([np.nanmedian(part) for part in values])
        if np.ptp(middles) > absolute + relative * abs(float(np.median(middles))):
            return False
    return True


def _settling(values: np.ndarray) -> int:
    """Count the first rows in which a channel (s, k) settles in all runs alike; 0 where it does not."""
    count = values.shape[1]
    half, first = count // 2, max(math.ceil(_FIRST * count), 2)
    there = np.isfinite(values)
    told = (there[:, half:].sum(axis=1) > half // 2) & there[:, :first].any(axis=1)
    if told.sum() < _FEWEST_RUNS:
        return 0
    values = values[told]
    away = values - np.nanmedian(values[:, half:], axis=1, keepdims=True)
    sd = math.sqrt(float(np.nanmean(away[:, half:] ** 2)))
    if sd == 0.0:
        return 0
    began = np.nanmean(away[:, :first], axis=1) / sd
    size = math.sqrt(float(np.mean(began**2)))
    if size < _OFF or abs(float(began.mean())) / size < max(_ALIKE, _SURE / math.sqrt(len(began))):
        return 0
    # Each run by how far off it begins: what they share counts, and their noise averages out.
    course = np.nansum(began[:, None] * away / sd, axis=0) / np.sum(began[:, None] ** 2 * there[told], axis=0).clip(
        1e-9
    )
    return _length(course, size, first)


def _length(course: np.ndarray, size: float, first: int) -> int:
    """Count the rows until the mean course of a channel (k,) settles; 0 where it does not.

    It begins at one, in the `first` rows, and is there off by the `size`, in standard deviations.
    """
    half = len(course) // 2
    middle, end = (float(part.mean()) for part in np.array_split(course[half:], 2))
    smooth = np.convolve(course, np.ones(3) / 3.0, mode="same")
    off = np.flatnonzero(size * np.abs(smooth[:half]) >= _SETTLED)
    if abs(middle - end) > _FLAT or not len(off):
        return 0
    length = int(off[np.argmax(np.diff(off, append=len(course)) > first)]) + 1
    begun, ended = (np.abs(part).mean() for part in (course[: -(-length // 2)], course[length // 2 : length]))
    return length if math.ceil(_MARGIN * length) <= half and ended < _FALLS * begun else 0
