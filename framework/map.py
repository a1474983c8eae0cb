"""A picture of what a terrain database knows of a site."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.patheffects import withStroke

from ..database.observations import Drive, SoilObservation
from ..database.snapshot import Snapshot
from ..database.store import TerrainDatabase
from .colours import UNKNOWN_COLOUR, cell_colours, class_colours
from .core.errors import InputError
from .core.files import whole
from .core.pooling import cells_from_keys
from .core.recording.types import Recording
from .core.track.way import track_of
from .placement import Claim, place_as_stored

MOST_PIXELS = 4000
"""Of a picture on a side; several cells share a pixel where there are more [-]."""

_CELLS_PLAIN_TO_SEE, _WIDEST = 200, 3
_SLOW_COLOUR = "#111111"
_SOILS_SHOWN = 24


@dataclass(frozen=True)
class _Stretch:
    """A stretch whose soil was learnt, numbered as in the picture."""

    number: int
    soil: SoilObservation

    @property
    def text(self) -> str:
        belief = self.soil.class_probabilities
        name = max(belief, key=lambda one: belief[one]) if belief else "unknown class"
        estimate = self.soil.estimate
        assert estimate is not None
        c, phi = estimate.parameters["c_Pa"], estimate.parameters["phi_rad"]
        return (
            f"{self.number}  {name}:  c = {c.value / 1e3:.2f} ± {c.sd / 1e3:.2f} kPa,  "
            f"φ = {math.degrees(phi.value):.1f} ± {math.degrees(phi.sd):.1f}°"
        )


def draw_map(
    database: TerrainDatabase, out: str | Path, *, site: str | None = None, tracks: Sequence[Recording] = ()
) -> None:
    """Draw what a database knows of a site: cells by class, opaque by probability, and the soil where it was measured.

    Parameters
    ----------
    database
        The terrain database.
    out
        The picture to write; its suffix says the format (.png, .svg, .pdf).
    site
        Which site; may be left out where the database holds one.
    tracks
        Recordings whose way is drawn on top, its slow stretches that gave soil in bold.

    Raises
    ------
    InputError
        No such site, nothing to draw, or a format that matplotlib does not write.
    """
    out = Path(out)
    known = FigureCanvasAgg(Figure()).get_supported_filetypes()
    if out.suffix.lstrip(".").lower() not in known:
        expected = f"one of {', '.join(sorted(known))}"
        raise InputError(out, f"no picture format {out.suffix!r}", expected=expected)
    figure = map_figure(database, site=site, tracks=tracks)
    with whole(out) as part:
        figure.savefig(part)


def map_figure(
    database: TerrainDatabase, *, site: str | None = None, tracks: Sequence[Recording] = ()
) -> Figure:  # fmt: skip
    """Give the picture of `draw_map`."""
    snapshot = database.snapshot(site)
    if not len(snapshot.cells.key):
        raise InputError(database.name, "no ground in it yet", expected="a database that `bevameter run` has filled")
    drives = database.drives(snapshot.site, newest=True)
    stretches = _stretches(drives)
    figure = Figure(figsize=_size(snapshot, len(stretches)), dpi=150, layout="constrained")
    axes = figure.add_subplot()
    colours = class_colours(snapshot.class_names)
    _draw_cells(axes, snapshot, colours)
    for track in tracks:
        recording = place_as_stored(track, database)
        if Claim.of(recording) is not None and recording.site != snapshot.site:
            raise InputError(
                track.source, f"is at the site {recording.site!r}", expected=f"a recording at {snapshot.site!r}"
            )
        _draw_track(axes, recording, [soil for drive in drives for soil in drive.soils])
    _draw_stretches(axes, stretches)
    _decorate(figure, axes, snapshot, drives, colours, stretches, drawn_track=bool(tracks))
    return figure


def _stretches(drives: Sequence[Drive]) -> list[_Stretch]:
    measured = [
        soil
        for drive in drives
        for soil in drive.soils
        if soil.estimate is not None and not soil.gate_reason and math.isfinite(soil.x_m + soil.y_m)
    ]
    return [_Stretch(number, soil) for number, soil in enumerate(measured, 1)]


def _bounds(snapshot: Snapshot) -> tuple[float, float, float, float]:
    """Corners of the seen ground [m]: least x, greatest x, least y, greatest y."""
    cell_x, cell_y = cells_from_keys(snapshot.cells.key).T
    size = snapshot.cell_size_m
    return (
        float(cell_x.min()) * size, float(cell_x.max() + 1) * size,
        float(cell_y.min()) * size, float(cell_y.max() + 1) * size,
    )  # fmt: skip


def _size(snapshot: Snapshot, stretches: int) -> tuple[float, float]:
    """Size of the figure [inch]: at most twelve wide, as the ground's shape and the legends ask for."""
    x0, x1, y0, y1 = _bounds(snapshot)
    wide, high = max(x1 - x0, 1e-6), max(y1 - y0, 1e-6)
    picture = 11.0 * high / wide
    listed = min(stretches, _SOILS_SHOWN)
    width = 12.0 if wide >= high else float(np.clip(11.0 * wide / high + 3.0, 7.0, 12.0))
    return width, float(np.clip(picture, 1.2, 11.0)) + 1.8 + 0.2 * math.ceil(listed / 2)


def cells_picture(
    snapshot: Snapshot, colours: Mapping[str, str]
) -> tuple[np.ndarray, tuple[float, float], float]:  # fmt: skip
    """Give the cells as a picture of no more than `MOST_PIXELS` on a side.

    Returns
    -------
    picture : (h, w, 4)
        Red, green, blue and opacity in [0, 1], the row of the least y first; where cells share a pixel, the surest.
    corner
        Least x and y [m].
    step
        Edge of a pixel [m].
    """
    cells = snapshot.cells
    cell_x, cell_y = cells_from_keys(cells.key).T
    known = np.isfinite(cells.probability).all(axis=1) & (cells.looks > 0)
    rgba = cell_colours(snapshot.class_names, np.where(known[:, None], cells.probability, 0.0), known, colours)
    stride = max(1, math.ceil(max(np.ptp(cell_x), np.ptp(cell_y)) / MOST_PIXELS))
    column, row = (cell_x - cell_x.min()) // stride, (cell_y - cell_y.min()) // stride
    picture = np.zeros((int(row.max()) + 1, int(column.max()) + 1, 4))
    order = np.argsort(np.where(known, rgba[:, 3], -1.0), kind="stable")
    picture[row[order], column[order]] = rgba[order]
    x0, _, y0, _ = _bounds(snapshot)
    return picture, (x0, y0), stride * snapshot.cell_size_m


def _draw_cells(axes: Axes, snapshot: Snapshot, colours: dict[str, str]) -> None:
    picture, (x0, y0), step = cells_picture(snapshot, colours)
    _widen(picture, max(picture.shape[:2]) // _CELLS_PLAIN_TO_SEE)
    extent = (x0, x0 + step * picture.shape[1], y0, y0 + step * picture.shape[0])
    axes.imshow(picture, extent=extent, origin="lower", interpolation="nearest", aspect="equal")


def _widen(picture: np.ndarray, reach: int) -> None:
    """Let every cell (h, w, 4) spread over `reach` empty ones around it, so that a long, narrow strip can be seen."""
    for _ in range(min(reach, _WIDEST)):
        for axis in (0, 1):
            for step in (1, -1):
                shifted = np.roll(picture, step, axis=axis)
                edge = (slice(None),) * axis + (0 if step == 1 else -1,)
                shifted[edge] = 0.0
                empty = (picture[..., 3] == 0.0) & (shifted[..., 3] > 0.0)
                picture[empty] = shifted[empty]


def _draw_track(axes: Axes, recording: Recording, soils: Sequence[SoilObservation]) -> None:
    track = track_of(recording)
    if track is None:
        return
    holes = np.searchsorted(track.time_s, track.holes_s[:, 0], side="right")
    x_m, y_m = (np.insert(values, holes, np.nan) for values in (track.x_m, track.y_m))  # no line leads over a hole
    edged = [withStroke(linewidth=2.4, foreground="white")]  # seen on dark ground, too
    axes.plot(x_m, y_m, color=_SLOW_COLOUR, linewidth=0.8, zorder=3, path_effects=edged)
    used = [soil for soil in soils if soil.estimate is not None and not soil.gate_reason]
    lines = []
    for soil in used:
        inside = (track.time_s >= soil.start_s) & (track.time_s <= soil.end_s)
        here = np.column_stack([track.x_m[inside], track.y_m[inside]])
        # The database holds stretches of other drives too; those of this one lie on its track.
        if len(here) > 1 and np.hypot(*(here.mean(axis=0) - (soil.x_m, soil.y_m))) < np.ptp(here, axis=0).max() + 1.0:
            lines.append(here)
    axes.add_collection(LineCollection(lines, colors=_SLOW_COLOUR, linewidths=3.0, zorder=4))


def _draw_stretches(axes: Axes, stretches: Sequence[_Stretch]) -> None:
    for stretch in stretches:
        axes.annotate(
            str(stretch.number), (stretch.soil.x_m, stretch.soil.y_m), ha="center", va="center", fontsize=8, zorder=5,
            xytext=(26 if stretch.number % 2 else -26, -16 if stretch.number % 2 else 16), textcoords="offset points",
            arrowprops={"arrowstyle": "-", "linewidth": 0.7},
            bbox={"boxstyle": "circle,pad=0.25", "facecolor": "white", "edgecolor": "black", "linewidth": 0.8},
        )  # fmt: skip


def _decorate(
    figure: Figure,
    axes: Axes,
    snapshot: Snapshot,
    drives: Sequence[Drive],
    colours: dict[str, str],
    stretches: Sequence[_Stretch],
    *,
    drawn_track: bool,
) -> None:
    axes.set_xlabel("x [m]")
    axes.set_ylabel("y [m]")
    axes.set_facecolor("white")
    where = f" of {snapshot.site}" if snapshot.site else ""
    title = f"Terrain{where}: {len(snapshot.cells.key)} cells from {len(drives)} drive{'s' * (len(drives) != 1)}"
    figure.suptitle(title, x=0.01, ha="left", fontsize=11)  # a line of its own: a narrow map has no room for two titles
    if any(drive.synthetic for drive in drives):
        axes.set_title("synthetic", loc="right", fontsize=11, color="#b00020", fontweight="bold")
    seen = np.isfinite(snapshot.cells.probability).all(axis=1)
    present = set(np.argmax(snapshot.cells.probability[seen], axis=1).tolist()) if seen.any() else set()
    handles: list[Patch | Line2D] = [
        Patch(facecolor=colours[name], label=name)
        for index, name in enumerate(snapshot.class_names)
        if index in present
    ]
    if not seen.all():
        handles.append(Patch(facecolor=UNKNOWN_COLOUR, label="seen, not recognised"))
    if drawn_track:
        handles.append(Line2D([], [], color=_SLOW_COLOUR, linewidth=0.8, label="track"))
        handles.append(Line2D([], [], color=_SLOW_COLOUR, linewidth=3.0, label="slow: soil measured"))
    figure.legend(
        handles=handles, loc="outside right upper", frameon=False, fontsize=9, title=_legend_title(snapshot),
        title_fontsize=8, alignment="left",
    )  # fmt: skip
    if stretches:
        listed = [stretch.text for stretch in stretches[:_SOILS_SHOWN]]
        if len(stretches) > len(listed):
            listed.append(f"and {len(stretches) - len(listed)} more")
        figure.legend(
            handles=[Line2D([], [], linestyle="none", label=text) for text in listed],
            loc="outside lower left", ncols=2, frameon=False, fontsize=8, handlelength=0, handletextpad=0,
            title="Soil measured by the wheels (± one standard deviation)", title_fontsize=9, alignment="left",
        )  # fmt: skip


def _legend_title(snapshot: Snapshot) -> str:
    cells = np.ptp(cells_from_keys(snapshot.cells.key), axis=0).max() + 1
    widened = "\ncells drawn wider than they are" if cells >= _CELLS_PLAIN_TO_SEE else ""
    return f"more opaque: surer{widened}"
