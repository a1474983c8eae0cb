"""Whether the noise that a vehicle states can be that of its sensors, by what they read."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np

from ...framework.core.errors import InputError
from ...framework.core.recording.types import WheelTable
from ...framework.core.vehicle import Vehicle
from ..mechanics.textbook import CHANNELS
from .noise import measured_noise
from .trials import is_of_trials, without_time

_RANGES, _LOADS, _LARGEST_SLIP = 10.0, 3.0, 1.0
"""Standard deviations beyond which no sensor tells anything: ranges of what answers, largest loads, and slips [-]. A
load may be held, and a slip, so that their ranges say nothing. The smallest range of 1164 channels whose noise others
stated is 12 standard deviations."""

_FEWEST = 5
"""Rows of which the range says something."""

_SAME_LOAD, _SAME_SLIP = 0.1, 0.03
"""Share of a load [-], and slip, within which trials are repeats of one."""

_TOO_SMALL = 100.0
"""What neighbours show, over what is stated, from which on the latter is worth a word [-]: on those channels they show
22 times it at most."""


def check_stated_noise(table: WheelTable, vehicle: Vehicle, besides: Collection[str] = ()) -> list[str]:
    """Refuse a stated noise that leaves nothing of what its sensor reads, and say, in words, which is far too small.

    Parameters
    ----------
    table
        Rows of the vehicle's wheels; channels that were left out, or never change, say nothing of their noise.
    vehicle
        With `noise`, standard deviations by channel, in its unit.
    besides
        Channels that are not looked at.

    Raises
    ------
    InputError
        A standard deviation is ten times the range of its channel, three times the largest load, or a slip of 1.
    """
    if is_of_trials(table) and "time_s" in table:
        table = without_time(table)
    notes = []
    for name in CHANNELS:
        stated, values = vehicle.noise.get(name), table.get(name)
        seen = np.empty(0) if values is None else values[np.isfinite(values)]
        if stated is None or name in besides or len(seen) < _FEWEST:
            continue
        _check_size(name, stated, seen, table, vehicle)
        shown = measured_noise(table, name)
        if shown > _TOO_SMALL * stated:
            notes.append(
                f"the noise stated of {name}, {stated:.3g}, is less than a hundredth of what neighbours differ by "
                f"({shown:.2g}): check it; it is used as it is, and without it would be estimated from the data"
            )
    return notes


def _check_size(name: str, stated: float, seen: np.ndarray, table: WheelTable, vehicle: Vehicle) -> None:
    """Refuse a noise beside which the values seen (m,) of a channel are nothing."""
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
        values = table.get(name)
        seen = np.empty(0) if values is None else values[np.isfinite(values)]
        scale = float(np.abs(seen).max()) if name == "load_N" and len(seen) else 1.0
        if len(seen) and np.ptp(seen) > held * scale:
            return False
    return True
