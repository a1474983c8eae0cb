"""The `index.csv` of a labelled folder, written row by row."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from pathlib import Path

from ..errors import InputError, reading
from ..files import whole, write_csv

_COLUMNS = ("file", "class", "group")


def check_index(folder: Path) -> None:
    """Raise `InputError` where files cannot be added to a labelled folder, for its index would hide others."""
    if folder.exists() and not folder.is_dir():
        raise InputError(folder, "a file", expected="a folder")
    there = [] if not folder.exists() else [each for each in folder.iterdir() if not each.name.startswith(".")]
    if there and not (folder / "index.csv").is_file():
        expected = "an empty folder, or one with an index.csv: without a row there, a file is not trained on"
        raise InputError(folder, f"holds {there[0].name} and no index.csv", expected=expected)


def add_to_index(folder: Path, rows: Sequence[tuple[str, str, str]]) -> None:
    """Add rows of file, class and group to the index of a folder; a file that is there already gets a new row.

    Raises
    ------
    InputError
        The index cannot be read or written, or lacks one of the columns.
    """
    path = folder / "index.csv"
    before: list[dict[str, str]] = []
    columns = list(_COLUMNS)
    if path.exists():
        with reading(path, "an index of labelled files"), path.open(encoding="utf-8-sig", newline="") as file:
            reader = csv.DictReader(file)
            before, columns = list(reader), list(reader.fieldnames or ())
        if missing := [name for name in _COLUMNS if name not in columns]:
            raise InputError(path, f"no column {missing[0]}", expected=", ".join(_COLUMNS))
    added = {file for file, _, _ in rows}
    kept = [row for row in before if row["file"] not in added]
    with whole(path) as part, part.open("w", encoding="utf-8", newline="") as file:
        write_csv([*kept, *(dict(zip(_COLUMNS, row, strict=True)) for row in rows)], columns, file)
