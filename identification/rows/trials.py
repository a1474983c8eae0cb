"""Steady trials: rows that have nothing to do with the rows before them, though they may carry the time of each."""

from __future__ import annotations

import numpy as np

from ...framework.core.recording.types import WheelTable

AS_TRIALS = "slip or load leap from each row to the next: each is taken for a steady trial, whatever its time"
"""Note where that was found."""

_UNRELATED, _FAR_APART = 1.2, {"slip": 0.05, "load_N": 0.1}
"""Mean square of the steps from row to row over the variance, 2 where the order is by chance, from which on rows do not
follow from one another; and how large the usual step of slip, or of load as a share of it, then is at least [-]."""

_ROWS_OF_A_DRIVE = 50
"""Rows to a run without a time from which on they look like a drive's."""

_SHORTEST_S = 2.0
"""A trial takes longer [s]; a drive that is so unsteady is logged more often."""


def is_of_trials(table: WheelTable) -> bool:
    """Say whether rows with a time, in its order, are steady trials: slip or load leap from each to the next.

    The measure is that of J. von Neumann, Ann. Math. Stat. 12 (1941), 367-395.
    """
    if "time_s" not in table or len(table) < 2 or not np.median(np.diff(table["time_s"])) > _SHORTEST_S:
        return False
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


def without_clock(table: WheelTable) -> list[str]:
    """Say, in words, that rows are taken for trials of their own though they may be those of a drive."""
    if "time_s" in table or table.run is None:
        return []
    runs = len(set(table.run))
    if len(table) < _ROWS_OF_A_DRIVE * runs:
        return []
    return [
        f"{len(table)} rows of {runs} run{'s' if runs > 1 else ''} have no time_s: each is taken for a steady trial of "
        "its own, not for the next one's neighbour as in a drive"
    ]


def without_time(table: WheelTable) -> WheelTable:
    """Give the rows without the time of each."""
    columns = {name: values for name, values in table.columns.items() if name != "time_s"}
    return WheelTable(columns, table.wheel, table.run, table.source)
