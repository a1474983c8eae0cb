import math

import numpy as np
import pytest
from bevameter import InputError
from bevameter.database.grid import LAYERS, MOST_CELLS, UNITS
from bevameter.database.snapshot import Snapshot

BOUNDS = (-2.0, -1.5, 2.0, 1.0)


@pytest.fixture
def view(drive_with_soil) -> Snapshot:
    """Cells of 0.5 m: sand (0, 0), clay (1, 0), not recognised (2, 0), asphalt without soil (-3, -2)."""
    return Snapshot.derive("quarry", [drive_with_soil])


def test_each_cell_is_what_the_snapshot_says_of_its_centre(view):
    grid = view.grid(BOUNDS, 0.25, normal_stress=1e4, confidence=0.9, now=2e9)
    assert (grid.site, grid.origin, grid.resolution, grid.shape) == ("quarry", (-2.0, -1.5), 0.25, (10, 16))
    assert (grid.normal_stress, grid.confidence, grid.time_s) == (1e4, 0.9, 2e9)
    assert tuple(grid.layers) == LAYERS
    for row, column in ((0, 0), (6, 9), (6, 11), (6, 12), (2, 2), (9, 15)):
        place = view.at(grid.x[column], grid.y[row], normal_stress=1e4, confidence=0.9, now=2e9)
        for name in ("cohesion", "friction_angle", "shear_strength", "shear_strength_lower", "age"):
            assert grid.layers[name][row, column] == pytest.approx(getattr(place, name)[0], nan_ok=True, abs=0)
        assert grid.layers["known"][row, column] == place.known[0]


def test_rows_run_north_and_columns_east(view):
    index = view.grid(BOUNDS, 0.5, ["class_index"]).layers["class_index"]
    names = view.class_names
    expected = np.full((5, 8), math.nan)
    expected[3, 4], expected[3, 5] = names.index("sand"), names.index("clay")
    expected[1, 1] = names.index("asphalt")
    np.testing.assert_array_equal(index, expected)


def test_unknown_is_nan(view):
    grid = view.grid(BOUNDS, 0.5, now=2e9)
    seen_without_soil, dark, unseen = (1, 1), (3, 6), (0, 0)
    for cell in (seen_without_soil, dark, unseen):
        assert grid.layers["known"][cell] == 0
        for name in ("cohesion", "friction_angle", "shear_strength", "shear_strength_lower", "extrapolated"):
            assert math.isnan(grid.layers[name][cell])
    assert grid.layers["class_index"][seen_without_soil] == view.class_names.index("asphalt")
    assert math.isnan(grid.layers["class_index"][dark])
    assert grid.layers["observation_count"][3, 4] == 1
    assert grid.layers["observation_count"][unseen] == 0
    assert math.isnan(grid.layers["age"][unseen])
    assert grid.layers["extrapolated"][3, 4] == 0
    assert view.grid(BOUNDS, 0.5, ["extrapolated"], normal_stress=1e6).layers["extrapolated"][3, 4] == 1


def test_the_grid_covers_its_bounds(view):
    assert view.grid((0, 0, 1.0, 0.6), 0.25).shape == (3, 4)
    assert view.grid((0, 0, 0.1, 0.1), 0.5).shape == (1, 1)
    assert view.grid((0.1, 0.0, 0.1 + 3 * 0.1, 0.7), 0.1).shape == (7, 3), "0.4 - 0.1 is no further cell of 0.1"


def test_a_grid_is_immutable(view):
    grid = view.grid(BOUNDS, 0.5, ["known"])
    with pytest.raises(ValueError, match="read-only"):
        grid.layers["known"][0, 0] = 1.0
    with pytest.raises(TypeError):
        grid.layers["known"] = np.zeros((5, 8))
    with pytest.raises(InputError, match=r"layer: 'age' .expected one of known"):
        grid.layer("age")


def test_units_are_of_layers():
    assert set(UNITS) <= set(LAYERS)


@pytest.mark.parametrize(
    ("ask", "said"),
    [
        (lambda view: view.grid((0, 0, 1), 1), r"bounds: \(0, 0, 1\) .expected x0, y0, x1, y1"),
        (lambda view: view.grid(None, 1), "bounds: None"),
        (lambda view: view.grid((0, 0, "a", 1), 1), "bounds: 'a'"),
        (lambda view: view.grid((0, 0, math.nan, 1), 1), "bounds: "),
        (lambda view: view.grid((1, 0, 0, 1), 1), r"bounds: \(1.0, 0.0, 0.0, 1.0\) .* x0 < x1"),
        (lambda view: view.grid((0, 0, 1, 1), 0), "resolution: 0 .expected a finite, positive"),
        (lambda view: view.grid((0, 0, 1, 1), "fine"), "resolution: 'fine'"),
        (lambda view: view.grid((0, 0, 1, 1), 1, ["colour"]), "layers: 'colour' .expected names among class_index"),
        (lambda view: view.grid((0, 0, 1, 1), 1, "age"), "layers: 'age'"),
        (lambda view: view.grid((0, 0, 1, 1), 1, []), "layers: "),
        (lambda view: view.grid((0, 0, 1e4, 1e4), 1), f"grid: 10000 m by 10000 m at 1 m .*at most {MOST_CELLS}"),
        (lambda view: view.grid((0, 0, 1e308, 1e308), 1e-300), "grid: .* inf cells"),
        (lambda view: view.grid((0, 0, 1, 1), 1, confidence=2), "confidence: 2"),
    ],
)
def test_what_is_no_grid_is_one_clear_error(view, ask, said):
    with pytest.raises(InputError, match=said):
        ask(view)
