"""Another simulator's file, put beside the rows of a recording."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np

from ....framework.core.errors import InputError
from ....framework.core.recording.types import WheelTable
from ....framework.core.recording.wheel_file import derive, read_wheel_file
from ....framework.core.vehicle import Wheel
from ...effects.effect import LOAD, SLIP
from ...forward import CHANNELS
from ...plausible import check_signs, check_sizes
from .samples import ANSWERS, MOST_SLIP, SIMULATED

IMPOSED = CHANNELS[LOAD], CHANNELS[SLIP]
"""What a drive imposes on a wheel, and a simulator is given."""

_APART = 2.05
"""Samples of the recording between two rows at most that a straight line joins."""

_OTHER_UNIT = 10.0
"""A load that is so many times the recorded one, or that part of it, is of another drive or in another unit [-]."""

_TURNED_ROUND = 0.1
"""Slips with the other sign are nearer to the recorded ones by this share, where the sign is the other one [-]."""

_Columns = dict[str, np.ndarray]
_Carry = Callable[[np.ndarray], np.ndarray]
"""Carries values of one file's rows over to another's; NaN where there are none."""


def attach(table: WheelTable, path: str | Path, wheel: Wheel) -> WheelTable:
    """Give a recording's table columns with the simulator's answers for each row, by run or by time.

    They come with the load [N] and slip that it simulated: those of its file, slip from its speeds where it has no such
    column, or, where that has neither, those recorded, taken at its own rows. Rows in which its wheel is stuck or
    carries nothing, or of which its file does not say what load and slip they are of, have no answer.

    Parameters
    ----------
    table
        The recording's rows, with load and slip.
    path
        The simulator's file.
    wheel
        The recording's wheel.

    Raises
    ------
    InputError
        The file has no answer, or neither the clock nor the runs of the recording; its load, slip or sinkage cannot be
        what its name says, or is not the drive's; or its wheel is stuck throughout.
    """
    simulated = read_wheel_file(Path(path))
    if CHANNELS[SLIP] not in simulated:
        simulated = derive(simulated, wheel)
    check_signs(simulated, wheel)
    check_sizes(simulated, wheel)
    names = [CHANNELS[channel] for channel in ANSWERS if CHANNELS[channel] in simulated]
    if not names:
        raise InputError(path, "nothing to compare", expected="torque_Nm, sinkage_m or drawbar_pull_N")
    to_recorded, to_simulated = _carried_over(table, simulated, path)
    if not np.isfinite(to_recorded(np.zeros(len(simulated)))).any():
        raise InputError(path, "no row has the time or the run of one of the recording's", expected="the same drive")
    imposed = {name: simulated[name] if name in simulated else to_simulated(table[name]) for name in IMPOSED}
    load, slip = imposed.values()
    moves = (load > 0.0) & (slip < MOST_SLIP)
    columns = {**imposed, **{name: simulated[name] for name in names}}
    beside = {name: to_recorded(np.where(moves, values, np.nan)) for name, values in columns.items()}
    given = [name for name in IMPOSED if name in simulated]
    if given and not any(np.isfinite(beside[name]).any() for name in names):
        raise InputError(
            path, "no row has an answer of a wheel that carries load and moves",
            expected=f"load_N above 0 and slip below {MOST_SLIP}",
        )  # fmt: skip
    _check_drive(table, {name: beside[name] for name in given}, path)
    columns = {SIMULATED + name: values for name, values in beside.items()}
    return WheelTable({**table.columns, **columns}, table.wheel, table.run, table.source)


def _check_drive(table: WheelTable, given: _Columns, path: str | Path) -> None:
    """Refuse a load and a slip (n,) of the simulator's own that cannot be those of the recorded drive."""
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
            as_it_is, turned = (float(np.median(np.abs(sign * own - recorded))) for sign in (1.0, -1.0))
            if turned < _TURNED_ROUND * as_it_is:
                raise InputError(
                    path, f"{middle:.3g} (median) where {float(np.median(recorded)):.3g} was recorded",
                    place=f"column {name}", expected="the same sign: positive where the wheel drives",
                )  # fmt: skip


def _carried_over(table: WheelTable, simulated: WheelTable, path: str | Path) -> tuple[_Carry, _Carry]:
    """Give how values of the simulator's rows are carried over to the recorded ones, and the reverse."""
    if "time_s" in table and "time_s" in simulated:
        labels, others = _labels(table, simulated)
        recorded, other = (table["time_s"], labels), (simulated["time_s"], others)
        farthest_s = _APART * _step(*recorded)
        return partial(_by_time, recorded, other, farthest_s), partial(_by_time, other, recorded, farthest_s)
    if table.run is not None and simulated.run is not None:
        runs = np.asarray(table.run).astype(str), np.asarray(simulated.run).astype(str)
        return partial(_by_run, *runs), partial(_by_run, *runs[::-1])
    raise InputError(path, "neither time_s nor run in both files", expected="the clock or the runs of the recording")


def _by_run(wanted: np.ndarray, runs: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Mean (n,) of the values (m,) of each run that is wanted."""
    known = np.isfinite(values)
    names, of = np.unique(runs[known], return_inverse=True)
    means = np.bincount(of, values[known], len(names)) / np.bincount(of, minlength=len(names))
    at = np.minimum(np.searchsorted(names, wanted), max(len(names) - 1, 0))
    return np.where(names[at] == wanted, means[at], np.nan) if len(names) else np.full(len(wanted), np.nan)


def _by_time(
    wanted: tuple[np.ndarray, np.ndarray], known: tuple[np.ndarray, np.ndarray], farthest_s: float, values: np.ndarray
) -> np.ndarray:
    """Interpolate values (m,) within each wheel and run, (n,), given when [s] and under which label rows stand.

    NaN outside the time of those, between two that lie too far apart, and beside one without a value: what happens
    there is not told by a straight line.
    """
    answer = np.full(len(wanted[0]), np.nan)
    for label in np.unique(wanted[1]):
        rows = np.flatnonzero(wanted[1] == label)
        there = np.flatnonzero((known[1] == label) & np.isfinite(known[0]))
        if there.size:
            there = there[np.argsort(known[0][there], kind="stable")]
            at_s, time_s, seen = wanted[0][rows], known[0][there], np.isfinite(values[there])
            line = np.interp(at_s, time_s, np.where(seen, values[there], 0.0), left=np.nan, right=np.nan)
            whole = np.interp(at_s, time_s, seen.astype(float)) > 1.0 - 1e-6
            answer[rows] = np.where(whole & _near(at_s, time_s, farthest_s), line, np.nan)
    return answer


def _near(wanted: np.ndarray, time_s: np.ndarray, farthest_s: float) -> np.ndarray:
    """(k,) True for times with one of others (m,), ascending, at them or close by on both sides."""
    after = np.clip(np.searchsorted(time_s, wanted), 0, len(time_s) - 1)
    before = np.maximum(after - 1, 0)
    away = np.minimum(np.abs(time_s[after] - wanted), np.abs(time_s[before] - wanted))
    return (time_s[after] - time_s[before] <= farthest_s) | (away <= 1e-3 * farthest_s)


def _step(time_s: np.ndarray, labels: np.ndarray) -> float:
    """Usual time [s] from a row to the next of the same wheel and run."""
    order = np.lexsort((time_s, labels))
    steps = np.diff(time_s[order])[labels[order][1:] == labels[order][:-1]]
    return float(np.median(steps[steps > 0.0])) if (steps > 0.0).any() else 0.0


def _labels(*tables: WheelTable) -> list[np.ndarray]:
    """Number wheel and run of each row alike in several tables, as far as all of them name them."""
    labels = [np.full(len(table), "", dtype=object) for table in tables]
    for names in ([table.wheel for table in tables], [table.run for table in tables]):
        if all(each is not None for each in names):
            labels = [label + "/" + np.asarray(each, dtype=object) for label, each in zip(labels, names, strict=True)]
    return [label.astype(str) for label in labels]
