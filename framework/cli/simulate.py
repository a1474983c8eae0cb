"""`bevameter simulate`: what a wheel would sense on a known soil."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from .options import COLUMNS


def command(
    drive: Annotated[
        Path, typer.Argument(metavar="DRIVE", help="Wheel file with load_N and slip (or the two speeds).")
    ],
    vehicle: Annotated[Path, typer.Option("--vehicle", help="Vehicle TOML.")],
    soil: Annotated[Path, typer.Option("--soil", help="Soil TOML with c_Pa, phi_deg, k_m, stiffness_Pa and n.")],
    out: Annotated[Path, typer.Option("--out", help="Wheel file to write: CSV, or Parquet by its ending.")],
    columns: Annotated[Path | None, typer.Option("--columns", help=COLUMNS)] = None,
    effect: Annotated[
        list[str] | None,
        typer.Option(
            "--effect",
            metavar="SLUG:NAME=VALUE,...",
            help="Beyond the textbook wheel, such as slip_sinkage:n1=0.2 (docs/effects.md); repeatable.",
        ),
    ] = None,
) -> None:
    """Add torque, sinkage and drawbar pull to a drive."""
    from ...identification.simulate import notes, simulate
    from ..core.files import check_outputs
    from ..core.recording.wheel_file import read_wheel, write_wheel_file
    from ..core.vehicle import load_vehicle

    check_outputs([out], [drive, vehicle, columns, soil])
    driven, effects = load_vehicle(vehicle), tuple(effect or ())
    given, problems, converted = read_wheel(drive, columns)
    table = simulate(driven, soil, given, effects)
    write_wheel_file(table, out)
    print(f"{len(table)} rows written to {out}")
    for note in (*converted, *problems, *notes(driven, table, effects)):
        print(f"note: {note}")
