"""Tables from files: CSV (gzip allowed) and Parquet, read strictly, every number as it stands in the file.

Nothing is coerced in silence: a cell that is no number, a row that is too short, a column that stands twice, are
errors that name their row and column. Rows are counted as in the file: the header of a CSV file is row 1, and the
first row of a Parquet file, which has no header row, is row 1.
"""

from __future__ import annotations

import gzip
import io
import math
import zlib
from collections import deque
from collections.abc import Callable, Sequence
from csv import Error as CsvError
from csv import reader as csv_reader
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq
from pyarrow import csv

from ..errors import InputError
from ..files import file_size

MAX_TABLE_BYTES = 256 * 2**20
"""No table is read whose text is longer than this, after unpacking: a gzip bomb ends here [bytes]."""

_FIRST_ROW = 2**20
"""Bytes in which the first row of a table must end."""

EMPTY_CELLS = ["", "nan", "NaN", "NAN", "NA", "N/A", "null", "None"]


@dataclass(frozen=True)
class Table:
    """A table as it was read: columns of numbers and columns of text, each (n,).

    Parameters
    ----------
    numbers
        float64, by column name in the order of the file; NaN where a cell is empty.
    text
        Columns of str objects, by column name; "" where a cell is empty.
    source
        The file.
    first_row
        Number of the first row of data, as the file's reader counts it.
    problems
        What could not be read, in words.
    rows
        Number of each row in the file, (n,), where rows between them were left out; else None.
    """

    numbers: dict[str, np.ndarray]
    text: dict[str, np.ndarray]
    source: Path
    first_row: int
    problems: tuple[str, ...] = ()
    rows: np.ndarray | None = None

    def __len__(self) -> int:
        return len(next(iter({**self.numbers, **self.text}.values()), ()))

    def place(self, row: int, column: str) -> str:
        """Name a cell as a user finds it: `row` counts from 0 here."""
        return f"row {self.row_number(row)}, column {column}"

    def row_number(self, row: int) -> int:
        """Give the number of a row in the file: `row` counts from 0 here."""
        return row + self.first_row if self.rows is None else int(self.rows[row])

    def need(self, *names: str) -> tuple[np.ndarray, ...]:
        """Give columns, each (n,); raises `InputError` where one is not there."""
        columns = {**self.numbers, **self.text}
        for name in names:
            if name not in columns:
                problem = f"no column {name}; there are {', '.join(columns)}"
                raise InputError(self.source, problem, expected=", ".join(names))
        return tuple(columns[name] for name in names)

    def refuse(self, bad: np.ndarray, column: str, problem: Callable[[int], str], expected: str) -> None:
        """Raise `InputError` for the first row, if any, in which a column is `bad` (n,)."""
        if bad.any():
            row = int(np.argmax(bad))
            raise InputError(self.source, problem(row), expected=expected, place=self.place(row, column))

    def check_time(self, name: str, *, increasing: bool = False) -> None:
        """Refuse time that is not there, is no finite number, or runs backwards; or stands, if it is to increase."""
        time = self.numbers[name]
        self.check_finite(name)
        step = np.diff(time, prepend=-np.inf)
        verb, expected = ("does not go on", "increases") if increasing else ("runs backwards", "does not decrease")
        self.refuse(
            step <= 0 if increasing else step < 0,
            name,
            lambda row: f"time {verb}, {time[row - 1]:.9g} s and then {time[row]:.9g} s",
            f"time that {expected}",
        )

    def check_finite(self, name: str, *, missing: bool = False) -> None:
        """Refuse numbers that are infinite or, unless they may be missing, not there."""
        values = self.numbers[name]
        bad = np.isinf(values) if missing else ~np.isfinite(values)
        self.refuse(bad, name, lambda row: "no value" if np.isnan(values[row]) else str(values[row]), "a finite number")


def is_table(path: Path) -> bool:
    """Say by its name whether a file is a table that can be read here."""
    return path.name.lower().endswith((".csv", ".csv.gz", ".parquet"))


def read_table(
    path: Path,
    *,
    numbers: frozenset[str] = frozenset(),
    text: frozenset[str] | None = frozenset(),
) -> Table:
    """Read a table.

    Parameters
    ----------
    path
        A ``.csv``, ``.csv.gz`` or ``.parquet`` file.
    numbers
        Columns that must be numbers where they are present.
    text
        Columns that are text; None for all that are not in `numbers`. Columns in neither set are numbers if all their
        cells are, and text otherwise.

    Raises
    ------
    InputError
        The file is missing, without rows, too large, or no such table; a column stands twice; a cell is no number.
    """
    path = Path(path)
    if not is_table(path):
        raise InputError(path, f"a file of kind {path.suffix!r}", expected="a .csv, .csv.gz or .parquet file")
    file_size(path, "a table file")
    if path.name.lower().endswith(".parquet"):
        return with_rows(from_parquet(path, numbers, text))
    return with_rows(_from_csv(path, numbers, text))


def with_rows(table: Table) -> Table:
    """Give a table back; raises `InputError` where it has no row."""
    if not len(table):
        raise InputError(table.source, "a header without rows", expected="at least one row of data")
    return table


def read_bytes(path: Path) -> bytes:
    """Read a file, unpacking it if its name ends in ``.gz``; raises `InputError` beyond `MAX_TABLE_BYTES`."""
    data = _opened(path, MAX_TABLE_BYTES + 1)
    if len(data) > MAX_TABLE_BYTES:
        problem = f"{'unpacks to' if path.name.lower().endswith('.gz') else 'holds'} more than {MAX_TABLE_BYTES} bytes"
        raise InputError(path, problem, expected="a smaller table")
    return data


def _opened(path: Path, size: int) -> bytes:
    """Read the beginning of a file, unpacked if its name ends in ``.gz``: `size` bytes at most."""
    try:
        with gzip.open(path) if path.name.lower().endswith(".gz") else path.open("rb") as file:
            return file.read(size)
    except (gzip.BadGzipFile, EOFError, zlib.error) as error:
        raise InputError(path, f"damaged gzip: {error}", expected="a whole gzip file") from error
    except OSError as error:
        raise InputError(path, error.strerror or str(error), expected="a readable file") from error


def column_names(path: Path) -> list[str]:
    """Give the cells of a table's first row, or its columns where it is Parquet; none where it has no such row."""
    file_size(path, "a table file")
    if path.name.lower().endswith(".parquet"):
        return parquet_names(path)
    first = _opened(path, _FIRST_ROW).removeprefix(b"\xef\xbb\xbf").replace(b"\r", b"\n").partition(b"\n")[0]
    try:
        return [name.strip() for name in next(csv_reader([first.decode()]), [])]
    except (UnicodeDecodeError, CsvError):
        return []


def _from_csv(path: Path, numbers: frozenset[str], text: frozenset[str] | None) -> Table:
    content = _csv_bytes(path)
    header = _header(path, content)
    if text is None:
        text = frozenset(header) - numbers
    if b'"' not in content and b"\n\n" in (body := content.rstrip(b"\n")):
        row = body[: body.index(b"\n\n")].count(b"\n") + 2
        raise InputError(path, "0 cells", expected=f"{len(header)}, as in the header", place=f"row {row}")
    rows, problems = csv_rows(path, content.partition(b"\n")[2], header, number=lambda row: row + 2)
    columns: dict[str, np.ndarray] = {}
    words: dict[str, np.ndarray] = {}
    for name in header:
        cells = pc.utf8_trim_whitespace(rows[name])  # pyright: ignore[reportAttributeAccessIssue]
        values = None if name in text else numbers_or_none(cells)
        if values is not None:
            columns[name] = values
        elif name in numbers:
            row, cell = next((row, cell) for row, cell in enumerate(cells.to_pylist()) if not is_number(cell))
            raise InputError(path, repr(cell), expected="a number", place=f"row {row + 2}, column {name}")
        else:
            words[name] = cells.to_numpy()
    return Table(columns, words, path, 2, problems)


def _csv_bytes(path: Path) -> bytes:
    """Read a CSV file's text, checked to be UTF-8, its lines ended by line feeds."""
    data = read_bytes(path).removeprefix(b"\xef\xbb\xbf")
    if not data.strip():
        raise InputError(path, "an empty file", expected="a header and rows")
    if b"\0" in data:
        raise InputError(path, "binary data", expected="comma-separated text")
    try:
        data.decode("utf-8")
    except UnicodeDecodeError as error:
        raise InputError(
            path, f"byte {error.start} is not UTF-8 text", expected="comma-separated text in UTF-8"
        ) from error
    return data.replace(b"\r\n", b"\n").replace(b"\r", b"\n") if b"\r" in data else data


def _header(path: Path, content: bytes) -> list[str]:
    first = content.split(b"\n", 1)[0].decode("utf-8")
    if not first.strip():
        raise InputError(path, "an empty line", expected="column names", place="row 1")
    header = [name.strip() for name in next(csv_reader([first]))]
    if len(header) == 1 and any(mark in first for mark in ";\t"):
        raise InputError(path, f"columns parted by {';' if ';' in first else 'tabs'}", expected="commas", place="row 1")
    for place, name in enumerate(header):
        if not name:
            raise InputError(path, f"column {place + 1} has no name", expected="a name", place="row 1")
        if header.index(name) != place:
            raise InputError(path, f"column {name} stands twice", expected="each column once", place="row 1")
    return header


def csv_rows(
    path: Path, text: bytes, header: Sequence[str], *, number: Callable[[int], int], delimiter: str = ","
) -> tuple[pa.Table, tuple[str, ...]]:
    """Part rows into cells of text; a last row that was cut off is left out, which is said.

    Parameters
    ----------
    path
        The file, for errors.
    text
        The rows below the header, in UTF-8, their ends line feeds.
    header
        Names of the columns.
    number
        Gives the number in the file of a row, which is counted from 0.
    delimiter
        What parts the cells.

    Returns
    -------
    rows, problems
        A column of text by each name, and what was left out, in words.

    Raises
    ------
    InputError
        A row has more or fewer cells than the header.
    """
    wrong: list[csv.InvalidRow] = []

    def leave_out(row: csv.InvalidRow) -> str:
        wrong.append(row)
        return "skip"

    quoted, body = b'"' in text, text.rstrip(b"\n")
    if not body:
        return pa.table({name: pa.array([], pa.string()) for name in header}), ()
    try:
        if quoted:  # Arrow takes the end of the file for the end of a quotation
            deque(csv_reader(io.StringIO(body.decode(), newline=""), delimiter=delimiter, strict=True), maxlen=0)
        rows = csv.read_csv(
            pa.BufferReader(body + b"\n"),
            # rows are counted by one thread only
            csv.ReadOptions(column_names=header, use_threads=False, block_size=max(len(body) + 1, 2**20)),
            csv.ParseOptions(
                delimiter=delimiter, newlines_in_values=quoted, ignore_empty_lines=False, invalid_row_handler=leave_out
            ),
            csv.ConvertOptions(column_types=dict.fromkeys(header, pa.string())),
        )
    except (pa.ArrowException, CsvError) as error:
        raise InputError(path, f"no comma-separated text: {error}", expected="comma-separated text") from error
    if not wrong:
        return rows, ()
    first = wrong[0]
    cells, row = first.actual_columns, first.number - 1
    if len(rows) and row == len(rows) and cells < len(header) and not text.endswith(b"\n") and not quoted:
        return rows, (f"{path.name}, row {number(row)}: cut off in mid-row, left out",)
    more = f"; {len(wrong) - 1} more row{'s' * (len(wrong) > 2)} differ{'s' * (len(wrong) == 2)}" * (len(wrong) > 1)
    expected = f"{len(header)}, as in the header{more}"
    raise InputError(path, f"{cells} cells", expected=expected, place=f"row {number(row)}")


def numbers_or_none(cells: pa.ChunkedArray) -> np.ndarray | None:
    """Give the numbers of a column of text, NaN for empty cells, or None if a cell is no number."""
    filled = pc.if_else(pc.is_in(cells, value_set=pa.array(EMPTY_CELLS)), "nan", cells)  # pyright: ignore[reportAttributeAccessIssue]
    try:
        return filled.cast(pa.float64()).to_numpy()
    except pa.ArrowInvalid:  # a number that Arrow does not write so, such as +1, or none
        listed = cells.to_pylist()
        return np.array([_number(cell) for cell in listed]) if all(map(is_number, listed)) else None


def _number(cell: str) -> float:
    return math.nan if cell in EMPTY_CELLS else float(cell)


def is_number(cell: str) -> bool:
    """Say whether a cell is a number, or empty."""
    try:
        _number(cell)
    except ValueError:
        return False
    return "_" not in cell  # Python's own grouping mark, which no other program reads


def parquet_names(path: Path) -> list[str]:
    """Give the names of a Parquet file's columns; raises `InputError` where it is none."""
    try:
        return [field.name for field in pq.ParquetFile(path).schema_arrow]
    except (pa.ArrowException, OSError, ValueError) as error:
        raise InputError(path, f"no readable Parquet: {error}", expected="a Parquet file") from error


def from_parquet(path: Path, numbers: frozenset[str], text: frozenset[str] | None) -> Table:
    """Read a Parquet file; parameters and errors as of `read_table`."""
    try:
        file = pq.ParquetFile(path)
        names = [field.name for field in file.schema_arrow]
        if text is None:
            text = frozenset(names) - numbers
        for name in names:
            if names.count(name) > 1:
                raise InputError(path, f"column {name} stands twice", expected="each column once")
        size = file.metadata.num_rows * max(len(names), 1) * 8
        unpacked = sum(file.metadata.row_group(i).total_byte_size for i in range(file.metadata.num_row_groups))
        if max(size, unpacked) > MAX_TABLE_BYTES:
            raise InputError(path, f"unpacks to {max(size, unpacked)} bytes", expected="a smaller table")
        data = file.read()
    except (pa.ArrowException, OSError, ValueError) as error:
        raise InputError(path, f"no readable Parquet: {error}", expected="a Parquet file") from error
    columns: dict[str, np.ndarray] = {}
    words: dict[str, np.ndarray] = {}
    for name, column in zip(names, data.columns, strict=True):
        kind = column.type
        if name not in text and (pa.types.is_integer(kind) or pa.types.is_floating(kind) or pa.types.is_boolean(kind)):
            columns[name] = column.cast(pa.float64(), safe=False).to_numpy()
        elif name in numbers and not pa.types.is_null(kind):
            raise InputError(path, f"holds {kind}", expected="numbers", place=f"column {name}")
        elif pa.types.is_null(kind):
            columns[name] = np.full(len(column), np.nan)
        else:
            words[name] = np.array(["" if cell is None else str(cell).strip() for cell in column.to_pylist()], object)
    return Table(columns, words, path, 1)
