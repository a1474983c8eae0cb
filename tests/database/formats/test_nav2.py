"""Maps for Nav2, read back by OpenCV and ruamel.yaml and interpreted as the map server does."""

import math

import cv2
import numpy as np
import pytest
from bevameter import InputError
from bevameter.database.exporters import Request, export
from bevameter.database.formats.nav2 import strength_costs, write_costmap, write_speed_mask
from ruamel.yaml import YAML


def occupancy(path):
    """What the map server makes of a map: the YAML's values, and nav_msgs/OccupancyGrid data (height, width).

    After nav2_map_server, map_io.cpp, loadMapFromFile, mode raw; the message's first row is the lowest.
    """
    about = YAML(typ="safe").load(path.read_text(encoding="utf-8"))
    assert (about["mode"], about["negate"]) == ("raw", 0)
    assert (path.parent / about["image"]).read_bytes().startswith(b"P5")
    pixels = cv2.imread(str(path.parent / about["image"]), cv2.IMREAD_UNCHANGED).astype(int)
    return about, np.where(pixels <= 100, pixels, -1)[::-1]


def test_costs_are_read_back_where_they_belong(grid, tmp_path):
    costs = np.full(grid.shape, math.nan)
    costs[3, 4], costs[3, 5], costs[1, 1] = 0.0, 57.2, 100.0
    write_costmap(grid, costs, tmp_path / "costs of quarry.yaml")
    about, data = occupancy(tmp_path / "costs of quarry.yaml")
    assert (about["resolution"], about["origin"]) == (0.5, [-2.0, -1.5, 0.0])
    expected = np.full(grid.shape, -1)
    expected[3, 4], expected[3, 5], expected[1, 1] = 0, 58, 100
    np.testing.assert_array_equal(data, expected)


def test_the_command_exports_costs_by_strength(view, grid, tmp_path):
    lower = grid.layer("shear_strength_lower")
    required = 0.75 * lower[3, 4]
    request = Request(view, bounds=(-2.0, -1.5, 2.0, 1.0), required_strength_Pa=required)
    assert export(request, tmp_path / "a.yaml") == (tmp_path / "a.yaml", tmp_path / "a.pgm")
    _, data = occupancy(tmp_path / "a.yaml")
    assert data[3, 4] == math.floor(98 * 0.75)
    assert data[3, 5] == (100 if lower[3, 5] < required else math.floor(98 * required / lower[3, 5]))
    assert np.count_nonzero(data != -1) == 2, "no soil, not recognised and never seen are unknown"


def test_only_what_is_too_weak_is_an_obstacle():
    lower = np.array([[0.0, 4999.0, 5000.0, 10e3, 1e9, math.nan]])
    np.testing.assert_array_equal(strength_costs(lower, 5000.0), [[100, 100, 98, 49, 0, math.nan]])
    assert np.nanmax(strength_costs(np.linspace(5000.0, 9000.0, 10_000)[None], 5000.0)) == 98


def test_speed_limits_are_whole_percent_and_never_none(grid, tmp_path):
    percent = np.full(grid.shape, math.nan)
    percent[3, 4], percent[3, 5], percent[1, 1] = 100.0, 1.9, 40.0
    write_speed_mask(grid, percent, tmp_path / "speed.yaml", unknown_percent=20.5)
    _, data = occupancy(tmp_path / "speed.yaml")
    expected = np.full(grid.shape, 20)
    expected[3, 4], expected[3, 5], expected[1, 1] = 100, 1, 40
    np.testing.assert_array_equal(data, expected)


@pytest.mark.parametrize(
    ("write", "said"),
    [
        (lambda grid, path: write_costmap(grid, np.full(grid.shape, 101.0), path), "costs, row 0, column 0: 101 "),
        (lambda grid, path: write_costmap(grid, np.full(grid.shape, -1.0), path), "costs, .*: -1 .expected 0 to 100"),
        (lambda grid, path: write_costmap(grid, np.zeros((2, 2)), path), r"costs: shape \(2, 2\) .* \(5, 8\)"),
        (lambda grid, path: write_costmap(grid, "free", path), "costs: 'free'"),
        (
            lambda grid, path: write_speed_mask(grid, np.zeros(grid.shape), path, unknown_percent=1),
            "percent, row 0, column 0: 0 .expected 1 to 100",
        ),
        (
            lambda grid, path: write_speed_mask(grid, np.ones(grid.shape), path, unknown_percent=0),
            "unknown_percent: 0 .expected a number, 1 to 100",
        ),
        (
            lambda grid, path: write_costmap(grid, np.zeros(grid.shape), path.with_suffix(".pgm")),
            "path: .*expected the path of a .yaml file",
        ),
        (lambda grid, path: strength_costs(np.ones((1, 1)), 0.0), "required strength: 0.0 .expected a finite"),
        (lambda grid, path: strength_costs(np.ones((1, 1)), math.nan), "required strength: nan"),
        (lambda grid, path: write_costmap(grid, np.zeros(grid.shape), path / "none" / "a.yaml"), "no folder"),
    ],
)  # fmt: skip
def test_what_is_no_map_is_one_clear_error(grid, tmp_path, write, said):
    with pytest.raises(InputError, match=said):
        write(grid, tmp_path / "map.yaml")
    assert not list(tmp_path.iterdir())


def test_the_requirement_must_be_stated(view, tmp_path):
    with pytest.raises(InputError, match=r"required strength: not stated .expected the shear strength"):
        export(Request(view), tmp_path / "map.yaml")
