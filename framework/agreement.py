"""How far what each sense says of the ground, and what all say together, agrees with the labels of a recording."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .core.evidence import UNKNOWN
from .core.recording.types import Labels
from .core.track.way import Track
from .core.vehicle import Vehicle
from .fusion import fuse
from .segments import ClassTrack, classes_along
from .sense_map import SenseRecord
from .summary import Agreement

FUSED = "all together"
"""How the fused belief is named among the senses."""


def agreement_with(
    labels: Labels | None,
    along: ClassTrack | None,
    records: Sequence[SenseRecord],
    track: Track | None,
    vehicle: Vehicle | None,
    cell_size_m: float,
) -> tuple[Agreement, ...]:
    """Compare senses and fused belief with labels, piece by piece of the track.

    Parameters
    ----------
    labels
        Stretches of time whose ground is known; what they call unknown is left out.
    along
        The fused class along the track.
    records
        What each sense observed; those that observed nothing are left out.
    track, vehicle, cell_size_m
        As in `segments.classes_along`.

    Returns
    -------
    tuple of Agreement
        One for each sense, by its instrument, and a last one for the fused belief; none without labels on the track, or
        where no sense observed anything.
    """
    there = [record for record in records if record.items]
    if labels is None or along is None or track is None or not there:
        return ()
    truth = labels.at(0.5 * (along.start_s + along.end_s))
    truth[truth == UNKNOWN] = ""
    if not (truth != "").any():
        return ()
    found = [(one.sense, classes_along(fuse([one.map]), track, vehicle, cell_size_m)) for one in there]
    return tuple(_compared(name, each, truth) for name, each in (*found, (FUSED, along)))


def _compared(name: str, along: ClassTrack, truth: np.ndarray) -> Agreement:
    said = np.array([*along.classes, ""], dtype=object)[np.where(along.known, along.label, -1)]
    labelled, right, unknown = truth != "", said == truth, said == ""
    right_m, wrong_m, unknown_m = (
        float(along.length_m[labelled & rows].sum()) for rows in (right, ~right & ~unknown, unknown)
    )
    return Agreement(name, right_m, wrong_m, unknown_m)
