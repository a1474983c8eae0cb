"""`bevameter run`: a recording in, a filled terrain database out."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from .options import TOPICS


def command(
    recording: Annotated[
        Path, typer.Argument(metavar="RECORDING", help="A recording's folder, wheel file, ROS bag or MCAP file.")
    ],
    db: Annotated[str, typer.Option("--db", help="Terrain database: a path or an SQLAlchemy URL.")],
    vehicle: Annotated[
        Path | None, typer.Option("--vehicle", help="vehicle.toml, instead of the recording's own.")
    ] = None,
    topics: Annotated[Path | None, typer.Option("--topics", "--columns", help=TOPICS)] = None,
    models: Annotated[
        Path | None,
        typer.Option(
            "--models",
            help="Folder with vision.skops, audio.skops ...; default: NAME.models next to NAME.db, else small "
            "models of synthetic ground.",
        ),
    ] = None,
    json: Annotated[Path | None, typer.Option("--json", help="Write the summary as JSON.")] = None,
) -> None:
    """Recognise the ground of a recording, identify its soil, store both, and print a summary."""
    from ..core.files import check_outputs
    from ..core.recording.readers import read_recording
    from .printing import progress_bars, write_json
    from .results import print_summary

    check_outputs([json], [recording, vehicle, topics])
    with progress_bars() as progress:
        drive = read_recording(recording, vehicle=vehicle, topics=topics)
        # Loaded after the recording was read: what cannot be read is refused without waiting for the classifiers.
        from ..traverse import run_traverse

        summary = run_traverse(drive, db, models=models, progress=progress)
    if json is not None:
        write_json(summary.as_dict(), json)
    print_summary(summary)
