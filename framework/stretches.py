"""The fused class along the track: where it changes, and what is believed of one stretch."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .core.evidence import UNKNOWN
from .core.track.way import Track, cells_under_wheels
from .core.vehicle import Vehicle
from .fusion import Belief

PATCH_LENGTH_M = 10.0
"""Typical length of ground of one class [m]: what a change of class from cell to cell is weighed against."""

LEAST_KNOWN_SHARE = 0.5
"""A stretch of whose cells fewer than this share are known has no class [-]."""


LEAST_CLASS_PROBABILITY = 2.0 / 3.0
"""A stretch whose class is less probable than this has none [-]: a soil filed under a wrong class misleads every
planner that asks for that class."""


@dataclass(frozen=True)
class ClassTrack:
    """The fused class of m pieces of the track, each about a cell long.

    Parameters
    ----------
    start_s, end_s : (m,)
        When the wheels were on the piece [s].
    length_m : (m,)
        Its length [m].
    probabilities : (m, k)
        Belief over the classes under the wheels, mean of their known cells; uniform where none is known.
    known : (m,)
        Is any cell under the wheels known?
    label : (m,) int
        The class of the piece in the most probable sequence of classes; -1 where the senses know no class at all.
    classes
        The k names.
    """

    start_s: np.ndarray
    end_s: np.ndarray
    length_m: np.ndarray
    probabilities: np.ndarray
    known: np.ndarray
    label: np.ndarray
    classes: tuple[str, ...]

    def changes_s(self) -> np.ndarray:
        """Times at which the class changes [s]."""
        return self.start_s[1:][self.label[1:] != self.label[:-1]]

    def metres(self) -> dict[str, float]:
        """Length of track by class, and of what stays unknown, where there is any [m]."""
        names = [*self.classes, UNKNOWN]
        label = np.where(self.known, self.label, len(self.classes))
        sums = np.bincount(label, self.length_m, len(names))
        return {name: float(length) for name, length in zip(names, sums, strict=True) if length > 0}

    def belief_between(self, start_s: float, end_s: float) -> dict[str, float]:
        """Give the mean belief over a stretch of time, by class; empty where it is too little known, or too unsure."""
        overlap = np.clip(np.minimum(self.end_s, end_s) - np.maximum(self.start_s, start_s), 0.0, None)
        total, known = float(overlap.sum()), overlap * self.known
        if total <= 0 or not self.classes or known.sum() < LEAST_KNOWN_SHARE * total:
            return {}
        mean = known @ self.probabilities / known.sum()
        if mean.max() < LEAST_CLASS_PROBABILITY:
            return {}
        return {name: float(value) for name, value in zip(self.classes, mean, strict=True)}


def classes_along(belief: Belief, track: Track, vehicle: Vehicle | None, cell_size_m: float) -> ClassTrack:
    """Follow the belief along the track.

    Single cells that are wrong would cut a stretch to pieces, so the class is the most probable *sequence* under a
    Markov chain that changes once in `PATCH_LENGTH_M` on average (Viterbi 1967, doi:10.1109/TIT.1967.1054010).
    """
    times = track.every(cell_size_m)
    start_s, end_s = times[:-1], times[1:]
    window, cells = cells_under_wheels(track, vehicle, start_s, end_s, cell_size_m)
    row = belief.rows(cells)
    seen = row >= 0
    seen[seen] = ~belief.unknown[row[seen]]
    m, k = len(start_s), len(belief.classes)
    weight = np.bincount(window[seen], belief.quality[row[seen]], m)
    sums = np.zeros((m, k))
    np.add.at(sums, window[seen], belief.quality[row[seen]][:, None] * belief.probabilities[row[seen]])
    known = weight > 0
    probabilities = np.full((m, k), 1.0 / max(k, 1))
    probabilities[known] = sums[known] / weight[known][:, None]
    length_m = np.interp(end_s, track.time_s, track.way_m) - np.interp(start_s, track.time_s, track.way_m)
    label = _most_probable_sequence(probabilities, length_m) if k else np.full(m, -1)
    return ClassTrack(start_s, end_s, length_m, probabilities, known, label, belief.classes)


def _most_probable_sequence(probabilities: np.ndarray, length_m: np.ndarray) -> np.ndarray:
    m, k = probabilities.shape
    if k == 1 or m == 0:
        return np.zeros(m, dtype=np.int64)
    change = 1.0 - np.exp(-np.maximum(length_m, 1e-6) / PATCH_LENGTH_M)
    stay, leave = np.log1p(-change), np.log(change / (k - 1))
    logs = np.log(np.maximum(probabilities, 1e-9))
    score, back = logs[0], np.zeros((m, k), dtype=np.int64)
    for piece in range(1, m):  # one step a cell of track, k numbers each
        keep = score + stay[piece]
        best = int(np.argmax(score))
        switch = score[best] + leave[piece]
        moved = keep < switch
        back[piece] = np.where(moved, best, np.arange(k))
        score = np.where(moved, switch, keep) + logs[piece]
    label = np.empty(m, dtype=np.int64)
    label[-1] = int(np.argmax(score))
    for piece in range(m - 1, 0, -1):
        label[piece - 1] = back[piece, label[piece]]
    return label
