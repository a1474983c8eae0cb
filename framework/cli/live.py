"""`bevameter live`: an MCAP file that is being written, or standard input, into a terrain database while it grows."""

from __future__ import annotations

import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from .options import TOPICS, Database, Heading, OffsetPlace, OriginPlace, stated_frame

if TYPE_CHECKING:
    from types import FrameType

    import numpy as np

    from ..live.following import Following
    from ..live.live import LiveTraverse

_STATUS_S = 0.5


def command(
    mcap: Annotated[
        str, typer.Option("--mcap", metavar="FILE|-", help="MCAP file that is being written, or - for standard input.")
    ],
    db: Database,
    vehicle: Annotated[
        Path | None, typer.Option("--vehicle", help="vehicle.toml, instead of the one next to the file.")
    ] = None,
    topics: Annotated[Path | None, typer.Option("--topics", help=TOPICS)] = None,
    models: Annotated[list[str] | None, typer.Option("--models", help="As of bevameter run; may be repeated.")] = None,
    site: Annotated[str | None, typer.Option("--site", help="Site, instead of the file's own.")] = None,
    origin: OriginPlace = None,
    heading: Heading = None,
    offset: OffsetPlace = None,
    idle: Annotated[
        float | None,
        typer.Option("--idle", metavar="S", min=0.0, help="End where nothing was written for so long [s]; never."),
    ] = None,
    resume: Annotated[
        Path | None, typer.Option("--resume", metavar="JOURNAL", help="Go on with a drive that was cut off.")
    ] = None,
    rerun: Annotated[
        str | None,
        typer.Option(
            "--rerun",
            metavar="FILE|URL",
            help="Show the drive in a Rerun viewer (rerun+http://HOST:9876/proxy), or write a .rrd file.",
        ),
    ] = None,
    json: Annotated[Path | None, typer.Option("--json", help="Write the summary as JSON.")] = None,
) -> None:
    """Follow a drive that is being recorded: tell changes of the ground as they come, and store it at its end."""
    from ..core.files import check_outputs
    from .printing import status

    file = None if mcap == "-" else Path(mcap)
    check_outputs([json], [file, vehicle, topics, resume])
    frame = stated_frame(site, origin, heading, offset)
    if rerun is not None:
        from ..rerun_stream import check_rerun

        check_rerun(rerun)
    with status(f"waiting for {mcap}"):
        from ..live.following import Following

        following = Following(file, vehicle=vehicle, topics=topics, idle_s=float("inf") if idle is None else idle)
    with status(f"beginning {following.source.path}"):
        live = following.begin(db, models=models, resume=resume, **frame)
    _follow(following, live, rerun, json)


def _follow(following: Following, live: LiveTraverse, rerun: str | None, json: Path | None) -> None:
    """Hand over the file up to its end, or until Ctrl-C or SIGTERM, and store the drive."""
    from ..core.errors import BevameterError
    from .printing import every, status, write_json
    from .results_live import print_beginning, print_event, print_unstored, status_line
    from .results_run import print_summary

    print_beginning(following)
    out = None if sys.stdout.isatty() else sys.stdout  # a status on a terminal takes all that is printed for it
    live.subscribe(lambda event: print_event(event, out))
    try:
        with _stopping(following) as signals:
            with (
                _shown(live, rerun) as show,
                status(f"following {following.source.path}") as say,
                every(_STATUS_S, lambda: say(status_line(live, following))),
            ):
                following.hand_over(live, show)
            with status("identifying the soil, and storing the drive"):
                summary = following.close(live)
    except (KeyboardInterrupt, BevameterError):
        live.__exit__(KeyboardInterrupt, None, None)
        print_unstored(live, following)
        raise
    if json is not None:
        write_json(summary.as_dict(), json)
    print_summary(summary)
    if signals:
        if not following.is_whole:
            print("warning: `bevameter run` on the whole file would store this part of the drive once more")
        raise typer.Exit(128 + signals[0])


@contextmanager
def _shown(live: LiveTraverse, to: str | None) -> Iterator[Callable[[float, np.ndarray], None] | None]:
    """Show the drive in the Rerun viewer; give what is called with each image."""
    if to is None:
        yield None
        return
    from ..rerun_live import RerunLive

    with RerunLive(live, to) as view:
        yield view.image
    if view.fault:
        print(f"warning: {to}: {view.fault}")


@contextmanager
def _stopping(following: Following) -> Iterator[list[int]]:
    """Take the first Ctrl-C or SIGTERM as the end of the file; the second one interrupts. Give those that came."""
    came: list[int] = []

    def stop(number: int, frame: FrameType | None) -> None:
        came.append(number)
        following.source.stop()
        if len(came) > 1:
            raise KeyboardInterrupt

    before = {each: signal.signal(each, stop) for each in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield came
    finally:
        for each, handler in before.items():
            signal.signal(each, handler)
