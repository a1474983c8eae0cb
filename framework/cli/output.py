"""How reading commands print what they found: ``--format table|json|csv|geojson``."""

from __future__ import annotations

import csv
import json
import sys
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from ..core.errors import InputError

if TYPE_CHECKING:
    from rich.console import Console

FORMATS = ("table", "json", "csv", "geojson")
"""What ``--format`` takes."""


def check_format(name: str, allowed: Sequence[str] = FORMATS) -> str:
    """Give the format back; raises `InputError` where there is no such format."""
    if name not in allowed:
        raise InputError("--format", f"{name!r}", expected=" or ".join(allowed))
    return name


def print_json(page: Any) -> None:
    """Print JSON on one page; NaN is a fault of the caller (`ValueError`), for JSON knows none."""
    print(json.dumps(page, ensure_ascii=False, allow_nan=False, indent=1))


def print_csv(rows: Sequence[dict[str, Any]], columns: Sequence[str] | None = None) -> None:
    """Print rows as CSV under a header, cells empty where a row has no value.

    Columns are those given, and else those of the rows in the order in which they first appear.
    """
    if columns is None:
        columns = list(dict.fromkeys(name for row in rows for name in row))
    writer = csv.DictWriter(sys.stdout, columns, restval="", lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)


def console_of_results(width: int) -> Console:
    """Give the console for results; `width` columns wide where nobody is watching, so that no line is broken there."""
    from rich.console import Console

    class Results(Console):
        def on_broken_pipe(self) -> None:
            """Leave it to the command line (`main`) what is done where the reader is gone."""
            raise

    console = Results(highlight=False)
    return console if console.is_terminal else Results(highlight=False, width=width)


def print_table(rows: Sequence[dict[str, str]], empty: str) -> None:
    """Print rows of text under their headings, or the line `empty` where there is none."""
    from rich.table import Table
    from rich.text import Text

    console = console_of_results(400)
    if not rows:
        console.print(Text(empty))
        return
    table = Table(box=None, pad_edge=False, header_style="bold")
    for name in rows[0]:
        table.add_column(Text(name), overflow="fold")
    for row in rows:
        table.add_row(*(Text(cell) for cell in row.values()))
    console.print(table)
