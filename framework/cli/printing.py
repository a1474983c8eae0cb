"""What the commands share in showing progress and results and in writing files whole or not at all."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, Progress, TaskID, TaskProgressColumn, TextColumn, TimeElapsedColumn

from ..core.files import check_outputs as check_outputs
from ..core.files import write_text as write_text
from .output import console_of_results, print_table


def out() -> Console:
    """Give the console for results; wide where nobody is watching, so that no line is broken in a file."""
    return console_of_results(160)


@contextmanager
def status(text: str) -> Iterator[Callable[[str], None]]:
    """Show on stderr that work is going on, and what at present once told; nothing where stderr is no terminal."""
    with Console(stderr=True).status(escape(text)) as shown:
        yield lambda doing: shown.update(escape(f"{text}: {doing}"))


def print_rows(headers: Sequence[str], rows: Sequence[Sequence[str]], title: str | None = None) -> None:
    """Print rows of text under their headers; nothing where there are no rows."""
    if rows:
        if title is not None:
            print(title)
        print_table([dict(zip(headers, row, strict=True)) for row in rows], "")


def write_json(page: Any, path: Path) -> None:
    """Write JSON whole or not at all; what is not finite becomes null, since JSON knows no NaN."""
    write_text(json.dumps(_jsonable(page), indent=1, ensure_ascii=False, allow_nan=False) + "\n", path)


def _jsonable(value: Any) -> Any:
    if isinstance(value, dict):
        return {str(key): _jsonable(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [_jsonable(entry) for entry in value]
    if isinstance(value, np.ndarray):
        return _jsonable(value.tolist())
    if isinstance(value, np.generic):
        return _jsonable(value.item())
    if isinstance(value, float) and not np.isfinite(value):
        return None
    if isinstance(value, Path):
        return str(value)
    return value


@contextmanager
def progress_bars() -> Iterator[Callable[[str, float], None]]:
    """Show on stderr how far each stage has come; the stages are named as they begin, nothing where nobody watches."""
    console = Console(stderr=True)
    with Progress(
        TextColumn("{task.description:<22}"), BarColumn(), TaskProgressColumn(), TimeElapsedColumn(),
        console=console, transient=True, disable=not console.is_terminal,
    ) as bars:  # fmt: skip
        tasks: dict[str, TaskID] = {}

        def tell(stage: str, share: float) -> None:
            if stage not in tasks:
                tasks[stage] = bars.add_task(stage, total=1.0)
            bars.update(tasks[stage], completed=share)

        yield tell
