"""`bevameter train`: a classifier from labelled files."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer


class Modality(StrEnum):
    """What a classifier is trained on."""

    VISION = "vision"
    AUDIO = "audio"
    VIBRATION = "vibration"


def command(
    modality: Annotated[Modality, typer.Argument(metavar="vision|audio|vibration", help="Which sense to train.")],
    labelled: Annotated[
        Path,
        typer.Argument(
            metavar="LABELLED",
            help="Folder with index.csv (file, class, group[, start_s, end_s]) or with sub-folders named by class.",
        ),
    ],
    out: Annotated[Path, typer.Option("--out", help="Where to write the model.")],
    json: Annotated[Path | None, typer.Option("--json", help="Write the report as JSON.")] = None,
    report: Annotated[Path | None, typer.Option("--report", help="Write the report as an HTML page.")] = None,
    seed: Annotated[int, typer.Option("--seed", min=0, help="Seed of everything random.")] = 0,
) -> None:
    """Train, test on groups that were held out, and write the model."""
    from ..core.classifier.report import report_html
    from ..training import train_from_folder
    from .printing import check_outputs, status, write_json, write_text
    from .training_report import print_report

    check_outputs([out, json, report], [labelled])
    with status(f"training {modality.value} on {labelled}"):
        outcome = train_from_folder(modality.value, labelled, seed=seed)
    outcome.classifier.save(out)
    if json is not None:
        origin = {"model": str(out), "version": outcome.classifier.version, "seed": seed}
        write_json({"schema": 1, **origin, **outcome.report}, json)
    if report is not None:
        write_text(report_html(outcome.report), report)
    print_report(outcome.report, str(out))
