"""What several commands share: their options, numbers and quantities as people write them, and the snapshot."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ..core.errors import InputError
from ..core.quantities import magnitude

if TYPE_CHECKING:
    from ...database.snapshot import Snapshot
    from ..core.origin import Offset, Origin

COLUMNS = "TOML map from a wheel table's columns to channels, where names and units do not identify them."
TOPICS = (
    "TOML map from a bag's topics to streams, or from a wheel table's columns to channels, where names do not identify "
    "them."
)

RecordingPath = Annotated[
    Path, typer.Argument(metavar="RECORDING", help="A recording (folder, bag, MCAP) or a wheel file.")
]
VehicleFile = Annotated[Path | None, typer.Option("--vehicle", help="Vehicle TOML; the recording's own where absent.")]
Topics = Annotated[Path | None, typer.Option("--topics", "--columns", help=TOPICS)]
Database = Annotated[str, typer.Option("--db", help="Terrain database: a path or an SQLAlchemy URL.")]
Site = Annotated[str | None, typer.Option("--site", help="Which site, where the database holds several.")]
Confidence = Annotated[float, typer.Option("--confidence", help="Of the lower bounds, at least 0.5, less than 1.")]
Stress = Annotated[str, typer.Option("--normal-stress", help='Where shear strength is wanted, such as "20 kPa".')]
STRESS = "20 kPa"

From = Annotated[float | None, typer.Option("--from", metavar="S", help="Use wheel rows from this time on [s].")]
To = Annotated[float | None, typer.Option("--to", metavar="S", help="Use wheel rows up to this time [s].")]
On = Annotated[
    str | None,
    typer.Option("--on", metavar="CLASS", help="Use wheel rows on this class of ground: by labels, map or senses."),
]
Wheels = Annotated[
    list[str] | None, typer.Option("--wheel", metavar="NAME", help="Use rows of this wheel; may be repeated.")
]
OriginPlace = Annotated[
    tuple[str, str] | None,
    typer.Option("--origin", metavar="LAT LON", help="Where on Earth x = y = 0 of the places lies, WGS 84 [deg]."),
]
Heading = Annotated[
    str | None, typer.Option("--heading", help="With --origin: direction of y, clockwise from north [deg]; 0.")
]
OffsetPlace = Annotated[
    tuple[str, str, str] | None,
    typer.Option(
        "--offset",
        metavar="X Y YAW",
        help="Where x = y = 0 of the places lies at the site [m], and how x is turned there [deg].",
    ),
]


def finite(name: str, text: str, unit: str = "m") -> float:
    """Read a number without a unit; raises `InputError`."""
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise InputError(name, f"{text!r}", expected=f"a finite number [{unit}]")
    return value


def stated_origin(place: tuple[str, str] | None, heading: str | None) -> Origin | None:
    """Read what `--origin` and `--heading` state; raises `InputError`."""
    from ..core.origin import Origin

    if place is None:
        if heading is not None:
            raise InputError("--heading", "stated without --origin", expected="both")
        return None
    latitude, longitude = (finite("--origin", text, "deg") for text in place)
    return Origin(latitude, longitude, finite("--heading", heading or "0", "deg"))


def stated_frame(
    site: str | None, origin: tuple[str, str] | None, heading: str | None, offset: tuple[str, str, str] | None
) -> dict[str, Any]:
    """Read what `--site`, `--origin`, `--heading` and `--offset` state, by their names in Python."""
    return {"site": site, "origin": stated_origin(origin, heading), "offset": stated_offset(offset)}


def stated_offset(given: tuple[str, str, str] | None) -> Offset | None:
    """Read what `--offset` states; raises `InputError`."""
    from ..core.origin import Offset

    if given is None:
        return None
    x_m, y_m, yaw_deg = (finite("--offset", text) for text in given)
    return Offset(x_m, y_m, math.radians(yaw_deg))


def quantity(name: str, text: str, unit: str, example: str) -> float:
    """Read a quantity that is not negative; a bare number is in `unit`. Raises `InputError`, which gives the example.

    Examples
    --------
    >>> quantity("--normal-stress", "20 kPa", "Pa", 'a pressure such as "20 kPa"')
    20000.0
    """
    try:
        value = magnitude(text, unit)
    except ValueError as error:
        raise InputError(name, f"{text!r}", expected=example) from error
    if not (math.isfinite(value) and value >= 0):
        raise InputError(name, f"{text!r}", expected=f"{example}, finite and not negative")
    return value


def pascals(name: str, text: str) -> float:
    """Read a pressure."""
    return quantity(name, text, "Pa", 'a pressure such as "20 kPa"')


def open_snapshot(db: str, site: str | None, bounds: Sequence[float] | None = None) -> Snapshot:
    """Give what a database that exists knows of a site, or of the ground there between corners x0, y0, x1, y1 [m]."""
    from ...database.store import TerrainDatabase

    with TerrainDatabase(db, must_exist=True) as database:
        return database.snapshot(site, bounds=bounds)
