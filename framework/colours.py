"""Colours of maps: classes of ground and what is unknown, told apart by people with any kind of colour vision."""

from __future__ import annotations

from collections.abc import Sequence

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
