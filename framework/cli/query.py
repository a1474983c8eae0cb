"""`bevameter query`: ask the terrain database from the command line."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ..core.errors import InputError
from .options import STRESS, Confidence, Site, Stress, finite, open_snapshot, pascals
from .printing import FORMATS, check_format, print_csv, print_json

if TYPE_CHECKING:
    import numpy as np

    from ...database.answer import GroundAnswer
    from ...database.snapshot import Snapshot

# Negative coordinates look like options: what is no option is left to be an argument.
_NUMBERS = {"ignore_unknown_options": True}

app = typer.Typer(no_args_is_help=True, add_completion=False, rich_markup_mode=None)

Db = Annotated[str, typer.Option("--db", help="Path or SQLAlchemy URL of the terrain database.")]
Format = Annotated[str, typer.Option("--format", help=" | ".join(FORMATS))]

_DB = "sqlite:///terrain.db"


@app.command("classes", help="What is known of every class.")
def classes(
    db: Db = _DB, site: Site = None, confidence: Confidence = 0.95, normal_stress: Stress = STRESS,
    format: Format = "table",
) -> None:  # fmt: skip
    """Print one row a class."""
    _print_classes("classes", None, db, site, confidence, normal_stress, format)


@app.command("class", help="What is known of one class.")
def one_class(
    name: Annotated[str, typer.Argument(metavar="NAME", help="The class.")],
    db: Db = _DB, site: Site = None, confidence: Confidence = 0.95, normal_stress: Stress = STRESS,
    format: Format = "table",
) -> None:  # fmt: skip
    """Print the row of one class."""
    _print_classes("class", name, db, site, confidence, normal_stress, format)


@app.command("at", help="What the ground at a place can bear.", context_settings=_NUMBERS)
def at(
    x: Annotated[str, typer.Argument(metavar="X", help="East [m].")],
    y: Annotated[str, typer.Argument(metavar="Y", help="North [m].")],
    db: Db = _DB, site: Site = None, confidence: Confidence = 0.95, normal_stress: Stress = STRESS,
    format: Format = "table",
) -> None:  # fmt: skip
    """Print the row of one place."""
    place = finite("X", x), finite("Y", y)
    _print_places(
        "at", lambda view, options: view.at(*place, **options), place * 2, db, site, confidence, normal_stress, format
    )


@app.command("along", help="What the ground along a path can bear.")
def along(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="CSV with columns x_m, y_m.")],
    db: Db = _DB, site: Site = None, confidence: Confidence = 0.95, normal_stress: Stress = STRESS,
    format: Format = "table",
) -> None:  # fmt: skip
    """Print one row a place of the path."""
    path = _read_path(file)
    bounds = (*path.min(axis=0), *path.max(axis=0)) if len(path) else None
    _print_places(
        "along", lambda view, options: view.along(path, **options), bounds, db, site, confidence, normal_stress, format
    )


@app.command("near", help="All cells that were seen near a place.", context_settings=_NUMBERS)
def near(
    x: Annotated[str, typer.Argument(metavar="X", help="East [m].")],
    y: Annotated[str, typer.Argument(metavar="Y", help="North [m].")],
    radius: Annotated[str, typer.Option("--radius", help="Radius around it [m].")],
    db: Db = _DB, site: Site = None, confidence: Confidence = 0.95, normal_stress: Stress = STRESS,
    format: Format = "table",
) -> None:  # fmt: skip
    """Print one row a cell."""
    east, north, reach = finite("X", x), finite("Y", y), finite("--radius", radius)
    far = abs(reach) + 1e-9  # cells that touch the circle belong to it
    _print_places(
        "near", lambda view, options: view.near(east, north, reach, **options),
        (east - far, north - far, east + far, north + far), db, site, confidence, normal_stress, format,
    )  # fmt: skip


def _print_places(
    query: str,
    ask: Callable[[Snapshot, dict[str, float]], GroundAnswer],
    bounds: Sequence[float] | None, db: str, site: str | None, confidence: float, normal_stress: str, form: str,
) -> None:  # fmt: skip
    check_format(form)
    stress = pascals("--normal-stress", normal_stress)
    view = open_snapshot(db, site, bounds)
    answer = ask(view, {"normal_stress": stress, "confidence": confidence})

    from ...database.exports import answer_rows, csv_columns, flat, geojson
    from .results import print_places

    rows = answer_rows(answer)
    if form == "json":
        print_json(_page(query, view, stress, confidence) | {"places": rows})
    elif form == "csv":
        print_csv([flat(row) for row in rows], csv_columns(view.class_names))
    elif form == "geojson":
        print_json(geojson(rows, view, view.cell_size_m if query == "near" else None))
    else:
        print_places(rows, stress, confidence)


def _print_classes(
    query: str, name: str | None, db: str, site: str | None, confidence: float, normal_stress: str, form: str
) -> None:
    check_format(form, [known for known in FORMATS if known != "geojson"])
    stress = pascals("--normal-stress", normal_stress)
    view = open_snapshot(db, site)

    from ...database.exports import class_rows, flat
    from .results import print_classes

    if name is not None:
        view.class_answer(name)  # finds out whether there is such a class
    rows = class_rows(view, normal_stress=stress, confidence=confidence)
    rows = [row for row in rows if name is None or row["class"] == name]
    if form == "json":
        print_json(_page(query, view, stress, confidence) | {"classes": rows})
    elif form == "csv":
        print_csv([flat(row) for row in rows])
    else:
        print_classes(rows, stress, confidence)


def _page(query: str, view: Snapshot, stress: float, confidence: float) -> dict[str, Any]:
    return {
        "schema": 1,
        "query": query,
        "site": view.site,
        "cell_size_m": view.cell_size_m,
        "normal_stress_Pa": stress,
        "confidence": confidence,
    }


def _read_path(file: Path) -> np.ndarray:
    """Read the places of a path, (n, 2) [m], as strictly as the tables of a recording."""
    import numpy as np

    from ..core.recording.tables import read_table

    names = ("x_m", "y_m")
    table = read_table(file, numbers=frozenset(names))
    if table.problems:
        raise InputError(
            file, "cut off in mid-row", expected="a whole row", place=f"row {len(table) + table.first_row}"
        )
    for name in names:
        if name not in table.numbers:
            found = ", ".join((*table.numbers, *table.text))
            raise InputError(file, f"no column {name}", expected=f"columns x_m, y_m, found {found[:200]}")
        strange = ~np.isfinite(table.numbers[name])
        if strange.any():
            row = int(np.argmax(strange))
            value = f"'{table.numbers[name][row]:g}'"
            raise InputError(file, value, expected="a finite number [m]", place=table.place(row, name))
    return np.column_stack([table.numbers[name] for name in names])
