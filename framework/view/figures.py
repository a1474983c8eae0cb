"""The two figures of the map page: the map, and the region of cohesion and friction angle of the selected cell."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from bokeh.core.property.descriptors import UnsetValueError
from bokeh.models import BoxZoomTool, ColumnDataSource, HoverTool, Range1d, WheelZoomTool
from bokeh.plotting import figure

from ...database.observations import SoilObservation
from .layers import Layer
from .raster import HATCH_COLOUR, colours_of
from .site import Site

_WIDTH, _HEIGHT = 900, 600
"""Size of the map until the browser says its own [px]."""

_LEAST_PX = 4.0
"""Least edge of a cell that is drawn by itself [px]."""

_TIP = [("", "@text"), ("x, y", "@x{0.00} m, @y{0.00} m")]


class MapFigure:
    """The map; both axes have one scale."""

    def __init__(self) -> None:
        zoom = WheelZoomTool()
        self._across, self._along = Range1d(start=0.0, end=1.0), Range1d(start=0.0, end=1.0)
        self.figure = figure(
            height=_HEIGHT, sizing_mode="stretch_width", x_range=self._across, y_range=self._along,
            tools=["pan", zoom, BoxZoomTool(match_aspect=True), "save"], active_scroll=zoom, x_axis_label="x [m]",
            y_axis_label="y [m]", background_fill_color="white", toolbar_location="right",
        )  # fmt: skip
        self.figure.toolbar.logo = None
        self.figure.grid.grid_line_color = "#eeeeee"
        draw = self.figure
        none: dict[str, list] = {"x": [], "y": []}
        self._image = ColumnDataSource({"image": [], "x": [], "y": [], "dw": [], "dh": []})
        self._squares = ColumnDataSource({**none, "fill": [], "hatch": [], "text": []})
        self.drawn_side = 0.0
        self._measured, self._closed = ColumnDataSource({**none, "text": []}), ColumnDataSource({**none, "text": []})
        self._tracks = ColumnDataSource({"xs": [], "ys": []})
        self._mark = ColumnDataSource({**none, "side": []})
        draw.image_rgba("image", "x", "y", "dw", "dh", source=self._image)
        self._rect = draw.rect(
            "x", "y", 1.0, 1.0, fill_color="fill", line_color=None, hatch_pattern="hatch", hatch_color=HATCH_COLOUR,
            hatch_weight=1.0, hatch_scale=8.0, source=self._squares,
        )  # fmt: skip
        for colour, width in (("white", 3.5), ("#111111", 1.2)):
            draw.multi_line("xs", "ys", color=colour, line_width=width, source=self._tracks)
        style = {"size": 7, "line_color": "#111111", "line_width": 1.5}
        measured = draw.scatter("x", "y", marker="circle", fill_color="white", source=self._measured, **style)
        closed = draw.scatter("x", "y", marker="x", source=self._closed, **style)
        for colour, width in (("white", 5.0), ("#d50000", 2.5)):
            draw.rect("x", "y", "side", "side", fill_alpha=0.0, line_color=colour, line_width=width, source=self._mark)
            draw.scatter(
                "x", "y", marker="square", size=14, fill_alpha=0.0, line_color=colour, line_width=width,
                source=self._mark,
            )  # fmt: skip
        self.figure.add_tools(HoverTool(renderers=[self._rect], tooltips=_TIP, description="value under the pointer"))
        self.figure.add_tools(HoverTool(renderers=[measured, closed], tooltips="@text"))

    @property
    def view(self) -> tuple[float, float, float, float]:
        """Corners x0, y0, x1, y1 of what is in view [m]."""
        across: Any
        along: Any
        across, along = self._across, self._along
        return float(across.start), float(along.start), float(across.end), float(along.end)

    @view.setter
    def view(self, corners: tuple[float, float, float, float]) -> None:
        x0, y0, x1, y1 = corners
        self._across.update(start=x0, end=x1)
        self._along.update(start=y0, end=y1)

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of the map without its axes [px]."""
        try:
            width, height = self.figure.inner_width, self.figure.inner_height
        except UnsetValueError:
            width = height = 0
        return (width, height) if width > 0 and height > 0 else (_WIDTH, _HEIGHT)  # the browser has not drawn it yet

    def fit(self, corners: tuple[float, float, float, float], margin: float) -> None:
        """Bring a region [m] and a margin around it [-] into view."""
        x0, y0, x1, y1 = corners
        width, height = self.size
        per_px = max((x1 - x0) / width, (y1 - y0) / height) * (1.0 + 2.0 * margin)
        self._around(0.5 * (x0 + x1), 0.5 * (y0 + y1), per_px)

    def keep_square(self) -> None:
        """Make both axes of one scale again, after the browser has changed the map's size."""
        x0, y0, x1, y1 = self.view
        width, height = self.size
        self._around(0.5 * (x0 + x1), 0.5 * (y0 + y1), max((x1 - x0) / width, (y1 - y0) / height))

    def centre(self, x: float, y: float) -> None:
        """Move a place [m] to the middle."""
        x0, _, x1, _ = self.view
        self._around(x, y, (x1 - x0) / self.size[0])

    def zoom(self, factor: float, about: tuple[float, float] | None) -> None:
        """Come closer by a factor, to a place [m] or to the middle."""
        x0, y0, x1, y1 = self.view
        x, y = about or (0.5 * (x0 + x1), 0.5 * (y0 + y1))
        self._around(x, y, (x1 - x0) / self.size[0] / factor)

    def _around(self, x: float, y: float, per_px: float) -> None:
        half_x, half_y = (0.5 * per_px * pixels for pixels in self.size)
        self.view = (x - half_x, y - half_y, x + half_x, y + half_y)

    def show_squares(self, site: Site, layer: Layer, rows: np.ndarray) -> bool:
        """Draw cells one by one; say whether they are drawn wider than they are, to be seen."""
        names, size = site.snapshot.class_names, site.snapshot.cell_size_m
        x0, _, x1, _ = self.view
        self.drawn_side = side = max(size, _LEAST_PX * (x1 - x0) / self.size[0])
        values = layer.values[rows]
        colours = colours_of(layer, names, values)
        if layer.shown == "most":
            text = ["unknown" if np.isnan(value) else names[int(value)] for value in values]
        else:
            text = [layer.text(row) for row in rows.tolist()]
        self._rect.glyph.update(width=side, height=side)
        _show(self._image, {name: [] for name in self._image.data})
        self._squares.data = {
            "x": (site.columns[rows] + 0.5) * size,
            "y": (site.rows[rows] + 0.5) * size,
            "fill": [f"#{r:02x}{g:02x}{b:02x}" for r, g, b, _ in colours.tolist()],
            "hatch": np.where(np.isnan(values), "right_diagonal_line", "blank").tolist(),
            "text": text,
        }
        return side > size

    def show_image(self, rgba: np.ndarray, side: float) -> None:
        """Draw an image of what is in view, in which a cell may be drawn as wide as `side` [m]."""
        self.drawn_side = side
        x0, y0, x1, y1 = self.view
        _show(self._squares, {name: [] for name in self._squares.data})
        self._image.data = {"image": [rgba], "x": [x0], "y": [y0], "dw": [x1 - x0], "dh": [y1 - y0]}

    def mark(self, x: float, y: float, side: float) -> None:
        """Frame the selected cell."""
        self._mark.data = {"x": [x], "y": [y], "side": [side]}

    def show_stretches(self, soils: Sequence[SoilObservation]) -> None:
        """Mark where wheels measured the soil, and where they could not."""
        placed = [soil for soil in soils if math.isfinite(soil.x_m + soil.y_m)]
        for source, wanted in ((self._measured, True), (self._closed, False)):
            some = [soil for soil in placed if (soil.estimate is not None and not soil.gate_reason) == wanted]
            source.data = {
                "x": [soil.x_m for soil in some],
                "y": [soil.y_m for soil in some],
                "text": [soil.gate_reason or "soil measured here" for soil in some],
            }

    def show_tracks(self, tracks: Sequence[tuple[np.ndarray, np.ndarray]]) -> None:
        """Draw the ways of drives, x and y [m] each."""
        self._tracks.data = {"xs": [x for x, _ in tracks], "ys": [y for _, y in tracks]}


def _show(source: ColumnDataSource, columns: Any) -> None:
    source.data = columns


class RegionFigure:
    """Cohesion and friction angle of the selected cell: the mean, and the 95 % region of each class."""

    def __init__(self) -> None:
        self.figure = figure(
            height=250, sizing_mode="stretch_width", x_axis_label="cohesion c [kPa]",
            y_axis_label="friction angle phi [deg]", tools="save", toolbar_location=None,
        )  # fmt: skip
        self._regions = ColumnDataSource({"xs": [], "ys": [], "colour": [], "width": [], "name": []})
        self._mean = ColumnDataSource({"x": [], "y": []})
        self.figure.patches(
            "xs", "ys", fill_color="colour", fill_alpha=0.25, line_color="colour", line_width="width",
            legend_field="name", source=self._regions,
        )  # fmt: skip
        self.figure.scatter("x", "y", marker="cross", size=14, line_width=2, line_color="#111111", source=self._mean)
        legend = self.figure.legend[0]
        legend.update(border_line_color=None, margin=0, padding=2)
        self.figure.add_layout(legend, "above")
        self.figure.visible = False

    def show(
        self, regions: Mapping[str, np.ndarray], shares: Mapping[str, float], colours: Mapping[str, str],
        mean: tuple[float, float] | None,
    ) -> None:  # fmt: skip
        """Show the regions (n, 2) of c [Pa] and phi [rad] by class, and the mean of the cell; nothing where unknown."""
        names = sorted(regions, key=lambda name: -shares[name])
        self._regions.data = {
            "xs": [regions[name][:, 0] / 1e3 for name in names],
            "ys": [np.degrees(regions[name][:, 1]) for name in names],
            "colour": [colours[name] for name in names],
            "width": [3.0 if name == names[0] else 1.5 for name in names],
            "name": [f"95 % region if {name} ({100 * shares[name]:.1f} % probable)" for name in names],
        }
        self._mean.data = {"x": [], "y": []} if mean is None else {"x": [mean[0] / 1e3], "y": [math.degrees(mean[1])]}
        self.figure.height = 230 + 22 * len(names)
        self.figure.visible = bool(names)
