"""`bevameter identify`: soil parameters from the wheel channels of a recording."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from shlex import quote
from typing import Annotated

import typer

from .options import From, On, RecordingPath, To, Topics, VehicleFile, Wheels

PICTURES = (".png", ".svg", ".pdf")
"""Endings that ``--plot`` takes."""


class Method(StrEnum):
    """How the soil is estimated."""

    ML = "ml"
    LINEAR = "linear"


def command(
    recording: RecordingPath,
    vehicle: VehicleFile = None,
    topics: Topics = None,
    soil: Annotated[Path | None, typer.Option("--soil", help="TOML of what is known of the soil already.")] = None,
    method: Annotated[
        Method, typer.Option("--method", help="ml: errors in all channels; linear: the paper's closed form.")
    ] = Method.ML,
    from_s: From = None,
    to_s: To = None,
    on: On = None,
    wheels: Wheels = None,
    db: Annotated[
        str | None, typer.Option("--db", help="Terrain database: read for where the ground is of the class --on.")
    ] = None,
    json: Annotated[Path | None, typer.Option("--json", help="Write the result as JSON.")] = None,
    report: Annotated[Path | None, typer.Option("--report", help="Write the result as an HTML page.")] = None,
    plot: Annotated[
        Path | None, typer.Option("--plot", help="Draw the estimates along the drive and the regions of c and phi.")
    ] = None,
) -> None:
    """Identify cohesion, friction angle, shear modulus, stiffness and sinkage exponent."""
    from ...identification.estimate.identify import identify
    from ...identification.estimate.report import identification_json
    from ..core.errors import InputError
    from ..core.files import check_outputs
    from ..core.findings import codes
    from ..core.recording.readers import read_recording
    from ..core.soil import load_soil
    from ..part import part_of
    from .printing import status, write_json
    from .results import print_identification

    check_outputs([json, plot, report], [recording, vehicle, topics, soil])
    if plot is not None and (method is not Method.ML or plot.suffix.lower() not in PICTURES):
        raise InputError("--plot", str(plot), expected="the method ml, and a file ending in " + ", ".join(PICTURES))
    with status(f"identifying the soil of {recording}") as progress:
        progress("reading the recording")
        opened = read_recording(recording, vehicle=vehicle, topics=topics)
        opened = part_of(opened, from_s=from_s, to_s=to_s, on=on, wheels=wheels or (), database=db)
        known = load_soil(soil) if soil is not None else None
        result = identify(opened, soil=known, method=method.value, progress=progress)
    if plot is not None:
        from ...identification.estimate.picture import draw_identification

        with status(f"drawing {plot}"):
            draw_identification(opened, result, plot, soil=known)
    if report is not None:
        from ...identification.estimate.page import write_report

        with status(f"drawing {report}"):
            write_report(opened, result, report, soil=known)
    if json is not None:
        write_json(identification_json(result), json)
    print_identification(result)
    given = {"--vehicle": vehicle, "--topics": topics}
    options = "".join(f" {name} {quote(str(each))}" for name, each in given.items() if each is not None)
    estimates = [result.overall, *result.by_soil.values()]
    if not any(segment.used for segment in result.segments):
        print(f"next: bevameter inspect {quote(str(recording))}{options} says what is missing, and what mends it")
    elif any("wrong_form" in codes(each.findings) for each in estimates if each is not None):
        print(f"next: bevameter explain {quote(str(recording))}{options} says what the simulated wheel lacks")
