"""`bevameter train`: a classifier from labelled files."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

SENSE = "vision|audio|vibration"
"""The package's own senses; others may be registered (`framework.senses`)."""


def command(
    sense: Annotated[str, typer.Argument(metavar=SENSE, help="Which sense to train.")],
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
    backbone: Annotated[
        Path | None,
        typer.Option(
            "--backbone",
            help="ONNX file of an image network, for vision: its features stand beside the built-in ones. "
            "NAME.toml next to NAME.onnx states size_px, colour_order, mean, sd.",
        ),
    ] = None,
    seed: Annotated[int, typer.Option("--seed", min=0, help="Seed of everything random.")] = 0,
) -> None:
    """Train, test on groups that were held out, and write the model."""
    from ..core.classifier.report import report_html
    from ..core.files import check_outputs, write_text
    from ..senses import sense_named, train_sense
    from .printing import status, write_json
    from .results import print_report

    sense_named(sense)
    check_outputs([out, json, report], [labelled, backbone])
    with status(f"training {sense} on {labelled}"):
        outcome = train_sense(sense, labelled, seed=seed, backbone=backbone)
    outcome.classifier.save(out)
    if json is not None:
        origin = {"model": str(out), "version": outcome.classifier.version, "seed": seed}
        write_json({"schema": 1, **origin, **outcome.report}, json)
    if report is not None:
        write_text(report_html(outcome.report), report)
    print_report(outcome.report, str(out))
