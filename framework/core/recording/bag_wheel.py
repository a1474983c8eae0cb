"""Wheel channels from topics of different rates, merged onto one clock for each wheel."""

from __future__ import annotations

import math
from array import array
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from scipy.signal import lfilter

from ..errors import InputError
from ..vehicle import Vehicle
from .bag_places import reading
from .clock import interpolate, nearest
from .slip_definitions import SLIP_TOLERANCE
from .topic_map import WheelTopic
from .types import WheelTable

_KEPT = (0.0, *np.linspace(0.1, 0.98, 45).tolist())
"""Share of its last value that a filter of the first order keeps from one sample to the next [-]."""

_MOST_LATE = 10
"""Samples by which a filter is late at most."""

_CALIBRATED = 0.1
"""How far from 1 the factor lies by which an odometry made from the wheels is corrected [-]."""

_EXACTLY, _NEARLY = 1e-3, 2e-3
"""How closely a speed made from the wheels keeps to them, reading by reading and in means over a second [-]."""

_FEWEST = 50
"""Fewest readings that say whether it does."""

_HALF_S = 0.1
"""A speed is the change of the angle from so long before to so long after [s]."""

_FEW = 0.1  # a channel that is missing for less than this share of the samples is not worth a word


class WheelChannels:
    """The channels of one topic and wheel, as they are collected message by message."""

    def __init__(self, source: WheelTopic):
        self.source = source
        self._time_ns = array("q")
        self._values = {column: array("d") for column in source.fields}

    @classmethod
    def of(cls, source: WheelTopic, time_ns: np.ndarray, values: Mapping[str, np.ndarray]) -> WheelChannels:
        """Make them of times (n,) [ns] and values (n,) by column."""
        made = cls(source)
        made._time_ns = array("q", time_ns.tolist())
        made._values = {column: array("d", each.tolist()) for column, each in values.items()}
        return made

    def add(self, time_ns: int, content: Any) -> None:
        """Add a message; raises `DecodeError`, and adds nothing, where one of the fields is not there."""
        values = {column: reading(content, source) for column, source in self.source.fields.items()}
        self._time_ns.append(time_ns)
        for column, value in values.items():
            self._values[column].append(value)

    def __len__(self) -> int:
        return len(self._time_ns)

    @property
    def last_ns(self) -> int:
        """Time of the newest message [ns]; far back where there is none."""
        return max(self._time_ns, default=-(2**62))

    def forget_before(self, time_ns: float) -> None:
        """Forget the messages before a time [ns], but for the last one of these; all where it is infinite."""
        times = np.array(self._time_ns, dtype=np.int64)
        before = np.flatnonzero(times < time_ns)
        kept = times >= time_ns
        if len(before) and math.isfinite(time_ns):
            kept[before[np.argmax(times[before])]] = True
        if kept.all():
            return
        self._time_ns = array("q", times[kept].tobytes())
        self._values = {column: array("d", np.array(data)[kept].tobytes()) for column, data in self._values.items()}

    def held_until(self, time_ns: int) -> WheelChannels:
        """Give them with their last values once more at a later time [ns], up to which no other message came."""
        if not len(self) or self.last_ns >= time_ns:
            return self
        last = int(np.argmax(np.array(self._time_ns)))
        made = WheelChannels(self.source)
        made._time_ns = array("q", [*self._time_ns, time_ns])
        made._values = {column: array("d", [*data, data[last]]) for column, data in self._values.items()}
        return made

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


def clocks_of(sources: Sequence[WheelChannels]) -> dict[str | None, str]:
    """Give the topic whose messages are the rows of each wheel, the fastest one, by the wheel's name."""
    there = [source for source in sources if len(source)]
    names = {source.source.wheel for source in there} - {None}
    return {
        name: max((each for each in there if each.source.wheel == name), key=len).source.topic
        for name in (names or ({None} if there else ()))
    }


def merge(
    sources: Sequence[WheelChannels], origin_ns: int, max_gap_s: float, path: Path,
    clocks: Mapping[str | None, str] | None = None,
) -> tuple[WheelTable | None, list[str]]:  # fmt: skip
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
    clocks
        Of a part of a bag: the topic that is each wheel's clock in the whole; wheels without any of it are left out.

    Returns
    -------
    WheelTable or None, problems

    Raises
    ------
    InputError
        A channel is given twice for a wheel, or slip lies outside of [-1, 1].
    """
    sources = [source for source in sources if len(source)]
    there = {(each.source.wheel, each.source.topic) for each in sources}
    clocks = clocks_of(sources) if clocks is None else {n: each for n, each in clocks.items() if (n, each) in there}
    if not clocks:
        return None, []
    names = sorted(name for name in clocks if name is not None)
    problems: list[str] = []
    parts: list[tuple[np.ndarray, dict[str, np.ndarray], str | None]] = []
    for name in names or [None]:
        own = sorted(
            (source for source in sources if source.source.wheel == name),
            key=lambda each: each.source.topic != clocks[name],
        )
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


def with_speed_of_angle(table: WheelTable) -> WheelTable:
    """Give wheels their speed by the change of their angle, as of encoders, where no wheel's speed was recorded."""
    angle = table.get("wheel_angle_rad")
    if angle is None or table.observed("wheel_speed_rad_s").size:
        return table
    speed = np.full(len(table), np.nan)
    for name in [None] if table.wheel is None else sorted(set(table.wheel)):
        rows = np.flatnonzero(np.isfinite(angle) & (True if name is None else table.wheel == name))
        time_s = table["time_s"][rows]
        if len(rows) < 3:
            continue
        turned, half_s = np.unwrap(angle[rows]), max(_HALF_S, 1.5 * float(np.median(np.diff(time_s))))
        ends = [np.clip(time_s + sign * half_s, time_s[0], time_s[-1]) for sign in (-1.0, 1.0)]
        before, after = (np.interp(each, time_s, turned) for each in ends)
        speed[rows] = (after - before) / (ends[1] - ends[0])
    return table.adding({"wheel_speed_rad_s": speed})


def with_pitch_and_roll(
    table: WheelTable, time_s: np.ndarray, pitch_rad: np.ndarray, roll_rad: np.ndarray, max_gap_s: float
) -> WheelTable:
    """Give rows the attitude that was observed at times (m,) [s], where they have none of their own."""
    added = {
        name: interpolate(time_s, values, table["time_s"], max_gap_s)
        for name, values in (("pitch_rad", pitch_rad), ("roll_rad", roll_rad))
        if name not in table
    }
    return table.adding(added)


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
    clock, _ = own[0].channels(origin_ns)
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


def follows_the_wheels(table: WheelTable, vehicle: Vehicle | None) -> str:
    """Say how a travel speed follows the wheels' own, as one that is made from them does; empty where it does not.

    Slip from such a speed is zero whatever the ground. An independent speed has noise of its own, and keeps to no
    multiple of the mean speed of the rims within `_EXACTLY`, as it is or as a filter passes it on: late by some
    samples, or smoothed with a lag of first order; nor to one near to 1 in its means over a second within `_NEARLY`.

    Parameters
    ----------
    table
        Merged channels.
    vehicle
        The wheels' radii; any one radius where None.
    """
    rim, travel = table.get("wheel_speed_rad_s"), table.get("travel_speed_m_s")
    if rim is None or travel is None:
        return ""
    radius = {wheel.name: wheel.radius_m for wheel in vehicle.wheels} if vehicle else {}
    names = [None] if table.wheel is None else sorted(set(table.wheel))
    parts = [np.ones(len(table), bool) if name is None else table.wheel == name for name in names]
    usual = next(iter(radius.values()), 1.0)
    clock = table["time_s"][parts[0]]
    rims = [
        np.interp(clock, table["time_s"][part], rim[part] * radius.get(str(name), usual))
        for name, part in zip(names, parts, strict=True)
    ]
    mean, travel = np.mean(rims, axis=0), travel[parts[0]]
    moving = np.isfinite(mean) & np.isfinite(travel) & (np.abs(mean) > 0.2 * np.nanmax(np.abs(mean), initial=0.0))
    if moving.sum() < _FEWEST:
        return ""
    factor = float(np.median(travel[moving] / mean[moving]))
    if abs(factor) < 1e-6:
        return ""
    ratios = [travel[moving] / late[moving] for late in _filtered(mean)]
    apart = min(float(np.quantile(np.abs(each / np.median(each) - 1.0), 0.8)) for each in ratios)
    width = max(round(1.0 / max(float(np.median(np.diff(clock))), 1e-6)), 1)
    means = [np.convolve(each[moving], np.ones(width) / width, mode="valid") for each in (travel, mean)]
    nearly = math.inf
    if len(means[0]) and radius and abs(factor - 1.0) < _CALIBRATED:
        nearly = float(np.quantile(np.abs(means[0] / (factor * means[1]) - 1.0), 0.8))
    if apart > _EXACTLY and nearly > _NEARLY:
        return ""
    what = "the mean speed of the rims" if radius else "the wheels' mean rate of turning"
    return f"within {100.0 * min(apart, nearly):.2g} % it is {factor:.4g} times {what}"


def _filtered(speed: np.ndarray) -> Iterator[np.ndarray]:
    """Give a speed (n,) as filters of the first order and delays pass it on, as it is first."""
    there = np.flatnonzero(np.isfinite(speed))
    steady = np.interp(np.arange(len(speed)), there, speed[there])
    for kept in _KEPT:
        smooth = lfilter([1.0 - kept], [1.0, -kept], steady, zi=[kept * steady[0]])[0]
        for late in range(_MOST_LATE + 1):
            passed = np.concatenate([np.full(late, smooth[0]), smooth[: len(smooth) - late]])
            yield np.where(np.isfinite(speed), passed, np.nan)
