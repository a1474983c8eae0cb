"""Tables of measurements as files: what was measured, by which command, when, on which machine.

A study writes its table with `write`, the documentation shows it (`docs/measured_table.py`), and a test compares what
the pages quote with it. ``python tests/studies/measured.py BENCHMARKS.json`` makes the table of speeds from what
``pytest --benchmark-json`` wrote.
"""

from __future__ import annotations

import ast
import json
import os
import platform
import shlex
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
FOLDER = ROOT / "docs" / "measured"
NOT_RECORDED = "not recorded"


@dataclass(frozen=True)
class Measured:
    """A table with what it takes to judge it.

    Parameters
    ----------
    data
        What was measured on: simulated or real, and how many.
    command
        What makes the table anew.
    date
        Day of the measurement, ISO 8601.
    commit, machine
        `NOT_RECORDED` where nobody wrote it down; so is a `command` of which no script was kept.
    columns
        Headers, with units in brackets.
    rows
        Cells, as they are shown.
    """

    data: str
    command: str
    date: str
    commit: str
    machine: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]

    def __post_init__(self) -> None:
        if not all((self.data, self.command, self.date, self.commit, self.machine, self.rows)):
            raise ValueError("a table of measurements says of what, how, when and where it was made")
        if any(len(row) != len(self.columns) for row in self.rows):
            raise ValueError("a row with another number of cells than there are columns")

    def cell(self, row: str | tuple[str, ...], column: str) -> str:
        """Give the cell of the row that begins with a text or with several, in a column."""
        begin = (row,) if isinstance(row, str) else row
        (found,) = [each for each in self.rows if each[: len(begin)] == begin]
        return found[self.columns.index(column)]

    def markdown(self) -> str:
        """Lay the table out, and below it what was measured, when and where."""
        lines = [self.columns, tuple("---" for _ in self.columns), *self.rows]
        table = "\n".join("| " + " | ".join(line) + " |" for line in lines)
        made = "No command is kept." if self.command == NOT_RECORDED else f"Made by `{self.command}`."
        where = f"Commit: {self.commit}. Machine: {self.machine}. {made}"
        return f"{table}\n\n*{self.data}. Measured {self.date}.* {where}"


def read(name: str) -> Measured:
    """Read a table by its name."""
    text = json.loads((FOLDER / f"{name}.json").read_text(encoding="utf-8"))
    return Measured(**{**text, "columns": tuple(text["columns"]), "rows": tuple(map(tuple, text["rows"]))})


def write(
    name: str, columns: Sequence[str], rows: Sequence[Sequence[str]], *, data: str, command: str | None = None
) -> Path:
    """Write a table that was measured now, on this machine, at this commit, by default by the command that runs."""
    now = Measured(
        data, command or _command(), datetime.now(UTC).date().isoformat(), _commit(), _machine(), tuple(columns),
        tuple(map(tuple, rows)),
    )  # fmt: skip
    path = FOLDER / f"{name}.json"
    path.write_text(json.dumps(asdict(now), indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
    return path


def _command() -> str:
    """Give what this process was called with; of absolute paths the last part, as they differ between machines."""
    given = [Path(each).name if Path(each).is_absolute() else each for each in sys.argv[1:]]
    return shlex.join(["python", f"tests/studies/{Path(sys.argv[0]).name}", *given])


def _commit() -> str:
    done = subprocess.run(["git", "describe", "--always", "--dirty"], cwd=ROOT, capture_output=True, text=True)
    return done.stdout.strip() or NOT_RECORDED


def _machine() -> str:
    names = Path("/proc/cpuinfo")
    model = platform.processor() or platform.machine()
    if names.is_file():
        lines = [line.partition(":")[2].strip() for line in names.read_text().splitlines() if "model name" in line]
        model = lines[0] if lines else model
    load = f", load {os.getloadavg()[0]:.1f} at the end" if hasattr(os, "getloadavg") else ""
    return f"{os.cpu_count()} cores of {model}{load}"


def _speeds(file: Path) -> None:
    """Write the table of speeds from a file of pytest-benchmark."""
    text = json.loads(file.read_text(encoding="utf-8"))
    rows = [
        (_what(each), _time(each["stats"]["median"]), _time(each["stats"]["min"]), str(each["stats"]["rounds"]))
        for each in text["benchmarks"]
    ]
    print(write(
        "speed", ("what is timed", "median", "least", "rounds"), rows, data="Simulated",
        command="make benchmark",
    ))  # fmt: skip


def _what(benchmark: dict) -> str:
    """Give the first line of a benchmark's docstring, and its parameter."""
    file, _, name = benchmark["fullname"].partition("::")
    tree = ast.parse((ROOT / file).read_text(encoding="utf-8"))
    (test,) = [each for each in tree.body if isinstance(each, ast.FunctionDef) and each.name == name.partition("[")[0]]
    said = (ast.get_docstring(test) or test.name).splitlines()[0].rstrip(".")
    return f"{said} ({benchmark['param']})" if benchmark["param"] else said


def _time(seconds: float) -> str:
    for unit, scale in (("s", 1.0), ("ms", 1e-3), ("us", 1e-6)):
        if seconds >= scale:
            return f"{seconds / scale:.3g} {unit}"
    return f"{seconds * 1e9:.3g} ns"


if __name__ == "__main__":
    _speeds(Path(sys.argv[1]))
