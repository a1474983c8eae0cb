"""Costmaps and speed masks for Nav2, as its map server reads them: a PGM image, and a YAML file that names it.

The image has mode ``raw``: a pixel of 0 to 100 is the value of nav_msgs/OccupancyGrid itself, any other is unknown
(nav2_map_server, map_io.cpp; docs.nav2.org, "Map Server / Saver"). Of the map server's modes it is the only one in
which a PGM holds both graded values and unknown: ``trinary`` knows three values, and ``scale`` takes what is unknown
from an alpha channel, which PGM lacks (205, the usual gray for unknown, is a cost there).
"""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np

from ...framework.core.arguments import number, numbers, path_of, refused
from ...framework.core.errors import InputError
from ...framework.core.files import whole, write_text
from ..exporters import Exporter, Request, register
from ..grid import Grid

LETHAL = 100
"""Cost of ground that is too weak: an obstacle to the static layer (`lethal_cost_threshold`)."""

DEAREST = 98
"""Greatest cost of ground that is strong enough: 99 means an inscribed obstacle to the static layer."""

UNKNOWN = 255
"""Pixel of unknown ground."""


@register
class Nav2Costmap(Exporter):
    """Costs by strength, for the static layer of a costmap."""

    name = "nav2"
    endings = (".yaml",)
    holds = "a costmap of Nav2's map server: a YAML file and its .pgm image"
    settings = ("bounds", "resolution", "required_strength_Pa")

    def files(self, out: Path) -> tuple[Path, ...]:
        """Name the YAML file and the image."""
        return out, out.with_suffix(".pgm")

    def write(self, request: Request, out: Path) -> None:
        """Write costs (`strength_costs`) of the lower bounds of strength."""
        required = request.stated("required_strength_Pa")
        grid = request.grid(["shear_strength_lower"])
        write_costmap(grid, strength_costs(grid.layer("shear_strength_lower"), required), out)


def strength_costs(strength_lower: np.ndarray, required_Pa: float) -> np.ndarray:
    """Rate ground by how much of its strength the vehicle needs.

    Parameters
    ----------
    strength_lower : (h, w)
        Lower bound of the shear strength [Pa]; NaN where unknown.
    required_Pa
        Shear strength that the vehicle needs [Pa].

    Returns
    -------
    costs : (h, w)
        `LETHAL` where the bound is below what is required; elsewhere ``DEAREST * required / bound``, rounded down: 98
        where it just suffices, 49 where it is twice that. NaN where the bound is unknown.

    Raises
    ------
    InputError
        A requirement that is no finite, positive number.
    """
    required = number("required strength", required_Pa, "a number [Pa]")
    if not (math.isfinite(required) and required > 0):
        raise refused("required strength", required_Pa, "a finite, positive number [Pa]")
    costs = np.full(strength_lower.shape, math.nan)
    costs[strength_lower < required] = LETHAL
    enough = strength_lower >= required
    costs[enough] = np.floor(DEAREST * (required / strength_lower[enough]))
    return costs


def write_costmap(grid: Grid, costs: np.ndarray, path: str | Path) -> None:
    """Write costs as a map.

    Nav2's static layer takes it as costs with ``trinary_costmap: false``, and keeps what is unknown with
    ``track_unknown_space: true``; neither is its default.

    Parameters
    ----------
    grid
        The raster that the costs are of.
    costs : (h, w)
        0 (free) to 100 (obstacle), rounded up to whole numbers; NaN where unknown. 99 is an inscribed obstacle to Nav2.
    path
        The YAML file; the image goes into the same folder, with the ending .pgm.

    Raises
    ------
    InputError
        Costs out of range or of another shape, or a file that cannot be written.
    """
    costs = _values("costs", costs, grid, 0.0, 100.0)
    _write(grid, np.where(np.isnan(costs), UNKNOWN, np.ceil(costs)), path)


def write_speed_mask(grid: Grid, percent: np.ndarray, path: str | Path, *, unknown_percent: float) -> None:
    """Write speed limits as a filter mask for Nav2's speed filter.

    The mask's values are percent of the greatest speed: the filter's info server has ``type: 1``, ``base: 0.0`` and
    ``multiplier: 1.0`` (docs.nav2.org, "Navigating with Speed Limits").

    Parameters
    ----------
    grid
        The raster that the limits are of.
    percent : (h, w)
        Speed limit in percent of the greatest speed, 1 to 100, rounded down to whole numbers; NaN where unknown. The
        filter takes 0 for no limit: where the vehicle must not go is for a costmap to say.
    path
        The YAML file; the image goes into the same folder, with the ending .pgm.
    unknown_percent
        Speed limit on unknown ground, 1 to 100: the filter takes no unknown cells, on which the limit of the cell
        before would stay.

    Raises
    ------
    InputError
        Limits out of range or of another shape, or a file that cannot be written.
    """
    limits = _values("percent", percent, grid, 1.0, 100.0)
    unknown = number("unknown_percent", unknown_percent, "a number, 1 to 100")
    if not 1.0 <= unknown <= 100.0:  # nor is NaN
        raise refused("unknown_percent", unknown_percent, "a number, 1 to 100")
    _write(grid, np.floor(np.where(np.isnan(limits), unknown, limits)), path)


def _values(name: str, values: np.ndarray, grid: Grid, least: float, greatest: float) -> np.ndarray:
    found = numbers(name, values, f"numbers {least:g} to {greatest:g}")
    if found.shape != grid.shape:
        raise InputError(name, f"shape {found.shape}", expected=f"that of the grid, {grid.shape}")
    wrong = (found < least) | (found > greatest)
    if np.any(wrong):
        row, column = np.argwhere(wrong)[0]
        value = f"{found[row, column]:g}"
        place = f"row {row}, column {column}"
        raise InputError(name, value, expected=f"{least:g} to {greatest:g}, NaN where unknown", place=place)
    return found


def _write(grid: Grid, pixels: np.ndarray, path: str | Path) -> None:
    """Write the image, whose first row lies in the north, then the file that names it."""
    from PIL import Image

    path = path_of("path", path, "the path of a .yaml file")
    if path.suffix.lower() != ".yaml":
        raise refused("path", str(path), "the path of a .yaml file")
    image = path.with_suffix(".pgm")
    with whole(image) as part:
        Image.fromarray(np.flipud(pixels).astype(np.uint8)).save(part, format="PPM")
    lines = [
        f"image: {json.dumps(image.name, ensure_ascii=False)}",
        "mode: raw",
        f"resolution: {grid.resolution!r}",
        f"origin: [{grid.origin[0]!r}, {grid.origin[1]!r}, 0.0]",
        "negate: 0",
        "occupied_thresh: 0.65",  # of no effect in this mode, but the map server wants them
        "free_thresh: 0.196",
    ]
    write_text("\n".join(lines) + "\n", path)
