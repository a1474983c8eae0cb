"""How commands print: tables, CSV and JSON on stdout, progress on stderr, files whole or not at all.

What they print is in `results`. Nothing heavy is imported here: `rich` comes with the first table.
"""

from __future__ import annotations

import json
import math
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..core.errors import InputError

if TYPE_CHECKING:
    from rich.console import Console

FORMATS = ("table", "json", "csv", "geojson")
"""What ``--format`` takes."""

_TABLE_WIDTH, _TEXT_WIDTH = 400, 160
"""Columns where stdout is no terminal: no line of a file is to be broken."""


def check_format(name: str, allowed: Sequence[str] = FORMATS) -> str:
    """Give the format back; raises `InputError` where there is no such format."""
    if name not in allowed:
        raise InputError("--format", f"{name!r}", expected=" or ".join(allowed))
    return name


def console(width: int = _TEXT_WIDTH) -> Console:
    """Give the console for results; `width` columns wide where stdout is no terminal."""
    from rich.console import Console

    class Results(Console):
        def on_broken_pipe(self) -> None:
            """Leave it to the command line (`main`) what is done where the reader is gone."""
            raise

    usual = Results(highlight=False)
    return usual if usual.is_terminal else Results(highlight=False, width=width)


def print_table(
    headers: Sequence[str], rows: Sequence[Sequence[str]], *, title: str | None = None, empty: str | None = None
) -> None:
    """Print rows of text under their headers; where there are none the line `empty`, or nothing."""
    if not rows:
        if empty is not None:
            print(empty)
        return
    from rich.table import Table
    from rich.text import Text

    if title is not None:
        print(title)
    table = Table(box=None, pad_edge=False, header_style="bold")
    for name in headers:
        table.add_column(Text(name), overflow="fold")
    for row in rows:
        table.add_row(*map(Text, row))
    console(_TABLE_WIDTH).print(table)


def counted(number: int, what: str) -> str:
    """Give a number of things, in the singular where it is one."""
    return f"{number} {what}{'s' * (number != 1)}"


def print_line(markup: str) -> None:
    """Print one line of rich's markup; it is broken nowhere."""
    console().print(markup, soft_wrap=True)


def print_csv(rows: Sequence[dict[str, Any]], columns: Sequence[str] | None = None) -> None:
    """Print rows as CSV under a header, cells empty where a row has no value.

    Columns are those given, and else those of the rows in the order in which they first appear.
    """
    from ..core.files import write_csv

    if columns is None:
        columns = list(dict.fromkeys(name for row in rows for name in row))
    write_csv(rows, columns, sys.stdout)


def print_json(page: Any) -> None:
    """Print JSON on one page; NaN is a fault of the caller (`ValueError`), for JSON knows none."""
    print(json.dumps(page, ensure_ascii=False, allow_nan=False, indent=1))


def write_json(page: Any, path: Path) -> None:
    """Write JSON whole or not at all; what is not finite becomes null, since JSON knows no NaN."""
    from ..core.files import write_text

    write_text(json.dumps(_jsonable(page), indent=1, ensure_ascii=False, allow_nan=False) + "\n", path)


def _jsonable(value: Any) -> Any:
    if isinstance(value, dict):
        return {str(key): _jsonable(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [_jsonable(entry) for entry in value]
    if hasattr(value, "tolist"):  # an array or a number of numpy's
        return _jsonable(value.tolist())
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return str(value) if isinstance(value, Path) else value


class _Progress:
    """How progress is shown: on a terminal as it comes, elsewhere as a line every `every_s` seconds; or not at all; or
    as a line for each stage that is done, with the time that it took.
    """

    quiet = False
    verbose = False
    every_s = 10.0


def show_progress(*, quiet: bool = False, verbose: bool = False) -> None:
    """Say how progress is shown from now on; results, warnings and errors are printed as ever."""
    if quiet and verbose:
        raise InputError("--verbose", "and --quiet, too", expected="one of them")
    _Progress.quiet, _Progress.verbose = quiet, verbose


@contextmanager
def _lines(current: Callable[[], str]) -> Iterator[None]:
    """Print to stderr, line by line, what is being done and for how long: for logs and pipes."""
    began = time.monotonic()

    def tell() -> None:
        print(f"{current()} ({time.monotonic() - began:.0f} s)", file=sys.stderr, flush=True)

    with every(_Progress.every_s, tell):
        yield


@contextmanager
def every(period_s: float, function: Callable[[], None]) -> Iterator[None]:
    """Call a function again and again, in a thread."""
    ended = threading.Event()

    def work() -> None:
        while not ended.wait(period_s):
            function()

    teller = threading.Thread(target=work, daemon=True)
    teller.start()
    try:
        yield
    finally:
        ended.set()
        teller.join()


@contextmanager
def _times(text: str = "") -> Iterator[Callable[[str, float], None]]:
    """Print to stderr how long each stage took, as its share reaches 1, and in the end how long all did."""
    began, running = time.monotonic(), dict[str, float]()

    def report(stage: str, share: float) -> None:
        start = running.setdefault(stage, time.monotonic())
        if share >= 1.0:
            del running[stage]
            print(f"{text}{stage}: {time.monotonic() - start:.1f} s", file=sys.stderr, flush=True)

    try:
        yield report
    finally:
        for stage in list(running):
            report(stage, 1.0)
        print(f"{text}{time.monotonic() - began:.1f} s in all", file=sys.stderr, flush=True)


@contextmanager
def status(text: str) -> Iterator[Callable[[str], None]]:
    """Show on stderr that work is going on, and what once it is reported."""
    if _Progress.quiet:
        yield lambda doing: None
    elif _Progress.verbose:
        with _times(f"{text}: ") as report:
            stages: list[str] = []

            def next_stage(now: str) -> None:
                if stages:
                    report(stages.pop(), 1.0)
                stages.append(now)
                report(now, 0.0)

            yield next_stage
    elif sys.stderr.isatty():
        from rich.console import Console
        from rich.markup import escape

        with Console(stderr=True).status(escape(text)) as shown:
            yield lambda doing: shown.update(escape(f"{text}: {doing}"))
    else:
        doing = [text]
        with _lines(lambda: doing[0]):
            yield lambda now: doing.__setitem__(0, f"{text}: {now}")


@contextmanager
def progress_bars() -> Iterator[Callable[[str, float], None]]:
    """Show the progress of each stage on stderr, named as it begins."""
    if _Progress.quiet:
        yield lambda stage, share: None
    elif _Progress.verbose:
        with _times() as report:
            yield report
    elif sys.stderr.isatty():
        with _bars() as report:
            yield report
    else:
        doing = ["starting"]
        with _lines(lambda: doing[0]):
            yield lambda stage, share: doing.__setitem__(0, f"{stage} {share:.0%}")


@contextmanager
def _bars() -> Iterator[Callable[[str, float], None]]:
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TaskID, TaskProgressColumn, TextColumn, TimeElapsedColumn

    with Progress(
        TextColumn("{task.description:<22}"), BarColumn(), TaskProgressColumn(), TimeElapsedColumn(),
        console=Console(stderr=True), transient=True,
    ) as bars:  # fmt: skip
        tasks: dict[str, TaskID] = {}

        def report(stage: str, share: float) -> None:
            if stage not in tasks:
                tasks[stage] = bars.add_task(stage, total=1.0)
            bars.update(tasks[stage], completed=share)

        yield report
