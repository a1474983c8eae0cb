"""Steady trials: rows that have nothing to do with the rows before them, though they may carry the time of each."""

from __future__ import annotations

import numpy as np

from ...framework.core.findings import Finding, note, warning
from ...framework.core.recording.types import WheelTable

AS_TRIALS = note("steady_trials")
"""Each row is taken as a steady trial, whatever its time."""

_UNRELATED, _FAR_APART = 1.2, {"slip": 0.05, "load_N": 0.1}
"""Least ratio of the mean square step to the variance (2 in random order) of rows that do not follow one another, and
least usual step of slip, and of load as a share of it [-]."""

_ROWS_OF_A_DRIVE, _SLOWEST_S = 50, 2.0
"""Rows (of a run without a time) from which on they look like a drive's, and the longest step of a drive's clock [s]:
one that is so unsteady is logged more often."""


def is_of_trials(table: WheelTable) -> bool:
    """Say whether rows with a time, in its order, are steady trials: they are farther apart than a drive's, and slip or
    load jump from each to the next, or they are too few for a drive.

    The measure is that of J. von Neumann, Ann. Math. Stat. 12 (1941), 367-395.
    """
    if "time_s" not in table:
        return False
    instants = np.unique(table["time_s"])  # wheels share them
    if len(instants) < 2 or not np.median(np.diff(instants)) > _SLOWEST_S:
        return False
    if len(instants) < _ROWS_OF_A_DRIVE:
        return True
    for name, far in _FAR_APART.items():
        values = table.get(name)
        if values is None or not np.isfinite(np.diff(values)).any():
            continue
        unit = float(np.nanmedian(np.abs(values))) if name == "load_N" else 1.0
        step = np.diff(values)
        leaps = float(np.nanmedian(np.abs(step))) > far * unit
        if leaps and float(np.nanmean(step**2)) > _UNRELATED * float(np.nanvar(values)):
            return True
    return False


def slow_clock(table: WheelTable) -> Finding | None:
    """Doubt the time of rows of a drive that follow each other as slowly as if it were not in seconds: ``time_unit``.

    Parameters
    ----------
    table
        Rows of one wheel, in order of time, slip derived.
    """
    if len(table) < _ROWS_OF_A_DRIVE or "time_s" not in table or is_of_trials(table):
        return None
    step = float(np.median(np.diff(table["time_s"])))
    return warning("time_unit", step_s=step) if step > _SLOWEST_S else None


def missing_clock(table: WheelTable) -> Finding | None:
    """Note that rows are taken for trials of their own though they may be those of a drive: ``rows_without_time``."""
    if "time_s" in table or table.run is None:
        return None
    runs = len(set(table.run))
    return note("rows_without_time", n=len(table), runs=runs) if len(table) >= _ROWS_OF_A_DRIVE * runs else None


def without_time(table: WheelTable) -> WheelTable:
    """Give the rows without the time of each."""
    columns = {name: values for name, values in table.columns.items() if name != "time_s"}
    return table.with_columns(columns)
