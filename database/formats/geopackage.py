"""Ground cells as polygons in a GeoPackage; needs pyogrio and shapely (the extra `geo`)."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from ...framework.core.arguments import path_of
from ...framework.core.errors import InputError
from ...framework.core.files import whole
from ..exporters import RASTER, Exporter, Request, register
from ..georeference import Origin, geographic_library
from ..grid import Grid
from .gridmap import describe

LAYER = "ground"
"""Name of the layer in the GeoPackage."""

_WHOLE = ("class_index", "known", "observation_count", "extrapolated")
"""Layers that are whole numbers."""

_NEVER_NAN = ("known", "observation_count")
"""Layers that say by 0 that nothing is known."""


@register
class GeoPackage(Exporter):
    """A polygon a cell, its layers as fields."""

    name = "gpkg"
    endings = (".gpkg",)
    holds = "a GeoPackage with a polygon a cell; needs --origin"
    settings = (*RASTER, "origin")

    def write(self, request: Request, out: Path) -> None:
        """Write the layers requested."""
        write_geopackage(request.grid(), out, request.stated("origin"))


def write_geopackage(grid: Grid, path: str | Path, origin: Origin) -> None:
    """Write the cells of a raster of which anything is known, in the local map projection of a site's origin.

    Parameters
    ----------
    grid
        The raster. Its layers become fields, unknown is null; with `class_index` there is the field ``class``, too.
        What else the numbers mean is JSON in the layer's metadata ``bevameter``.
    path
        The file.
    origin
        Where the site lies.

    Raises
    ------
    InputError
        pyogrio or shapely is not installed, nothing is known of any cell, or a file that cannot be written.
    """
    path = path_of("path", path, "the path of a .gpkg file")
    pyogrio, shapely = geographic_library("pyogrio"), geographic_library("shapely")
    rows, columns = np.nonzero(_informative(grid))
    if not len(rows):
        raise InputError("grid", "nothing is known of any of its cells", expected="bounds with ground that was seen")
    corners = np.array([[0, 0], [1, 0], [1, 1], [0, 1], [0, 0]])
    places = (np.stack([columns, rows], axis=1)[:, None, :] + corners) * grid.resolution + grid.origin
    geometry = shapely.to_wkb(shapely.polygons(origin.to_local(places)))
    names, values, missing = _fields(grid, rows, columns)
    with whole(path) as part:
        pyogrio.raw.write(
            part, geometry=geometry, field_data=values, fields=names, field_mask=missing, layer=LAYER, driver="GPKG",
            geometry_type="Polygon", crs=origin.crs, layer_metadata={"bevameter": json.dumps(describe(grid))},
        )  # fmt: skip


def _informative(grid: Grid) -> np.ndarray:
    """(h, w) bool: does any layer say something?"""
    return np.any(
        [layer > 0 if name in _NEVER_NAN else np.isfinite(layer) for name, layer in grid.layers.items()], axis=0
    )


def _fields(
    grid: Grid, rows: np.ndarray, columns: np.ndarray
) -> tuple[list[str], list[np.ndarray], list[np.ndarray | None]]:
    """Names, values (n,) and where these are null, (n,), of the fields."""
    names: list[str] = []
    fields: list[np.ndarray] = []
    masks: list[np.ndarray | None] = []
    for name, layer in grid.layers.items():
        values = layer[rows, columns]
        null = np.isnan(values)
        names.append(name)
        fields.append(np.where(null, 0, values).astype(np.int32) if name in _WHOLE else values)
        masks.append(null)
        if name == "class_index":
            labels = np.array([*grid.class_names, None], dtype=object)
            names.append("class")
            fields.append(labels[np.where(null, -1, values).astype(int)])
            masks.append(null)
    return names, fields, masks
