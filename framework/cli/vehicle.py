"""`bevameter vehicle`: vehicle files of common robots."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer


def command(
    name: Annotated[str | None, typer.Argument(metavar="NAME", help="Which robot; --list names them.")] = None,
    out: Annotated[
        Path | None, typer.Option("--out", help="File to write, which must not exist; else it is printed.")
    ] = None,
    list_them: Annotated[bool, typer.Option("--list", help="List the robots and exit.")] = False,
) -> None:
    """Print or write the vehicle file of a common robot, each number with its source, or list what there is."""
    from ..core.errors import InputError
    from ..core.vehicle_templates import vehicle_template, vehicle_templates

    if list_them:
        from .printing import print_table

        rows = [
            (one.name, one.robot, str(len(one.data["wheels"])), f"{one.data['wheels'][0]['radius_m']:g}",
             f"{one.data['wheels'][0].get('width_m', '')}", f"{one.data.get('mass_kg', '')}", ", ".join(one.left_out))
            for one in vehicle_templates().values()
        ]  # fmt: skip
        print_table(("name", "robot", "wheels", "radius m", "width m", "mass kg", "to be measured"), rows)
        return
    if name is None:
        raise InputError("vehicle", "NAME missing", expected="bevameter vehicle NAME, or --list")
    template = vehicle_template(name)
    if out is None:
        print(template.text, end="")
        return
    from ..core.files import write_new

    write_new(template.text, out)
    left_out = f"; to be measured: {', '.join(template.left_out)}" if template.left_out else ""
    print(f"wrote {out}{left_out}")
