"""`bevameter classify`: the terrain class of files, with its probability or the reason why there is none."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from .train import SENSE


def command(
    sense: Annotated[str, typer.Argument(metavar=SENSE, help="Which sense the files are for.")],
    files: Annotated[list[Path], typer.Argument(metavar="FILES", help="Images, sounds, or vibration CSV files.")],
    model: Annotated[
        str,
        typer.Option(
            "--model",
            help="A model that `bevameter train` wrote, or the name of one of the package (bevameter models).",
        ),
    ],
    json: Annotated[Path | None, typer.Option("--json", help="Write the answers as JSON.")] = None,
) -> None:
    """Classify each file, window by window where it is long."""
    from ..core.files import check_outputs
    from ..senses import classify_files
    from .printing import write_json
    from .results import print_classified

    check_outputs([json], [*files, Path(model)])
    rows = classify_files(sense, files, model)
    if json is not None:
        write_json({"schema": 1, "modality": sense, "model": model, "rows": rows}, json)
    print_classified(rows)
