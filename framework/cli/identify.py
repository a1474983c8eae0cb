"""`bevameter identify`: soil parameters from the wheel channels of a recording."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer


class Method(StrEnum):
    """How the soil is estimated."""

    ML = "ml"
    LINEAR = "linear"


def command(
    recording: Annotated[
        Path, typer.Argument(metavar="RECORDING", help="A recording (folder, bag, MCAP) or a wheel file.")
    ],
    vehicle: Annotated[
        Path | None, typer.Option("--vehicle", help="Vehicle TOML; the recording's own where absent.")
    ] = None,
    soil: Annotated[Path | None, typer.Option("--soil", help="TOML of what is known of the soil already.")] = None,
    method: Annotated[
        Method, typer.Option("--method", help="ml: errors in all channels; linear: the paper's closed form.")
    ] = Method.ML,
    json: Annotated[Path | None, typer.Option("--json", help="Write the result as JSON.")] = None,
) -> None:
    """Identify cohesion, friction angle, shear modulus, stiffness and sinkage exponent."""
    from ...identification.identify import identify
    from ...identification.report import identification_json
    from .identified import print_identification
    from .printing import check_writable, status, write_json

    if json is not None:
        check_writable(json)
    with status(f"identifying the soil of {recording}"):
        result = identify(recording, vehicle=vehicle, soil=soil, method=method.value)
    if json is not None:
        write_json(identification_json(result), json)
    print_identification(result)
