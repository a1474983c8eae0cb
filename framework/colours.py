"""Colours of maps: classes of ground and what is unknown, safe for common colour-vision deficiencies."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.colors import to_rgb

COLOURS = {
    "sand": "#f0c33c", "loam": "#7a3e10", "gravel": "#7fa8c9", "grass": "#0f7d4f", "clay": "#e0703c",
    "asphalt": "#26262b",
}  # fmt: skip
"""Colours of the synthetic world's classes; other classes get the next of `FURTHER_COLOURS`."""

FURTHER_COLOURS = ("#332288", "#ddcc77", "#cc6677", "#88ccee", "#117733", "#882255", "#44aa99", "#aa4499")
"""P. Tol's qualitative scheme "muted" (personal.sron.nl/~pault, 2021)."""

UNKNOWN_COLOUR = "#dcdcdc"

SEQUENTIAL = "cividis"
"""Matplotlib's name of the colour map of numbers (J. R. Nunez et al. 2018, doi:10.1371/journal.pone.0199239)."""


def class_colours(names: Sequence[str]) -> dict[str, str]:
    """Give each class its colour."""
    others = [name for name in names if name not in COLOURS]
    further = {name: FURTHER_COLOURS[index % len(FURTHER_COLOURS)] for index, name in enumerate(others)}
    return {name: COLOURS.get(name, further.get(name, "")) for name in names}


LEAST_OPACITY = 0.15
"""Of a cell whose class is as good as guessed [-]."""


def cell_colours(
    names: Sequence[str], probability: np.ndarray, known: np.ndarray, colours: Mapping[str, str]
) -> np.ndarray:
    """Give cells the colour of their most probable class, the more opaque the surer it is.

    Parameters
    ----------
    names
        Of the k classes.
    probability : (n, k)
        Of each class [-]; of any value where it is not known.
    known : (n,)
        Whether a class may be named; else a cell has `UNKNOWN_COLOUR`, opaque.
    colours
        By class.

    Returns
    -------
    (n, 4)
        Red, green, blue and opacity in [0, 1].
    """
    if not names:
        return np.tile([*to_rgb(UNKNOWN_COLOUR), 1.0], (len(known), 1))
    palette, guessed = np.array([to_rgb(colours[name]) for name in names]), 1.0 / max(len(names), 2)
    best, surest = np.argmax(probability, axis=1), np.max(probability, axis=1)
    sure = np.clip((surest - guessed) / (1.0 - guessed), 0.0, 1.0)
    rgba = np.column_stack([palette[best], LEAST_OPACITY + (1.0 - LEAST_OPACITY) * sure])
    return np.where(known[:, None], rgba, [*to_rgb(UNKNOWN_COLOUR), 1.0])
