"""Benefit of cleaning: the ground recognised along a drive, before and after, with an interval over drives."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from bevameter.audio.listen import listen
from bevameter.framework.core.classifier.classifier import TerrainClassifier
from bevameter.framework.core.recording.types import Labels, SoundStream


@dataclass(frozen=True)
class Heard:
    """A classifier's result on one drive, window by window.

    Parameters
    ----------
    truth, taken : (n,)
        Class that was driven over, and the class taken to be most probable; ``""`` where nothing could be said.
    known : (n,)
        Whether the classifier gave a class.
    """

    truth: np.ndarray
    taken: np.ndarray
    known: np.ndarray


def heard(sound: SoundStream, model: TerrainClassifier, labels: Labels) -> Heard:
    """Classify a drive's sound where it is labelled: windows whose start, middle and end lie on one class."""
    truth, taken, known = [], [], []
    for part in listen(sound, model):
        evidence = part.evidence
        ends = [labels.at(t) for t in (part.start_s, 0.5 * (part.start_s + part.end_s), part.end_s)]
        own = (ends[0] == ends[1]) & (ends[1] == ends[2]) & (ends[1] != "")
        best = np.array(evidence.classes, dtype=object)[np.argmax(evidence.probabilities, axis=1)]
        spoken = np.ptp(evidence.probabilities, axis=1) > 1e-9
        truth.append(ends[1][own])
        taken.append(np.where(spoken, best, "")[own])
        known.append(~np.asarray(evidence.unknown)[own])
    return Heard(
        np.concatenate(truth) if truth else np.zeros(0, dtype=object),
        np.concatenate(taken) if taken else np.zeros(0, dtype=object),
        np.concatenate(known) if known else np.zeros(0, dtype=bool),
    )


@dataclass(frozen=True)
class Gain:
    """Balanced accuracy before and after cleaning, its difference with a 95 % interval over drives, and the verdict.

    `known_before` and `known_after` are the shares of windows that the classifier gave a class; `helps` is whether the
    interval of the difference lies above zero. Windows of one drive are not independent: drives are drawn.
    """

    before: float
    after: float
    difference: float
    low: float
    high: float
    known_before: float
    known_after: float
    drives: int
    windows: int

    @property
    def helps(self) -> bool:
        """Whether cleaning significantly helps."""
        return self.low > 0.0


def gain_of(before: Sequence[Heard], after: Sequence[Heard], rng: np.random.Generator, draws: int = 1000) -> Gain:
    """Compare n drives heard before and after cleaning; the bootstrap draws whole drives."""
    classes = np.unique(np.concatenate([drive.truth for drive in before]).astype(str))
    tables = [np.stack([_table(drive, classes) for drive in drives]) for drives in (before, after)]
    scores = [_balanced(table.sum(axis=0)) for table in tables]
    picks = rng.integers(0, len(before), (draws, len(before)))
    drawn = np.array([_balanced(tables[1][p].sum(axis=0)) - _balanced(tables[0][p].sum(axis=0)) for p in picks])
    low, high = np.quantile(drawn, [0.025, 0.975])
    known = [float(np.mean(np.concatenate([drive.known for drive in drives]))) for drives in (before, after)]
    return Gain(
        scores[0], scores[1], scores[1] - scores[0], float(low), float(high), known[0], known[1], len(before),
        int(tables[0][..., 1].sum()),
    )  # fmt: skip


def _table(drive: Heard, classes: np.ndarray) -> np.ndarray:
    """Windows right and windows in all, by class: (k, 2)."""
    own = drive.truth.astype(str)[:, None] == classes
    return np.stack([(own & (drive.taken == drive.truth)[:, None]).sum(axis=0), own.sum(axis=0)], axis=1)


def _balanced(table: np.ndarray) -> float:
    there = table[:, 1] > 0
    return float(np.mean(table[there, 0] / table[there, 1])) if there.any() else 0.0
