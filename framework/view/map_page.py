"""The map: cells coloured by a layer, one of them selected, and what is known of it; a Bokeh document."""

from __future__ import annotations

import shlex
from dataclasses import replace
from html import escape
from typing import TYPE_CHECKING, Any

import numpy as np
from bokeh.events import RangesUpdate, Tap
from bokeh.layouts import column, row
from bokeh.models import Button, Div, NumericInput, Select
from matplotlib import colormaps
from matplotlib.colors import to_hex

from ...database.exports import answer_rows
from ..colours import SEQUENTIAL, class_colours
from ..core.errors import InputError
from .cell import cell_html, looks_html, regions
from .figures import MapFigure, RegionFigure
from .keys import key_listener, mirror
from .layers import LAYERS, Layer, Question, layer
from .raster import View, image_of
from .site import Site

if TYPE_CHECKING:
    from bokeh.document import Document

    from .server import Shared

_MOST_SQUARES = 4000
"""So many cells are drawn one by one, as squares; more become an image."""

_MARGIN = 0.04
"""Margin around the whole site [-]."""

_CLOSER = 1.5
"""Factor of one step of zooming by key [-]."""

_NO_VEHICLE = "choose"


class MapPage:
    """What one browser tab shows.

    Parameters
    ----------
    site
        The site.
    shared
        What all tabs share: recordings and vehicles.
    """

    def __init__(self, site: Site, shared: Shared) -> None:
        self.site, self.shared = site, shared
        self.question = Question(vehicle=shared.vehicles.get(shared.vehicle or ""))
        self.layer_name = "class"
        self.selected: tuple[int, int] | None = None
        self.map, self.regions = MapFigure(), RegionFigure()
        self._layers: dict[tuple, Layer] = {}
        self._make_controls()
        self._show_drives()

    def add_to(self, document: Document) -> None:
        """Fill a document."""
        self.document = document
        keys = Div(text="", visible=False, name="key")
        keys.on_change("text", lambda attr, old, new: self.press(new.partition(" ")[0]))
        mirrored = (self.legend, self.details, self.observations)
        for model in mirrored:
            model.js_on_change("text", mirror(model))
        self.map.figure.on_event(Tap, self._tapped)
        self.map.figure.on_event(RangesUpdate, lambda event: self.draw())
        for size in ("inner_width", "inner_height"):
            self.map.figure.on_change(size, lambda attr, old, new: self._resized())
        self.controls.name, self.map.figure.name, self.regions.figure.name = "controls", "area", "regions"
        hidden = column(keys, *mirrored, visible=False, name="hidden")
        for root in (self.controls, self.map.figure, self.regions.figure, hidden):
            document.add_root(root)
        document.js_on_event("document_ready", key_listener(keys, mirrored))
        self.whole_site()
        self.update()
        self._show_details()
        if self.shared.recordings.is_searching:
            self._looking = document.add_periodic_callback(self.show_found, _LOOKING_MS)

    def show_found(self) -> None:
        """Show what was found of the drives' recordings since the page was opened; the last time when all was."""
        is_last = not self.shared.recordings.is_searching
        self._show_drives()
        if is_last:
            self.document.remove_periodic_callback(self._looking)
            self._show_details()

    def update(self) -> None:
        """Compute the layer anew, and draw it."""
        try:
            self.layer = self._layer()
        except InputError as error:
            self.layer = Layer(
                f"{LAYERS[self.layer_name]}: {error}", "", np.full(len(self.site.columns), np.nan), "least"
            )
        self.draw()

    def _layer(self) -> Layer:
        vehicle = self.question.vehicle.name if self.question.vehicle else ""
        key = (self.layer_name, replace(self.question, vehicle=None), vehicle)
        if key not in self._layers:
            if len(self._layers) >= len(LAYERS):
                self._layers.clear()
            self._layers[key] = layer(self.site.snapshot, self.layer_name, self.question)
        return self._layers[key]

    def draw(self) -> None:
        """Draw what is in view: squares where cells are few, an image where they are many."""
        size = self.site.snapshot.cell_size_m
        x0, y0, x1, y1 = view = _scaled(self.map.view, 1.0 / size)
        site = self.site
        within = slice(*np.searchsorted(site.columns, (np.floor(x0), np.ceil(x1))))
        rows = np.flatnonzero((site.rows[within] >= np.floor(y0)) & (site.rows[within] <= y1)) + within.start
        block, widened = 1, False
        if len(rows) <= _MOST_SQUARES:
            widened = self.map.show_squares(site, self.layer, rows)
        else:
            image = image_of(self.layer, site.snapshot.class_names, site.columns, site.rows, view, self.map.size)
            block = image.cells
            self.map.show_image(image.rgba, 2.0 * block * size if block > 1 else size)
        legend = legend_html(self.layer, site.snapshot.class_names, block, widened)
        if legend != self.legend.text:
            self.legend.text = legend

    def select(self, cell: tuple[int, int]) -> None:
        """Select a cell, seen or not."""
        self.selected = cell
        x, y = self.site.centre_of(cell)
        self.map.mark(x, y, self.site.snapshot.cell_size_m)
        x0, y0, x1, y1 = self.map.view
        if not (x0 <= x <= x1 and y0 <= y <= y1):
            self.map.centre(x, y)
            self.draw()
        self._show_details()

    def hit(self, x: float, y: float) -> None:
        """Select the cell that is drawn at a place [m]; where none is, the unseen one that it lies in."""
        cell, near = self.site.cell_at(x, y), self.site.nearest(x, y)
        if near is not None and near != cell:
            # Cells are drawn wider than they are where they would be too small to be seen.
            near_x, near_y = self.site.centre_of(near)
            reach = 0.5 * max(self.map.drawn_side, self.site.snapshot.cell_size_m)
            if max(abs(near_x - x), abs(near_y - y)) <= reach:
                cell = near
        self.select(cell)

    def press(self, key: str) -> None:
        """Do what a key is for."""
        steps = {"ArrowLeft": (-1, 0), "ArrowRight": (1, 0), "ArrowDown": (0, -1), "ArrowUp": (0, 1)}
        name = key.removeprefix("Shift+")
        if name in steps:
            far = 10 if key != name else 1
            x0, y0, x1, y1 = self.map.view
            nearest = self.site.nearest(0.5 * (x0 + x1), 0.5 * (y0 + y1))
            if self.selected is None:
                if nearest is not None:
                    self.select(nearest)
            else:
                self.select((self.selected[0] + far * steps[name][0], self.selected[1] + far * steps[name][1]))
        elif name in ("+", "-"):
            about = None if self.selected is None else self.site.centre_of(self.selected)
            self.map.zoom(_CLOSER if name == "+" else 1.0 / _CLOSER, about)
            self.draw()
        elif name == "0":
            self.whole_site()
            self.draw()

    def whole_site(self) -> None:
        """Bring all cells into view."""
        if len(self.site.columns):
            self.map.fit(self.site.snapshot.extent, _MARGIN)

    def _tapped(self, event: Any) -> None:
        self.hit(event.x, event.y)

    def _resized(self) -> None:
        self.map.keep_square()
        self.draw()

    def _make_controls(self) -> None:
        colour = Select(title="Colour by", value="class", options=list(LAYERS.items()), width=230)
        stress = NumericInput(
            title="Normal stress [kPa]",
            value=self.question.normal_stress / 1e3,
            mode="float",
            low=0.0,
            high=1e6,
            width=130,
        )
        vehicles: list[str | None] = [_NO_VEHICLE, *self.shared.vehicles]
        vehicle = Select(title="Vehicle", value=self.shared.vehicle or _NO_VEHICLE, options=vehicles, width=180)
        sight = NumericInput(title="Sight [m]", value=self.question.sight_m, mode="float", low=0.1, width=90)
        most = NumericInput(title="At most [m/s]", value=self.question.most_m_s, mode="float", low=0.1, width=110)
        whole = Button(label="Whole site", width=100, align="end")
        of_speed = (vehicle, sight, most)
        self.legend, self.details, self.observations = (
            Div(visible=False, name=name) for name in ("legend", "details", "observations")
        )

        def asked(attr: str, old: object, new: object) -> None:
            self.layer_name = colour.value if colour.value in LAYERS else self.layer_name
            for each in of_speed:
                each.visible = colour.value == "speed"
            if stress.value is not None and sight.value is not None and most.value is not None:
                self.question = replace(
                    self.question, normal_stress=1e3 * stress.value, vehicle=self.shared.vehicles.get(vehicle.value),
                    sight_m=float(sight.value), most_m_s=float(most.value),
                )  # fmt: skip
            self.legend.text = "<p class=note>Computing ...</p>"
            self.document.add_next_tick_callback(answered)

        def answered() -> None:
            self.update()
            self._show_details()

        for each in (colour, stress, vehicle, sight, most):
            each.on_change("value", asked)
        for each in of_speed:
            each.visible = False

        def to_whole_site() -> None:
            self.whole_site()
            self.draw()

        whole.on_click(to_whole_site)
        self.controls = row(colour, stress, *of_speed, whole, styles={"flex-wrap": "wrap", "gap": "4px"})

    def _show_drives(self) -> None:
        drives = self.site.drives
        self.map.show_stretches([soil for drive in drives for soil in drive.soils])
        self.map.show_tracks([track for drive in drives if (track := self.shared.track_of(drive)) is not None])

    def _show_details(self) -> None:
        if self.selected is None:
            self.details.text = _NOTHING_SELECTED if len(self.site.columns) else _no_ground(self.site)
            self.observations.text = ""
            self.regions.show({}, {}, {}, None)
            return
        x, y = self.site.centre_of(self.selected)
        snapshot, question = self.site.snapshot, self.question
        answer = snapshot.at(x, y, normal_stress=question.normal_stress, confidence=question.confidence)
        probability = answer.class_probability[0]
        known = answer_rows(answer)[0]
        mean = (known["c_Pa"], known["phi_rad"]) if known["known"] else None
        shares = dict(zip(snapshot.class_names, probability.tolist(), strict=True))
        found = regions(snapshot, probability, question)
        self.regions.show(found, shares, class_colours(snapshot.class_names), mean)
        self.details.text = cell_html(self.site, self.selected, question)
        self.observations.text = looks_html(self.site.looks_at(self.selected), self.shared.recordings)


def _scaled(view: View, factor: float) -> View:
    x0, y0, x1, y1 = view
    return factor * x0, factor * y0, factor * x1, factor * y1


_LOOKING_MS = 1000
"""While recordings are looked for, the page shows so often what was found."""

_NOTHING_SELECTED = (
    "<h2>No cell selected</h2><p>Click a cell, or press an arrow key while the map has the focus. Then the classes, "
    "the soil and the observations of that cell are shown here.</p>"
)


def _no_ground(site: Site) -> str:
    command = f"bevameter run RECORDING --db {shlex.quote(site.database.name)}"
    return (
        f"<h2>No ground yet</h2><p>No drive has brought a place. To add one:</p><p><code>{escape(command)}</code></p>"
    )


def legend_html(shown: Layer, class_names: tuple[str, ...], block: int, widened: bool = False) -> str:
    """Say what the colours mean.

    `block` is how many cells along each edge are drawn as one, `widened` whether cells are drawn wider than they are.
    """
    if shown.shown == "most":
        present = set(np.unique(shown.values[~shown.unknown]).astype(int).tolist())
        parts = [
            f'<span><span class=swatch style="background:{colour}"></span>{escape(name)}</span>'
            for index, (name, colour) in enumerate(class_colours(class_names).items())
            if index in present
        ]
    elif not shown.unknown.all():
        stops = ", ".join(to_hex(colormaps[SEQUENTIAL](share)) for share in np.linspace(0.0, 1.0, 9))
        ends = [f"{end:.3g} {shown.unit}" for end in (shown.low, shown.high)]
        parts = [
            f'<span class=scale>{ends[0]} <span class=bar style="background:linear-gradient(90deg,{stops})"></span> '
            f"{ends[1]}</span>"
        ]
    else:
        parts = []
    parts.append("<span><span class='swatch hatched'></span>seen, unknown</span>")
    parts.append("<span><span class=swatch style='background:#fff'></span>not seen</span>")
    what = {"least": "the least of them", "greatest": "the greatest of them", "most": "the class of most of them"}
    several = " Cells are drawn wider than they are." if widened else ""
    if block > 1:
        several = (
            f" {block} by {block} cells are drawn as one, which shows {what[shown.shown]}; it is hatched where at "
            "least half of them are unknown."
        )
    unknown = int(shown.unknown.sum())
    counted = f"{len(shown.values):,} cells, {unknown:,} of them unknown."
    parts.append(f"<p class=note>Colour: {escape(shown.title)}. {counted}{several}</p>")
    return "".join(parts)
