"""`bevameter classify`: the terrain class of files, with its probability or the reason why there is none."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from .train import Modality


def command(
    modality: Annotated[
        Modality, typer.Argument(metavar="vision|audio|vibration", help="Which sense the files are for.")
    ],
    files: Annotated[list[Path], typer.Argument(metavar="FILES", help="Images, sounds, or vibration CSV files.")],
    model: Annotated[Path, typer.Option("--model", help="A model that `bevameter train` wrote.")],
    json: Annotated[Path | None, typer.Option("--json", help="Write the answers as JSON.")] = None,
) -> None:
    """Classify each file, window by window where it is long."""
    from ..training import classify_files
    from .printing import check_outputs, print_rows, write_json

    check_outputs([json], [*files, model])
    rows = classify_files(modality.value, files, model)
    if json is not None:
        write_json({"schema": 1, "modality": modality.value, "model": str(model), "rows": rows}, json)
    print_rows(
        ["file", "from s", "to s", "class", "probability", "quality", "why not"],
        [
            [
                str(row["file"]),
                _seconds(row.get("start_s")),
                _seconds(row.get("end_s")),
                row["class"],
                "" if row["unknown"] else f"{row['probabilities'][row['class']]:.2f}",
                f"{row['quality']:.2f}",
                ", ".join(row["reasons"]),
            ]
            for row in rows
        ],
    )


def _seconds(value: float | None) -> str:
    return "" if value is None else f"{value:.2f}"
