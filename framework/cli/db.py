"""`bevameter db`: look after a terrain database."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Annotated, Any

import typer

from ..core.errors import InputError
from . import export
from .printing import FORMATS, check_format, counted, print_csv, print_json, progress_bars

_FORMATS = [known for known in FORMATS if known != "geojson"]
_FAULT_COLUMNS = ("table", "id", "problem")

UNSOUND = 1
"""Exit status of `check` where something is wrong."""

app = typer.Typer(no_args_is_help=True, add_completion=False, rich_markup_mode=None)

Db = Annotated[str, typer.Argument(metavar="DB", help="Path or SQLAlchemy URL of the terrain database.")]
Format = Annotated[str, typer.Option("--format", help=" | ".join(_FORMATS))]


def _print(
    format: str, page: dict[str, Any], rows: tuple[Sequence[dict[str, Any]], Sequence[str]], table: Callable[[], None]
) -> None:
    """Print an answer as JSON, as CSV of rows and their columns, or as people read it."""
    if format == "json":
        print_json({"schema": 1, **page})
    elif format == "csv":
        print_csv(*rows)
    else:
        table()


@app.command("info", help="What a database holds: sites, drives, classes.")
def info(db: Db, format: Format = "table") -> None:
    """Print one row a site."""
    check_format(format, _FORMATS)
    from ...database.info import info as describe
    from .results_database import print_info, sites_as_rows

    found = describe(db)
    _print(format, found.as_dict(), sites_as_rows(found), lambda: print_info(found))


@app.command("check", help="Whether every row is sound; exit status 1 if not.")
def check(db: Db, format: Format = "table") -> None:
    """Print one line a fault."""
    check_format(format, _FORMATS)
    from ...database.check import check as find_faults
    from .results_database import print_check

    with progress_bars() as progress:
        report = find_faults(db, progress=progress)
    faults = [fault.as_dict() for fault in report.faults]
    page = {"sound": report.sound, "rows": dict(report.rows), "faults": faults}
    _print(format, page, (faults, _FAULT_COLUMNS), lambda: print_check(faults, report.rows))
    if not report.sound:
        raise typer.Exit(UNSOUND)


@app.command("merge", help="Add all that other databases hold.")
def merge(
    db: Annotated[str, typer.Argument(metavar="DB", help="Path or SQLAlchemy URL; made where there is none.")],
    others: Annotated[
        list[str],
        typer.Argument(metavar="OTHER...", help="Paths or URLs; only older schemas are changed."),
    ],
) -> None:
    """Merge, and print what was new."""
    from ...database.store import TerrainDatabase

    for other in others:  # all of them, before anything is written
        TerrainDatabase(other, must_exist=True).close()
    with TerrainDatabase(db) as target:
        for other in others:
            with TerrainDatabase(other, must_exist=True) as source, progress_bars() as progress:
                added = target.merge(source, progress=progress)
                print(f"{source.name}: {counted(added.new, 'observation')} added, {added.known} known already")


Server = Annotated[str, typer.Argument(metavar="SERVER", help="SQLAlchemy URL of the fleet's database.")]
Sites = Annotated[list[str] | None, typer.Option("--site", help="Only of this site; repeat for several.")]


@app.command("push", help="Send the fleet's server what a vehicle has learnt.")
def push(db: Db, server: Server, site: Sites = None) -> None:
    """Merge the vehicle's database into the server's."""
    if "://" not in server:  # a mistyped URL would become a file
        raise InputError("SERVER", f"{server!r}", expected="a URL such as postgresql://rover@server/fleet")
    _bring(db, server, site)


@app.command("pull", help="Fetch what the fleet has learnt from its server.")
def pull(
    db: Annotated[str, typer.Argument(metavar="DB", help="Path or SQLAlchemy URL; made where there is none.")],
    server: Server,
    site: Sites = None,
) -> None:
    """Merge the server's database into the vehicle's."""
    _bring(server, db, site)


def _bring(origin: str, destination: str, sites: list[str] | None) -> None:
    from ...database.store import TerrainDatabase

    with TerrainDatabase(origin, must_exist=True) as source:
        for site in sites or ():  # before anything is written
            source.check_site(site)
        with TerrainDatabase(destination) as target, progress_bars() as progress:
            added = target.merge(source, sites=sites, progress=progress)
        print(f"{target.name}: {counted(added.new, 'observation')} added, {added.known} known already")


app.command("export", help="Write what is known of a site for other programs.")(export.command)


@app.command("prune", help="Remove what newer processings have replaced.")
def prune(
    db: Db,
    yes: Annotated[bool, typer.Option("--yes", help="Remove; else only say what would be removed.")] = False,
    format: Format = "table",
) -> None:
    """Print one row a drive and one a physics, and remove them where that is said."""
    check_format(format, _FORMATS)
    from ...database.maintenance import prune as remove
    from ...database.maintenance import superseded
    from ...database.store import TerrainDatabase
    from .results_database import PRUNED_COLUMNS, print_pruned

    with TerrainDatabase(db, must_exist=True) as database:
        rows = (remove(database) if yes else superseded(database)).rows()
    page = {"removed": yes, "rows": rows}
    _print(format, page, (rows, PRUNED_COLUMNS), lambda: print_pruned(rows, removed=yes))


@app.command("rebuild", help="Write the sound rows of a damaged file into a new one.")
def rebuild(
    db: Annotated[str, typer.Argument(metavar="DB", help="The damaged SQLite file; it is not changed.")],
    new: Annotated[Path, typer.Argument(metavar="NEW", help="The file to write.")],
    format: Format = "table",
) -> None:
    """Print one line a fault, and what the new file holds."""
    check_format(format, _FORMATS)
    from ...database.rebuild import rebuild as write_sound_rows
    from .results_database import print_rebuilt

    with progress_bars() as progress:
        rebuilt = write_sound_rows(db, new, progress=progress)
    faults = [fault.as_dict() for fault in rebuilt.faults]
    page = {"rows": dict(rebuilt.rows), "faults": faults}
    _print(format, page, (faults, _FAULT_COLUMNS), lambda: print_rebuilt(faults, rebuilt.rows, new))


@app.command("migrate", help="Bring the schema to the newest.")
def migrate(db: Db) -> None:
    """Print from which schema to which, and where the copy is."""
    from ...database.maintenance import migrate as bring_up_to_date

    done = bring_up_to_date(db)
    if done.spatial_index_added:
        print("spatial index added")
    if done.before == done.after and not done.spatial_index_added:
        print(f"schema {done.after}, the newest: nothing to do")
    elif done.before != done.after:
        copy = "" if done.copy is None else f"; as it was before: {done.copy}"
        print(f"migrated from schema {done.before} to {done.after}{copy}")
