"""The line of a column map or a topic map that says of a channel what its recording does not."""

from __future__ import annotations

from .sheet import ENDINGS
from .types import WheelTable
from .wheel_columns import map_line


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
    if name := table.column_names.get(channel):
        return f"{map_line(channel, name, entry)} under [columns] in a column map (--columns)"
    if table.source.name.lower().endswith(ENDINGS):
        return f'{channel} = {{ column = "...", {entry} }} under each [wheels.NAME] in a column map (--columns)'
    return f'{channel} = {{ field = "...", {entry} }} in the fields of its [[wheel]] in a topic map (--topics)'
