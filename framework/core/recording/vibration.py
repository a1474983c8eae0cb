"""Vibration files: an inertial sensor at the vehicle's frame hears the ground through the structure.

A vibration file is a table with `time` or `time_s` and numeric columns; the wheel drives' current and speed may lie in
a second file of the same clock, as in the BorealTC runs (LaRocque et al. 2024, "Proprioception Is All You Need").
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from fractions import Fraction
from pathlib import Path

import numpy as np
from scipy.signal import resample_poly

from ..errors import InputError
from .clock import interpolate
from .tables import Table, read_table
from .types import VibrationRun, WheelTable

SAMPLE_RATE_HZ = 100.0
"""The clock that every vibration run is brought onto [Hz]."""

MAX_RUN_S = 24 * 3600.0
"""No run is longer than this: a stray time stamp would ask for memory without end [s]."""

G_UNIT = 0.1
"""A mean acceleration within this of 1 is gravity in g [-]: no body to drive on has 1 m/s^2."""

_ACCELERATION = re.compile(r"a(cc(el(eration)?)?)?[_.]?[xyz]", re.IGNORECASE)
_GAP_SAMPLES = 5.0
_WHEEL_GAP_S = 0.5
_OF_WHEELS = {"current_A": "current", "wheel_speed_rad_s": "speed"}
_TIME = ("time_s", "time")


def read_vibration_run(imu_file: str | Path, wheel_file: str | Path | None = None) -> VibrationRun:
    """Read a vibration file, and the wheel drives' file of the same run where there is one.

    Parameters
    ----------
    imu_file
        CSV (gzip allowed) or Parquet with `time` or `time_s` [s] and at least one column of numbers.
    wheel_file
        Likewise, for the wheel drives.

    Returns
    -------
    VibrationRun
        On a uniform clock of `SAMPLE_RATE_HZ`; faster recordings are low-passed before they are thinned out.

    Raises
    ------
    InputError
        A file is missing or no table, has no time, time that runs backwards or a value that is no finite number, or
        fewer than two samples; the two files do not overlap in time.
    """
    table, time, names = _read(Path(imu_file))
    if time[-1] - time[0] > MAX_RUN_S:
        raise InputError(table.source, f"time spans {time[-1] - time[0]:g} s", expected=f"no more than {MAX_RUN_S:g} s")
    problems = list(table.problems)
    period = float(np.median(np.diff(time)))
    rate = 1.0 / period
    count = int(np.floor((time[-1] - time[0]) * SAMPLE_RATE_HZ + 1e-6)) + 1
    clock = time[0] + np.arange(count) / SAMPLE_RATE_HZ
    if rate < 0.9 * SAMPLE_RATE_HZ:
        problems.append(f"{table.source.name}: recorded at {rate:.3g} Hz, nothing above {rate / 2:.3g} Hz is in it")
    gap = _GAP_SAMPLES * period
    channels = np.column_stack([on_clock(time, table.numbers[name], clock, rate, gap) for name in names])
    lost = float(np.isnan(channels).any(axis=1).mean())
    if lost:
        problems.append(f"{table.source.name}: {100 * lost:.2g} % of the time without a value")
    problems += in_g(names, channels, table.source.name)
    wheel_names: tuple[str, ...] = ()
    wheel = np.empty((count, 0))
    if wheel_file is not None:
        wheel_names, wheel, found = _read_wheel(Path(wheel_file), clock)
        problems += found
    return VibrationRun(clock, names, channels, wheel_names, wheel, SAMPLE_RATE_HZ, table.source, tuple(problems))


def _read(path: Path) -> tuple[Table, np.ndarray, tuple[str, ...]]:
    """Read a table with a clock; give it, its time (m,) and the names of its channels."""
    table = read_table(path, numbers=frozenset(_TIME))
    key = next((name for name in _TIME if name in table.numbers), None)
    if key is None:
        raise InputError(
            path, "no column of time; there are " + ", ".join((*table.numbers, *table.text)), expected="time or time_s"
        )
    time = table.numbers[key]
    names = tuple(name for name in table.numbers if name not in _TIME)
    if not names:
        raise InputError(path, "no column of numbers besides time", expected="channels such as wx, wy, wz, ax, ay, az")
    if len(time) < 2:
        raise InputError(path, f"{len(time)} sample", expected="at least two")
    table.check_time(key, increasing=True)
    for name in names:
        table.check_finite(name, missing=True)
    return table, time, names


def on_clock(time: np.ndarray, values: np.ndarray, clock: np.ndarray, rate: float, gap: float) -> np.ndarray:
    """Bring one channel onto the clock (n,), low-passed where it was sampled faster than the clock runs."""
    if rate <= 1.1 * SAMPLE_RATE_HZ:
        return interpolate(time, values, clock, gap)
    ratio = Fraction(SAMPLE_RATE_HZ / rate).limit_denominator(64)
    fast_rate = SAMPLE_RATE_HZ / float(ratio)
    fast_clock = time[0] + np.arange(int(np.floor((time[-1] - time[0]) * fast_rate + 1e-6)) + 1) / fast_rate
    fast = interpolate(time, values, fast_clock, gap)
    missing = np.isnan(fast)
    if missing.all():
        return np.full(len(clock), np.nan)
    level = float(fast[~missing].mean())  # gravity is a large constant: filter what is left
    thin = resample_poly(np.where(missing, 0.0, fast - level), ratio.numerator, ratio.denominator) + level
    thin_clock = time[0] + np.arange(len(thin)) / SAMPLE_RATE_HZ
    answer = interpolate(thin_clock, thin, clock, 2.5 / SAMPLE_RATE_HZ)
    return np.where(np.isnan(interpolate(time, values, clock, gap)), np.nan, answer)


def in_g(names: Sequence[str], channels: np.ndarray, source: str) -> list[str]:
    """Say where the accelerations among channels (n, c) show gravity as 1: they are in g, and models expect m/s^2."""
    axes = [index for index, name in enumerate(names) if _ACCELERATION.fullmatch(name)]
    seen = channels[:, axes][np.isfinite(channels[:, axes]).all(axis=1)]
    if len(axes) != 3 or not len(seen) or abs(float(np.linalg.norm(seen.mean(axis=0))) - 1.0) > G_UNIT:
        return []
    axis = ", ".join(names[index] for index in axes)
    return [f"{source}: {axis} average 1.0 in size, as gravity does in g; m/s^2 is expected: multiply by 9.80665"]


def of_wheels(wheel: WheelTable | None, clock: np.ndarray) -> tuple[tuple[str, ...], np.ndarray]:
    """Give current and speed of each wheel of a table, ``current_NAME`` and ``speed_NAME``: names, and (n, w)."""
    found: dict[str, np.ndarray] = {}
    for column, short in _OF_WHEELS.items():
        if wheel is None or column not in wheel or "time_s" not in wheel:
            continue
        for name in [None] if wheel.wheel is None else sorted(set(wheel.wheel.tolist())):
            own = wheel if name is None else wheel.select(wheel.wheel == name)
            values = interpolate(own["time_s"], own[column], clock, _WHEEL_GAP_S)
            if np.isfinite(values).any():
                found[short if name is None else f"{short}_{name}"] = values
    return tuple(found), np.column_stack([*found.values()]) if found else np.empty((len(clock), 0))


def _read_wheel(path: Path, clock: np.ndarray) -> tuple[tuple[str, ...], np.ndarray, list[str]]:
    """Read the wheel drives' file onto the clock: names, (n, w), and what is amiss."""
    table, time, names = _read(path)
    if time[0] > clock[-1] or time[-1] < clock[0]:
        raise InputError(
            path,
            f"time from {time[0]:g} s to {time[-1]:g} s",
            expected=f"the clock of the vibration file, {clock[0]:g} s to {clock[-1]:g} s",
        )
    gap = _GAP_SAMPLES * float(np.median(np.diff(time)))
    wheel = np.column_stack([interpolate(time, table.numbers[name], clock, gap) for name in names])
    problems = list(table.problems)
    problems += _zero_speeds(table, names)
    beyond = float(np.isnan(wheel).any(axis=1).mean())
    if beyond > 0.01:
        problems.append(f"{path.name}: {100 * beyond:.2g} % of the time without a value")
    return names, wheel, problems


def _zero_speeds(table: Table, names: tuple[str, ...]) -> list[str]:
    """Say where the wheels' speed, or that of the vehicle between them, is zero throughout."""
    speeds = {
        name: np.nan_to_num(table.numbers[name])
        for name in names
        if name.casefold().startswith(("vel", "speed", "wheel_speed"))
    }
    where = table.source.name
    problems = [
        f"{where}, column {name}: zero in every row; the wheel speed was not recorded"
        for name, values in speeds.items()
        if not values.any()
    ]
    if len(speeds) == 2 and not problems:
        (left, one), (right, other) = speeds.items()
        if not (one + other).any():
            problems.append(
                f"{where}: {left} and {right} are opposite in every row: the mean wheel speed is zero, as in a turn on "
                "the spot"
            )
    return problems
