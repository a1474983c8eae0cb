"""Excel workbooks (extra ``excel``): the sheet with the wheel table, as text."""

from __future__ import annotations

import csv
import io
import warnings
import zipfile
from collections.abc import Callable, Iterator
from datetime import date, time
from importlib import import_module
from pathlib import Path
from typing import Any

from ..errors import InputError
from .layout import find_layout
from .tables import MAX_TABLE_BYTES

_MOST_PARTS = 4096
"""Parts of a workbook's archive: sheets, styles, pictures [-]."""

_FIRST_ROWS = 100
"""Rows that say how wide a table is [-]."""

_MOST_COLUMNS = 512
"""Columns that are looked at: what lies further right is no column of a wheel table [-]."""


def workbook_text(path: Path, is_known: Callable[[str], bool], sheet: str | None) -> tuple[bytes, list[str]]:
    """Read a sheet as comma-separated text, one line a row.

    Parameters
    ----------
    path
        The workbook, ``.xlsx`` or ``.xlsm``; macros are not run, formulas have the values that were stored with them.
    is_known
        Says whether a cell is the name of a column that means something.
    sheet
        Its name; the only sheet with a header where None.

    Raises
    ------
    InputError
        openpyxl is not installed; the file is damaged, or unpacks to too much; no sheet has a header, or several have.
    """
    try:
        openpyxl = import_module("openpyxl")
    except ImportError as error:
        expected = "pip install 'bevameter[excel]', or the table saved as CSV"
        raise InputError(path, "openpyxl, which reads Excel workbooks, is not installed", expected=expected) from error
    _check_archive(path)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of styles and extensions that openpyxl leaves out
            book = openpyxl.load_workbook(path, read_only=True, data_only=True, keep_links=False)
            try:
                texts = {
                    each.title: text
                    for each in book.worksheets
                    if sheet in (None, each.title) and (text := _as_text(path, each)).strip(b",\n")
                }
                titles = [each.title for each in book.worksheets]
            finally:
                book.close()
    except InputError:
        raise
    except Exception as error:  # openpyxl raises whatever the XML of a damaged file leads it to
        problem = f"no readable workbook: {type(error).__name__}: {error}"
        raise InputError(path, problem, expected="an Excel workbook (.xlsx)") from error
    if sheet is not None and sheet not in titles:
        raise InputError(path, f"no sheet {sheet!r}", expected=f"one of {', '.join(titles)}")
    if not texts:
        raise InputError(path, "no sheet with a cell that is not empty", expected="a header and rows")
    tables = {title: text for title, text in texts.items() if _score(text, is_known) > 1} or texts
    if len(tables) > 1:
        expected = "sheet = '...' in a column map says which"
        raise InputError(path, f"{len(tables)} sheets could be the table: {', '.join(tables)}", expected=expected)
    title, text = next(iter(tables.items()))
    return text, [f"sheet {title!r}"] if len(titles) > 1 else []


def _check_archive(path: Path) -> None:
    """Refuse what is no workbook, and one that unpacks to more than a table may hold: openpyxl unpacks all of it."""
    try:
        with zipfile.ZipFile(path) as archive:
            parts = archive.infolist()
    except (zipfile.BadZipFile, OSError, ValueError) as error:
        kind = "an Excel workbook (.xlsx); an .xls has to be saved as one"
        raise InputError(path, f"no readable workbook: {error}", expected=kind) from error
    size = sum(part.file_size for part in parts if part.filename.endswith((".xml", ".rels")))
    if size > MAX_TABLE_BYTES or len(parts) > _MOST_PARTS:
        raise InputError(path, f"unpacks to {size} bytes in {len(parts)} parts", expected="a smaller workbook")


def _as_text(path: Path, sheet: Any) -> bytes:
    """Write a sheet as comma-separated text; raises `InputError` where it is longer than a table may be."""
    buffer = io.StringIO()
    writer = csv.writer(buffer, lineterminator="\n")
    for row in _rows(sheet):
        writer.writerow(row)
        if buffer.tell() > MAX_TABLE_BYTES:
            problem = f"sheet {sheet.title!r} holds more than {MAX_TABLE_BYTES} bytes"
            raise InputError(path, problem, expected="a smaller table")
    return buffer.getvalue().encode()


def _rows(sheet: Any) -> Iterator[list[str]]:
    """Yield the rows as text, as wide as the first: a cell far off would ask for millions of others."""
    sheet.reset_dimensions()  # what the file says of its size may be wrong
    width = 1
    for cells in sheet.iter_rows(max_row=_FIRST_ROWS, max_col=_MOST_COLUMNS):
        width = max([width, *(place for place, cell in enumerate(cells, 1) if cell.value is not None)])
    for cells in sheet.iter_rows(max_col=width):
        yield [_text(cell) for cell in cells] or [""]


def _text(cell: Any) -> str:
    value = cell.value
    if value is None:
        return ""
    if isinstance(value, float | int) and not isinstance(value, bool):
        # Shown as 20 %, stored as 0.2: beside "Slip [%]" it is 20.
        return f"{100.0 * value!r}%" if "%" in str(cell.number_format) else repr(value)
    if isinstance(value, date | time):
        return value.isoformat()
    return " ".join(str(value).split())


def _score(text: bytes, is_known: Callable[[str], bool]) -> int:
    layout = find_layout(text[: 2**18].decode(errors="ignore"), is_known)
    return 0 if layout is None else sum(map(is_known, layout.names))
