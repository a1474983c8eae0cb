"""The line of a column map or a topic map that says of a channel what its recording does not."""

from __future__ import annotations

from .sheet import ENDINGS
from .types import WHEEL_COLUMNS, WheelTable
from .wheel_columns import ALSO_READ, map_line

TURNED = "scale = -1.0"
"""Turns the sign of a channel."""


def mend(table: WheelTable, channel: str, entry: str) -> str:
    """Give the line to write, and where.

    Parameters
    ----------
    table
        The table that the channel is of.
    channel
        Its column in a wheel file.
    entry
        What is to be said of it, as in TOML: ``scale = -1.0``.
    """
    if table.column_names.get(channel) == "":
        return f'{channel} = {{ column = "...", {entry} }} under each [wheels.NAME] in a column map (--columns)'
    if channel in table.column_names or table.source.name.lower().endswith(ENDINGS):
        name = table.column_names.get(channel, channel)
        return f"{map_line(channel, name, entry)} under [columns] in a column map (--columns)"
    return f'{channel} = {{ field = "...", {entry} }} in the fields of its [[wheel]] in a topic map (--topics)'


def missing(table: WheelTable, channel: str) -> str:
    """Give the line of a column map that names a channel's column, where a table has columns that nothing reads;
    ``""`` where it has none.
    """
    known = {*WHEEL_COLUMNS, *ALSO_READ, *table.column_names}
    unused = [name for name in table.columns if name not in known and "_sd" not in name]
    if not unused:
        return ""
    line = map_line(channel, unused[0], 'unit = "..."')
    which = f"if it is one of {', '.join(unused)}" if len(unused) > 1 else "if that is it"
    return f"{line} under [columns] in a column map (--columns), {which}"
