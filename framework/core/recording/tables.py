"""Tables from files: CSV (gzip allowed) and Parquet, read strictly, every number as it stands in the file.

Nothing is coerced in silence: a cell that is no number, a row that is too short, a column that stands twice, are
errors that name their row and column. Rows are counted as in the file: the header of a CSV file is row 1, and the
first row of a Parquet file, which has no header row, is row 1.
"""

from __future__ import annotations

import csv
import gzip
import io
import re
import zlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq

from ..errors import InputError
from .paths import file_size

MAX_TABLE_BYTES = 256 * 2**20
"""No table is read whose text is longer than this, after unpacking: a gzip bomb ends here [bytes]."""

_EMPTY_CELLS = ["", "nan", "NaN", "NAN", "NA", "N/A", "null", "None"]
_TRUTH = re.compile(rb"\b(true|false)\b", re.IGNORECASE)
_PIECE = 2**20
_EXACT_BY_DEFAULT = (3, 1)  # from this pandas on, numbers are read to the last bit without asking, and asking warns
_PRECISION: dict[str, Any] = (
    {}
    if tuple(int(part) for part in pd.__version__.split(".")[:2]) >= _EXACT_BY_DEFAULT
    else {"float_precision": "round_trip"}
)


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
    """

    numbers: dict[str, np.ndarray]
    text: dict[str, np.ndarray]
    source: Path
    first_row: int
    problems: tuple[str, ...] = ()

    def __len__(self) -> int:
        return len(next(iter({**self.numbers, **self.text}.values()), ()))

    def place(self, row: int, column: str) -> str:
        """Name a cell as a user finds it: `row` counts from 0 here."""
        return f"row {row + self.first_row}, column {column}"


def is_table(path: Path) -> bool:
    """Tell by its name whether a file is a table that can be read here."""
    return path.name.lower().endswith((".csv", ".csv.gz", ".parquet"))


def read_table(
    path: Path,
    *,
    numbers: frozenset[str] = frozenset(),
    text: frozenset[str] | None = frozenset(),
    required: bool = True,
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
    required
        Whether a table without a single row is an error.

    Raises
    ------
    InputError
        The file is missing, empty, too large, or no such table; a column stands twice; a cell is no number.
    """
    path = Path(path)
    if not is_table(path):
        raise InputError(path, f"a file of kind {path.suffix!r}", expected="a .csv, .csv.gz or .parquet file")
    file_size(path, "a table file")
    if path.name.lower().endswith(".parquet"):
        table = _from_parquet(path, numbers, text)
    else:
        table = _from_csv(path, numbers, text)
    if required and not len(table):
        raise InputError(path, "a header without rows", expected="at least one row of data")
    return table


def read_bytes(path: Path, limit: int = MAX_TABLE_BYTES) -> bytes:
    """Read a file, unpacking it if its name ends in ``.gz``; raises `InputError` beyond the limit [bytes]."""
    try:
        if path.stat().st_size > limit:
            raise InputError(path, f"{path.stat().st_size} bytes", expected=f"no more than {limit} bytes")
        with path.open("rb") as plain:
            if not path.name.lower().endswith(".gz"):
                return plain.read()
            pieces: list[bytes] = []
            total = 0
            with gzip.GzipFile(fileobj=plain) as packed:
                while piece := packed.read(_PIECE):
                    total += len(piece)
                    if total > limit:
                        raise InputError(path, f"unpacks to more than {limit} bytes", expected="a smaller table")
                    pieces.append(piece)
            return b"".join(pieces)
    except (gzip.BadGzipFile, EOFError, zlib.error) as error:
        raise InputError(path, f"damaged gzip: {error}", expected="a whole gzip file") from error
    except OSError as error:
        raise InputError(path, error.strerror or str(error), expected="a readable file") from error


def _from_csv(path: Path, numbers: frozenset[str], text: frozenset[str] | None) -> Table:
    content = _csv_bytes(path)
    header = _header(path, content)
    if text is None:
        text = frozenset(header) - numbers
    content, problems = _whole_rows(path, content, len(header))
    frame = _parse(path, content, header, text)
    columns: dict[str, np.ndarray] = {}
    words: dict[str, np.ndarray] = {}
    for name in header:
        if name in text:
            words[name] = _stripped(frame, name)
        elif pd.api.types.is_numeric_dtype(frame[name]):
            columns[name] = frame[name].to_numpy(dtype=float)
        elif name in numbers:
            columns[name] = _strict_numbers(path, name, _stripped(frame, name), 2)
        else:
            guess = _numbers_or_none(_stripped(frame, name))
            if guess is None:
                words[name] = _stripped(frame, name)
            else:
                columns[name] = guess
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
    header = [name.strip() for name in next(csv.reader([first]))]
    if len(header) == 1 and any(mark in first for mark in ";\t"):
        raise InputError(path, f"columns parted by {';' if ';' in first else 'tabs'}", expected="commas", place="row 1")
    for place, name in enumerate(header):
        if not name:
            raise InputError(path, f"column {place + 1} has no name", expected="a name", place="row 1")
        if header.index(name) != place:
            raise InputError(path, f"column {name} stands twice", expected="each column once", place="row 1")
    return header


def _whole_rows(path: Path, content: bytes, width: int) -> tuple[bytes, tuple[str, ...]]:
    """Check that every row has as many cells as the header; give the text without a last row that was cut off.

    pandas would fill up a row that is too short and, where the header is given, cut one that is too long.
    """
    finished = content.endswith(b"\n")
    content = content.rstrip(b"\n") + b"\n"
    counts = _cells_by_row(path, content)
    wrong = np.flatnonzero(counts != width)
    if not len(wrong):
        return content, ()
    row = int(wrong[0])
    if row == len(counts) - 1 and row > 1 and not finished and counts[row] < width and b'"' not in content:
        start = content.rfind(b"\n", 0, -1) + 1
        return content[:start], (f"{path.name}, row {row + 1}: cut off in mid-row, left out",)
    raise InputError(path, f"{counts[row]} cells", expected=f"{width}, as in the header", place=f"row {row + 1}")


def _cells_by_row(path: Path, content: bytes) -> np.ndarray:
    """Count the cells of each row, (n,); an empty line counts none."""
    if b'"' in content:
        try:
            with io.TextIOWrapper(io.BytesIO(content), encoding="utf-8", newline="") as lines:
                return np.array([len(cells) for cells in csv.reader(lines, strict=True)])
        except csv.Error as error:
            raise InputError(path, f"no comma-separated text: {error}", expected="comma-separated text") from error
    characters = np.frombuffer(content, dtype=np.uint8)
    ends = np.flatnonzero(characters == ord("\n"))
    commas = np.searchsorted(np.flatnonzero(characters == ord(",")), ends)
    return np.where(np.diff(ends, prepend=-1) == 1, 0, np.diff(commas, prepend=0) + 1)


def _parse(path: Path, content: bytes, header: list[str], text: frozenset[str]) -> pd.DataFrame:
    """Parse the rows; columns that are not all numbers stay text, for the caller to name the cell that is none."""
    options = {
        "header": 0, "names": header, "index_col": False, "keep_default_na": False, "skip_blank_lines": False,
        "encoding": "utf-8", "low_memory": False,
    }  # fmt: skip
    wanted = [name for name in header if name not in text]
    try:
        if _TRUTH.search(content):
            raise ValueError("pandas would take a truth value for a number")
        return pd.read_csv(
            io.BytesIO(content),
            dtype={name: str if name in text else float for name in header},
            na_values={name: _EMPTY_CELLS for name in wanted},
            **_PRECISION,
            **options,
        )
    except (ValueError, OverflowError):
        pass  # a cell is no number: read again as text, so that the caller can name it
    try:
        return pd.read_csv(io.BytesIO(content), dtype=str, **options)
    except (ValueError, pd.errors.ParserError) as error:
        raise InputError(path, f"no table: {error}", expected="comma-separated text") from error


def _stripped(frame: pd.DataFrame, name: str) -> np.ndarray:
    return np.array([cell.strip() if isinstance(cell, str) else "" for cell in frame[name].tolist()], dtype=object)


def _numbers_or_none(cells: np.ndarray) -> np.ndarray | None:
    """Give the numbers of a column of text, NaN for empty cells, or None if a cell is no number."""
    try:
        return np.array([np.nan if cell in _EMPTY_CELLS else _number(cell) for cell in cells.tolist()], dtype=float)
    except ValueError:
        return None


def _number(cell: str) -> float:
    if "_" in cell:  # Python's own grouping mark, which no other program reads
        raise ValueError(cell)
    return float(cell)


def _strict_numbers(path: Path, name: str, cells: np.ndarray, first_row: int) -> np.ndarray:
    answer = _numbers_or_none(cells)
    if answer is not None:
        return answer
    for row, cell in enumerate(cells):
        if _numbers_or_none(cells[row : row + 1]) is None:
            raise InputError(path, repr(cell), expected="a number", place=f"row {row + first_row}, column {name}")
    raise AssertionError("a column of numbers was taken for text")


def _from_parquet(path: Path, numbers: frozenset[str], text: frozenset[str] | None) -> Table:
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
