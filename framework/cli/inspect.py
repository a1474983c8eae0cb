"""`bevameter inspect`: what is in a recording, and what it lacks."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from .options import Topics, VehicleFile

if TYPE_CHECKING:
    from collections.abc import Sequence

    from ..inspection import Inspection


def command(
    recording: Annotated[
        Path, typer.Argument(metavar="RECORDING", help="A folder, a wheel table, a ROS bag or an MCAP file.")
    ],
    vehicle: VehicleFile = None,
    topics: Topics = None,
    json: Annotated[Path | None, typer.Option("--json", help="Write the answer as JSON.")] = None,
    write: Annotated[
        bool,
        typer.Option("--write", help="Write a topic or column map and vehicle.toml to edit, next to the recording."),
    ] = False,
    into: Annotated[Path | None, typer.Option("--into", help="Folder to write them into instead.")] = None,
) -> None:
    """Say what is in a recording, what is read from it, and what it lacks for a class map, for soil, for explain."""
    from ..core.files import check_outputs
    from ..inspection import inspect_recording
    from .printing import status, write_json

    check_outputs([json], [recording, vehicle, topics])
    with status(f"inspecting {recording}"):
        found = inspect_recording(recording, vehicle=vehicle, topics=topics)
    written = found.write(into) if write or into is not None else ()
    if json is not None:
        write_json(found.as_dict(), json)
    _print(found)
    if write or into is not None:
        _print_written(found, written, vehicle, topics)


def _print(found: Inspection) -> None:
    """Print the answers first, then what is in the recording, then what to mind."""
    from .printing import print_table

    answers = {"class map": found.class_map, "soil (c, phi)": found.soil, "explain": found.explain}
    for name, answer in answers.items():
        print(f"{name}: {'yes' if answer.possible else 'no'}, {answer.because}")
    missing = dict.fromkeys(each for answer in answers.values() for each in answer.missing)
    heading = "missing" if found.contents.recording is not None else "fault"
    for each in missing:
        print(f"{heading}: {each.what}\n    {each.mend}")
    print()
    rows = [
        (each.name, each.kind.rsplit("/", 1)[-1], *map(_text, (each.n, each.rate_Hz, each.start_s, each.end_s)),
         each.feeds or "not used", each.remark)
        for each in found.contents.sources
    ]  # fmt: skip
    print_table(("name", "type", "n", "Hz", "from s", "to s", "feeds", "taken as, or why not"), rows)
    print()
    for note in found.notes:
        print(f"note: {note}")
    for problem in found.contents.problems:
        print(f"not usable: {problem}")


def _text(value: float | None) -> str:
    if value is None:
        return ""
    return str(value) if isinstance(value, int) else f"{value:.1f}"


def _print_written(found: Inspection, written: Sequence[Path], vehicle: Path | None, topics: Path | None) -> None:
    """Say what was written, and how to go on with it."""
    import shlex

    if not written:
        print("nothing to write: vehicle and map are there")
        return
    paths = {path.name: path for path in written}
    map_option = "--columns" if found.contents.map_name == "columns.toml" else "--topics"
    options = {map_option: paths.get(found.contents.map_name, topics), "--vehicle": paths.get("vehicle.toml", vehicle)}
    said = [part for name, path in options.items() if path is not None for part in (name, str(path))]
    print(f"wrote {', '.join(map(str, written))}: what is to be measured stands there in comments")
    print("then: " + shlex.join(["bevameter", "inspect", str(found.source), *said]))
