"""Sensors that are stuck, and stated noise that contradicts what the sensors read."""

from __future__ import annotations

import math
from collections.abc import Collection

import numpy as np

from ...framework.core.errors import InputError
from ...framework.core.findings import Finding, note, warning
from ...framework.core.recording.types import WheelTable
from ...framework.core.vehicle import Vehicle
from ..mechanics.textbook import ANSWERS, CHANNELS
from .noise import measured_noise
from .trials import is_of_trials, without_time

_RANGES, _LOADS, _LARGEST_SLIP = 10.0, 3.0, 1.0
"""Largest noise of a sensor: as a multiple of the range of torque, sinkage or pull, of the largest load; a slip [-].
Load and slip may be held constant, so that their ranges do not count. The smallest range of 1164 channels whose noise
was stated is 12 standard deviations."""

_FEWEST = 5
"""Fewest rows whose range counts."""

_SAME_LOAD, _SAME_SLIP = 0.1, 0.03
"""Share of a load [-], and slip, within which trials are repeats of one."""

_TOO_SMALL = 100.0
"""What neighbours show, over what is stated, from which on the latter is worth a word [-]: on those channels they show
22 times it at most."""


_MOST_EQUAL, _BY_CHANCE = 0.1, 1e-3
"""Largest share of equal neighbours in a channel whose steps are fine [-], and the probability below which a run of one
value is no chance [-]."""


def without_stuck(table: WheelTable, computed: frozenset[str] = frozenset()) -> tuple[WheelTable, list[Finding]]:
    """Leave out answers of the ground that never change, and rows in which a channel hangs.

    A load that never changes may be the wheel's share of the weight, and a slip may be held.

    Parameters
    ----------
    table
        Rows of one wheel.
    computed
        Channels that no sensor gave: they stay.

    Returns
    -------
    WheelTable
        The same rows, NaN where a channel was left out.
    list of Finding
        What was left out: ``stuck_channel``, or ``stuck_rows`` with their number, for each.
    """
    columns, findings = dict(table.columns), list[Finding]()
    for name in CHANNELS:
        if name in computed:
            continue
        values = table.observed(name)
        if name in ANSWERS and len(values) >= _FEWEST and np.ptp(values) == 0.0:
            columns[name] = np.full(len(table), math.nan)
            findings.append(note("stuck_channel", channel=name))
        elif len(values) and "time_s" in table and (held := _held(table[name])).any():
            columns[name] = np.where(held, math.nan, table[name])
            findings.append(note("stuck_rows", channel=name, n=int(held.sum())))
    return table.with_columns(columns), findings


def _held(values: np.ndarray) -> np.ndarray:
    """(n,) True where a channel (n,) repeats a value for longer than chance allows, as a sensor that hangs does.

    Chance is how often other neighbours are equal; a channel whose steps are coarse says nothing, nor do its largest
    and least value, at which a sensor saturates.
    """
    same = np.append(False, values[1:] == values[:-1])
    if same.mean() > _MOST_EQUAL:
        return np.zeros(len(values), dtype=bool)
    number = np.cumsum(~same) - 1
    length = np.bincount(number)
    short = length < _FEWEST
    chance = max(float((length[short] - 1).sum()), 1.0) / len(values)
    unlikely = ~short & (math.log(len(values)) + (length - 1) * math.log(chance) < math.log(_BY_CHANCE))
    return unlikely[number] & (values > np.nanmin(values)) & (values < np.nanmax(values))


def check_stated_noise(table: WheelTable, vehicle: Vehicle, ignore: Collection[str] = ()) -> list[Finding]:
    """Refuse a stated noise that leaves nothing of what its sensor reads, and doubt one that is far too small.

    Parameters
    ----------
    table
        Rows of the vehicle's wheels; channels that were left out, or never change, say nothing of their noise.
    vehicle
        With `noise`, standard deviations by channel, in its unit.
    ignore
        Channels that are not looked at.

    Returns
    -------
    list of Finding
        ``stated_noise`` for each channel whose noise is far too small.

    Raises
    ------
    InputError
        A standard deviation is ten times the range of its channel, three times the largest load, or a slip of 1.
    """
    if is_of_trials(table) and "time_s" in table:
        table = without_time(table)
    doubts = []
    for name in CHANNELS:
        stated, seen = vehicle.noise.get(name), table.observed(name)
        if stated is None or name in ignore or len(seen) < _FEWEST:
            continue
        _check_size(name, stated, seen, table, vehicle)
        shown = measured_noise(table, name)
        if shown > _TOO_SMALL * stated:
            doubts.append(warning("stated_noise", channel=name, stated=stated, shown=shown))
    return doubts


def _check_size(name: str, stated: float, seen: np.ndarray, table: WheelTable, vehicle: Vehicle) -> None:
    """Refuse a noise that exceeds the values seen (m,) of a channel."""
    size, what = _RANGES * float(np.ptp(seen)), f"ranges from {seen.min():.6g} to {seen.max():.6g}"
    if name == "load_N":
        size, what = _LOADS * float(np.max(np.abs(seen))), f"is {np.max(np.abs(seen)):.3g} at most"
    elif name == "slip":
        size, what = _LARGEST_SLIP, "lies in [-1, 1]"
    elif _is_repeated(table):
        # Means of one trial over and over differ by less than a reading errs.
        return
    if size > 0.0 and stated >= size:
        raise InputError(
            f"vehicle {vehicle.name!r}", f"{stated:.3g}", place=f"key noise.{name}",
            expected=f"the sensor's standard deviation: {name} of {table.source.name} {what}",
        )  # fmt: skip


def _is_repeated(table: WheelTable) -> bool:
    """Say whether load and slip, as far as they were recorded, are the same in all rows."""
    for name, held in (("load_N", _SAME_LOAD), ("slip", _SAME_SLIP)):
        seen = table.observed(name)
        scale = float(np.abs(seen).max()) if name == "load_N" and len(seen) else 1.0
        if len(seen) and np.ptp(seen) > held * scale:
            return False
    return True
