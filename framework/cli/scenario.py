"""`bevameter scenario`: a synthetic traverse, written as a recording with its ground truth."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer


def command(
    name: Annotated[str | None, typer.Argument(metavar="NAME", help="Which traverse; --list names them.")] = None,
    out: Annotated[Path | None, typer.Argument(metavar="OUT", help="Folder to write, new or empty.")] = None,
    seed: Annotated[int, typer.Option("--seed", min=0, help="Seed of everything random.")] = 0,
    duration: Annotated[
        float | None, typer.Option("--duration", help="Duration [s]; default: that of the traverse.")
    ] = None,
    list_them: Annotated[bool, typer.Option("--list", help="List the traverses and exit.")] = False,
) -> None:
    """Write the traverse, or list what there is."""
    from ..core.errors import InputError
    from ..scenario.presets import PRESETS

    if list_them:
        from .printing import print_table

        rows = [(key, f"{one.duration_s:g} s", one.about) for key, one in PRESETS.items()]
        print_table(("name", "duration", "about"), rows)
        return
    if name is None or out is None:
        missing = "NAME and OUT" if name is None else "OUT"
        raise InputError("scenario", f"{missing} missing", expected="bevameter scenario NAME OUT, or --list")
    from ..scenario.write import write_scenario
    from .printing import progress_bars

    with progress_bars() as progress:
        folder = write_scenario(name, out, seed=seed, duration_s=duration, progress=progress)
    print(f"wrote {folder}: scenario {name}, seed {seed}; the truth is in truth.json and labels.csv")
