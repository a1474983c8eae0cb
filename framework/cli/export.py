"""`bevameter db export`: what the terrain database knows, for other programs."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from .options import STRESS, Confidence, Site, Stress, finite, open_snapshot, pascals, quantity, stated_origin


def command(
    db: Annotated[str, typer.Argument(metavar="DB", help="Terrain database: a path or an SQLAlchemy URL.")],
    out: Annotated[
        Path,
        typer.Argument(
            metavar="OUT",
            help="The file: .parquet, .csv, .geojson, .yaml, .mcap, .tif, .gpkg, .json; no ending for a ROS 2 bag.",
        ),
    ],
    form: Annotated[
        str | None,
        typer.Option(
            "--as",
            help="parquet | csv | geojson | nav2 | gridmap | geotiff | gpkg | scm; by the file's ending where absent.",
        ),
    ] = None,
    layer: Annotated[
        list[str] | None, typer.Option("--layer", help="A layer, all where absent; may be repeated.")
    ] = None,
    bounds: Annotated[
        tuple[str, str, str, str] | None,
        typer.Option("--bounds", metavar="X0 Y0 X1 Y1", help="Corners [m]; all ground that was seen where absent."),
    ] = None,
    resolution: Annotated[
        str | None, typer.Option("--resolution", help="Edge of a cell [m]; that of the database where absent.")
    ] = None,
    site: Site = None,
    normal_stress: Stress = STRESS,
    confidence: Confidence = 0.95,
    required_strength: Annotated[
        str | None, typer.Option("--required-strength", help='nav2: shear strength needed, such as "8 kPa".')
    ] = None,
    origin: Annotated[
        tuple[str, str] | None,
        typer.Option(
            "--origin",
            metavar="LAT LON",
            help="geotiff, gpkg: where x = y = 0 lies, WGS 84 [deg]; as the database has it.",
        ),
    ] = None,
    heading: Annotated[
        str | None, typer.Option("--heading", help="With --origin: direction of y, clockwise from north [deg].")
    ] = None,
    wheel_width: Annotated[
        str | None, typer.Option("--wheel-width", help="scm: width of the wheels that measured the soil [m].")
    ] = None,
    elastic_stiffness: Annotated[
        str | None, typer.Option("--elastic-stiffness", help='scm: of unloading, such as "4e7 Pa/m".')
    ] = None,
    damping: Annotated[str | None, typer.Option("--damping", help='scm: of the soil, such as "3e4 Pa*s/m".')] = None,
) -> None:
    """Write a raster of the ground, or the soils of its classes, in the format of the file's ending."""
    from ...database.exporters import Request, export
    from ..core.files import check_outputs

    check_outputs([out], [Path(db)])

    def read(name: str, text: str | None, unit: str, example: str) -> float | None:
        return None if text is None else quantity(name, text, unit, example)

    request = Request(
        open_snapshot(db, site),
        bounds=None if bounds is None else [finite("--bounds", text) for text in bounds],
        resolution=read("--resolution", resolution, "m", 'a length such as "0.25 m"'),
        layers=layer,
        normal_stress=pascals("--normal-stress", normal_stress),
        confidence=confidence,
        required_strength_Pa=read("--required-strength", required_strength, "Pa", 'a pressure such as "8 kPa"'),
        origin=stated_origin(origin, heading),
        wheel_width_m=read("--wheel-width", wheel_width, "m", 'a length such as "0.12 m"'),
        elastic_stiffness_Pa_m=read("--elastic-stiffness", elastic_stiffness, "Pa/m", 'such as "4e7 Pa/m"'),
        damping_Pa_s_m=read("--damping", damping, "Pa*s/m", 'such as "3e4 Pa*s/m"'),
    )
    written = export(request, out, form)
    print(f"written to {' and '.join(map(str, written))}")
