"""GeoTIFF and GeoPackage, read back by OpenCV, sqlite3 and GDAL; places checked against the ellipsoid's radii."""

import json
import math
import sqlite3
import struct

import cv2
import numpy as np
import pytest
from bevameter import InputError
from bevameter.database.exporters import Request, export
from bevameter.database.formats.geopackage import write_geopackage
from bevameter.database.formats.geotiff import write_geotiff
from bevameter.database.georeference import Origin, geographic_library
from bevameter.database.grid import LAYERS, UNITS

QUARRY = Origin(47.1, 15.4)
AXIS_M, FLATTENING = 6378137.0, 1 / 298.257223563


def geographic(origin, east, north):
    """Latitude and longitude [deg] of a place near the origin, by WGS 84's radii of curvature there."""
    latitude = math.radians(origin.latitude_deg)
    eccentricity = FLATTENING * (2 - FLATTENING)
    across = AXIS_M / math.sqrt(1 - eccentricity * math.sin(latitude) ** 2)
    along = across * (1 - eccentricity) / (1 - eccentricity * math.sin(latitude) ** 2)
    return (
        origin.latitude_deg + math.degrees(north / along),
        origin.longitude_deg + math.degrees(east / (across * math.cos(latitude))),
    )


def test_the_axes_turn_clockwise():
    east = Origin(47.1, 15.4, heading_deg=90.0)
    np.testing.assert_allclose(east.to_local(np.array([[0.0, 1.0], [1.0, 0.0]])), [[1, 0], [0, -1]], atol=1e-12)
    np.testing.assert_allclose(QUARRY.to_local(np.array([3.0, 4.0])), [3, 4])
    np.testing.assert_allclose(
        Origin(0, 0, 30.0).to_local(np.array([[[0.0, 1.0]]])), [[[0.5, math.sqrt(0.75)]]], atol=1e-12
    )


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: Origin(91.0, 0.0), r"latitude: 91.0 .expected -90 to 90 \[deg\]"),
        (lambda: Origin(0.0, "15 E"), "longitude: '15 E'"),
        (lambda: Origin(0.0, math.nan), "longitude: nan"),
        (lambda: Origin(0.0, 0.0, 400.0), "heading: 400.0"),
    ],
)
def test_what_is_no_origin_is_one_clear_error(make, said):
    with pytest.raises(InputError, match=said):
        make()


@pytest.mark.parametrize("name", ["a.tif", "a.gpkg"])
def test_the_origin_must_be_stated(view, tmp_path, name):
    with pytest.raises(
        InputError, match=r"origin: not stated .expected latitude and longitude of the site's x = y = 0"
    ):
        export(Request(view), tmp_path / name)
    assert not list(tmp_path.iterdir())


def test_a_library_that_is_missing_is_named():
    with pytest.raises(InputError, match=r'no_such_gis: is not installed .expected pip install "bevameter\[geo\]"'):
        geographic_library("no_such_gis")


def test_the_pixels_of_a_geotiff(view, tmp_path):
    pytest.importorskip("rasterio", reason="rasterio (the extra geo) is not installed")
    layers = ["cohesion", "age", "known"]
    grid = view.grid((-2.0, -1.5, 2.0, 1.0), 0.5, layers, now=2e9)
    write_geotiff(grid, tmp_path / "a.tif", QUARRY)
    assert [path.name for path in tmp_path.iterdir()] == ["a.tif"]
    pixels = cv2.imread(str(tmp_path / "a.tif"), cv2.IMREAD_UNCHANGED)
    assert pixels.dtype == np.float32
    for band, name in enumerate(reversed(layers)):  # OpenCV gives blue first
        np.testing.assert_array_equal(pixels[::-1, :, band], grid.layers[name].astype(np.float32))


@pytest.mark.parametrize("heading", [0.0, 37.0, -120.0])
def test_a_geotiff_lies_where_the_site_lies(grid, tmp_path, heading):
    rasterio = pytest.importorskip("rasterio", reason="rasterio (the extra geo) is not installed")
    from rasterio.warp import transform

    origin = Origin(47.1, 15.4, heading)
    write_geotiff(grid, tmp_path / "a.tif", origin)
    with rasterio.open(tmp_path / "a.tif") as file:
        assert file.descriptions == LAYERS
        assert file.units == tuple(UNITS.get(name) for name in LAYERS)
        assert math.isnan(file.nodata)
        about = json.loads(file.tags()["bevameter"])
        assert (about["site"], about["class_names"]) == ("quarry", ["asphalt", "clay", "sand"])
        turn = math.radians(heading)
        for row, column in ((3, 4), (1, 1), (0, 7)):
            x, y = grid.x[column], grid.y[row]
            east, north = x * math.cos(turn) + y * math.sin(turn), y * math.cos(turn) - x * math.sin(turn)
            assert file.xy(4 - row, column) == pytest.approx((east, north), abs=1e-9)
            (longitude,), (latitude,) = transform(file.crs, "EPSG:4326", *([each] for each in file.xy(4 - row, column)))
            assert (latitude, longitude) == pytest.approx(geographic(origin, east, north), abs=1e-11)
            (found,) = file.sample([(east, north)])
            expected = [grid.layers[name][row, column] for name in LAYERS]
            np.testing.assert_array_equal(found, np.float32(expected))


def test_no_precision_is_lost_on_the_way(view, tmp_path):
    """Far from the origin cells of a centimetre still lie where they should: the file's numbers are metres."""
    rasterio = pytest.importorskip("rasterio", reason="rasterio (the extra geo) is not installed")
    grid = view.grid((12345.67, -9876.54, 12345.77, -9876.44), 0.01, ["known"])
    write_geotiff(grid, tmp_path / "a.tif", QUARRY)
    with rasterio.open(tmp_path / "a.tif") as file:
        assert file.xy(9, 0) == pytest.approx((grid.x[0], grid.y[0]), abs=1e-9)
        assert file.crs.linear_units == "metre"


def polygon(blob):
    """The corners (n, 2) of a polygon in a GeoPackage's geometry: a header of flags, an envelope, then WKB."""
    assert blob[:2] == b"GP"
    little, envelope = blob[3] & 1, (blob[3] >> 1) & 7
    assert little == 1
    start = 8 + {0: 0, 1: 32, 2: 48, 3: 48, 4: 64}[envelope]
    order, kind, rings, count = struct.unpack_from("<BIII", blob, start)
    assert (order, kind, rings) == (1, 3, 1)
    return np.frombuffer(blob, "<f8", 2 * count, start + 13).reshape(count, 2)


def test_a_geopackage_is_a_database_of_cells(grid, tmp_path):
    pytest.importorskip("pyogrio", reason="pyogrio (the extra geo) is not installed")
    pytest.importorskip("shapely", reason="shapely (the extra geo) is not installed")
    write_geopackage(grid, tmp_path / "a.gpkg", Origin(47.1, 15.4, heading_deg=90.0))
    assert [path.name for path in tmp_path.iterdir()] == ["a.gpkg"]
    with sqlite3.connect(tmp_path / "a.gpkg") as database:
        database.row_factory = sqlite3.Row
        rows = {row["class"]: row for row in database.execute("select * from ground")}
        ((definition,),) = database.execute(
            "select definition from gpkg_spatial_ref_sys join gpkg_contents using (srs_id) where table_name = 'ground'"
        )
        ((metadata,),) = database.execute("select metadata from gpkg_metadata")
    assert "Transverse" in definition
    assert "47.1" in definition
    assert "normal_stress_Pa" in metadata
    assert set(rows) == {"sand", "clay", "asphalt", None}, "cells that nobody has seen are left out"
    sand, asphalt, dark = rows["sand"], rows["asphalt"], rows[None]
    assert sand["cohesion"] == grid.layers["cohesion"][3, 4]
    assert (sand["known"], sand["class_index"], sand["observation_count"], sand["extrapolated"]) == (1, 2, 1, 0)
    for name in ("cohesion", "shear_strength_lower", "extrapolated"):
        assert asphalt[name] is None
        assert dark[name] is None
    assert (asphalt["known"], dark["class_index"]) == (0, None)
    # The site's y axis points east: its cell (0, 0) to (0.5, 0.5) lies south of the origin.
    corners = polygon(sand["geom"])
    assert len(corners) == 5
    np.testing.assert_allclose(corners.min(axis=0), [0.0, -0.5], atol=1e-12)
    np.testing.assert_allclose(corners.max(axis=0), [0.5, 0.0], atol=1e-12)


def test_a_geopackage_is_read_by_gdal(view, grid, tmp_path):
    pyogrio = pytest.importorskip("pyogrio", reason="pyogrio (the extra geo) is not installed")
    shapely = pytest.importorskip("shapely", reason="shapely (the extra geo) is not installed")
    request = Request(view, layers=["observation_count"], origin=QUARRY)
    export(request, tmp_path / "a.gpkg")
    about, _, geometry, (counts,) = pyogrio.raw.read(tmp_path / "a.gpkg")
    assert about["geometry_type"] == "Polygon"
    assert counts.tolist() == [1, 1, 1]
    centres = shapely.centroid(shapely.from_wkb(geometry))
    assert {(point.x, point.y) for point in centres} == {(0.25, 0.25), (0.75, 0.25), (-1.25, -0.75)}


def test_nothing_known_is_no_geopackage(view, tmp_path):
    pytest.importorskip("pyogrio", reason="pyogrio (the extra geo) is not installed")
    with pytest.raises(InputError, match="nothing is known of any of its cells"):
        write_geopackage(view.grid((50, 50, 51, 51), 0.5), tmp_path / "a.gpkg", QUARRY)
    assert not list(tmp_path.iterdir())
