"""Rows of runs at constant load, slip and speed in which the wheel has not settled yet: it starts, or a step ends."""

from __future__ import annotations

import math

import numpy as np
from scipy.stats import t as t_distribution

from ...framework.core.findings import Finding, note
from ...framework.core.recording.types import WheelTable
from ..mechanics.textbook import ANSWERS
from .steady_runs import FEWEST_RUNS, Runs, steady_runs
from .stops import without_stops

_ONE_RATE = 0.2
"""Relative difference of a run's time step from the usual one, at most [-]."""

_STEPS = 5.0
"""Standard deviations of the steps of a channel that would show a settling after them [-]."""

_FIRST = 0.05
"""Share of a run that is tested for first rows that are off [-]."""

_OFF, _ALIKE, _BY_CHANCE = 2.0, 0.6, 0.01
"""Least root mean square of the first rows' deviations [standard deviations], share of it that is common to all runs,
and the probability below which what they have in common is no chance [-]."""

_SETTLED, _OVER_NOISE = 0.3, 3.0
"""Standard deviations from which on a row is off [-]: of a row, and at least of the mean course."""

_FLAT, _SHORTEST = 0.12, 5
"""Largest change over the rest of the run, as of a sensor that drifts, as a share of the first deviation [-]; fewest
rows of a settling."""

_STAYS = 1.2
"""Least length of a patch of other ground at the start of a run, in widths of its edge [-]."""

_NOTHING = 0.3
"""Share of its level below which an answer begins as at rest [-]: the mean of first rows in which it already grows."""

_LEAST, _LEAST_IMPOSED = 1e-4, 0.01
"""Least scatter of an answer and of what is imposed, as shares of their levels, for channels without noise [-]."""

_MARGIN = 1.25
"""Factor on the length of the settling that is left out [-]."""


def only_steady(table: WheelTable) -> tuple[WheelTable, list[Finding]]:
    """Leave out the rows in which the wheels of a test at constant slips start, settle and stop.

    Parameters
    ----------
    table
        Channels as `standstill.with_standstill` gives them.

    Returns
    -------
    WheelTable
        The other rows.
    list of Finding
        ``stop_rows`` and ``settling_rows``, where rows are left out.
    """
    table, stopped, started = without_stops(table)
    table, settling = without_settling(table, started=started)
    return table, [found for found in (stopped, settling) if found]


def without_settling(table: WheelTable, *, started: bool = False) -> tuple[WheelTable, Finding | None]:
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
    started
        The runs' first rows were left out, in which the wheel got going: an instrument that warms up does so from the
        first one on, and one answer that settles is enough.

    Returns
    -------
    WheelTable
        The other rows.
    Finding or None
        ``settling_rows``, where rows are left out.
    """
    runs = steady_runs(table)
    if runs is None or len(runs.each) < FEWEST_RUNS or np.ptp(runs.step_s) > _ONE_RATE * np.median(runs.step_s):
        return table, None
    channels = {name: runs.of(table[name]) for name in ANSWERS if name in table}
    settling = {name: _settling(values, runs.after) for name, values in channels.items()}
    begin = sum(np.isfinite(values[:, :_SHORTEST]).any(axis=1).sum() >= FEWEST_RUNS for values in channels.values())
    # One alone that settles is an instrument that warms up.
    if sum(rows > 0 for rows in settling.values()) < max(1, min(1 if started else 2, begin)):
        return table, None
    if _imposed(table, runs) or (runs.stepped and _late(channels, settling, runs.after)):
        return table, None
    longest = max(settling.values())
    first = runs.rows[:, : math.ceil(_MARGIN * longest)]
    kept = np.ones(len(table), dtype=bool)
    kept[first[first >= 0]] = False
    return table.select(kept), note(
        "settling_rows", seconds=first.shape[1] * float(np.median(runs.step_s)), runs=len(first), steps=runs.stepped,
        channels=[name for name, rows in settling.items() if rows],
    )  # fmt: skip


def _imposed(table: WheelTable, runs: Runs) -> bool:
    """Say whether load, slip or a speed settles, too: then the answers may follow it."""
    names = ("load_N", "slip", "wheel_speed_rad_s", "travel_speed_m_s")
    seen = [runs.of(table[name]) for name in names if name in table]
    return any(_settling(values, runs.after, _LEAST_IMPOSED) > 0 for values in seen)


def _levels(values: np.ndarray, least: float = _LEAST) -> tuple[np.ndarray, float]:
    """Final level (s,) of a channel (s, k) in each run, NaN where not observed, and its scatter there, no less than a
    share `least` of the level.
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
    """Say whether only some of the channels (s, k) that step settle: the others rule out a transient of the wheel."""
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
    usable = np.isfinite(level) & there[:, :first].any(axis=1)
    way = np.ones(len(values))
    if (after >= 0).any():
        way = np.where(after >= 0, np.sign(level[after] - level), math.nan)
        usable &= np.isfinite(way)
    if usable.sum() < FEWEST_RUNS or not sd > 0.0:
        return 0
    away = ((values - level[:, None]) * way[:, None])[usable]
    began = np.nanmean(away[:, :first], axis=1) / sd
    size = math.sqrt(float(np.mean(began**2)))
    if size < _OFF:
        return 0
    begin = np.abs(np.nanmean(values[usable, :first], axis=1))
    at_rest = not (after >= 0).any() and bool(np.all(begin < _NOTHING * np.abs(level[usable])))
    alike = at_rest or (abs(float(began.mean())) / size >= _ALIKE and _are_alike(began))
    if not alike:
        return 0
    # Each run by how far off it begins: what they share counts, and their noise averages out.
    weight = np.sum(began[:, None] ** 2 * there[usable], axis=0)
    course = np.nansum(began[:, None] * away / sd, axis=0) / np.maximum(weight, 1e-9)
    return _length(course, size, first, at_rest)


def _are_alike(began: np.ndarray) -> bool:
    """Say whether runs begin off their levels (s,) by more in common than chance makes them, by Student's t."""
    error = float(np.std(began, ddof=1)) / math.sqrt(len(began))
    return abs(float(began.mean())) > error * float(t_distribution.ppf(1.0 - 0.5 * _BY_CHANCE, len(began) - 1))


def _length(course: np.ndarray, size: float, first: int, at_rest: bool) -> int:
    """Count the rows until the mean course of a channel (k,) settles; 0 where it does not.

    It begins at one, in the `first` rows, and is there off by the `size`, in standard deviations; `at_rest` where the
    channel itself begins near zero, as on no ground that is driven.
    """
    half = len(course) // 2
    middle, end = (float(part.mean()) for part in np.array_split(course[half:], 2))
    smooth = np.convolve(course, np.ones(3) / 3.0, mode="same")
    # Few runs leave noise in their mean, which the rest of it shows.
    noise = size * float(np.std(smooth[half:-1]))
    off = np.flatnonzero(size * np.abs(smooth[:half]) >= max(_SETTLED, _OVER_NOISE * noise))
    if abs(middle - end) > _FLAT or not len(off):
        return 0
    length = int(off[np.argmax(np.diff(off, append=len(course)) > first)]) + 1
    if length < _SHORTEST or math.ceil(_MARGIN * length) > half:
        return 0
    return length if at_rest or _dies_away(course[:half]) else 0


def _dies_away(course: np.ndarray) -> bool:
    """Say whether an exponential decay fits a mean course (k,) better than an edge does, as of a patch of other ground
    or of a delay, by least squares.
    """
    rows = np.arange(len(course))
    by_time = np.exp(-rows / np.geomspace(1.0, 0.5 * len(rows), 40)[:, None])
    centre, width = (each.ravel() for each in np.meshgrid(rows[2:], np.geomspace(0.5, 0.5 * len(rows), 20)))
    stays = centre >= _STAYS * width
    by_edge = 0.5 * (1.0 - np.tanh((rows - centre[stays, None]) / width[stays, None]))
    decay, edge = (float(np.max((each @ course) ** 2 / np.sum(each**2, axis=1))) for each in (by_time, by_edge))
    return decay > edge
