"""The ground as whoever drove knows it: a class that is stated of a whole recording, fused with what the senses say.

A vehicle without camera and microphone, on a field that its driver knows, so attaches what its wheels measure to a
class. The statement is evidence like a sense's, under the wheels, and is stored as one.
"""

from __future__ import annotations

import numpy as np

from .core.class_names import check_spelling
from .core.evidence import ClassEvidence
from .core.recording.types import Recording
from .core.track.way import Track
from .default_models import Models
from .sense_map import SenseMap, SenseRecord
from .senses import Observation

OPERATOR = "operator"
"""How the statement is named among the senses."""

STATED = 0.99
"""Probability of the class that is stated [-]: whoever drives may be wrong about a patch of ground."""


def check_stated(ground: str, models: Models) -> None:
    """Refuse a class that no class may be named, or that a model spells otherwise; raises `InputError`."""
    check_spelling(ground, [each.classes for each in models.classifiers.values()], "ground")


def observe_stated(
    ground: str | None, recording: Recording, track: Track | None, models: Models, cell_size_m: float
) -> tuple[SenseRecord, ...]:
    """Give what is stated of the ground as a sense's record; none where nothing is.

    Parameters
    ----------
    ground
        Class of the whole recording; None where nobody stated one.
    recording, track
        Its vehicle, and where that was.
    models
        The senses' classifiers: what is stated speaks against their other classes.
    cell_size_m
        Edge of a ground cell [m].
    """
    if ground is None:
        return ()
    record = SenseRecord(OPERATOR, OPERATOR, SenseMap(OPERATOR), absent="" if track else "no places in the recording")
    if track is not None:
        times = track.every(cell_size_m)
        known = {ground}.union(*(each.classes for each in models.classifiers.values()))
        evidence = _evidence(ground, tuple(sorted(known)), len(times) - 1)
        record.add(Observation.under_wheels(evidence, times[:-1], times[1:], recording, track, cell_size_m))
    return (record,)


def _evidence(ground: str, classes: tuple[str, ...], n: int) -> ClassEvidence:
    others = len(classes) - 1
    row = np.full(len(classes), (1.0 - STATED) / max(others, 1))
    row[classes.index(ground)] = STATED if others else 1.0
    return ClassEvidence(classes, np.tile(row, (n, 1)), np.ones(n), np.zeros(n, dtype=bool), ((),) * n)
