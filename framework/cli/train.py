"""`bevameter train`: a classifier from labelled files."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from ..core.classifier.classifier import TrainingOutcome

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
    out: Annotated[
        Path, typer.Option("--out", help="Where to write the model; its folder is made where it is not there.")
    ],
    json: Annotated[Path | None, typer.Option("--json", help="Write the report as JSON.")] = None,
    report: Annotated[
        Path | None,
        typer.Option(
            "--report",
            help="Write the report as an HTML page, with the worst mistakes and what more data would bring; "
            "training takes up to twice as long then.",
        ),
    ] = None,
    backbone: Annotated[
        Path | None,
        typer.Option(
            "--backbone",
            help="ONNX file of an image network, for vision: its features are used with the built-in ones. "
            "NAME.toml next to NAME.onnx states size_px, colour_order, mean, sd.",
        ),
    ] = None,
    seed: Annotated[int, typer.Option("--seed", min=0, help="Seed of everything random.")] = 0,
) -> None:
    """Train, test on groups that were held out, and write the model."""
    from ..core.files import check_outputs, write_text
    from ..senses import sense_named, train_sense
    from .printing import status, write_json
    from .results import print_report

    sense_named(sense)
    folder = None if out.parent.exists() else out.parent
    check_outputs([folder or out, json, report], [labelled, backbone])
    with status(f"training {sense} on {labelled}"):
        outcome = train_sense(sense, labelled, seed=seed, backbone=backbone)
    if folder is not None:
        folder.mkdir(exist_ok=True)
    outcome.classifier.save(out)
    if json is not None:
        origin = {"model": str(out), "version": outcome.classifier.version, "seed": seed}
        write_json({"schema": 1, **origin, **outcome.report}, json)
    if report is not None:
        write_text(_page(sense, outcome, seed), report)
    print_report(outcome.report, str(out))


def _page(sense: str, outcome: TrainingOutcome, seed: int) -> str:
    """The report as a page, with what takes a closer look."""
    import numpy as np

    from ..core.classifier.page import report_html
    from ..senses import sense_named
    from .printing import status

    material = outcome.material
    with status("measuring what more data would bring"):
        learning = material.learning_curve(np.random.default_rng(seed)) if material else None
    mistakes = material.mistakes(outcome.report["classes"]) if material else ()
    return report_html(outcome.report, learning=learning, mistakes=mistakes, excerpt=sense_named(sense).excerpt)
