"""Another simulator's file, interpolated to the rows of a recording."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from ...framework.core.errors import InputError
from ...framework.core.recording.types import WheelTable
from ...framework.core.recording.wheel_file import derive, read_wheel
from ...framework.core.vehicle import Wheel
from ..effects.effect import LOAD, SLIP
from ..mechanics.textbook import CHANNELS
from ..rows.signs import check_signs
from ..rows.trials import is_of_trials
from ..rows.units import check_sizes
from .samples import ANSWERS, MOST_SLIP, SIMULATED

IMPOSED = CHANNELS[LOAD], CHANNELS[SLIP]
"""Channels that a drive imposes on a wheel: the input of a simulator."""

_APART, _AT = 2.05, 1e-3
"""Largest distances in time, in steps of the recording, between rows that are interpolated, and between equal times."""

_OTHER_UNIT = 3.0
"""Ratio of a load to the recorded one, or its inverse, from which on drive or unit differ [-]."""

_REVERSED, _LEAST_SLIP = 0.1, 0.03
"""The sign of slip is reversed if reversing it reduces the difference from the recorded slip to this share; least size
of slip for this check [-]."""

_Interpolator = Callable[[np.ndarray, np.ndarray], np.ndarray]
"""Interpolates values (m,) of one file to the rows (n,) of another; NaN next to holes, (m,) True."""


def attach(table: WheelTable, path: str | Path, wheel: Wheel) -> tuple[WheelTable, tuple[str, ...]]:
    """Add another simulator's channels to a recording's table, matched by run or by time.

    They include the load [N] and slip that it simulated: those of its file, slip from its speeds where it has no such
    column, or else those recorded, interpolated to its rows. Rows in which its wheel is stuck or carries no load, or
    whose load or slip is unknown, have no values.

    Parameters
    ----------
    table
        The recording's rows, with load and slip.
    path
        The simulator's file.
    wheel
        The recording's wheel.

    Returns
    -------
    table, notes
        The table with the simulator's channels, and what was converted or assumed in reading these.

    Raises
    ------
    InputError
        The file has no predicted channel, or neither time nor runs in common with the recording; its load, slip or
        sinkage is implausible, or is not that of the drive; a time occurs twice in it; only one of the two files
        distinguishes several wheels or runs; or its wheel is stuck throughout.
    """
    simulated, _, notes = read_wheel(path)
    if CHANNELS[SLIP] not in simulated:
        simulated = derive(simulated, wheel)
    check_signs(simulated, wheel)
    check_sizes(simulated, wheel)
    names = [CHANNELS[channel] for channel in ANSWERS if CHANNELS[channel] in simulated]
    if not names:
        raise InputError(path, "nothing to compare", expected="torque_Nm, sinkage_m or drawbar_pull_N")
    to_recorded, to_simulated = _interpolators(table, simulated, path)
    everywhere, nowhere = np.zeros(len(simulated)), np.zeros(len(simulated), dtype=bool)
    if not np.isfinite(to_recorded(everywhere, nowhere)).any():
        raise InputError(path, "no row has the time or the run of one of the recording's", expected="the same drive")
    holes = np.zeros(len(table), dtype=bool)
    imposed = {name: simulated[name] if name in simulated else to_simulated(table[name], holes) for name in IMPOSED}
    load, slip = imposed.values()
    # Missing values are interpolated; those of a stuck wheel are not.
    stuck = (load <= 0.0) | (slip >= MOST_SLIP)
    columns = {**imposed, **{name: simulated[name] for name in names}}
    attached = {name: to_recorded(np.where(stuck, np.nan, values), stuck) for name, values in columns.items()}
    unknown = ~(np.isfinite(attached[IMPOSED[0]]) & np.isfinite(attached[IMPOSED[1]]))
    attached = {name: np.where(unknown, np.nan, values) for name, values in attached.items()}
    given = [name for name in IMPOSED if name in simulated]
    if given and not any(np.isfinite(attached[name]).any() for name in names):
        raise InputError(
            path, "no row has an answer with a load and a slip of a wheel that carries load and moves",
            expected=f"load_N above 0 and slip below {MOST_SLIP} in the rows with an answer",
        )  # fmt: skip
    _check_drive(table, {name: attached[name] for name in given}, path)
    columns = {SIMULATED + name: values for name, values in attached.items()}
    return table.adding(columns), notes


def _check_drive(table: WheelTable, given: Mapping[str, np.ndarray], path: str | Path) -> None:
    """Raise `InputError` if the simulator's own load or slip (n,) cannot be that of the recorded drive."""
    for name, values in given.items():
        both = np.isfinite(values) & np.isfinite(table[name])
        if not both.any():
            continue
        own, recorded = values[both], table[name][both]
        middle, usual = float(np.median(own)), float(np.median(np.abs(recorded)))
        if name == CHANNELS[LOAD] and not usual / _OTHER_UNIT < middle < usual * _OTHER_UNIT:
            raise InputError(
                path, f"{middle:.3g} N (median) where {usual:.3g} N was recorded", place=f"column {name}",
                expected="the load of the recorded drive, in N, or one of that size",
            )  # fmt: skip
        if name == CHANNELS[SLIP]:
            as_given, reversed_sign = (float(np.median(np.abs(sign * own - recorded))) for sign in (1.0, -1.0))
            if usual > _LEAST_SLIP and reversed_sign < _REVERSED * as_given:
                raise InputError(
                    path, f"{middle:.3g} (median) where {float(np.median(recorded)):.3g} was recorded",
                    place=f"column {name}", expected="the same sign: positive where the wheel drives",
                )  # fmt: skip


def _interpolators(table: WheelTable, simulated: WheelTable, path: str | Path) -> tuple[_Interpolator, _Interpolator]:
    """Return interpolators from the simulator's rows to the recorded ones, and the reverse."""
    if "time_s" in table and "time_s" in simulated:
        _check_labels(table, simulated, path)
        recorded, other = _clocks(table, simulated)
        if (repeated := other.repeated_time()) is not None:
            raise InputError(
                path, f"{repeated:g} s in two rows", place="column time_s",
                expected="each time once, or columns wheel and run that distinguish the rows",
            )  # fmt: skip
        steps = recorded.steps()
        apart = 0.0 if is_of_trials(table) else _APART
        return partial(_by_time, recorded, other, steps, apart), partial(_by_time, other, recorded, steps, apart)
    if table.run is not None and simulated.run is not None:
        runs = np.asarray(table.run).astype(str), np.asarray(simulated.run).astype(str)
        return partial(_by_run, *runs), partial(_by_run, *runs[::-1])
    raise InputError(path, "neither time_s nor run in both files", expected="the clock or the runs of the recording")


def _check_labels(table: WheelTable, simulated: WheelTable, path: str | Path) -> None:
    """Raise `InputError` if only one file distinguishes rows of several wheels, or of several runs at one time."""
    for column in ("wheel", "run"):
        named = [getattr(each, column) for each in (table, simulated)]
        if (named[0] is None) == (named[1] is None):
            continue
        lacking, labels, clock = (
            (path, named[0], table["time_s"]) if named[1] is None else (table.source, named[1], simulated["time_s"])
        )
        names, of = np.unique(np.asarray(labels).astype(str), return_inverse=True)
        order = np.argsort(clock, kind="stable")
        changes = np.count_nonzero(np.diff(of[order]))
        if len(names) > 1 and (column == "wheel" or changes >= len(names)):
            several = ", ".join(names[:3]) + (", ..." if len(names) > 3 else "")
            raise InputError(lacking, f"no column {column}", expected=f"which of {several} each row is of")


@dataclass(frozen=True)
class _Clock:
    """Times of rows (n,) [s], and their labels: wheel and run."""

    time_s: np.ndarray
    label: np.ndarray

    def of(self, label: str) -> np.ndarray:
        """Rows (k,) of a label that have a time, in order of time."""
        rows = np.flatnonzero((self.label == label) & np.isfinite(self.time_s))
        return rows[np.argsort(self.time_s[rows], kind="stable")]

    def steps(self) -> dict[str, float]:
        """Median time step [s] by label; 0 for one row."""
        each = {label: np.diff(self.time_s[self.of(label)]) for label in np.unique(self.label)}
        return {
            label: float(np.median(step[step > 0.0])) if (step > 0.0).any() else 0.0 for label, step in each.items()
        }

    def repeated_time(self) -> float | None:
        """A time that occurs twice under one label [s]; None if there is none."""
        for label in np.unique(self.label):
            time_s = self.time_s[self.of(label)]
            if (same := np.diff(time_s) == 0.0).any():
                return float(time_s[1:][same][0])
        return None


def _by_run(requested: np.ndarray, runs: np.ndarray, values: np.ndarray, _holes: np.ndarray) -> np.ndarray:
    """Values (m,) for the run of each row (n,): row by row if the numbers of rows are equal, else the run's mean."""
    answer = np.full(len(requested), np.nan)
    for name in np.unique(requested):
        rows, there = np.flatnonzero(requested == name), np.flatnonzero(runs == name)
        if len(rows) == len(there):
            answer[rows] = values[there]
        elif np.isfinite(values[there]).any():
            answer[rows] = np.nanmean(values[there])
    return answer


def _by_time(
    requested: _Clock, known: _Clock, steps: Mapping[str, float], apart: float, values: np.ndarray, holes: np.ndarray
) -> np.ndarray:
    """Interpolate values (m,) linearly in time within each wheel and run, (n,); NaN are skipped, holes are not.

    NaN outside the known times, between two that are more than `apart` of the recording's `steps` [s] apart, and next
    to a hole.
    """
    answer = np.full(len(requested.time_s), np.nan)
    for label in np.unique(requested.label):
        there, rows, step = known.of(label), np.flatnonzero(requested.label == label), steps.get(label, 0.0)
        there = there[np.isfinite(values[there]) | holes[there]]
        if there.size:
            at_s, time_s, seen = requested.time_s[rows], known.time_s[there], ~holes[there]
            line = np.interp(at_s, time_s, np.where(seen, values[there], 0.0))
            whole = np.interp(at_s, time_s, seen.astype(float)) > 1.0 - 1e-6
            answer[rows] = np.where(whole & _near(at_s, time_s, apart * step, _AT * step), line, np.nan)
    return answer


def _near(requested: np.ndarray, time_s: np.ndarray, farthest_s: float, at_s: float) -> np.ndarray:
    """(k,) True for times at one of others (m,), which ascend, or between two that are no more than so far apart."""
    after = np.clip(np.searchsorted(time_s, requested), 0, len(time_s) - 1)
    before = np.maximum(after - 1, 0)
    away = np.minimum(np.abs(time_s[after] - requested), np.abs(time_s[before] - requested))
    between = (requested >= time_s[0]) & (requested <= time_s[-1])
    return (between & (time_s[after] - time_s[before] <= farthest_s)) | (away <= at_s)


def _clocks(*tables: WheelTable) -> list[_Clock]:
    """Return the clocks of tables, with labels of wheel and run as far as all of the tables have them."""
    labels = [np.full(len(table), "", dtype=object) for table in tables]
    for names in ([table.wheel for table in tables], [table.run for table in tables]):
        if all(each is not None for each in names):
            labels = [label + "/" + np.asarray(each, dtype=object) for label, each in zip(labels, names, strict=True)]
    return [_Clock(table["time_s"], label.astype(str)) for table, label in zip(tables, labels, strict=True)]
