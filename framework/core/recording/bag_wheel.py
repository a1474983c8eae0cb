"""Wheel channels from topics of different rates, merged onto one clock for each wheel."""

from __future__ import annotations

from array import array
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InputError
from .bag_messages import number
from .clock import interpolate, nearest
from .topic_map import Reading, WheelTopic
from .types import WheelTable
from .wheel_file import SLIP_TOLERANCE

_FEW = 0.1  # a channel that is missing for less than this share of the samples is not worth a word


def reading(content: Any, source: Reading) -> float:
    """Give a number of a message in SI units; raises `DecodeError` where the field is not there."""
    return number(content, source.field) * source.scale + source.offset


class WheelChannels:
    """The channels of one topic and wheel, as they are collected message by message."""

    def __init__(self, source: WheelTopic):
        self.source = source
        self._time_ns = array("q")
        self._values = {column: array("d") for column in source.fields}

    def add(self, time_ns: int, content: Any) -> None:
        """Add a message; raises `DecodeError`, and adds nothing, where one of the fields is not there."""
        values = {column: reading(content, source) for column, source in self.source.fields.items()}
        self._time_ns.append(time_ns)
        for column, value in values.items():
            self._values[column].append(value)

    def __len__(self) -> int:
        return len(self._time_ns)

    def turn_load_up(self) -> bool:
        """Turn the load's sign where it is negative on the whole, as with a sensor whose axis points up; say if so."""
        load = np.array(self._values["load_N"], dtype=float)
        if not len(load) or not np.nan_to_num(np.nanmedian(load)) < 0:
            return False
        self._values["load_N"] = array("d", (-load).tolist())
        return True

    def channels(self, origin_ns: int) -> tuple[np.ndarray, dict[str, np.ndarray]]:
        """Give time (m,) [s], increasing, and the channels by column, (m,)."""
        time_ns, rows = np.unique(np.array(self._time_ns, dtype=np.int64), return_index=True)
        values = {column: np.array(data, dtype=float)[rows] for column, data in self._values.items()}
        return (time_ns - origin_ns) * 1e-9, values


def merge(
    sources: Sequence[WheelChannels], origin_ns: int, max_gap_s: float, path: Path
) -> tuple[WheelTable | None, list[str]]:
    """Merge topics into a wheel table: each wheel's clock is that of its fastest topic, the others are interpolated.

    Parameters
    ----------
    sources
        Channels by topic; one that names no wheel counts for every wheel.
    origin_ns
        Zero of the recording's clock [ns].
    max_gap_s
        No longer gap is bridged [s].
    path
        The bag, for errors.

    Returns
    -------
    WheelTable or None, problems

    Raises
    ------
    InputError
        A channel is given twice for a wheel, or slip lies outside of [-1, 1].
    """
    sources = [source for source in sources if len(source)]
    if not sources:
        return None, []
    names = sorted({source.source.wheel for source in sources if source.source.wheel is not None})
    problems: list[str] = []
    parts: list[tuple[np.ndarray, dict[str, np.ndarray], str | None]] = []
    for name in names or [None]:
        own = [source for source in sources if source.source.wheel == name]
        shared = [source for source in sources if source.source.wheel is None and name is not None]
        _refuse_double([*own, *shared], name, path)
        time, columns = _merge_one(own, shared, origin_ns, max_gap_s, name, problems)
        parts.append((time, columns, name))
    every = sorted({column for _, columns, _ in parts for column in columns})
    time = np.concatenate([time for time, _, _ in parts])
    order = np.argsort(time, kind="stable")
    table = {"time_s": time[order]}
    for column in every:
        pieces = [columns.get(column, np.full(len(time), np.nan)) for time, columns, _ in parts]
        table[column] = np.concatenate(pieces)[order]
    _check_slip(table, path)
    wheel = np.concatenate([np.full(len(time), name, dtype=object) for time, _, name in parts])[order]
    return WheelTable(table, wheel if names else None, None, path), problems


def _refuse_double(sources: Sequence[WheelChannels], name: str | None, path: Path) -> None:
    seen: dict[str, str] = {}
    for source in sources:
        for column in source.source.fields:
            if column in seen:
                whose = "" if name is None else f" of wheel {name}"
                raise InputError(
                    path, f"{column}{whose} comes from {seen[column]} and {source.source.topic}",
                    expected="one topic for it; say which in a topic map",
                )  # fmt: skip
            seen[column] = source.source.topic


def _merge_one(
    own: Sequence[WheelChannels],
    shared: Sequence[WheelChannels],
    origin_ns: int,
    max_gap_s: float,
    name: str | None,
    problems: list[str],
) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    clock, _ = max(own, key=len).channels(origin_ns)
    columns: dict[str, np.ndarray] = {}
    whose = "" if name is None else f" of wheel {name}"
    for source in (*own, *shared):
        time, values = source.channels(origin_ns)
        for column, recorded in values.items():
            infinite = np.isinf(recorded)
            if infinite.any():
                problems.append(f"{source.source.topic}: {int(infinite.sum())} infinite values of {column}, left out")
                recorded = np.where(infinite, np.nan, recorded)
            onto = nearest if column == "pass" else interpolate
            columns[column] = onto(time, recorded, clock, max_gap_s)
            lost = float(np.isnan(columns[column]).mean())
            if lost > _FEW:
                problems.append(
                    f"{source.source.topic}: {column}{whose} is missing for {100 * lost:.0f} % of the samples, "
                    f"further than {max_gap_s:g} s from the next that was recorded"
                )
    return clock, columns


def _check_slip(table: dict[str, np.ndarray], path: Path) -> None:
    slip = table.get("slip")
    if slip is None:
        return
    outside = np.abs(slip) > 1.0 + SLIP_TOLERANCE
    if outside.any():
        row = int(np.argmax(outside))
        raise InputError(
            path, f"{slip[row]:g}", expected="slip in [-1, 1]", place=f"slip at {table['time_s'][row]:.3f} s"
        )
    table["slip"] = np.clip(slip, -1.0, 1.0)
