"""`bevameter view`: a local web page on a terrain database."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ..core.errors import InputError


def command(
    db: Annotated[
        str, typer.Argument(metavar="DB", help="Path or SQLAlchemy URL of the terrain database.")
    ] = "sqlite:///terrain.db",
    site: Annotated[str | None, typer.Option("--site", help="The site that is shown first.")] = None,
    vehicle: Annotated[
        Path | None, typer.Option("--vehicle", help="vehicle.toml of a vehicle whose speed is to be limited.")
    ] = None,
    recordings: Annotated[
        Path | None,
        typer.Option(
            "--recordings", metavar="FOLDER", help="Where the drives' recordings lie, for tracks, frames and sound."
        ),
    ] = None,
    port: Annotated[int, typer.Option("--port", min=0, max=65535, help="Port; 0 for any free one.")] = 5006,
    address: Annotated[
        str,
        typer.Option(
            "--address",
            help="Address to listen on, such as 0.0.0.0 in a container. Anybody who reaches it can read all.",
        ),
    ] = "127.0.0.1",
    browser: Annotated[bool, typer.Option("--browser/--no-browser", help="Open the page in a browser.")] = True,
) -> None:
    """Show maps, classes, drives and explanations in a browser on this machine until Ctrl-C; nothing is written."""
    try:
        from ..view.start import serve
    except ModuleNotFoundError as missing:
        if missing.name is None or missing.name.partition(".")[0] not in ("bokeh", "datashader", "jinja2", "tornado"):
            raise
        raise InputError("view", f"{missing.name} is not installed", expected='pip install "bevameter[view]"') from None
    serve(db, site=site, vehicle=vehicle, recordings=recordings, port=port, address=address, show=browser, say=print)
