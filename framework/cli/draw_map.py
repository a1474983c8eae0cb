"""`bevameter map`: a picture of what the terrain database knows."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from .options import Database, Site


def command(
    out: Annotated[Path, typer.Option("--out", help="The picture: .png, .svg or .pdf.")],
    db: Database = "sqlite:///terrain.db",
    site: Site = None,
    track: Annotated[
        list[Path] | None, typer.Option("--track", help="A recording whose way is drawn on top; may be repeated.")
    ] = None,
) -> None:
    """Draw the ground by class, the more probable the more opaque, and the soil where the wheels measured it."""
    from ...database.store import TerrainDatabase
    from ..core.files import check_outputs
    from ..core.recording.readers import read_recording
    from ..map import draw_map

    check_outputs([out], track or [])
    recordings = [read_recording(path) for path in track or []]
    with TerrainDatabase(db, must_exist=True) as database:
        draw_map(database, out, site=site, tracks=recordings)
    print(f"map written to {out}")
