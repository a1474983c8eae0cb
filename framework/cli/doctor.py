"""`bevameter doctor`: whether the installation, the models and a terrain database are in order."""

from __future__ import annotations

from contextlib import nullcontext
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from .printing import counted, progress_bars

if TYPE_CHECKING:
    from ..doctor import Diagnosis

NEEDS_ATTENTION = 1
"""Exit status where something is not in order."""


def command(
    db: Annotated[
        str | None, typer.Argument(metavar="DB", help="Path or SQLAlchemy URL of a terrain database to check, too.")
    ] = None,
    json: Annotated[Path | None, typer.Option("--json", help="Write what was found as JSON.")] = None,
) -> None:
    """Print whether anything needs attention, and what was looked at; exit status 1 if something does."""
    from ..core.files import check_outputs
    from .printing import write_json

    check_outputs([json], [None if db is None else Path(db)])
    try:
        from ..doctor import diagnose
    except ModuleNotFoundError as missing:  # `packaging`, which reads the requirements
        name = str(missing.name).partition(".")[0]
        print(f"1 thing needs attention\n  dependency {name}: is not installed\n    python -m pip install {name}")
        raise typer.Exit(NEEDS_ATTENTION) from None
    # Progress is shown by rich, which may be what is not there.
    with progress_bars() if find_spec("rich") else nullcontext() as progress:
        found = diagnose(db, progress=progress)
    if json is not None:
        write_json({"schema": 1, **found.as_dict()}, json)
    _print(found)
    if found.problems:
        raise typer.Exit(NEEDS_ATTENTION)


def _print(found: Diagnosis) -> None:
    """Print the answer, what needs attention, and a table; without rich, too."""
    lacking = [check.name for check in found.checks if check.subject == "extra" and check.found != "complete"]
    if found.problems:
        number = len(found.problems)
        print(f"{counted(number, 'thing')} {'needs' if number == 1 else 'need'} attention")
        for check in found.problems:
            print(f"  {check.subject} {check.name}: {check.problem}\n    {check.remedy}")
    else:
        without = f"; extras that are not installed: {', '.join(lacking)}" if lacking else ""
        print(f"everything that the base needs works{without}")
    print()
    rows = [("", "", "found", "required", "to do")]
    for check in found.checks:
        to_do = "see above" if check.problem else check.remedy
        rows.append((check.subject, check.name, check.found, check.required, to_do))
    widths = [min(max(len(row[column]) for row in rows), 60) for column in range(len(rows[0]))]
    for row in rows:
        print("  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip())
