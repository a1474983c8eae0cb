"""Wheel files: the wheel's channels, one row a sample (CONTRACTS.md, "A recording")."""

from __future__ import annotations

import difflib
import re
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pandas as pd

from ..errors import InputError
from ..files import whole
from ..vehicle import Vehicle, Wheel
from .tables import Table, read_table
from .types import WHEEL_COLUMNS, WheelTable

SLIP_TOLERANCE = 0.02
"""How far beyond [-1, 1] a recorded slip may lie, by the noise of the two speeds it was made of [-]."""

STANDSTILL_M_S = 1e-3
"""Below this, both the rim's speed r omega and the travel speed V count as zero and slip is not defined [m/s]."""

_ABSURD = 1e12
"""Size that no channel has: what is beyond stands for a missing value, or overflows where it is squared [SI]."""

TEXT_COLUMNS = frozenset({"wheel", "run"})
_UNITS = frozenset({
    "n", "kn", "mn", "kgf", "lbf", "newton", "newtons", "nm", "knm", "mnm", "nmm", "m", "mm", "cm", "km", "ft", "in",
    "metre", "metres", "meter", "meters", "s", "ms", "us", "ns", "min", "h", "second", "seconds", "rad", "mrad", "deg",
    "degree", "degrees", "rpm", "rps", "hz", "mps", "kmh", "kph", "g", "kg", "lb", "pct", "percent", "ratio",
})  # fmt: skip


_ALSO_READ = ("radius_m", "width_m", "grouser_height_m", "grouser_count", "yaw_rad", "roll_rad", "current_A")
"""Columns beyond the contract's that something reads: the wheel that a row is of, the vehicle's heading and roll, and
the current of the wheel's motor."""

_ANSWERS = ("torque_Nm", "sinkage_m", "drawbar_pull_N")
_MOST_NAMED = 6
"""Columns that a note names; the others are counted."""

_NUMBER = re.compile(r"[-+]?\.?\d").match


def read_wheel_file(path: str | Path) -> WheelTable:
    """Read a wheel file, ``.csv`` (gzip allowed) or ``.parquet``, and check it.

    Columns beyond those of the contract are kept where they are numbers, though nothing reads them, which
    `read_wheel` says, and left out where they are text. An empty cell
    is a value that was not observed (NaN); a column of the contract without a single value is left out.

    Parameters
    ----------
    path
        The file.

    Returns
    -------
    WheelTable
        Channels in SI units, each (n,).

    Raises
    ------
    InputError
        The file is missing, empty or no table; a column is misspelt, stands twice, or is neither number nor empty; a
        value is infinite or beyond 1e12, slip lies outside [-1, 1] or a pass is below 1; time runs backwards within a
        wheel and run; there is neither `time_s` nor `run`.
    """
    return read_wheel(path)[0]


def read_wheel(path: str | Path) -> tuple[WheelTable, tuple[str, ...]]:
    """Read a wheel file as `read_wheel_file` does; give the table and, in words, what it lacks."""
    table = read_table(Path(path), numbers=frozenset(WHEEL_COLUMNS), text=TEXT_COLUMNS)
    for name in (*table.numbers, *table.text):
        _check_spelling(table.source, name)
    if "time_s" not in table.numbers and "run" not in table.text:
        raise InputError(
            table.source,
            "neither column time_s nor column run; there are " + ", ".join((*table.numbers, *table.text)),
            expected="time_s, or run in a file of steady-state trials",
        )
    problems = list(table.problems)
    columns: dict[str, np.ndarray] = {}
    for name, values in table.numbers.items():
        _check_values(table, name)
        if np.isnan(values).all() and name != "time_s":
            problems.append(f"{table.source.name}, column {name}: no value in any row, left out")
        else:
            columns[name] = np.clip(values, -1.0, 1.0) if name == "slip" else values
    wheel, run = (_names(table, name) for name in ("wheel", "run"))
    _check_time(table, columns.get("time_s"), wheel, run)
    if not set(columns) - {"time_s"}:
        raise InputError(table.source, "no wheel channel has a value", expected="columns such as load_N and slip")
    problems += _not_used(table, columns)
    return WheelTable(columns, wheel, run, table.source), tuple(problems)


def write_wheel_file(table: WheelTable, path: str | Path) -> None:
    """Write a wheel table whole or not at all: CSV (``.csv``, ``.csv.gz``) or Parquet (``.parquet``), by its ending.

    Raises
    ------
    InputError
        The ending is another, or the file cannot be written.
    """
    path = Path(path)
    columns: dict[str, object] = {}
    if table.run is not None:
        columns["run"] = table.run
    if table.wheel is not None:
        columns["wheel"] = table.wheel
    frame = pd.DataFrame({**columns, **table.columns})
    if not path.name.endswith((".csv", ".csv.gz", ".parquet")):
        raise InputError(path, f"ending {path.suffix!r}", expected=".csv, .csv.gz or .parquet")
    with whole(path) as part:
        if path.suffix == ".parquet":
            frame.to_parquet(part, index=False)
        else:
            frame.to_csv(part, index=False, lineterminator="\n")


def derive(table: WheelTable, wheel: Wheel) -> WheelTable:
    """Fill in what can be derived: slip from the speeds of rim and travel, where it was not recorded.

    Slip is i = 1 - V/(r omega) where the wheel drives (r omega >= V) and i = r omega/V - 1 where it brakes (Wong 2010,
    Eq. 4.44 and 4.47; CONTRACTS.md), both for a wheel that rolls forwards; one that rolls backwards is taken as
    rolling forwards in its own direction. A wheel that turns against its travel slips more than wholly, which has no
    value here: it and a wheel at standstill are NaN.

    Parameters
    ----------
    table
        The channels.
    wheel
        Its radius r [m]; grousers do not count.

    Returns
    -------
    WheelTable
        With `slip` where both speeds are there; rows that had a recorded slip keep it.
    """
    return _with_slip(table, np.full(len(table), wheel.radius_m))


def derive_all(table: WheelTable, vehicle: Vehicle) -> WheelTable:
    """Fill in what can be derived, as `derive` does, for the wheels of a vehicle together.

    Raises
    ------
    InputError
        The table names a wheel that the vehicle does not have, or none where the vehicle has several.
    """
    if not vehicle.wheels:
        return table
    first = vehicle.wheels[0]
    # A single wheel without a name is what each of them is like; one with a name is the only one there is.
    for_all = "name" not in first.model_fields_set or table.wheel is None or len(set(table.wheel)) == 1
    if len(vehicle.wheels) == 1 and for_all:
        return derive(table, first)
    radius = {wheel.name: wheel.radius_m for wheel in vehicle.wheels}
    known = "one of the vehicle's wheels, " + ", ".join(radius)
    if table.wheel is None:
        raise InputError(table.source, "no column wheel", expected=known)
    names, rows, inverse = np.unique(table.wheel.astype(str), return_index=True, return_inverse=True)
    for name, row in zip(names, rows, strict=True):
        if name not in radius:
            raise InputError(table.source, repr(str(name)), expected=known, place=f"sample {row + 1}, column wheel")
    return _with_slip(table, np.array([radius[name] for name in names])[inverse])


def _with_slip(table: WheelTable, radius_m: np.ndarray) -> WheelTable:
    rim, travel = table.get("wheel_speed_rad_s"), table.get("travel_speed_m_s")
    if rim is None or travel is None:
        return table
    recorded = table.get("slip")
    slip = slip_from_speeds(rim * radius_m, travel)
    if recorded is not None:
        slip = np.where(np.isnan(recorded), slip, recorded)
    if np.isnan(slip).all():
        return table
    return WheelTable({**table.columns, "slip": slip}, table.wheel, table.run, table.source)


def slip_from_speeds(rim_m_s: np.ndarray, travel_m_s: np.ndarray) -> np.ndarray:
    """Give slip [-], (n,), from the speed of the rim r omega and the speed of travel V, each (n,) [m/s]."""
    forwards = np.where(np.abs(travel_m_s) > STANDSTILL_M_S, np.sign(travel_m_s), np.sign(rim_m_s))
    rim, travel = rim_m_s * forwards, travel_m_s * forwards
    faster = np.maximum(rim, travel)
    with np.errstate(divide="ignore", invalid="ignore"):
        slip = np.where(rim >= travel, 1.0 - travel / rim, rim / travel - 1.0)
    defined = (faster > STANDSTILL_M_S) & (rim > -STANDSTILL_M_S) & (travel > -STANDSTILL_M_S)
    return np.where(defined, np.clip(slip, -1.0, 1.0), np.nan)


def _check_spelling(source: Path, name: str) -> None:
    """Refuse a column that means one of the contract's and is not written so: its unit may be another one."""
    if name in WHEEL_COLUMNS or name in TEXT_COLUMNS:
        return
    right = _meant(name)
    if right is not None:
        raise InputError(source, "no column of a wheel file", expected=right, place=f"column {name}")


def is_wheel_channel(name: str) -> bool:
    """Say whether a column is one of the contract's, or a misspelling of one."""
    return name in WHEEL_COLUMNS or name in TEXT_COLUMNS or _meant(name) is not None


def _meant(name: str) -> str | None:
    """Give the contract's column that a name is a misspelling of, or None for a column of the user's own."""
    small = name.casefold().replace(" ", "_").replace("-", "_").replace("[", "").replace("]", "")
    for right in (*WHEEL_COLUMNS, *TEXT_COLUMNS):
        if small == right.casefold():
            return right
    for right in sorted(WHEEL_COLUMNS, key=len, reverse=True):
        stem, unit = _stem(right)
        for beginning, answer in ((stem, right), (f"{stem}_sd", f"{stem}_sd_{unit}" if unit else f"{stem}_sd")):
            rest = small.removeprefix(beginning).split("_") if small.startswith(beginning) else None
            if name == answer:
                return None
            if small == beginning or (rest and rest[0] == "" and all(part in _UNITS for part in rest[1:])):
                return answer
    # a word more makes a column of the user's own, such as wheel_speed_left_rad_s
    alike = {c.casefold(): c for c in WHEEL_COLUMNS if len(c) > 4 and c.count("_") == small.count("_")}
    close = difflib.get_close_matches(small, alike, n=1, cutoff=0.83)
    return alike[close[0]] if close else None


def _stem(column: str) -> tuple[str, str]:
    """Part a column of the contract into quantity and unit: drawbar_pull, N."""
    for unit in ("rad_s", "m_s", "rad", "Nm", "N", "m", "s"):
        if column.endswith("_" + unit):
            return column.removesuffix("_" + unit), unit
    return column, ""


def _not_used(table: Table, columns: Mapping[str, np.ndarray]) -> list[str]:
    """Say which columns of numbers nothing reads, and of what answers there is none: they may be meant for these."""
    scatter = {f"{stem}_sd_{unit}" if unit else f"{stem}_sd" for stem, unit in map(_stem, WHEEL_COLUMNS)}
    known = {*WHEEL_COLUMNS, *TEXT_COLUMNS, *_ALSO_READ, *scatter}
    # "3.2 N" makes a column of text; what was written about a row is no channel.
    text = [name for name, cells in table.text.items() if name not in known and _mostly_numbers(cells)]
    others = [name for name in columns if name not in known] + text
    if not others:
        return []
    more = f" and {len(others) - _MOST_NAMED} more" if len(others) > _MOST_NAMED else ""
    missing = [name for name in _ANSWERS if name not in columns]
    none = f"; there is no {', '.join(missing)}" if missing else ""
    return [f"{table.source.name}: columns not used: {', '.join(others[:_MOST_NAMED])}{more}{none}"]


def _mostly_numbers(cells: np.ndarray) -> bool:
    """Say whether most cells (n,) of text that are not empty begin with a number."""
    seen = [str(cell) for cell in cells if cell]
    return bool(seen) and sum(_NUMBER(cell) is not None for cell in seen) > len(seen) / 2


def _check_values(table: Table, name: str) -> None:
    table.check_finite(name, missing=name != "time_s")
    values = table.numbers[name]
    if name in WHEEL_COLUMNS and name != "time_s":
        expected = f"a number between {-_ABSURD:g} and {_ABSURD:g}, SI"
        table.refuse(np.abs(values) > _ABSURD, name, lambda row: f"{values[row]:g}", expected)
    if name == "slip":
        outside = np.abs(values) > 1.0 + SLIP_TOLERANCE  # False for NaN
        more = f" and {outside.sum() - 1} more rows" if outside.sum() > 1 else ""
        table.refuse(outside, name, lambda row: f"{values[row]:g}{more}", "slip in [-1, 1]")
    if name == "pass":
        expected = "1 on fresh ground, 2 in the first wheel's rut, and so on"
        table.refuse(values < 1.0, name, lambda row: f"{values[row]:g}", expected)


def _names(table: Table, name: str) -> np.ndarray | None:
    names = table.text.get(name)
    if names is not None:
        table.refuse(names == "", name, lambda row: "an empty cell", f"the name of the {name}")
    return names


def _check_time(table: Table, time: np.ndarray | None, wheel: np.ndarray | None, run: np.ndarray | None) -> None:
    """Refuse time that runs backwards within one wheel of one run."""
    if time is None:
        return
    keys = np.zeros(len(time), dtype=np.intp)
    for names in (wheel, run):
        if names is not None:
            _, inverse = np.unique(names.astype(str), return_inverse=True)
            keys = keys * (int(inverse.max()) + 1) + inverse
    order = np.argsort(keys, kind="stable")
    before = np.full(len(time), -1)
    before[order[1:]] = np.where(np.diff(keys[order]) == 0, order[:-1], -1)
    table.refuse(
        (before >= 0) & (time < time[before]),
        "time_s",
        lambda row: (
            f"time runs backwards, {time[before[row]]:.9g} s in row {before[row] + table.first_row}, "
            f"then {time[row]:.9g} s"
        ),
        "time that does not decrease",
    )
