"""Wheel tables as files: text of any layout, workbooks and Parquet, opened first, read when their columns are known."""

from __future__ import annotations

import codecs
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from ..errors import InputError
from ..files import file_size
from . import numerals
from .layout import BLANKS, Layout, find_layout, is_comment, is_number, is_unit_row, split, upright
from .summary_rows import gaps, headings, summaries, unnamed_means, words_only
from .tables import Table, csv_rows, from_parquet, parquet_names, read_bytes, with_rows

TEXT_ENDINGS = (".csv", ".tsv", ".txt", ".dat", ".lvm", ".asc")
ENDINGS = (*TEXT_ENDINGS, *(ending + ".gz" for ending in TEXT_ENDINGS), ".parquet", ".xlsx", ".xlsm")
"""Endings of files that can hold a wheel table."""

_LONGEST = 200
"""Longest name of a column [characters]."""

_MOST_SAID = 8
"""Rows left out whose numbers are said [-]."""

_BEGINNING = 2**18
"""So much of a text is looked at for its header [bytes]."""

_BOMS = ((codecs.BOM_UTF8, "utf-8"), (codecs.BOM_UTF32_LE, "utf-32"), (codecs.BOM_UTF16_LE, "utf-16"),
         (codecs.BOM_UTF16_BE, "utf-16"))  # fmt: skip
_CONTROL = re.compile(r"[\x00-\x08\x0e-\x19\x1b-\x1f\x80-\x9f]")


@dataclass(frozen=True)
class Sheet:
    """A table whose header was read, and whose cells were not.

    Parameters
    ----------
    source
        The file.
    names
        Names of the columns, as they stand in the header and each once; what has none is ``column 3``.
    units
        Unit of each column by a row of units, None where it has none.
    header
        Number of the header's row in the file.
    twice
        Names that stand in the header more than once; the further columns of that name have a number added.
    unnamed
        Columns without a name, of which nothing is read.
    notes
        What was unusual in its layout, in words.
    """

    source: Path
    names: tuple[str, ...]
    units: tuple[str | None, ...]
    header: int = 1
    twice: tuple[str, ...] = ()
    unnamed: tuple[str, ...] = ()
    notes: list[str] = field(default_factory=list)
    delimiter: str = ","
    body: bytes = b""
    first: int = 2

    def read(
        self,
        *,
        numbers: frozenset[str],
        text: frozenset[str],
        clocks: frozenset[str],
        decimal: str | None,
        faults: list[InputError],
    ) -> tuple[Table, frozenset[str], frozenset[str]]:
        """Read the cells.

        Parameters
        ----------
        numbers, text, clocks, decimal
            As of `numerals.read_numbers`.
        faults
            Cells that are no numbers, and other faults that leave a table to look at, are added to it.

        Returns
        -------
        table, percent, dated
            The table, and names of the columns whose cells end in a per cent sign, and of those with dates.

        Raises
        ------
        InputError
            Rows and header differ in their number of cells, or there is no row.
        """
        if self.source.name.lower().endswith(".parquet"):
            table = from_parquet(self.source, numbers, text)
            return with_rows(table), frozenset(), frozenset()
        body, rows, left_out = self._body()
        first = self.first

        def number(row: int) -> int:
            return row + first if rows is None else int(rows[row])

        delimiter = "\t" if self.delimiter == BLANKS else self.delimiter
        cells, problems = csv_rows(self.source, body, self.names, number=number, delimiter=delimiter)
        trimmed = {name: pc.utf8_trim_whitespace(cells[name]) for name in self.names}  # pyright: ignore[reportAttributeAccessIssue]
        read = partial(numerals.read_numbers, wanted=numbers, text=text, clocks=clocks, decimal=decimal)
        found = read(trimmed)
        heads = headings(list(trimmed.values()))
        trials = np.flatnonzero(~heads)
        for row in np.flatnonzero(heads).tolist():
            if len(trials) and trials[0] < row < trials[-1]:
                text, expected = (
                    trimmed[self.names[0]][row].as_py(),
                    "a column that names each row's block, such as soil",
                )
                place = f"row {number(row)}"
                faults.append(InputError(self.source, f"{text!r} heads a block", expected=expected, place=place))
        if (none := self._no_trials(trimmed, found, numbers)).any():
            kept, leaving = np.flatnonzero(~none), [number(row) for row in np.flatnonzero(none).tolist()]
            said = ", ".join(map(str, leaving[:_MOST_SAID])) + " ..." * (len(leaving) > _MOST_SAID)
            left_out.append(f"rows of means, sums, extremes or remarks left out: {said}")
            rows = np.array([number(row) for row in kept.tolist()])
            trimmed = {name: column.take(pa.array(kept)) for name, column in trimmed.items()}
            found = read(trimmed)
        self.notes.extend([*left_out, *found.notes])
        for bad in found.bad:
            more = f" and {bad.count - 1} more rows" if bad.count > 1 else ""
            place = f"row {number(bad.row)}, column {bad.column}"
            faults.append(InputError(self.source, f"{bad.text!r}{more}", expected=bad.expected, place=place))
        for name in self.unnamed:
            values, words = found.numbers.pop(name, np.empty(0)), found.text.pop(name, np.empty(0))
            if np.isfinite(values).any() or any(words):
                self.notes.append(f"{name} has no name, left out")
        rows = None if rows is None else rows[: len(trimmed[self.names[0]])]
        table = with_rows(Table(found.numbers, found.text, self.source, self.first, problems, rows))
        return table, frozenset(found.percent), frozenset(found.dated)

    def _no_trials(
        self, cells: dict[str, pa.ChunkedArray], found: numerals.Numbers, numbers: frozenset[str]
    ) -> np.ndarray:
        """Find rows, (n,) of bool, that are statistics of others, or remarks."""
        wrong = {bad.column for bad in found.bad}
        words = [cells[name] for name in self.names if name in found.text or name in wrong]
        none = summaries(words, len(cells[self.names[0]])) | headings(list(cells.values()))
        if wrong:
            none |= words_only([cells[name] for name in self.names if name in numbers])
        elif numbers and not none.any():
            none |= unnamed_means(
                [found.numbers[name] for name in self.names if name in numbers], gaps(list(cells.values()))
            )
        return none

    def _body(self) -> tuple[bytes, np.ndarray | None, list[str]]:
        """Give the rows without what is none, their numbers in the file where rows were left out, and what was."""
        body, delimiter = self.body, self.delimiter.encode()
        if delimiter == b" ":
            lines = [b"\t".join(line.split()) for line in body.split(b"\n")]
            body, delimiter = b"\n".join(lines), b"\t"
        text = body.rstrip(b"\n")
        marks = set(b"\n#%/! \t" + delimiter + self.names[0][:1].encode())
        if marks.isdisjoint(_first_bytes(text)):
            return body, None, []
        lines = text.split(b"\n")
        if any(line.count(b'"') % 2 for line in lines):
            return body, None, []  # cells of several lines
        kinds = [self._kind(line.decode(), delimiter.decode()) for line in lines]
        kept = np.array([kind == "" for kind in kinds])
        counts = {kind: kinds.count(kind) for kind in dict.fromkeys(kinds) if kind}
        end = b"\n" if body.endswith(b"\n") else b""
        rows = np.flatnonzero(kept) + self.first
        left_out = [f"{count} {kind}{'s' * (count > 1)} left out" for kind, count in counts.items()]
        if not left_out:
            return body, None, []
        return b"\n".join(line for line, keep in zip(lines, kept, strict=True) if keep) + end, rows, left_out

    def _kind(self, line: str, delimiter: str) -> str:
        """Say what a line is that is no row: empty, a remark, the header again; ``""`` of a row."""
        if not line.strip(f" \t{delimiter}"):
            return "empty row"
        if not (is_comment(line) or line.startswith(self.names[0]) or not is_number(line[:1])):
            return ""
        cells = split(line, delimiter)
        if is_comment(line) and len(cells) != len(self.names):
            return "remark"
        if any(map(is_number, cells)):
            return ""
        same = sum(cell == name for cell, name in zip(cells, self.names, strict=False))
        if same > len(self.names) / 2:
            return "repeated header"
        return "repeated row of units" if self.units and any(self.units) and is_unit_row(cells) else ""


def _first_bytes(text: bytes) -> set[int]:
    """Give the bytes that lines begin with."""
    codes = np.frombuffer(text, dtype=np.uint8)
    after = codes[1:][codes[:-1] == ord("\n")]
    return {*text[:1], *np.flatnonzero(np.bincount(after, minlength=1)).tolist()}


def open_sheet(path: Path, is_known: Callable[[str], bool], *, own: frozenset[str], sheet: str | None = None) -> Sheet:
    """Open a wheel table and read its header.

    Parameters
    ----------
    path
        A file with one of `ENDINGS`.
    is_known
        Says whether a cell is the name of a column that means something.
    own
        Names of the wheel file's own columns: a first row that has one is the header.
    sheet
        Name of a workbook's sheet; the only one with a header where absent.

    Raises
    ------
    InputError
        The file is missing, empty, too large, or no table.
    """
    if not path.name.lower().endswith(ENDINGS):
        raise InputError(
            path, f"a file of kind {path.suffix!r}", expected="a .csv, .csv.gz, .tsv, .txt, .parquet or .xlsx file"
        )
    file_size(path, "a table file")
    if path.name.lower().endswith(".parquet"):
        return _named(path, parquet_names(path), None)
    if path.suffix.lower() in (".xlsx", ".xlsm"):
        from .workbook import workbook_text

        content, notes = workbook_text(path, is_known, sheet)
    else:
        content, notes = _text(path)
    beginning = content[:_BEGINNING].decode("utf-8", errors="ignore")
    turned = upright(beginning, is_known) if len(content) <= _BEGINNING else None
    if turned is not None:
        content, beginning = turned.encode(), turned
        notes = [*notes, "names stand in the first column: what is a row below is a column of the file"]
    layout = _own_layout(beginning, own) or find_layout(beginning, is_known)
    if layout is None:
        first = beginning.split("\n", 1)[0]
        if not first.strip():
            raise InputError(path, "an empty line", expected="column names", place="row 1")
        names = split(first, ",")
        if all(map(is_number, names)):
            raise InputError(path, f"no header: {first[:60]!r}", expected="a row of column names", place="row 1")
        layout = Layout(",", tuple(names), None, 1, 2, ())
    body = content
    for _ in range(layout.first - 1):
        body = body.partition(b"\n")[2]
    named = _named(path, layout.names, layout.units, header=layout.header)
    notes = [*notes, *layout.notes]
    return replace(named, notes=notes, delimiter=layout.delimiter, body=body, first=layout.first)


def _own_layout(beginning: str, own: frozenset[str]) -> Layout | None:
    """Take the first row for the header of a table in commas, if it has one of our own names and no row of units."""
    first, _, rest = beginning.partition("\n")
    names = split(first, ",")
    below = split(rest.partition("\n")[0], ",")
    if first.count('"') % 2 or own.isdisjoint(names) or is_unit_row(below) or len(below) == len(names) + 1:
        return None
    return Layout(",", tuple(names), None, 1, 2, ())


def _named(
    path: Path, names_in_header: Sequence[str], units: tuple[str | None, ...] | None, *, header: int = 1
) -> Sheet:
    """Give each column a name of its own."""
    names: list[str] = []
    twice: list[str] = []
    unnamed: list[str] = []
    for place, name in enumerate(names_in_header):
        if not name:
            if place and any(names_in_header[place:]):
                problem = f"column {place + 1} has no name"
                expected = "each column's name in that row alone, one a column"
                raise InputError(path, problem, expected=expected, place=f"row {header}")
            name = f"column {place + 1}"
            unnamed.append(name)
        if len(name) > _LONGEST:
            problem = f"a name of {len(name)} characters, {name[:20]!r} ..."
            raise InputError(path, problem, expected=f"at most {_LONGEST}", place=f"row {header}, column {place + 1}")
        if name in names_in_header[:place]:
            twice.append(name)
            name = f"{name} ({list(names_in_header[: place + 1]).count(name)})"
        names.append(name)
    return Sheet(path, tuple(names), units or (None,) * len(names), header, tuple(dict.fromkeys(twice)), tuple(unnamed))


def _text(path: Path) -> tuple[bytes, list[str]]:
    """Read a file's text as UTF-8, its lines ended by line feeds, and say in which encoding it was."""
    data, notes = read_bytes(path), []
    if not data.strip():
        raise InputError(path, "an empty file", expected="a header and rows")
    mark, encoding = next(((mark, name) for mark, name in _BOMS if data.startswith(mark)), (b"", "utf-8"))
    if encoding == "utf-8" and b"\0" in data:
        raise InputError(path, "binary data", expected="a table of text")
    try:
        text = data.decode(encoding).removeprefix("\ufeff")
        notes += [] if encoding == "utf-8" else [f"text in {encoding.upper()}"]
    except UnicodeDecodeError as error:
        text = data.decode("cp1252", errors="replace")
        if encoding != "utf-8" or _CONTROL.search(text) or "\ufffd" in text:
            problem = f"byte {error.start} is not {encoding.upper()} text"
            raise InputError(path, problem, expected="a table of text in UTF-8 or Windows-1252") from error
        notes.append(f"byte {error.start} is not UTF-8 text: read as Windows-1252 (Latin-1)")
    if not text.strip():
        raise InputError(path, "an empty file", expected="a header and rows")
    content = data[len(mark) :] if encoding == "utf-8" and not notes else text.encode()
    return content.replace(b"\r\n", b"\n").replace(b"\r", b"\n") if b"\r" in content else content, notes
