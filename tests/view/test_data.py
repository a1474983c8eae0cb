"""What the pages show is what a planner is answered; unknown is never a number."""

from __future__ import annotations

from dataclasses import replace
from html import escape

import numpy as np
import pytest

try:
    import bokeh  # noqa: F401
    import datashader  # noqa: F401
except ModuleNotFoundError:
    pytest.skip("the extra view is not installed", allow_module_level=True)

from bevameter import InputError, TerrainDatabase, Vehicle, Wheel
from bevameter.database.speed import speed_limit_of_each
from bevameter.framework.colours import UNKNOWN_COLOUR
from bevameter.framework.core.vehicle import Camera
from bevameter.framework.view.cell import cell_html, looks_html, region_of, regions
from bevameter.framework.view.layers import LAYERS, Question, layer
from bevameter.framework.view.map_page import MapPage, legend_html
from bevameter.framework.view.pages import PAGE_BODIES
from bevameter.framework.view.raster import HATCH_COLOUR, colours_of, image_of
from bevameter.framework.view.recordings import Recordings
from bevameter.framework.view.server import Shared, open_map
from bevameter.framework.view.site import Site
from bokeh.document import Document
from matplotlib.colors import to_hex
from scipy.stats import chi2, multivariate_t

CAMERA = Camera(
    matrix=((500, 0, 320), (0, 500, 240), (0, 0, 1)), width_px=640, height_px=480, height_m=1.0, pitch_rad=0.3
)
ROVER = Vehicle(name="rover", wheels=(Wheel(radius_m=0.15, width_m=0.12),))


@pytest.fixture
def site(database) -> Site:
    return Site.read(database, database.reader("quarry"))


def row_of(site, column, row) -> int:
    return int(np.flatnonzero((site.columns == column) & (site.rows == row))[0])


def test_layers_are_the_planners_answers(site):
    question = Question(normal_stress=15e3, vehicle=ROVER)
    sand, asphalt, dark = (row_of(site, *cell) for cell in ((2, 1), (2, 3), (9, 0)))
    answer = site.snapshot.at(*site.centre_of((2, 1)), normal_stress=15e3)
    found = {name: layer(site.snapshot, name, question) for name in LAYERS}
    assert site.snapshot.class_names[int(found["class"].values[sand])] == "sand"
    assert found["confidence"].values[sand] == pytest.approx(100 * answer.class_probability.max())
    assert found["strength"].values[sand] == pytest.approx(answer.shear_strength_lower[0] / 1e3)
    limit = speed_limit_of_each(answer, ROVER, sight_m=question.sight_m, most_m_s=question.most_m_s).limit_m_s[0]
    assert found["speed"].values[sand] == pytest.approx(limit)
    assert limit > 0.0
    assert found["age"].unit == "days" or found["age"].unit == "years"
    for name in LAYERS:
        assert found[name].unknown[dark] or name == "age", "nobody recognised it, but somebody looked"
        assert found[name].text(dark) == "unknown" or name == "age"
    for name in ("strength", "speed"):
        assert found[name].unknown[asphalt], "no soil of asphalt"
    assert not found["class"].unknown[asphalt]
    assert layer(site.snapshot, "speed", Question()).unknown.all(), "of no vehicle"
    with pytest.raises(InputError, match="normal stress"):
        layer(site.snapshot, "strength", Question(normal_stress=-1.0))


def test_a_pixel_is_a_cell_or_says_what_it_shows_of_many(site):
    shown = layer(site.snapshot, "class", Question())
    names, view = site.snapshot.class_names, (0.0, 0.0, 10.0, 4.0)
    near = image_of(shown, names, site.columns, site.rows, view, (100, 40))
    assert near.cells == 1
    colours = near.rgba.view(np.uint8).reshape(40, 100, 4)
    expected = colours_of(shown, names, np.arange(2.0))
    assert (colours[5, 5] == expected[names.index("sand")]).all()
    assert (colours[35, 5] == expected[names.index("asphalt")]).all()
    corner = {to_hex(each / 255.0) for each in colours[:10, 90:].reshape(-1, 4)}
    assert corner == {HATCH_COLOUR, UNKNOWN_COLOUR}, "unknown ground is hatched"
    outside = image_of(shown, names, site.columns, site.rows, (20.0, 0.0, 30.0, 4.0), (100, 40))
    assert (outside.rgba == 0).all(), "nothing is drawn where nobody has been"
    strength = layer(site.snapshot, "strength", Question())
    far = image_of(strength, names, site.columns, site.rows, view, (5, 2))
    assert far.cells == 2
    assert strength.shown == "least"
    assert "2 by 2 cells are drawn as one" in legend_html(strength, names, far.cells)
    strength.values[row_of(site, 0, 0)] = 0.5 * np.nanmin(strength.values)
    weakest = image_of(strength, names, site.columns, site.rows, view, (5, 2)).rgba.view(np.uint8).reshape(2, 5, 4)
    assert (weakest[0, 0] == colours_of(strength, names, np.nanmin(strength.values)[None])[0]).all()


def test_a_narrow_track_is_seen_from_far(site):
    along = np.arange(30_000)
    known = layer(site.snapshot, "confidence", Question())
    track = replace(known, values=np.where(along < 15_000, 90.0, np.nan))
    image = image_of(track, site.snapshot.class_names, along, along // 2, (0.0, 0.0, 30_000.0, 20_000.0), (900, 600))
    drawn = image.rgba.view(np.uint8).reshape(600, 900, 4)[..., 3] > 0
    assert drawn.sum(axis=0).min() >= 4
    assert image.cells == pytest.approx(4 * 30_000 / 900, abs=1)


def test_what_is_known_of_a_cell(site):
    html = cell_html(site, (2, 1), Question())
    answer = site.snapshot.at(*site.centre_of((2, 1)))
    assert f"{answer.shear_strength_lower[0] / 1e3:.3g} kPa" in html
    assert "Sand, 100.0 % probable" in html
    assert "drives that recognised it</td><td>3" in html
    assert "Soil unknown: no soil data for class asphalt" in cell_html(site, (2, 3), Question())
    dark = cell_html(site, (9, 0), Question())
    assert "too &lt;dark&gt;" in dark
    assert "<dark>" not in dark
    assert dark.count(">unknown<") == 4, "strength, its bound, c and phi"
    with_vehicle = cell_html(site, (2, 1), Question(vehicle=ROVER))
    limit = speed_limit_of_each(answer, ROVER, sight_m=6.0, most_m_s=5.0)
    assert f"speed limit of rover: {escape(limit.reason[0])}" in with_vehicle
    assert f"{limit.limit_m_s[0]:.3g} m/s" in with_vehicle
    assert "no wheels" in cell_html(site, (2, 1), Question(vehicle=Vehicle(name="cart", camera=CAMERA)))
    assert "nobody has seen this ground" in cell_html(site, (500, 0), Question())
    assert "nan" not in (html + dark).lower()
    looks = site.looks_at((2, 1))
    assert [look.drive.name for look in looks] == ["drive 3", "drive 2", "drive 1"]
    said = looks_html(looks, Recordings())
    assert "2026-03-04 09:00:02 UTC" in said
    assert "does not store where a recording lies" in said
    assert site.nearest(-3.0, 0.6) == (0, 1)


def test_the_region_holds_what_it_says(site):
    soil = site.snapshot.soils["sand"]
    c, phi = region_of(soil, 20e3, level=0.9).T
    corners = np.column_stack([c, np.tan(phi)])
    strength = soil.strength
    freedom = strength.predict(np.array([1.0, 20e3]))[2]
    drawn = multivariate_t(strength.mean, strength.predictive_covariance, freedom).rvs(20_000, random_state=1)
    root = np.linalg.inv(np.linalg.cholesky(strength.predictive_covariance))
    off = ((drawn - strength.mean) @ root.T) ** 2
    edge = (((corners - strength.mean) @ root.T) ** 2).sum(axis=1)
    assert np.mean(off.sum(axis=1) < np.median(edge)) == pytest.approx(0.9, abs=0.01)
    assert np.median(edge) > chi2.ppf(0.9, 2), "few stretches bound little"
    probability = site.snapshot.at(*site.centre_of((2, 1))).class_probability[0]
    assert list(regions(site.snapshot, probability, Question())) == ["sand"]
    assert not regions(site.snapshot, np.full(2, np.nan), Question())


def test_a_class_becomes_known_drive_by_drive(site):
    history = site.soil_history()
    assert [(drive.name, soil.stretches) for drive, soil in history["sand"]] == [("drive 1", 1), ("drive 2", 3)]
    first, last = (soil.strength.predictive_covariance for _, soil in history["sand"])
    assert np.linalg.det(last) < np.linalg.det(first)
    np.testing.assert_array_equal(last, site.snapshot.soils["sand"].strength.predictive_covariance)


def test_a_database_that_grows_and_a_page_that_is_open_meanwhile(tmp_path, drive, monkeypatch):
    monkeypatch.setattr("bevameter.framework.view.site.MOST_STEPS", 4)
    with TerrainDatabase(tmp_path / "terrain.db") as database:
        database.make()
        shared = Shared(database, Recordings())
        empty = shared.site(None)
        for path, body in PAGE_BODIES.items():
            assert "no drive" in body(empty, shared, "").lower() or path == "physics"
        page = MapPage(empty, shared)
        page.add_to(Document())
        assert "bevameter run RECORDING --db" in page.details.text
        database.add_drive(drive(1))
        first = shared.site(None)
        page, document = MapPage(first, shared), Document()
        page.add_to(document)
        assert shared.site("quarry") is shared.site("quarry")
        for number in range(2, 11):
            one = drive(number, ("sand",))
            database.add_drive(replace(one, terrain=replace(one.terrain, cell_x=one.terrain.cell_x + number)))
        now = shared.site("quarry")
        assert (len(now.drives), len(first.drives)) == (10, 1)
        assert len(now.columns) > len(first.columns)
        page.press("0")  # draws what it knows
        for _ in range(12):
            page.press("-")
        x0, _, x1, _ = page.map.view
        page.hit(-1.5 * (x1 - x0) / page.map.size[0], 0.1)
        assert page.selected == (0, 0), "a cell is hit where it is drawn, wider than it is"
        page.hit(-0.1 * (x1 - x0), 0.1)
        assert page.selected[0] < -10, "ground that nobody has seen can be selected, too"
        steps = now.soil_history()["sand"]
        assert len(steps) == 4
        assert [steps[at][0].name for at in (0, -1)] == ["drive 2", "drive 10"]
        everything = PAGE_BODIES["drives"](now, shared, "")
        assert everything.count("<h2>") == 8
        chosen = PAGE_BODIES["drives"](now, shared, str(now.drives[3].id))
        assert chosen.count("<h2>") == 1
        assert "<h2>drive 4</h2>" in chosen
        (tmp_path / "terrain.db").unlink()
        document = Document()
        open_map(shared, document)
        assert "no such file" in document.template_variables["problem"]
