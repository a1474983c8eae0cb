"""Rows of runs at constant load, slip and speed in which the wheel is stopped or has stopped, or is got going."""

from __future__ import annotations

import math

import numpy as np

from ...framework.core.findings import Finding, note
from ...framework.core.recording.types import WheelTable
from .noise import NORMAL_MAD, running_median
from .steady_runs import FEWEST_RUNS, Runs, steady_runs

_FORCES = ("torque_Nm", "drawbar_pull_N")

_PRESENT, _GONE = 5.0, 0.3
"""Standard deviations above which a force differs from zero, and the share of it that is left at most where the wheel
is not driven [-]."""

_MOST = 0.8
"""Share of the runs that end so [-]: what a few do may be the ground or a fault."""

_OFF, _OFF_LEAST = 3.0, 0.1
"""Standard deviations by which a force has left what it was, and the share of it that this is at least [-]."""

_FEWEST = 5
"""Fewest rows that give the force while the wheel is driven."""

_LONGEST = 0.3
"""Share of a run that its end is at most [-]."""


def without_stops(table: WheelTable) -> tuple[WheelTable, Finding | None, bool]:
    """Leave out the rows of runs at constant conditions in which the wheel is got going, is stopped or has stopped.

    Once the drive ends, torque and pull relax. Speeds show it where they were measured; else that torque or pull is
    nearly zero at the end of most runs, while the load stays.

    Parameters
    ----------
    table
        Channels as `with_standstill` gives them.

    Returns
    -------
    WheelTable
        The other rows.
    Finding or None
        ``stop_rows``, where rows are left out.
    bool
        Whether most runs begin with rows that are.
    """
    runs = steady_runs(table)
    if runs is None:
        return table, None, False
    left_out = np.unique(np.concatenate([*runs.starts, *runs.stops, _relaxed(table, runs)]))
    if not len(left_out):
        return table, None, False
    kept = np.ones(len(table), dtype=bool)
    kept[left_out] = False
    started = sum(len(rows) > 0 for rows in runs.starts) >= _MOST * len(runs.starts)
    return table.select(kept), note("stop_rows", n=len(left_out), runs=len(runs.each)), started


def _relaxed(table: WheelTable, runs: Runs) -> np.ndarray:
    """Find the rows at the ends of runs in which torque or pull is gone, or on its way there: numbers of rows."""
    whole = [np.concatenate(rows) for rows in zip(runs.each, runs.stops, strict=True)]
    first = np.array([len(rows) for rows in runs.each])
    for name in _FORCES:
        if runs.stepped or name not in table:
            continue
        seen = [_first_without(table[name][rows]) for rows in whole]
        begins = np.array([len(rows) if row is None else row for row, rows in zip(seen, whole, strict=True)])
        usable = np.array([row is not None for row in seen])
        gone = begins < np.array([len(rows) for rows in whole])
        if usable.sum() >= FEWEST_RUNS and np.mean(gone[usable]) >= _MOST:
            first = np.minimum(first, begins)
    return np.concatenate([rows[row:] for rows, row in zip(runs.each, first, strict=True)])


def _first_without(force: np.ndarray) -> int | None:
    """Say from which row of a run on its force (k,) is gone, or on its way there: k where it stays, None where too
    little of it was measured.
    """
    seen = np.flatnonzero(np.isfinite(force))
    middle = force[len(force) // 4 : math.ceil((1.0 - _LONGEST) * len(force))]
    if np.isfinite(middle).sum() < _FEWEST:
        return None
    level = float(np.nanmedian(middle))
    sd = NORMAL_MAD * float(np.nanmedian(np.abs(middle - level)))
    if not abs(level) > _PRESENT * sd:
        return None
    share = running_median(force, 3) / level
    last = int(seen[-1])
    if not max(share[last], force[last] / level) < _GONE:
        return len(force)
    there = np.flatnonzero(share[: last + 1] >= 1.0 - max(_OFF * sd / abs(level), _OFF_LEAST))
    begins = int(there[-1]) + 1 if len(there) else 0
    return begins if begins >= (1.0 - _LONGEST) * len(force) else None
