"""Numbers as programs and countries write them: decimal commas, marks between thousands, per cent, times of day.

What a mark means is decided once for a file, by those of its cells in which it can mean one thing only.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.compute as pc

# pyarrow makes its functions when it is imported, which no type checker sees
# pyright: reportAttributeAccessIssue=false
from .tables import EMPTY_CELLS, is_number, numbers_or_none

MISSING = [
    *EMPTY_CELLS, "-", "--", "---", "–", "—", "?", ".", "n/a", "n.a.", "NULL", "none", "missing", "#N/A", "#NV", "#N/D",
    "#VALUE!", "#WERT!", "#VALEUR!", "#DIV/0!", "#REF!", "#NUM!", "#ZAHL!", "1.#QNAN", "-1.#IND", "1.#IND", "1,#QNAN",
    "-1,#IND", "-nan", "+nan", "-NaN",
]  # fmt: skip
"""Cells that stand for no value."""

_EXPONENT = r"([eE][-+]?\d+)?"


def _certain(mark: str, other: str) -> str:
    """Pattern of a number in which `mark` can only be the decimal mark."""
    ways = (
        rf"\d*{mark}(\d{{0,2}}|\d{{4,}})", rf"0*{mark}\d+", rf"\d{{4,}}{mark}\d+",
        rf"\d{{1,3}}({other}\d{{3}})+{mark}\d+", rf"\d{{1,3}}({other}\d{{3}}){{2,}}", rf"\d+{mark}\d+[eE][-+]?\d+",
    )  # fmt: skip
    return rf"^[-+]?({'|'.join(ways)}){_EXPONENT}$"


_CERTAIN = {",": _certain(",", r"\."), ".": _certain(r"\.", ",")}
_GROUPED = {
    ",": rf"^[-+]?\d{{1,3}}(\.\d{{3}})+(,\d+)?{_EXPONENT}$",
    ".": rf"^[-+]?\d{{1,3}}(,\d{{3}})+(\.\d+)?{_EXPONENT}$",
}
_AFTER = {
    "the deviations after ±": r"[\s\x{a0}\x{202f}]*(±|\+/-)[\s\x{a0}\x{202f}]*\d[\d.,]*$",
    "marks of footnotes": r"[*†‡]+$",
}
"""What may follow the number in a cell and is no part of it."""

_SPACED = r"^[-+]?\d{1,3}([ '’\x{a0}\x{202f}\x{2009}]\d{3})+([.,]\d+)?$"


@dataclass(frozen=True)
class BadCell:
    """A cell that is no number: its column, its row from 0, its text, how many of that column are none, and why."""

    column: str
    row: int
    text: str
    count: int
    expected: str = "a number"


@dataclass
class Numbers:
    """What was read of columns of text.

    Parameters
    ----------
    numbers
        Columns of numbers, each (n,); NaN where there is no value.
    text
        Columns of text, each (n,) of str.
    percent
        Columns whose cells end in a per cent sign, which was left out.
    dated
        Columns of dates or times of day, now seconds since the first row.
    bad
        Cells of wanted columns that are no numbers.
    notes
        What was made of the cells, in words.
    """

    numbers: dict[str, np.ndarray] = field(default_factory=dict)
    text: dict[str, np.ndarray] = field(default_factory=dict)
    percent: set[str] = field(default_factory=set)
    dated: set[str] = field(default_factory=set)
    bad: list[BadCell] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)


def read_numbers(
    cells: Mapping[str, pa.ChunkedArray],
    *,
    wanted: frozenset[str],
    text: frozenset[str],
    clocks: frozenset[str] = frozenset(),
    decimal: str | None = None,
) -> Numbers:
    """Read columns of text as numbers.

    Parameters
    ----------
    cells
        Columns of text without blanks around it.
    wanted
        Columns that must be numbers.
    text
        Columns that stay text; those in neither set are numbers if all of their cells are.
    clocks
        Wanted columns that may hold dates or times of day, which become seconds since the first row.
    decimal
        The decimal mark, where it is known.
    """
    found = Numbers()
    plain = {name: None if name in text else numbers_or_none(column) for name, column in cells.items()}
    failing = [name for name, values in plain.items() if values is None and name in wanted]
    tidied = {name: _tidied(cells[name], found, name) for name in failing}
    if decimal is None and not failing:
        _refuse_thousands({name: cells[name] for name in plain if name in wanted}, found)
    if failing or decimal == ",":
        numeric = {name: tidied.get(name, cells[name]) for name in plain if name in wanted}
        decimal = decimal or _decimal_mark(numeric, found)
    if decimal is not None:
        for name in plain:
            if name not in text and (name in failing or decimal == ","):
                column = _with_points(tidied.get(name, cells[name]), decimal)
                plain[name] = numbers_or_none(column)
                tidied[name] = column if name in wanted else cells[name]
        found.notes += ["decimal commas"] if decimal == "," else []
    for name, values in plain.items():
        if values is None and name in clocks:
            values = _clock(cells[name])
            if values is not None:
                found.dated.add(name)
                found.notes.append(f"dates or times of day in {name} taken as seconds since the first row")
        if values is not None:
            found.numbers[name] = values
        elif name not in wanted:
            found.text[name] = cells[name].to_numpy()
        elif not any(bad.column == name for bad in found.bad):
            none = [row for row, cell in enumerate(tidied[name].to_pylist()) if not is_number(cell)]
            expected = "a number with a decimal comma, as in other cells" if decimal == "," else "a number"
            found.bad.append(BadCell(name, none[0], cells[name][none[0]].as_py(), len(none), expected))
    return found


def _tidied(cells: pa.ChunkedArray, found: Numbers, name: str) -> pa.ChunkedArray:
    """Replace marks of missing values by ``nan``; leave out per cent signs, and blanks between thousands."""
    missing = pc.is_in(cells, value_set=pa.array(MISSING))
    others = pc.and_(missing, pc.invert(pc.is_in(cells, value_set=pa.array(EMPTY_CELLS))))
    if (count := pc.sum(others).as_py()) and count < len(cells):
        mark = cells[pc.index(others, True).as_py()].as_py()
        found.notes.append(f"{name}: {count} cell{'s' * (count > 1)} such as {mark!r} taken for no value")
    cells = pc.if_else(missing, "nan", pc.replace_substring(cells, "−", "-"))
    for what, pattern in _AFTER.items():
        follows = pc.match_substring_regex(cells, rf"\d{pattern}")
        if count := pc.sum(follows).as_py():
            found.notes.append(f"{name}: {what} in {count} cell{'s' * (count > 1)} left out")
            cells = pc.if_else(follows, pc.replace_substring_regex(cells, pattern, ""), cells)
    signed = pc.match_substring_regex(cells, r"\d\s*%$")
    bare = pc.invert(pc.or_(missing, signed))
    if 2 * pc.sum(signed).as_py() > len(cells) - pc.sum(missing).as_py():
        found.percent.add(name)
        if count := pc.sum(bare).as_py():
            row = pc.index(bare, True).as_py()
            expected = "a number with a per cent sign, as in the other rows"
            found.bad.append(BadCell(name, row, cells[row].as_py(), count, expected))
        cells = pc.replace_substring_regex(cells, r"[\s\x{a0}\x{202f}]*%$", "")
    spaced = pc.match_substring_regex(cells, _SPACED)
    if pc.any(spaced).as_py():
        found.notes.append(f"{name}: blanks or apostrophes between thousands left out")
        cells = pc.if_else(spaced, pc.replace_substring_regex(cells, r"[ '’\x{a0}\x{202f}\x{2009}]", ""), cells)
    return cells


def _decimal_mark(columns: Mapping[str, pa.ChunkedArray], found: Numbers) -> str | None:
    """Find the decimal mark of a file, None where its numbers have none or a cell leaves it open."""
    seen = {mark: _first(columns, pattern) for mark, pattern in _CERTAIN.items()}
    comma, point = seen[","], seen["."]
    if comma and point:
        name, row, cell, count = comma
        expected = f"one decimal mark: there is {point[2]!r} in column {point[0]}, too"
        found.bad.append(BadCell(name, row, cell, count, expected))
        return None
    if comma or point:
        return "," if comma else "."
    if doubtful := _first(columns, r"^[-+]?\d{1,3},\d{3}$"):
        name, row, cell, count = doubtful
        expected = (
            f"{cell.replace(',', '.')} or {cell.replace(',', '')}: decimal = ',' or '.' in a column map says which"
        )
        found.bad.append(BadCell(name, row, cell, count, expected))
        return None
    return "."


def _refuse_thousands(columns: Mapping[str, pa.ChunkedArray], found: Numbers) -> None:
    """Refuse columns such as 802, 1.252: every point may be one between thousands, and a number without one is as large
    as that.
    """
    for name, cells in columns.items():
        pointed = pc.match_substring(cells, ".")
        grouped = pc.match_substring_regex(cells, r"^[-+]?[1-9]\d{0,2}\.\d{3}$")
        large = pc.match_substring_regex(cells, r"^[-+]?[1-9]\d{2}$")
        if pc.any(pointed).as_py() and pc.all(pc.equal(pointed, grouped)).as_py() and pc.any(large).as_py():
            row = pc.index(grouped, True).as_py()
            cell = cells[row].as_py()
            expected = f"{cell.replace('.', '')} or {cell}: decimal = ',' or '.' in a column map says which"
            found.bad.append(BadCell(name, row, cell, pc.sum(grouped).as_py(), expected))


def _first(columns: Mapping[str, pa.ChunkedArray], pattern: str) -> tuple[str, int, str, int] | None:
    """Column, row, text and number of cells that match, of the first column in which any does."""
    for name, cells in columns.items():
        matches = pc.match_substring_regex(cells, pattern)
        if count := pc.sum(matches).as_py():
            row = pc.index(matches, True).as_py()
            return name, row, cells[row].as_py(), count
    return None


def _with_points(cells: pa.ChunkedArray, decimal: str) -> pa.ChunkedArray:
    """Write numbers with a decimal point and without marks between thousands; leave what is no number as it is."""
    grouped = pc.match_substring_regex(cells, _GROUPED[decimal])
    other = "." if decimal == "," else ","
    cells = pc.if_else(grouped, pc.replace_substring(cells, other, ""), cells)
    if decimal == ",":
        # "1.5" beside decimal commas is no number here: its point would be taken for one.
        cells = pc.if_else(pc.match_substring(cells, "."), pc.binary_join_element_wise("?", cells, ""), cells)
        cells = pc.replace_substring(cells, ",", ".")
    return cells


def _clock(cells: pa.ChunkedArray) -> np.ndarray | None:
    """Read dates (ISO 8601) or times of day as seconds since the first row; None where a cell is neither."""
    texts = cells.to_pylist()
    if not texts or any(":" not in text for text in texts):
        return None
    try:
        if all(text[:1].isdigit() and text.split(":")[0].isdigit() for text in texts):
            whole = (text if text.count(":") > 1 else f"00:{text}" for text in texts)
            moments = pd.to_timedelta(pd.Series([text.replace(",", ".") for text in whole]))
        else:
            moments = pd.to_datetime(pd.Series(texts), format="ISO8601", utc=True)
        return np.asarray((moments - moments.iloc[0]).dt.total_seconds(), dtype=float)
    except (ValueError, OverflowError):
        return None
