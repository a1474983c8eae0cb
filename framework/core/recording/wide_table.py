"""Tables with columns for each wheel, as PlotJuggler exports bags: made into rows of each wheel.

Topics of different rates leave empty cells in each other's rows, so each wheel's rows are those of its fastest channel,
and the others are interpolated, as those of bags are.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np

from ..errors import InputError
from .bag_wheel import WheelChannels, merge
from .column_map import ColumnMap
from .topic_map import COLUMNS, Reading, WheelTopic
from .types import WheelTable
from .wheel_file import WheelFile
from .wheel_names import of_a_joint

MAX_GAP_S = 0.5
"""Channels are not interpolated over longer gaps [s]."""


def merged(parts: Mapping[str, WheelFile], mapped: ColumnMap, path: Path) -> WheelFile:
    """Put the rows of the wheels of a table together.

    Parameters
    ----------
    parts
        What was read of each wheel, by its name: its own channels, and those that all share.
    mapped
        The column map, which says which are its own.
    path
        The table, for errors.

    Raises
    ------
    InputError
        No channel has a value.
    """
    first = next(iter(parts.values())).table
    notes = dict.fromkeys(line for part in parts.values() for line in part.notes)
    if "time_s" not in first or first.run is not None or first.soil is not None:
        said = dict.fromkeys(line for part in parts.values() for line in part.problems)
        return WheelFile(_stacked({name: part.table for name, part in parts.items()}), tuple(said), tuple(notes))
    origin_s = float(np.min(first["time_s"]))
    every = {channel for own in mapped.wheels.values() for channel in own}
    shared = [channel for channel in first.columns if channel in COLUMNS and channel not in every]
    sources = [*_channels(first, None, shared, origin_s)]
    for name, part in parts.items():
        sources += _channels(part.table, name, mapped.wheels[name], origin_s)
    table, problems = merge(sources, 0, MAX_GAP_S, path)
    if table is None or table.wheel is None:
        raise InputError(path, "no wheel channel has a value", expected="columns of the wheels, with values")
    said = [*(line for part in parts.values() for line in part.problems), *problems]
    columns = {**table.columns, "time_s": table["time_s"] + origin_s}
    names = dict.fromkeys(every, "") | {name: first.column_names.get(name, "") for name in shared}
    whole = WheelTable(columns, table.wheel, None, path, column_names=names)
    return WheelFile(whole, tuple(dict.fromkeys(said)), tuple(notes))


def _stacked(tables: Mapping[str, WheelTable]) -> WheelTable:
    """Put the rows of trials of all wheels below one another."""
    names = dict.fromkeys(name for table in tables.values() for name in table.columns)
    columns = {
        name: np.concatenate([table.columns.get(name, np.full(len(table), np.nan)) for table in tables.values()])
        for name in names
    }
    wheel = np.concatenate([np.full(len(table), name, dtype=object) for name, table in tables.items()])
    first = next(iter(tables.values()))
    run, soil = (
        None if getattr(first, each) is None else np.concatenate([getattr(t, each) for t in tables.values()])
        for each in ("run", "soil")
    )
    return WheelTable(columns, wheel, run, first.source, soil, dict.fromkeys(first.column_names, ""))


def _channels(table: WheelTable, wheel: str | None, names: Iterable[str], origin_s: float) -> Iterator[WheelChannels]:
    """Yield channels of a table as those of a bag's topics are collected, each by itself."""
    time_ns = np.round((table["time_s"] - origin_s) * 1e9).astype(np.int64)
    for name in names:
        if name in table.columns and name != "time_s":
            source = WheelTopic(topic=f"column of {name}", wheel=wheel, fields={name: Reading(field=name)})
            seen = np.isfinite(table[name])
            yield WheelChannels.of(source, time_ns[seen], {name: table[name][seen]})


def joints_in(names: Sequence[str]) -> dict[str, dict[str, str]]:
    """Find columns of wheels' joints, as of ``/joint_states/front_left_wheel_joint/velocity``: by wheel and channel."""
    found: dict[str, dict[str, str]] = {}
    for name in names:
        if (known := of_a_joint(name)) is not None:
            found.setdefault(known[0], {})[known[1]] = name
    return found if len(found) > 1 else {}
