"""Channels in SI out of a table's columns: units, signs and per cent, each said where it was not written down."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from ..errors import InputError
from .slip_definitions import FORMULAS, SLIP_TOLERANCE, Definition, to_slip
from .tables import Table
from .types import TEXT_COLUMNS
from .wheel_columns import TORQUE_OVER_RADIUS, Column

_FRACTION, _PERCENT = 1.02, 10.0
"""Slip without a unit: a fraction up to the former, in per cent from the latter on [-]. A driven wheel's slip is at
most 1 by every definition; in between it may be a few per cent, or a ratio whose denominator is the rim's speed."""

_NEAR = 0.05
"""How far below 1 a ratio of speeds may lie by noise [-]."""

_REVERSED, _FEWEST = 0.9, 3
"""Share of the values that are not zero from which on a channel has the opposite sign, and fewest of them [-]."""

_DRIVEN = 0.1
"""From this slip on a wheel is driven [-]."""

_MOST_RUNS = 500
"""Most rows that are taken for steady-state trials without a word about time: the largest published series of one
wheel has 189."""

_PLAUSIBLE = {"sinkage_m": (1.0, "m"), "pitch_rad": (1.6, "rad"), "slip_angle_rad": (1.6, "rad"), "time_s": (1e11, "s")}
"""Size beyond which a median without a unit is in another one than SI: no wheel sinks by 1 m, an angle over 90 deg
is in degrees, and 1e11 s are three thousand years."""


def to_si(
    table: Table,
    found: Mapping[str, Column],
    percent: frozenset[str],
    dated: frozenset[str],
    faults: list[InputError],
) -> tuple[dict[str, np.ndarray], list[str]]:
    """Convert columns to channels.

    Parameters
    ----------
    table
        The cells, by the table's names.
    found
        Which channel is which column.
    percent
        Columns whose cells had per cent signs.
    dated
        Columns of dates or times, which are in seconds now.
    faults
        Values that may mean two things are added to it.

    Returns
    -------
    channels, said
        Each (n,), SI; those of the contract's own columns are untouched. What was read and assumed, in words.
    """
    channels: dict[str, np.ndarray] = {}
    read: list[str] = []
    assumed: list[str] = []
    bare: list[str] = []
    for channel, column in found.items():
        if channel in TEXT_COLUMNS:
            read += [] if column.source == "own" else [f"{channel} = {column.name}"]
            continue
        values = table.numbers.get(column.name)
        if values is None:
            continue
        by_size = column.unit is None and column.name not in percent and column.definition == "slip"
        as_slip = channel == "slip" and by_size and column.source != "own"
        if column.source == "own" and column.name not in percent:
            channels[channel] = values
        elif as_slip:
            channels[channel] = _slip(table, column, values, read, assumed, faults)
        else:
            channels[channel] = column.to_si(values, column.name in percent)
            small = 0.0 < np.nanmax(np.abs(values), initial=0.0) <= 1.0
            if channel == "slip" and column.factor == 0.01 and small:
                assumed.append(
                    f"{column.name} is in per cent, though it never exceeds 1; a fraction is called slip [-]"
                )
            read.append(_said(column, column.name in percent))
            if column.unit is None and column.name not in percent | dated:
                bare += _assumed(table, column, channels[channel], faults)
    _of_load(table, channels, found, faults)
    slip = found.get("slip")
    if slip is not None and slip.source != "own" and "slip" in channels:
        channels["slip"] = to_slip(channels["slip"], slip.definition)
        said = f'slip is {FORMULAS[slip.definition]} (definition = "{slip.definition}")'
        (assumed if slip.definition == "slip" else read).append(said)
    assumed += [f"SI units where none is given: {', '.join(bare)}"] if bare else []
    _turn(channels, found, assumed)
    name = table.source.name
    said = [f"{name}: columns read as {'; '.join(read)}"] if read else []
    return channels, said + [f"{name}: assumed: {text}" for text in assumed]


def rows_as_runs(
    table: Table, found: Mapping[str, Column], names: Sequence[str]
) -> tuple[np.ndarray | None, list[str]]:
    """Take the rows of a laboratory's table without time for steady-state trials; None where they may be a recording.

    Returns
    -------
    run, said
        (n,) of str, the rows' numbers; and that it was assumed. None for a table of the contract's own columns, one of
        more rows than trials are made, and one with a further column that counts up, as a clock does.
    """
    own = all(column.source == "own" for column in found.values())
    by_name = {column.name for column in found.values()}
    clocks = [
        name for name, values in table.numbers.items()
        if name not in by_name and len(values) > _FEWEST and np.all(np.diff(values) > 0.0)
        and not np.all(np.diff(values) == 1.0)
    ]  # fmt: skip
    if own or clocks or not found or len(table) > _MOST_RUNS:
        return None, []
    run = np.array([str(table.row_number(row)) for row in range(len(table))], dtype=object)
    return run, [f"{table.source.name}: assumed: each row is a steady-state trial, for there is neither time nor run"]


def _said(column: Column, percent: bool) -> str:
    text = f"{column.channel} = {column.name}"
    factor = column.factor if not (percent and column.unit is None) else 0.01
    if factor != 1.0:
        inverse = round(1.0 / factor) if 0.0 < abs(factor) < 1.0 else 0
        text += f" / {inverse}" if inverse and factor == 1.0 / inverse else f" * {factor:.6g}"
    if column.per_load:
        text += f" * {column.unit}"
    return text + (f" + {column.offset:g}" if column.offset else "")


def _of_load(
    table: Table, channels: dict[str, np.ndarray], found: Mapping[str, Column], faults: list[InputError]
) -> None:
    """Make forces of coefficients; a torque waits for the wheel's radius (`wheel_file.derive`)."""
    for channel, column in found.items():
        if not column.per_load or channel not in channels:
            continue
        if "load_N" in channels:
            name = TORQUE_OVER_RADIUS if channel == "torque_Nm" else channel
            channels[name] = channels.pop(channel) * np.abs(channels["load_N"])
        else:
            place = f"column {column.name}"
            faults.append(InputError(table.source, "a share of the load", expected="a column load_N", place=place))


def _assumed(table: Table, column: Column, values: np.ndarray, faults: list[InputError]) -> list[str]:
    """Say in which unit a column without one is taken to be, or refuse it where it cannot be."""
    most, unit = _PLAUSIBLE.get(column.channel, (np.inf, ""))
    seen = np.abs(values[np.isfinite(values)])
    middle = float(np.median(seen)) if len(seen) else 0.0
    if middle > most:
        unit_line = column.line(f'unit = "{OTHER_UNITS[column.channel]}"')
        expected = f"its unit in the name, such as {column.name} [{OTHER_UNITS[column.channel]}], or {unit_line}"
        problem = f"no unit, and {middle:.6g} {unit} (median) cannot be"
        faults.append(InputError(table.source, problem, expected=expected, place=f"column {column.name}"))
        return []
    return [f"{column.name} [{_SI.get(column.channel, '-')}]"]


OTHER_UNITS = {
    "sinkage_m": "mm", "pitch_rad": "deg", "slip_angle_rad": "deg", "time_s": "ns", "load_N": "kN", "torque_Nm": "Nmm",
    "drawbar_pull_N": "kN", "wheel_speed_rad_s": "rpm", "travel_speed_m_s": "mm/s", "wheel_angle_rad": "deg",
    "x_m": "mm", "y_m": "mm",
}  # fmt: skip
"""A usual unit of each channel besides SI, for lines of a column map."""

_SI = {
    "time_s": "s", "load_N": "N", "torque_Nm": "N m", "sinkage_m": "m", "drawbar_pull_N": "N",
    "wheel_speed_rad_s": "rad/s", "travel_speed_m_s": "m/s", "wheel_angle_rad": "rad", "pitch_rad": "rad",
    "slip_angle_rad": "rad", "x_m": "m", "y_m": "m", "pass": "-", "slip": "-",
}  # fmt: skip


def _slip(
    table: Table, column: Column, values: np.ndarray, read: list[str], assumed: list[str], faults: list[InputError]
) -> np.ndarray:
    """Take slip without a unit for a fraction or for per cent, by its size; refuse it in between."""
    seen = values[np.isfinite(values)] * column.factor
    largest, most = (float(np.max(each, initial=0.0)) for each in (seen, np.abs(seen)))
    if len(seen) > 2 and most > 1.0 and np.all(np.diff(seen) == 1.0):
        expected = "slip; columns.slip in a column map says which column it is"
        faults.append(InputError(table.source, "counts the rows", expected=expected, place=f"column {column.name}"))
        return np.full(len(values), np.nan)
    if most <= _FRACTION:
        read.append(_said(column, False))
        assumed.append(f"{column.name} is a fraction, not per cent, for no unit is given and it is at most {most:.3g}")
        return column.to_si(values, False)
    if largest >= _PERCENT and most <= 100.0 * _FRACTION:
        read.append(_said(column, True))
        assumed.append(f"{column.name} is in per cent, for no unit is given and it goes up to {largest:.4g}")
        return column.to_si(values, True)
    faults.append(
        InputError(
            table.source, f"no unit, and values up to {largest:.4g} and down to {np.min(seen, initial=0.0):.4g}",
            expected="Slip [%], or Slip [-] in [-1, 1], i = 1 - V/(r omega) when driving"
            + _other_definition(column, seen),
            place=f"column {column.name}",
        )
    )  # fmt: skip
    return np.full(len(values), np.nan)


def check_slip(table: Table, column: Column, values: np.ndarray) -> None:
    """Refuse slip (n,) beyond [-1, 1], and say how it may be defined."""
    outside = np.abs(values) > 1.0 + SLIP_TOLERANCE  # False for NaN
    more = f" and {outside.sum() - 1} more rows" if outside.sum() > 1 else ""
    expected = "slip in [-1, 1]; of one in per cent the column is called Slip [%]"
    if column.definition == "slip":
        expected += _other_definition(column, values)
    table.refuse(outside, column.name, lambda row: f"{values[row]:g}{more}", expected)


def _other_definition(column: Column, seen: np.ndarray) -> str:
    """Suggest a definition for slip beyond 1 (n,), with the line of a column map that states it."""
    name: Definition = "rim_to_travel" if np.nanmin(seen, initial=np.inf) >= 1.0 - _NEAR else "relative_to_travel"
    entries = ([] if column.unit else ['unit = "-"']) + [f'definition = "{name}"']
    return f"; if it is {FORMULAS[name]}: {column.line(*entries)}"


def _turn(channels: dict[str, np.ndarray], found: Mapping[str, Column], assumed: list[str]) -> None:
    """Turn the sign of load, sinkage and torque of a laboratory's table where nearly all values have the other one."""
    slip = channels.get("slip")
    for channel, direction in (
        ("load_N", "positive down"), ("sinkage_m", "positive down"), ("torque_Nm", "positive where it drives"),
    ):  # fmt: skip
        values, column = channels.get(channel), found.get(channel)
        if values is None or column is None or column.source == "own" or column.signed:
            continue
        if channel == "torque_Nm":
            if slip is None:
                continue
            values = values[slip > _DRIVEN]
        values = values[np.isfinite(values) & (values != 0.0)]
        if len(values) >= _FEWEST and float(np.mean(values < 0.0)) >= _REVERSED:
            channels[channel] = -channels[channel]
            share = f"{100.0 * float(np.mean(values < 0.0)):.0f} %"
            assumed.append(f"the sign of {column.name} is turned, {direction}: {share} of it was below 0")
