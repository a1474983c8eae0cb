"""What is said of the columns of a table that nothing reads."""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping, Sequence

import numpy as np

from ..errors import InputError
from ..files import toml_string
from . import units
from .column_names import stem_of, written
from .tables import Table
from .to_si import OTHER_UNITS
from .wheel_columns import ALSO_READ, OWN, TORQUE_OVER_RADIUS, Column, hints, is_scatter, map_line
from .wheel_names import of_a_joint

_ANSWERS = ("torque_Nm", "sinkage_m", "drawbar_pull_N")

_MOST_GROUPS = 0.5
"""Most names per row of a column that parts rows into groups; one of more names holds remarks [-]."""

_MOST_NAMED = 6
"""Columns that a note names; the others are counted."""

OF_JOINTS = "columns of wheels' joints need a column map, which `bevameter inspect {} --write` writes"

_NUMBER = re.compile(r"[-+]?\.?\d").match


def not_used(
    table: Table,
    columns: Mapping[str, np.ndarray],
    used: Collection[str],
    given: Mapping[str, str | None],
    *,
    grouped: bool,
) -> list[str]:
    """Say which columns nothing reads, and of what answers there is none: they may be meant for these.

    Parameters
    ----------
    table
        The cells, by the table's names.
    columns
        What was read, by channel, and columns of numbers beyond.
    used
        Names of columns that channels come from.
    given
        The unit of each column by a row of units.
    grouped
        Whether a column names the soil of each row.
    """
    known = {*OWN, *ALSO_READ, *filter(is_scatter, columns)}
    text = {name: cells for name, cells in table.text.items() if name not in {*known, *used} and any(cells)}
    words = [name for name, cells in text.items() if not _mostly_numbers(cells)]
    grouping = [name for name in words if len(set(text[name])) > 1 and are_groups(text[name])]
    left_out = [f"{table.source.name}: columns of text not used: {_listed(words)}"] if words else []
    if grouping and not grouped:
        left_out[0] += f"; where one names the soil: soil = {toml_string(grouping[0])} under [columns] in a column map"
    # "3.2 N" makes a column of text; what was written about a row is no channel.
    others = [name for name in (*columns, *text) if name not in {*known, *words}]
    if not others:
        return left_out
    torque = {"torque_Nm"} if TORQUE_OVER_RADIUS in columns else set[str]()
    missing = [name for name in _ANSWERS if name not in {*columns, *torque}]
    none = f"; there is no {', '.join(missing)}" if missing else ""
    said = [f"{table.source.name}: columns not used: {_listed(others)}{none}{_may_be(missing, others, given)}"]
    said += [f"{table.source.name}: {OF_JOINTS.format(table.source)}"] if any(map(of_a_joint, others)) else []
    near = [f"{table.source.name}, column {name}: not used; expected {text}" for name, text in hints(others).items()]
    return [*said, *near, *left_out]


def _may_be(missing: Sequence[str], names: Sequence[str], given: Mapping[str, str | None]) -> str:
    """Name for each missing channel a column that has its unit, with the line of a column map that makes it the one."""
    lines = []
    for channel in missing:
        for name in names:
            unit = written(name).unit or given.get(name)
            if unit is not None and units.factor(unit, stem_of(channel)[1]) is not None:
                lines.append(f"if {name} is one, {map_line(channel, name, f'unit = {toml_string(unit)}')}")
                break
    return f"; {'; '.join(lines)} under [columns] in a column map" if lines else ""


def doubts(
    table: Table, found: Mapping[str, Column], known: Collection[str], used: Collection[str]
) -> list[InputError]:
    """Name the columns that may be at fault where a table is, each with the line of a column map that mends it.

    Parameters
    ----------
    table
        The cells, by the table's names.
    found
        Which channel is which column.
    known
        Columns whose unit the cells say.
    used
        Names of columns that channels come from.
    """
    answer = []
    for channel, column in found.items():
        if column.source != "own" and column.unit is None and column.name not in known and channel in OTHER_UNITS:
            line = column.line(f'unit = "{OTHER_UNITS[channel]}"')
            place = f"column {column.name}"
            answer.append(InputError(table.source, "no unit, taken to be SI", expected=f"SI, or {line}", place=place))
    for name in table.numbers:
        if name not in {*used, *ALSO_READ, *OWN} and not is_scatter(name):
            line = map_line("CHANNEL", name, 'unit = "..."')
            expected = f"nothing, or {line} under [columns] in a column map (--columns)"
            answer.append(InputError(table.source, "not known by its name", expected=expected, place=f"column {name}"))
    return answer


def _listed(names: Sequence[str]) -> str:
    more = f" and {len(names) - _MOST_NAMED} more" if len(names) > _MOST_NAMED else ""
    return ", ".join(names[:_MOST_NAMED]) + more


def _mostly_numbers(cells: np.ndarray) -> bool:
    """Say whether most cells (n,) of text that are not empty begin with a number."""
    seen = [str(cell) for cell in cells if cell]
    return bool(seen) and sum(_NUMBER(cell) is not None for cell in seen) > len(seen) / 2


def are_groups(names: np.ndarray) -> bool:
    """Say whether names (n,) can be those of soils that rows are on: most recur."""
    return len(set(names)) <= _MOST_GROUPS * len(names)
