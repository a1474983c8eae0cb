"""The labelled samples that a training got wrong most surely: wrong labels, odd samples, or what is hard to tell."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .calibration import joined
from .labelled import LabelledFile
from .report import HeldOut

MOST = 12


@dataclass(frozen=True)
class Mistake:
    """A sample, what it is labelled, and what models said that had not seen its group, with which probability [-]."""

    sample: LabelledFile
    said: str
    probability: float


def worst_mistakes(
    samples: Sequence[LabelledFile], sample_of: np.ndarray, held: HeldOut, original: np.ndarray, classes: Sequence[str]
) -> tuple[Mistake, ...]:
    """Find the mistakes of the highest probability, one a group at most.

    Parameters
    ----------
    samples
        u labelled files or stretches of files.
    sample_of : (n,)
        Index of the sample that each row is of; rows of one are joined.
    held
        Predictions of the n rows.
    original : (n,)
        True for rows that count: items as they came.
    classes
        Names of the k classes.
    """
    count, rows = len(samples), np.flatnonzero(held.scored & original)
    together = np.full((count, len(classes)), 1.0 / len(classes))
    for rho in np.unique(held.correlation[rows]):
        own = rows[held.correlation[rows] == rho]
        unit = np.unique(sample_of[own])
        together[unit] = joined(held.probabilities[own], sample_of[own], np.ones(len(own)), count, rho)[unit]
    there = np.isin(np.arange(count), sample_of[rows])
    said, top = together.argmax(axis=1), together.max(axis=1)
    found: dict[str, Mistake] = {}
    for index in np.argsort(-top, kind="stable"):
        sample, name = samples[index], classes[int(said[index])]
        if there[index] and name != sample.class_name and len(found) < MOST:
            found.setdefault(sample.group, Mistake(sample, name, float(top[index])))
    return tuple(found.values())
