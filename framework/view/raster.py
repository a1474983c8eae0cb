"""The map as an image: cells summed up by Datashader where a pixel covers several of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib import colormaps
from matplotlib.colors import to_rgba_array

from ..colours import SEQUENTIAL, UNKNOWN_COLOUR, class_colours
from .layers import Layer

HATCH_COLOUR = "#8c8c8c"
"""Lines on unknown ground, which is `UNKNOWN_COLOUR`."""

_HATCH_PX, _LINE_PX = 8, 2
"""Distance and width of the lines [px]."""

_SPARSE, _LEAST_PX = 0.05, 4
"""Where less than this share of the picture is ground that was seen, such as the track of one drive [-], blocks of
cells are at least so wide [px]: narrower lines are hardly seen."""

_UNKNOWN_SHARE = 0.5
"""A pixel is unknown from this share of its cells on [-]."""

View = tuple[float, float, float, float]
"""Corners x0, y0, x1, y1 of what is in view, counted in cells."""


@dataclass(frozen=True)
class Image:
    """An image of a part of the map.

    Parameters
    ----------
    rgba : (h, w) uint32
        Row 0 in the south; nothing (transparent) where nobody has been.
    cells
        Cells along each edge of the blocks that are shown as one [-]; 1 where each cell is shown by itself.
    """

    rgba: np.ndarray
    cells: int


def image_of(
    layer: Layer, class_names: Sequence[str], columns: np.ndarray, rows: np.ndarray, view: View, size: tuple[int, int]
) -> Image:  # fmt: skip
    """Draw a layer.

    Parameters
    ----------
    layer
        Of m cells.
    class_names
        The snapshot's.
    columns, rows : (m,)
        The cells; columns ascend.
    view
        What is in view.
    size
        Width and height of the image [px].
    """
    x0, y0, x1, y1 = view
    width, height = size
    for pixels in (1, _LEAST_PX):
        block = max(1, int(np.ceil(pixels * max((x1 - x0) / width, (y1 - y0) / height) - 1e-9)))
        first = np.floor(np.array([x0, y0]) / block).astype(int) * block
        shape = np.maximum(np.ceil((np.array([x1, y1]) - first) / block).astype(int), 1)
        last = first + shape * block
        within = slice(*np.searchsorted(columns, (first[0], last[0])))
        colours, unknown = _blocks(layer, class_names, columns, rows, within, first, last, shape)
        if np.mean(colours[..., 3] > 0) >= _SPARSE:
            break
    # Each pixel shows the block that its centre lies in.
    x = ((x0 + (np.arange(width) + 0.5) * (x1 - x0) / width - first[0]) // block).astype(int)
    y = ((y0 + (np.arange(height) + 0.5) * (y1 - y0) / height - first[1]) // block).astype(int)
    picture = colours[y[:, None], x[None, :]]
    lines = (np.arange(width) + np.arange(height)[:, None]) % _HATCH_PX < _LINE_PX
    picture[unknown[y[:, None], x[None, :]] & lines] = _bytes([HATCH_COLOUR])[0]
    return Image(picture.view(np.uint32).reshape(height, width), block)


def colours_of(layer: Layer, class_names: Sequence[str], values: np.ndarray) -> np.ndarray:
    """Give the colours (..., 4) uint8 of values of a layer; `UNKNOWN_COLOUR` where they are NaN."""
    known = np.isfinite(values)
    filled = np.where(known, values, 0.0)
    if layer.shown == "most":
        palette = _bytes([*class_colours(class_names).values(), UNKNOWN_COLOUR])
        return palette[np.where(known, filled, len(class_names)).astype(int)]
    span = layer.high - layer.low
    colours = colormaps[SEQUENTIAL]((filled - layer.low) / span if span > 0.0 else filled * 0.0, bytes=True)
    return np.where(known[..., None], colours, _bytes([UNKNOWN_COLOUR])[0])


def _bytes(colours: Sequence[str]) -> np.ndarray:
    return np.round(255.0 * to_rgba_array(colours)).astype(np.uint8)


def _blocks(
    layer: Layer, class_names: Sequence[str], columns: np.ndarray, rows: np.ndarray, within: slice, first: np.ndarray,
    last: np.ndarray, shape: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:  # fmt: skip
    """Colours (h, w, 4) of blocks of cells, and which of them are unknown (h, w)."""
    count, lacking, value = _summed_up(layer, len(class_names), columns, rows, within, first, last, shape)
    unknown = (count > 0) & ((lacking >= _UNKNOWN_SHARE * count) | np.isnan(value))
    colours = colours_of(layer, class_names, np.where(unknown, np.nan, value))
    colours[count == 0] = 0
    return colours, unknown


def _summed_up(
    layer: Layer, classes: int, columns: np.ndarray, rows: np.ndarray, within: slice, first: np.ndarray,
    last: np.ndarray, shape: np.ndarray,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:  # fmt: skip
    """Number of cells in each block, how many are unknown, and the value that is shown; each (h, w)."""
    import datashader  # seconds, and a small site never needs it
    import pandas

    values = layer.values[within]
    table = pandas.DataFrame({"x": columns[within] + 0.5, "y": rows[within] + 0.5, "value": values})
    canvas = datashader.Canvas(
        int(shape[0]), int(shape[1]), x_range=(first[0], last[0]), y_range=(first[1], last[1])
    )  # fmt: skip
    if layer.shown == "most":
        codes = np.where(np.isnan(values), classes, values).astype(int)
        table["class"] = pandas.Categorical.from_codes(codes, categories=list(map(str, range(classes + 1))))
        counts = canvas.points(table, "x", "y", agg=datashader.by("class", datashader.count())).to_numpy()
        total, lacking = counts.sum(axis=-1), counts[..., -1]
        best = counts[..., :-1].argmax(axis=-1) if classes else np.zeros(total.shape)
        return total, lacking, best.astype(float)
    table["unknown"] = np.isnan(values).astype(float)
    reduce = datashader.min if layer.shown == "least" else datashader.max
    wanted = {"count": datashader.count(), "unknown": datashader.sum("unknown"), "value": reduce("value")}
    found = canvas.points(table, "x", "y", agg=datashader.summary(**wanted))
    total, lacking, value = (found[name].to_numpy() for name in wanted)
    return total, np.nan_to_num(lacking), value
