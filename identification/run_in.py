"""First rows of runs at constant load, slip and speed that settle: where the wheel starts, nothing is steady yet."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from scipy.signal import find_peaks

from ..framework.core.recording.types import WheelTable
from .effects.drive import order_of

_ANSWERS = ("torque_Nm", "sinkage_m", "drawbar_pull_N")

_HELD_LOAD, _HELD_SLIP, _HELD_SPEED = 0.05, 0.03, 0.1
"""How far load and speeds that are held may be off, as shares of them, and how far slip [-]."""

_FEWEST_ROWS, _FEWEST_RUNS = 15, 6
"""Rows of a run that can show it, and runs that tell a settling that all share from ground that varies along each."""

_MOST_RUNS = 0.8
"""Share of the rows that are in such runs at least [-]: else it is no test at constant slips."""

_STARTING = 2
"""Rows in which a wheel may be got up to its speed."""

_BESIDE_STEP, _STEPS = 5, 5.0
"""Rows before a step, and after it, by whose medians it is found, and standard deviations by which a channel steps that
would show whether it settles [-]."""

_FIRST = 0.05
"""Share of a run by which it is told that its first rows are off [-]."""

_OFF, _ALIKE, _SURE = 2.0, 0.6, 2.4
"""Standard deviations by which first rows are off in the mean of their squares, the share of that by which all are off
the same way, and how many standard errors that share is [-]."""

_SETTLED = 0.3
"""Standard deviations that are no longer off [-]."""

_FLAT, _SHORTEST = 0.12, 5
"""What goes on in the rest of the run, as where a sensor drifts, as a share of what it began with [-]; and rows in
which a settling shows."""

_STAYS = 1.2
"""Widths of its edge by which a patch of other ground goes on from the start [-]."""

_LEAST, _LEAST_IMPOSED = 1e-4, 0.01
"""Scatter that counts at least, of an answer and of what is imposed, as shares of their levels: that of a command, say,
is none [-]."""

_ONE_RATE = 0.2
"""Share of the usual time from row to row by which a run's may differ [-]."""

_MARGIN = 1.25
"""Times which so long is left out."""


@dataclass(frozen=True)
class _Runs:
    """Runs at constant conditions.

    Parameters
    ----------
    rows : (s, k)
        Rows of the table by run, -1 where there is none.
    after : (s,)
        The run from which each goes on by a step, where most runs do; else -1.
    step_s
        Time from row to row [s].
    """

    rows: np.ndarray
    after: np.ndarray
    step_s: float

    @property
    def stepped(self) -> bool:
        """Whether the runs are steps of drives."""
        return bool((self.after >= 0).any())

    def of(self, values: np.ndarray) -> np.ndarray:
        """Give a channel (n,) by run (s, k), NaN where there is no row."""
        return np.where(self.rows >= 0, values[self.rows], math.nan)


def without_run_in(table: WheelTable) -> tuple[WheelTable, list[str]]:
    """Leave out the first rows of runs in which torque, sinkage or pull settle though nothing that drives them changes.

    A test at constant slip begins with a wheel that sinks in and shears its way to a steady state, which is all that
    the textbook describes; so does each step of a drive whose slip goes up in steps. All runs have to settle alike,
    more than their ground varies, in two answers at least: what one run does alone may be the ground, one answer alone
    an instrument, and what goes on while load, slip or speed settle the wheel. After steps all answers that step have
    to, each from where it was: one may be late.

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
    channels = {name: runs.of(table[name]) for name in _ANSWERS if name in table}
    settling = {name: _settling(values, runs.after) for name, values in channels.items()}
    begin = sum(np.isfinite(values[:, :_SHORTEST]).any(axis=1).sum() >= _FEWEST_RUNS for values in channels.values())
    # One alone that settles is an instrument that warms up.
    if sum(rows > 0 for rows in settling.values()) < max(1, min(2, begin)):
        return table, []
    if _imposed(table, runs) or (runs.stepped and _late(channels, settling, runs.after)):
        return table, []
    longest = max(settling.values())
    first = runs.rows[:, : math.ceil(_MARGIN * longest)]
    kept = np.ones(len(table), dtype=bool)
    kept[first[first >= 0]] = False
    names = ", ".join(name for name, rows in settling.items() if rows)
    what, where = ("steps", "gets from one state to the next") if runs.stepped else ("runs", "starts")
    said = (
        f"the first {first.shape[1] * runs.step_s:.3g} s of {len(first)} {what} are left out, where the wheel {where}: "
        f"load, slip and speed stay the same there, and what follows from them still settles ({names})"
    )
    return table.select(kept), [said]


def _imposed(table: WheelTable, runs: _Runs) -> bool:
    """Say whether load, slip or a speed settles, too: what the answers do then may follow from it."""
    names = ("load_N", "slip", "wheel_speed_rad_s", "travel_speed_m_s")
    seen = [runs.of(table[name]) for name in names if name in table]
    return any(_settling(values, runs.after, _LEAST_IMPOSED) > 0 for values in seen)


def _runs_at_constant_conditions(table: WheelTable) -> _Runs | None:
    """Find the runs in which load, slip and speeds are held; None where they are few, or most rows are in others."""
    if "time_s" not in table:
        return None
    order, stretch = order_of(table)
    imposed, conditions = _conditions(table)
    held: list[np.ndarray] = []
    after: list[int] = []
    for whole in np.split(order, np.flatnonzero(np.diff(stretch)) + 1):
        before = -1
        for piece in np.split(whole, _steps(imposed, whole)):
            good = len(piece) >= _FEWEST_ROWS and _is_held(conditions, piece)
            if good:
                held.append(piece)
                after.append(before)
            before = len(held) - 1 if good else -1
    steps = np.array([np.median(np.diff(table["time_s"][piece])) for piece in held])
    if not len(held) or np.ptp(steps) > _ONE_RATE * np.median(steps):
        return None
    if len(held) < _FEWEST_RUNS or sum(map(len, held)) < _MOST_RUNS * len(table):
        return None
    usual = int(np.median([len(piece) for piece in held]))
    rows = np.full((len(held), usual), -1)
    for number, piece in enumerate(held):
        rows[number, : len(piece)] = piece[:usual]
    stepped = np.mean(np.array(after) >= 0) > 0.5
    return _Runs(
        rows,
        np.array(after) if stepped else np.full(len(held), -1),
        float(np.median(np.diff(table["time_s"][rows[:, :2]]))),
    )


def _conditions(table: WheelTable) -> tuple[list[np.ndarray], list[np.ndarray]]:
    """Give what is imposed on the wheel, load and slip, and that and the speeds: (n,) each, in units of how far it may
    be off where it is held.
    """
    rim, travel = table.get("wheel_speed_rad_s"), table.get("travel_speed_m_s")
    imposed = []
    if "load_N" in table:
        imposed.append(np.log(np.maximum(np.abs(table["load_N"]), 1e-9)) / _HELD_LOAD)
    if "slip" in table:
        imposed.append(table["slip"] / _HELD_SLIP)
    elif rim is not None and travel is not None:
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = np.where(rim != 0.0, travel / rim, math.nan)
        # One less slip, as far as the radius goes.
        imposed.append(ratio / max(float(np.nanmax(np.abs(ratio), initial=1e-9)), 1e-9) / _HELD_SLIP)
    speeds = [np.log(np.maximum(np.abs(each), 1e-9)) / _HELD_SPEED for each in (rim, travel) if each is not None]
    return imposed, imposed + speeds


def _steps(imposed: list[np.ndarray], rows: np.ndarray) -> np.ndarray:
    """Find where what is imposed (n,) steps in rows that follow one another (k,): the numbers of rows."""
    if len(rows) < 2 * _BESIDE_STEP:
        return np.empty(0, dtype=int)
    size, leap = np.zeros(len(rows) - 2 * _BESIDE_STEP + 1), np.zeros(len(rows))
    for values in imposed:
        middles = np.median(sliding_window_view(values[rows], _BESIDE_STEP), axis=1)
        size = np.fmax(size, np.abs(middles[_BESIDE_STEP:] - middles[:-_BESIDE_STEP]))
        leap = np.fmax(leap, np.abs(np.diff(values[rows], prepend=values[rows[:1]])))
    about = find_peaks(size, height=1.0, distance=_BESIDE_STEP)[0] + _BESIDE_STEP
    # Medians tell that there is a step, to two rows where.
    near = about[:, None] + np.arange(-_STARTING, _STARTING + 1)
    return about - _STARTING + np.argmax(leap[near], axis=1)


def _is_held(conditions: list[np.ndarray], rows: np.ndarray) -> bool:
    """Say whether what drives the wheel, (n,) each, stays the same in the rows of a run (k,), the very first aside."""
    for values in conditions:
        parts = [values[part] for part in np.array_split(rows[_STARTING:], 6)]
        if not all(np.isfinite(part).any() for part in parts):
            return False
        if np.ptp([np.nanmedian(part) for part in parts]) > 1.0:
            return False
    return True


def _levels(values: np.ndarray, least: float = _LEAST) -> tuple[np.ndarray, float]:
    """Give where a channel (s, k) ends in each run (s,), NaN where that was not seen, and how it scatters there, that
    share of its level at `least`.
    """
    rest = values[:, values.shape[1] // 2 :]
    seen = np.isfinite(rest).sum(axis=1) > rest.shape[1] // 2
    level = np.full(len(values), math.nan)
    level[seen] = np.nanmedian(rest[seen], axis=1)
    if not seen.any():
        return level, math.nan
    scatter = math.sqrt(float(np.nanmean((rest[seen] - level[seen, None]) ** 2)))
    return level, max(scatter, least * float(np.abs(level[seen]).max()))


def _late(channels: dict[str, np.ndarray], settling: dict[str, int], after: np.ndarray) -> bool:
    """Say whether after steps only some of the channels (s, k) that step settle: they come late, by their own fault."""
    for name, values in channels.items():
        level, sd = _levels(values)
        steps = (level - level[after])[after >= 0]
        steps = steps[np.isfinite(steps)]
        if not settling[name] and len(steps) and math.sqrt(float(np.mean(steps**2))) > _STEPS * sd:
            return True
    return False


def _settling(values: np.ndarray, after: np.ndarray, least: float = _LEAST) -> int:
    """Count the first rows in which a channel (s, k) settles in all runs alike; 0 where it does not.

    Runs that go on `after` others (s,) settle from where these were, whichever way that is.
    """
    count = values.shape[1]
    first = max(math.ceil(_FIRST * count), 2)
    there = np.isfinite(values)
    level, sd = _levels(values, least)
    told = np.isfinite(level) & there[:, :first].any(axis=1)
    way = np.ones(len(values))
    if (after >= 0).any():
        way = np.where(after >= 0, np.sign(level[after] - level), math.nan)
        told &= np.isfinite(way)
    if told.sum() < _FEWEST_RUNS or not sd > 0.0:
        return 0
    away = ((values - level[:, None]) * way[:, None])[told]
    began = np.nanmean(away[:, :first], axis=1) / sd
    size = math.sqrt(float(np.mean(began**2)))
    if size < _OFF or abs(float(began.mean())) / size < max(_ALIKE, _SURE / math.sqrt(len(began))):
        return 0
    # Each run by how far off it begins: what they share counts, and their noise averages out.
    weight = np.sum(began[:, None] ** 2 * there[told], axis=0)
    course = np.nansum(began[:, None] * away / sd, axis=0) / np.maximum(weight, 1e-9)
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
    if length < _SHORTEST or math.ceil(_MARGIN * length) > half:
        return 0
    return length if _dies_away(course[:half]) else 0


def _dies_away(course: np.ndarray) -> bool:
    """Say whether a mean course (k,) falls off from the first row on, by an exponential, rather than stays as it is and
    ends at an edge, as a patch of other ground does, or an answer that comes late: by the squares that each leaves.
    """
    rows = np.arange(len(course))
    by_time = np.exp(-rows / np.geomspace(1.0, 0.5 * len(rows), 40)[:, None])
    centre, width = (each.ravel() for each in np.meshgrid(rows[2:], np.geomspace(0.5, 0.5 * len(rows), 20)))
    stays = centre >= _STAYS * width
    by_edge = 0.5 * (1.0 - np.tanh((rows - centre[stays, None]) / width[stays, None]))
    told = [float(np.max((each @ course) ** 2 / np.sum(each**2, axis=1))) for each in (by_time, by_edge)]
    return told[0] > told[1]
