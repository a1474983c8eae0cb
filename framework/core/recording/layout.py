"""How a table of text is laid out: what parts its columns, and which row is the header.

Laboratories' tables begin with lines about the test, have units in a row of their own, semicolons or tabs between
their columns and lines of remarks; what was made of one is said.
"""

from __future__ import annotations

import io
import re
from collections.abc import Callable, Sequence
from csv import Error as CsvError
from csv import reader as csv_reader
from dataclasses import dataclass

from . import units

BLANKS = " "
"""Delimiter of columns that are parted by runs of blanks."""

_DELIMITERS = {",": "commas", ";": "semicolons", "\t": "tabs", "|": "bars", BLANKS: "blanks"}
_COMMENT = re.compile(r"\s*(?:#+|%+|//+|!+)\s*")
_NUMBER = re.compile(r"\s*[-+−]?(?:\d[\d.,'’\s\u00a0\u202f]*|[.,]\d+)(?:[eE][-+]?\d+)?\s*%?\s*|[-+]?(?:nan|inf)", re.I)
_SEARCHED = 200
"""Lines at the beginning of a file among which its header is looked for."""


@dataclass(frozen=True)
class Layout:
    """How a table is laid out.

    Parameters
    ----------
    delimiter
        What parts the columns; `BLANKS` stands for runs of blanks.
    names
        Names of the columns as they stand in the header; ``""`` where one has none.
    units
        Unit of each column by a row of units; None where there is no such row.
    header
        Number of the header's line in the file, from 1.
    first
        Number of the first line of data, from 1.
    notes
        What is unusual about it, in words.
    """

    delimiter: str
    names: tuple[str, ...]
    units: tuple[str | None, ...] | None
    header: int
    first: int
    notes: tuple[str, ...]


@dataclass(frozen=True)
class _Line:
    text: str
    number: int


def find_layout(text: str, is_known: Callable[[str], bool]) -> Layout | None:
    """Find a table's header: the row in which most names are known, above a row of numbers.

    Parameters
    ----------
    text
        The beginning of the file, its lines ended by line feeds.
    is_known
        Says whether a cell is the name of a column that means something.

    Returns
    -------
    Layout or None
        None where no row is a header.
    """
    lines = _logical_lines(text)
    best: tuple[int, int, str, list[str]] | None = None
    first = lines[0].text.strip().strip('"').lower() if lines else ""
    given = first[4:] or "\t" if first.startswith("sep=") else None
    for index, line in enumerate(lines):
        plain = _COMMENT.sub("", line.text, count=1) if _COMMENT.match(line.text) else line.text
        for delimiter in [given] if given else _DELIMITERS:
            cells = split(plain, delimiter)
            known = sum(map(is_known, cells))
            enough = known > (best[0] if best else 0) and not any(map(is_number, cells))
            width = _width_below(lines, index, delimiter) if enough else None
            if width is not None and (delimiter != BLANKS or width in (0, len(cells))):
                best = known, index, delimiter, cells
    if best is None:
        best = _unknown_header(lines, given)
    return None if best is None else _described(lines, *best[1:])


def upright(text: str, is_known: Callable[[str], bool]) -> str | None:
    """Turn a table whose names stand one below the other, each before its numbers; None where it is no such table.

    Parameters
    ----------
    text
        The whole file, its lines ended by line feeds. A second column may hold units.
    is_known
        As in `find_layout`.
    """
    lines = [line.text for line in _logical_lines(text) if line.text.strip() and not is_comment(line.text)]
    found: list[tuple[int, str, list[list[str]]]] = []
    for delimiter in _DELIMITERS:
        rows = [split(line, delimiter) for line in lines]
        width = len(rows[0]) if rows else 0
        even = len(rows) > 1 and width > 2 and all(len(cells) == width for cells in rows)
        numbers = even and all(not is_number(cells[0]) and all(map(is_number, cells[2:])) for cells in rows)
        if numbers and sum(is_known(cells[0]) for cells in rows) > 1:
            found.append((width, "\t" if delimiter == BLANKS else delimiter, rows))
    if not found:
        return None
    _, parted, rows = max(found)
    turned = zip(*rows, strict=True)
    return "".join(parted.join(f'"{cell}"' if parted in cell else cell for cell in row) + "\n" for row in turned)


def split(line: str, delimiter: str) -> list[str]:
    """Part a line into its cells, without the blanks around them."""
    if delimiter == BLANKS:
        return re.sub(r"\s+(?=[\[(])", "", line.strip()).split()
    try:
        return [" ".join(cell.split()) for cell in next(csv_reader(io.StringIO(line, newline=""), delimiter=delimiter))]
    except (CsvError, StopIteration):
        return []


def is_number(cell: str) -> bool:
    """Say whether a cell looks like a number, in whatever locale."""
    return _NUMBER.fullmatch(cell) is not None


def is_comment(line: str) -> bool:
    """Say whether a line begins with one of the marks of a remark."""
    return _COMMENT.match(line) is not None


def _logical_lines(text: str) -> list[_Line]:
    """Part text into lines; one break within quotation marks is part of a cell."""
    lines: list[_Line] = []
    held, start = "", 0
    for number, line in enumerate(text.split("\n"), 1):
        held = f"{held} {line}" if held else line
        start = start or number
        if held.count('"') % 2 and number - start < 3:
            continue
        lines.append(_Line(held, start))
        held, start = "", 0
        if len(lines) == _SEARCHED:
            break
    return lines


def _width_below(lines: Sequence[_Line], header: int, delimiter: str) -> int | None:
    """Number of cells of the first row of numbers below a header, which may be followed by a row of units."""
    skipped = 0
    for line in lines[header + 1 :]:
        cells = split(line.text, delimiter)
        if not any(cells) or is_comment(line.text):
            continue
        if any(map(is_number, cells)):
            return len(cells)
        skipped += 1
        if skipped > 2:
            return None
    return None if skipped else 0


def _unknown_header(lines: Sequence[_Line], given: str | None) -> tuple[int, int, str, list[str]] | None:
    """Take the first row of words above a row of as many numbers for the header, though none of its names is known."""
    for index, line in enumerate(lines):
        for delimiter in [given] if given else _DELIMITERS:
            cells = split(line.text, delimiter)
            if (
                len(cells) > 1
                and not any(map(is_number, cells))
                and _width_below(lines, index, delimiter) == len(cells)
            ):
                return 0, index, delimiter, cells
    return None


def _described(lines: Sequence[_Line], header: int, delimiter: str, names: list[str]) -> Layout:
    notes: list[str] = []
    below, unit_row = header + 1, None
    while below < len(lines) and (not lines[below].text.strip() or not any(split(lines[below].text, delimiter))):
        below += 1
    if below < len(lines):
        cells = split(
            _COMMENT.sub("", lines[below].text) if is_comment(lines[below].text) else lines[below].text, delimiter
        )
        if is_unit_row(cells):
            unit_row = tuple(_unit(cell) for cell in cells)
            notes.append(f"units in row {lines[below].number}")
            below += 1
    if delimiter != ",":
        notes.insert(0, f"columns parted by {_DELIMITERS.get(delimiter, repr(delimiter))}")
    if header:
        notes.insert(0, f"header in row {lines[header].number}")
    width = _width_below(lines, below - 1, delimiter) or len(names)
    if len(names) > width and (not any(names[width:]) or _all_shorter(lines[below:], delimiter, width)):
        # Delimiters at the end of the header alone, or a column of remarks that no row has, as LabVIEW writes one
        notes += [f"nothing in column {name}" for name in names[width:] if name]
        names = names[:width]
    if len(names) == width - 1 and _ends_empty(lines[below:], delimiter):
        names = [*names, ""]  # delimiters at the end of each row
    if unit_row is not None:
        unit_row = (*unit_row, *[None] * len(names))[: len(names)]
    first = lines[below].number if below < len(lines) else lines[-1].number + 1
    return Layout(delimiter, tuple(names), unit_row, lines[header].number, first, tuple(notes))


def is_unit_row(cells: Sequence[str]) -> bool:
    """Say whether the cells of a row are units: of those that are not empty, at least half, and one that is no dash."""
    seen = [_unit(cell) for cell in cells if cell.strip()]
    known = [cell for cell in seen if cell is not None and units.is_unit(cell)]
    return bool(seen) and 2 * len(known) >= len(seen) and any(re.search(r"[^\W\d_]|%|°", cell) for cell in known)


def _unit(cell: str) -> str | None:
    """Give the unit in a cell of a row of units: without its brackets; None where the cell is empty."""
    return cell.strip().strip("[](){}<>").strip() or None


def _all_shorter(lines: Sequence[_Line], delimiter: str, width: int) -> bool:
    rows = [split(line.text, delimiter) for line in lines[:-1] or lines if line.text.strip()]
    return len(rows) > 0 and all(len(cells) == width for cells in rows if not is_comment(cells[0]))


def _ends_empty(lines: Sequence[_Line], delimiter: str) -> bool:
    rows = [split(line.text, delimiter) for line in lines if line.text.strip() and not is_comment(line.text)]
    return bool(rows) and all(not cells[-1] for cells in rows if cells)
