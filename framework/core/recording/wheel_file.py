"""Wheel files: the wheel's channels, one row a sample (CONTRACTS.md, "A recording")."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd

from ..errors import InputError, collected, raise_all
from ..files import whole
from ..vehicle import Vehicle, Wheel
from .column_map import ColumnMap, load_column_map
from .sheet import Sheet, open_sheet
from .tables import Table
from .to_si import check_slip, rows_as_runs, to_si
from .types import TEXT_COLUMNS, WHEEL_COLUMNS, WheelTable
from .unused_columns import OF_JOINTS, are_groups, doubts, not_used
from .wheel_columns import OWN, TORQUE_OVER_RADIUS, Column, assign, is_known
from .wheel_labels import is_of_a_wheel, wheels_in
from .wheel_names import of_a_joint, wheel_called

STANDSTILL_M_S = 1e-3
"""Below this, both the rim's speed r omega and the travel speed V count as zero and slip is not defined [m/s]."""

_ABSURD = 1e12
"""Size that no channel has: what is beyond stands for a missing value, or overflows where it is squared [SI]."""

_MOST_LISTED = 30
"""Columns that an error names."""


def read_wheel_file(path: str | Path, columns: str | Path | ColumnMap | None = None) -> WheelTable:
    """Read a wheel file and check it; what was converted or assumed is a warning (`UserWarning`).

    A wheel file has the columns of the contract, or it is a laboratory's table: `docs/recording.md` says what is
    recognised of names, units and layouts. Columns beyond are kept where they are numbers, though nothing reads them,
    which `read_wheel` says, and left out where they are text. An empty cell is a value that was not observed (NaN); a
    channel without a single value is left out.

    Parameters
    ----------
    path
        The file: text (``.csv``, ``.tsv``, ``.txt``, gzip allowed), ``.parquet``; ``.xlsx`` with the extra ``excel``.
    columns
        A column map, or its TOML file: which column is which channel, where names do not say it.

    Returns
    -------
    WheelTable
        Channels in SI units, each (n,).

    Raises
    ------
    InputError
        The file is missing, empty or no table; a column is misspelt, stands twice, has an unknown unit, or is neither
        number nor empty; a value is infinite or beyond 1e12, slip lies outside [-1, 1] or a pass is below 1; time runs
        backwards within a wheel and run; there is neither time nor run. `InputErrors` where there are several faults.
    """
    read = read_wheel(path, columns)
    for text in read.notes:
        warnings.warn(text, stacklevel=2)
    return read.table


class WheelFile(NamedTuple):
    """A wheel table, what it lacks, and what was converted or assumed in reading it, in words."""

    table: WheelTable
    problems: tuple[str, ...]
    notes: tuple[str, ...]


class OpenedTable(NamedTuple):
    """A wheel table whose header was read: its columns by channel, the column map, columns that the map has for other
    wheels, and what is wrong.
    """

    sheet: Sheet
    found: dict[str, Column]
    mapped: ColumnMap
    elsewhere: frozenset[str]
    faults: list[InputError]


def open_wheel(path: str | Path, columns: str | Path | ColumnMap | None = None) -> OpenedTable:
    """Read the header of a wheel table, and say which column is which channel.

    Raises
    ------
    InputError
        The file is missing, empty or no table, or the column map is at fault.
    """
    path = Path(path)
    map_source = None if columns is None or isinstance(columns, ColumnMap) else Path(columns)
    mapped = load_column_map(map_source) if map_source is not None else columns or ColumnMap()
    assert isinstance(mapped, ColumnMap)
    return _open(path, mapped, map_source)


def _open(path: Path, mapped: ColumnMap, map_source: Path | None) -> OpenedTable:
    named, faults = mapped.named, list[InputError]()
    sheet = open_sheet(
        path, lambda cell: cell in named or is_known(cell) or is_of_a_wheel(cell), own=OWN | named, sheet=mapped.sheet
    )
    mapped = _with_wheels(mapped, sheet, faults)
    return _assigned(sheet, mapped, map_source, mapped, faults)


def _assigned(
    sheet: Sheet, mapped: ColumnMap, map_source: Path | None, whole_map: ColumnMap,
    faults: list[InputError], wheel: str = "",
) -> OpenedTable:  # fmt: skip
    """Say which columns are the channels of a map; those of other wheels in the whole map are none."""
    elsewhere = whole_map.named - {entry.column for entry in mapped.columns.values()}
    ours = {name: unit for name, unit in zip(sheet.names, sheet.units, strict=True) if name not in elsewhere}
    found = assign([*ours], [*ours.values()], mapped, sheet.source, map_source, faults)
    shared = {entry.column for entry in whole_map.columns.values()} if wheel else set()
    own = {column.name for column in found.values() if column.name in mapped.named - shared}
    found = {channel: replace(c, wheel=wheel if c.name in own else "") for channel, c in found.items()}
    return OpenedTable(sheet, found, mapped, elsewhere, faults)


def _with_wheels(mapped: ColumnMap, sheet: Sheet, faults: list[InputError]) -> ColumnMap:
    """Add to a map the columns that are of a wheel by their names."""
    by_name = wheels_in(sheet.names, sheet.units, mapped.named)
    for wheel, own in by_name.items():
        for channel, columns in own.items():
            if len(columns) > 1:
                all_names = ", ".join(each.column for each in columns)
                expected = f"one column of it: {channel} = {{ column = ... }} under [wheels.{wheel}] in a column map"
                problem = f"{len(columns)} columns mean {channel} of {wheel}: {all_names}"
                faults.append(InputError(sheet.source, problem, expected=expected))
    wheels = {wheel: {channel: columns[0] for channel, columns in own.items()} for wheel, own in by_name.items()}
    wheels = {name: {**wheels.get(name, {}), **mapped.wheels.get(name, {})} for name in (*wheels, *mapped.wheels)}
    return mapped.model_copy(update={"wheels": wheels})


def read_wheel(path: str | Path, columns: str | Path | ColumnMap | None = None) -> WheelFile:
    """Read a wheel file as `read_wheel_file` does, and say what was made of it instead of warning."""
    path, opened = Path(path), open_wheel(path, columns)
    sheet, mapped = opened.sheet, opened.mapped
    if not mapped.wheels:
        return _read(path, opened)
    from .wide_table import merged  # which reads wheel files

    source = None if columns is None or isinstance(columns, ColumnMap) else Path(columns)
    raise_all(path, opened.faults)
    parts, faults = dict[str, WheelFile](), list[InputError]()
    for name in mapped.wheels:
        own = replace(sheet, notes=[*sheet.notes])
        with collected(faults):
            parts[name] = _read(path, _assigned(own, mapped.of_wheel(name), source, mapped, [], name))
    raise_all(path, faults)
    return merged(parts, mapped, path)


def _read(path: Path, opened: OpenedTable) -> WheelFile:
    """Read a table of which the header was read."""
    sheet, found, mapped, elsewhere, faults = opened
    by_name = {column.name: column for column in found.values()}
    for name in sheet.twice:
        if name in by_name or all(column.source == "own" for column in found.values()):
            place = f"row {sheet.header}"
            faults.append(InputError(path, f"column {name} stands twice", expected="each column once", place=place))
    text = frozenset(column.name for column in found.values() if column.channel in TEXT_COLUMNS)
    clock = frozenset(column.name for column in found.values() if column.channel == "time_s")
    table, percent, dated = sheet.read(
        numbers=frozenset(by_name) - text, text=text, clocks=clock, decimal=mapped.decimal, faults=faults
    )
    soils = found.get("soil")
    if soils is not None and soils.source != "map" and not are_groups(table.text[soils.name]):
        found = {channel: column for channel, column in found.items() if channel != "soil"}
        del by_name[soils.name]
    channels, converted = to_si(table, found, percent, dated, faults)
    others = {name: values for name, values in table.numbers.items() if name not in by_name and name not in elsewhere}
    wheel, run, soil = (_names(table, found.get(name), faults) for name in TEXT_COLUMNS)
    if "time_s" not in found and "run" not in found:
        run, said = rows_as_runs(table, found, sheet.names)
        converted += said
        faults += [] if run is not None else [_no_clock(path, sheet.names)]
    problems = list(table.problems)
    columns_read: dict[str, np.ndarray] = {}
    for name, values in {**channels, **others}.items():
        with collected(faults):
            where = found[name].name if name in found else name
            _check_values(table, name, where, values)
            if name == "slip" and name in found:
                check_slip(table, found[name], values)
        if np.isnan(values).all() and name != "time_s":
            where = found[name].name if name in found else name
            problems.append(f"{path.name}, column {where}: no value in any row, left out")
        else:
            columns_read[name] = np.clip(values, -1.0, 1.0) if name == "slip" else values
    if "time_s" in found and "time_s" in channels:
        with collected(faults):
            _check_time(table, found["time_s"].name, channels["time_s"], wheel, run)
    if not set(columns_read) - {"time_s"} and not faults:
        faults.append(InputError(path, "no wheel channel has a value", expected="columns such as load_N and slip"))
    again = {f"{name} (2)" for name in sheet.twice}  # which is a fault of its own
    raise_all(path, faults, doubts(table, found, percent | dated, {*by_name, *elsewhere, *again}))
    layout = [f"{path.name}: {', '.join(sheet.notes)}"] if sheet.notes else []
    given = dict(zip(sheet.names, sheet.units, strict=True))
    problems += not_used(table, columns_read, {*by_name, *elsewhere}, given, grouped=soil is not None)
    ordered = {name: columns_read[name] for name in _in_order(sheet.names, by_name) if name in columns_read}
    column_names = {channel: column.name for channel, column in found.items()}
    table_read = WheelTable(ordered, wheel, run, path, soil, column_names)
    if "radius_m" in table_read:
        table_read = _with_torque(table_read, table_read["radius_m"])
    return WheelFile(table_read, tuple(problems), (*layout, *converted))


def _in_order(names: Sequence[str], by_name: Mapping[str, Column]) -> list[str]:
    """Channels in the order of the table's columns."""
    return [*(by_name[name].channel if name in by_name else name for name in names), TORQUE_OVER_RADIUS]


def _no_clock(path: Path, names: Sequence[str]) -> InputError:
    more = f" and {len(names) - _MOST_LISTED} more" if len(names) > _MOST_LISTED else ""
    problem = f"neither column time_s nor column run; there are {', '.join(names[:_MOST_LISTED])}{more}"
    return InputError(path, problem, expected="time_s, or run in a file of steady-state trials")


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
    if table.soil is not None:
        columns["soil"] = table.soil
    frame = pd.DataFrame({**columns, **table.columns})
    if not path.name.endswith((".csv", ".csv.gz", ".parquet")):
        raise InputError(path, f"ending {path.suffix!r}", expected=".csv, .csv.gz or .parquet")
    with whole(path) as part:
        if path.suffix == ".parquet":
            frame.to_parquet(part, index=False)
        else:
            frame.to_csv(part, index=False, lineterminator="\n")


def derive(table: WheelTable, wheel: Wheel) -> WheelTable:
    """Fill in what can be derived: slip from the speeds of rim and travel, where it was not recorded; torque from its
    coefficient T/(W r).

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
    return _derived(table, np.full(len(table), wheel.radius_m))


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
    table = _named_as(table, vehicle)
    known = "one of the vehicle's wheels, " + ", ".join(radius)
    if table.wheel is None:
        joints = f"; {OF_JOINTS.format(table.source)}" if any(map(of_a_joint, table.columns)) else ""
        raise InputError(table.source, "no column wheel", expected=known + joints)
    names, rows, inverse = np.unique(table.wheel.astype(str), return_index=True, return_inverse=True)
    for name, row in zip(names, rows, strict=True):
        if name not in radius:
            raise InputError(table.source, repr(str(name)), expected=known, place=f"sample {row + 1}, column wheel")
    return _derived(table, np.array([radius[name] for name in names])[inverse])


def _named_as(table: WheelTable, vehicle: Vehicle) -> WheelTable:
    """Give rows of wheels that are called otherwise than the vehicle's (FL, front_left) the vehicle's names."""
    known = {wheel.name for wheel in vehicle.wheels}
    names_of_rows = [] if table.wheel is None else list(map(str, table.wheel))
    names = dict.fromkeys(names_of_rows)
    called = {name: name if name in known else wheel_called(name, vehicle.wheels) or name for name in names}
    if len(set(called.values())) < len(called) or all(name == new for name, new in called.items()):
        return table
    return replace(table, wheel=np.array([called[name] for name in names_of_rows], dtype=object))


def _with_torque(table: WheelTable, radius_m: np.ndarray) -> WheelTable:
    force = table.get(TORQUE_OVER_RADIUS)
    if force is None:
        return table
    columns = {name: values for name, values in table.columns.items() if name != TORQUE_OVER_RADIUS}
    return table.with_columns({**columns, "torque_Nm": force * radius_m})


def _derived(table: WheelTable, radius_m: np.ndarray) -> WheelTable:
    table = _with_torque(table, radius_m)
    rim, travel = table.get("wheel_speed_rad_s"), table.get("travel_speed_m_s")
    if rim is None or travel is None:
        return table
    recorded = table.get("slip")
    slip = slip_from_speeds(rim * radius_m, travel)
    if recorded is not None:
        slip = np.where(np.isnan(recorded), slip, recorded)
    if np.isnan(slip).all():
        return table
    return table.adding({"slip": slip})


def slip_from_speeds(rim_m_s: np.ndarray, travel_m_s: np.ndarray) -> np.ndarray:
    """Give slip [-], (n,), from the speed of the rim r omega and the speed of travel V, each (n,) [m/s]."""
    forwards = np.where(np.abs(travel_m_s) > STANDSTILL_M_S, np.sign(travel_m_s), np.sign(rim_m_s))
    rim, travel = rim_m_s * forwards, travel_m_s * forwards
    faster = np.maximum(rim, travel)
    with np.errstate(divide="ignore", invalid="ignore"):
        slip = np.where(rim >= travel, 1.0 - travel / rim, rim / travel - 1.0)
    defined = (faster > STANDSTILL_M_S) & (rim > -STANDSTILL_M_S) & (travel > -STANDSTILL_M_S)
    return np.where(defined, np.clip(slip, -1.0, 1.0), np.nan)


def _check_values(table: Table, name: str, column: str, values: np.ndarray) -> None:
    """Refuse values (n,) that a channel cannot have."""
    missing = np.isinf(values) if name != "time_s" else ~np.isfinite(values)
    table.refuse(
        missing, column, lambda row: "no value" if np.isnan(values[row]) else str(values[row]), "a finite number"
    )
    if name in WHEEL_COLUMNS and name != "time_s":
        expected = f"a number between {-_ABSURD:g} and {_ABSURD:g}, SI"
        table.refuse(np.abs(values) > _ABSURD, column, lambda row: f"{values[row]:g}", expected)
    if name == "pass":
        expected = "1 on fresh ground, 2 in the first wheel's rut, and so on"
        table.refuse(values < 1.0, column, lambda row: f"{values[row]:g}", expected)


def _names(table: Table, column: Column | None, faults: list[InputError]) -> np.ndarray | None:
    names = None if column is None else table.text.get(column.name)
    if column is not None and names is not None:
        names = _filled_down(names) if column.channel == "soil" else names
        with collected(faults):
            table.refuse(names == "", column.name, lambda row: "an empty cell", f"the name of the {column.channel}")
    return names


def _filled_down(names: np.ndarray) -> np.ndarray:
    """Give empty cells (n,) the name above in a column that is filled in each block's first row only."""
    filled = np.flatnonzero(names != "")
    if not len(filled) or filled[0] or 2 * len(filled) > len(names):
        return names
    return names[filled][np.searchsorted(filled, np.arange(len(names)), side="right") - 1]


def _check_time(table: Table, column: str, time: np.ndarray, wheel: np.ndarray | None, run: np.ndarray | None) -> None:
    """Refuse time that runs backwards within one wheel of one run."""
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
        column,
        lambda row: (
            f"time runs backwards, {time[before[row]]:.9g} s in row {table.row_number(before[row])}, "
            f"then {time[row]:.9g} s"
        ),
        "time that does not decrease",
    )
