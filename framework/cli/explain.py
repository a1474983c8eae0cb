"""`bevameter explain`: why simulation and recording differ."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from .options import From, On, RecordingPath, To, Topics, VehicleFile, Wheels


def command(
    recording: RecordingPath,
    vehicle: VehicleFile = None,
    topics: Topics = None,
    soil: Annotated[
        Path | None,
        typer.Option("--soil", help="TOML file of soil parameters known from elsewhere, with standard deviations."),
    ] = None,
    simulated: Annotated[
        Path | None, typer.Option("--simulated", help="Another simulator's wheel file for the same drive.")
    ] = None,
    from_s: From = None,
    to_s: To = None,
    on: On = None,
    wheels: Wheels = None,
    json: Annotated[Path | None, typer.Option("--json", help="Write the answer as JSON.")] = None,
    report: Annotated[Path | None, typer.Option("--report", help="Write the answer as an HTML page.")] = None,
    seed: Annotated[
        int,
        typer.Option("--seed", min=0, help="Seed of the intervals' resampling and of the sound's surrogates."),
    ] = 0,
    db: Annotated[
        str | None,
        typer.Option("--db", help="Terrain database: read for classes of ground, and what is found is stored in it."),
    ] = None,
    class_name: Annotated[
        str | None,
        typer.Option("--class", help="Class to store it with, if neither recording nor database gives it; see --on."),
    ] = None,
) -> None:
    """Say what the simulation of a recorded wheel lacks, how probable that is, and what modelling it gains."""
    from ..core.files import check_outputs
    from ..core.recording.readers import read_recording
    from ..explain import check_store, explain, store
    from .printing import status, write_json
    from .results import print_explanation

    check_outputs([json, report], [recording, vehicle, topics, soil, simulated])
    check_store(db, class_name, recording)
    with status(f"explaining {recording}") as progress:
        # A bag may complete the vehicle; without a map `explain` opens the path itself.
        opened = recording if topics is None else read_recording(recording, vehicle=vehicle, topics=topics)
        described = vehicle if topics is None else None
        answer = explain(
            opened, vehicle=described, soil=soil, simulated=simulated, seed=seed, from_s=from_s, to_s=to_s, on=on,
            wheels=wheels or (), database=db, progress=progress,
        )  # fmt: skip
    if json is not None:
        write_json(answer.to_json(), json)
    if report is not None:
        from ...identification.explain.report.page import write_report

        with status(f"drawing {report}"):
            write_report(answer, report)
    print_explanation(answer)
    if db is not None and (answer.verdict in ("physics", "instrument") or class_name is not None):
        names = store(answer, db, class_name)
        print(
            f"stored in {db} with {', '.join(names)}" if names else "not stored: it acts on one wheel or in single runs"
        )
