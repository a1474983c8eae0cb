"""`bevameter run`: recordings in, a filled terrain database out."""

from __future__ import annotations

import sys
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ..core.errors import BevameterError, InputError
from .options import Database, Heading, OffsetPlace, OriginPlace, Topics, stated_frame

if TYPE_CHECKING:
    from collections.abc import Iterator

    from distributed import Client

    from ..batch import Outcome


def command(
    recordings: Annotated[
        list[Path],
        typer.Argument(
            metavar="RECORDING...", help="Recordings: each a folder, a wheel file, a ROS bag or an MCAP file."
        ),
    ],
    db: Database,
    vehicle: Annotated[
        Path | None, typer.Option("--vehicle", help="vehicle.toml, instead of the recordings' own.")
    ] = None,
    topics: Topics = None,
    models: Annotated[
        list[str] | None,
        typer.Option(
            "--models",
            help="Folder with vision.skops, audio.skops ..., or the name of a model that comes with the package "
            "(bevameter models); may be repeated. Default: NAME.models next to NAME.db, else the package's own.",
        ),
    ] = None,
    site: Annotated[str | None, typer.Option("--site", help="Site, instead of the recordings' own.")] = None,
    origin: OriginPlace = None,
    heading: Heading = None,
    offset: OffsetPlace = None,
    ground: Annotated[
        str | None,
        typer.Option("--ground", metavar="CLASS", help="Class of the ground of the whole recording, if you know it."),
    ] = None,
    json: Annotated[Path | None, typer.Option("--json", help="Write the summary as JSON.")] = None,
    report: Annotated[
        Path | None, typer.Option("--report", help="Write what was found of one recording as an HTML page.")
    ] = None,
    rerun: Annotated[
        Path | None,
        typer.Option(
            "--rerun", metavar="FILE.rrd", help="Write one recording and what was found for the Rerun viewer."
        ),
    ] = None,
    workers: Annotated[
        int | None, typer.Option("--workers", min=1, help="Recordings at once, each in a process of its own; 1.")
    ] = None,
    dask: Annotated[
        str | None,
        typer.Option("--dask", metavar="ADDRESS", help="Scheduler of a Dask cluster that processes the recordings."),
    ] = None,
) -> None:
    """Recognise the ground of recordings, identify its soil, store both, and print a summary."""
    from ..core.files import check_outputs

    check_outputs([json, report, rerun], [*recordings, vehicle, topics])
    for option, given in (("--report", report), ("--rerun", rerun)):
        if given is not None and (len(recordings) > 1 or dask is not None):
            raise InputError(option, f"{len(recordings)} recordings", expected="one recording, on this machine")
    if workers is not None and dask is not None:
        raise InputError("--workers", f"{workers}, and --dask, too", expected="one of them")
    stated = stated_frame(site, origin, heading, offset) | {"ground": ground}
    if len(recordings) == 1 and dask is None:
        _run_one(recordings[0], db, vehicle, topics, models, stated, json, report, rerun)
    else:
        _run_several(recordings, db, vehicle, topics, models, stated, json, workers or 1, dask)


def _run_one(
    recording: Path, db: str, vehicle: Path | None, topics: Path | None, models: list[str] | None,
    stated: dict[str, Any], json: Path | None, report: Path | None, rerun: Path | None,
) -> None:  # fmt: skip
    from ..core.recording.readers import read_recording
    from .printing import progress_bars, status, write_json
    from .results_run import print_summary

    if rerun is not None:
        from ..rerun_stream import check_rerun

        check_rerun(rerun)
    with progress_bars() as progress:
        progress("reading", 0.0)
        drive = read_recording(recording, vehicle=vehicle, topics=topics)
        # Loaded after the recording was read: what cannot be read is refused without waiting for the classifiers.
        from ..traverse import run_traverse

        summary = run_traverse(drive, db, models=models, progress=progress, **stated)
    if json is not None:
        write_json(summary.as_dict(), json)
    try:
        if report is not None:
            from ..summary_page import write_report

            with status(f"drawing {report}"):
                write_report(summary, drive, report)
        if rerun is not None:
            from ..rerun_log import write_rerun

            with status(f"writing {rerun}"):
                write_rerun(summary, drive, rerun, models=models)
    finally:
        # What was stored is said, too, where a file could not be written.
        print_summary(summary)


def _run_several(
    recordings: list[Path], db: str, vehicle: Path | None, topics: Path | None, models: list[str] | None,
    stated: dict[str, Any], json: Path | None, workers: int, dask: str | None,
) -> None:  # fmt: skip
    """Run over recordings; raises `BevameterError` in the end where one of them failed."""
    from ..batch import FailedRecording, run_traverses
    from .printing import progress_bars, write_json
    from .results_run import print_outcomes

    stored = 0

    def finished(outcome: Outcome) -> None:
        nonlocal stored
        if isinstance(outcome, FailedRecording):
            print(f"bevameter: {outcome.problem}", file=sys.stderr)
        else:
            stored += 1

    try:
        with _client(dask) as client, progress_bars() as progress:
            outcomes = run_traverses(
                recordings, db, vehicle=vehicle, topics=topics, models=models, workers=workers, client=client,
                progress=progress, finished=finished, **stated,
            )  # fmt: skip
    except KeyboardInterrupt:
        print(
            f"bevameter: {stored} of {len(recordings)} recordings are stored; the same command processes the rest",
            file=sys.stderr,
        )
        raise
    if json is not None:
        write_json({"schema": 1, "recordings": [outcome.as_dict() for outcome in outcomes]}, json)
    print_outcomes(outcomes)
    if stored < len(outcomes):
        raise BevameterError(f"{len(outcomes) - stored} of {len(outcomes)} recordings failed")


@contextmanager
def _client(dask: str | None) -> Iterator[Client | None]:
    """Connect to a cluster where one is named."""
    if dask is None:
        yield None
        return
    from ..workers import connect

    with connect(dask) as client:
        yield client
