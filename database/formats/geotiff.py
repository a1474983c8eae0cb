"""Rasters as GeoTIFF, a band a layer; needs rasterio (the extra `geo`)."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np

from ...framework.core.arguments import path_of
from ...framework.core.files import whole
from ..exporters import RASTER, Exporter, Request, register
from ..georeference import Origin, geographic_library
from ..grid import UNITS, Grid
from .gridmap import describe


@register
class GeoTiff(Exporter):
    """Bands named after the layers."""

    name = "geotiff"
    endings = (".tif", ".tiff")
    holds = "a GeoTIFF with a band a layer; needs --origin"
    settings = (*RASTER, "origin")

    def write(self, request: Request, out: Path) -> None:
        """Write the layers requested."""
        write_geotiff(request.grid(), out, request.stated("origin"))


def write_geotiff(grid: Grid, path: str | Path, origin: Origin) -> None:
    """Write a raster in the local map projection of a site's origin (`Origin.crs`).

    Parameters
    ----------
    grid
        The raster; layers become float32 bands with their names as descriptions and their units; unknown is NaN, the
        value for no data. What else the numbers mean is JSON in the tag ``bevameter``.
    path
        The file.
    origin
        Where the site lies. With a heading the raster is turned: its geotransform has terms of rotation.

    Raises
    ------
    InputError
        rasterio is not installed, or a file that cannot be written.
    """
    path = path_of("path", path, "the path of a .tif file")
    rasterio = geographic_library("rasterio")
    rows, columns = grid.shape
    with whole(path) as part, rasterio.open(
        part, "w", driver="GTiff", width=columns, height=rows, count=len(grid.layers), dtype="float32",
        crs=origin.crs, transform=rasterio.Affine(*_geotransform(grid, origin)), nodata=math.nan, compress="deflate",
    ) as file:  # fmt: skip
        for band, (name, layer) in enumerate(grid.layers.items(), 1):
            file.write(np.flipud(layer).astype(np.float32), band)
            file.set_band_description(band, name)
            file.set_band_unit(band, UNITS.get(name, ""))
        file.update_tags(bevameter=json.dumps(describe(grid), ensure_ascii=False))


def _geotransform(grid: Grid, origin: Origin) -> tuple[float, ...]:
    """Give the affine map a, b, c, d, e, f from (column, row from the north) to metres east and north of the origin."""
    r = grid.resolution
    north_west = grid.origin[0], grid.origin[1] + grid.shape[0] * r
    (a, d), (b, e), (c, f) = origin.to_local(np.array([(r, 0.0), (0.0, -r), north_west])).tolist()
    return a, b, c, d, e, f
