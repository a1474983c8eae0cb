"""From fused observations to one belief over classes for every ground cell, whatever drives saw it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .observations import Drive

LEAST_PROBABILITY = 1e-3
"""No single look rules a class out further than this, nor does a model that has never heard of the class."""

NO_PLACE = "the place is not a finite number"
NOT_SEEN = "nobody has seen this ground"
NOT_RECOGNISED = "seen, but not recognised"


@dataclass(frozen=True)
class Cells:
    """Belief over k classes of m ground cells, sorted by key.

    Parameters
    ----------
    key : (m,) int64
        Both cell indices in one number (`cell_key`).
    probability : (m, k)
        Class probabilities [-]; NaN in cells that no look recognised.
    seen_s : (m,)
        Time of the newest look, POSIX seconds; NaN where no drive in it has a start time.
    looks : (m,) int
        Number of drives that recognised it.
    reason : (m,) int
        Index into `reasons`; 0 (empty) where the class is known.
    reasons
        Texts.
    """

    key: np.ndarray
    probability: np.ndarray
    seen_s: np.ndarray
    looks: np.ndarray
    reason: np.ndarray
    reasons: tuple[str, ...]


def cell_key(cell_x: np.ndarray, cell_y: np.ndarray) -> np.ndarray:
    """Make one int64 of two cell indices, so that lookup is one binary search."""
    return (np.asarray(cell_x, dtype=np.int64) << 32) + np.asarray(cell_y, dtype=np.int64)


def cell_of_key(key: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Undo `cell_key`."""
    cell_y = (key + 2**31 & 0xFFFFFFFF) - 2**31
    return (key - cell_y) >> 32, cell_y


@dataclass(frozen=True)
class _Looks:
    """Fused looks of all drives, one row each: cell key, drive number, evidence over the union of classes."""

    key: np.ndarray
    drive: np.ndarray
    log_probability: np.ndarray
    quality: np.ndarray
    unknown: np.ndarray
    seen_s: np.ndarray
    reasons: tuple[str, ...]


def grid_size(drives: Sequence[Drive]) -> float:
    """Cell size of a common grid [m]: the coarsest of the drives', so that no look is stretched over other ground."""
    sizes = [drive.terrain.cell_size_m for drive in drives if len(drive.terrain)]
    return max(sizes, default=1.0)


def combine(drives: Sequence[Drive], classes: tuple[str, ...], cell_size_m: float) -> Cells:
    """Combine the fused looks of several drives into one belief per cell.

    Looks of one drive share its light, its sound and its place's peculiarities, so they are pooled (geometric mean,
    weighted by quality) and count once. Different drives count as independent: their probabilities multiply, the
    best look of a cell whole and every further one tempered by its quality, as looks by similar models share
    their faults. Classes are equally probable beforehand.
    """
    looks = _gather(drives, classes, cell_size_m)
    keys, cell = np.unique(looks.key, return_inverse=True)
    number = len(keys)
    seen_s = np.full(number, -np.inf)
    np.fmax.at(seen_s, cell, looks.seen_s)
    told = ~looks.unknown
    pair, pair_row = np.unique(cell[told] * max(len(drives), 1) + looks.drive[told], return_inverse=True)
    share = np.maximum(looks.quality[told], 1e-6)
    pooled = np.zeros((len(pair), len(classes)))
    np.add.at(pooled, pair_row, share[:, None] * looks.log_probability[told])
    pooled /= np.bincount(pair_row, weights=share, minlength=len(pair))[:, None]
    best = np.zeros(len(pair))
    np.maximum.at(best, pair_row, looks.quality[told])
    pair_cell = pair // max(len(drives), 1)
    weight = _best_whole(pair_cell, best)
    evidence = np.zeros((number, len(classes)))
    np.add.at(evidence, pair_cell, weight[:, None] * pooled)
    counts = np.bincount(pair_cell, minlength=number)
    reason, reasons = _why_unknown(looks, cell, counts)
    probability = np.exp(evidence - np.max(evidence, axis=1, keepdims=True)) if classes else evidence
    probability /= np.sum(probability, axis=1, keepdims=True) if classes else 1.0
    probability[counts == 0] = np.nan
    return Cells(keys, probability, np.where(np.isinf(seen_s), np.nan, seen_s), counts, reason, reasons)


def _gather(drives: Sequence[Drive], classes: tuple[str, ...], cell_size_m: float) -> _Looks:
    parts: list[tuple[np.ndarray, ...]] = []
    reasons: list[str] = []
    for number, drive in enumerate(drives):
        terrain, evidence = drive.terrain, drive.terrain.evidence
        rows = np.flatnonzero(np.asarray(terrain.sense) == "fused")
        if not len(rows):
            continue
        # The cell's centre decides, should this drive's grid be finer than the common one.
        places = (np.stack([terrain.cell_x[rows], terrain.cell_y[rows]]) + 0.5) * terrain.cell_size_m
        cells = np.floor(places / cell_size_m).astype(np.int64)
        probability = np.full((len(rows), len(classes)), LEAST_PROBABILITY)
        columns = [classes.index(name) for name in evidence.classes]
        probability[:, columns] = np.maximum(evidence.probabilities[rows], LEAST_PROBABILITY)
        probability /= np.sum(probability, axis=1, keepdims=True)
        start = math.nan if drive.started is None else drive.started.timestamp()
        parts.append(
            (
                cell_key(cells[0], cells[1]),
                np.full(len(rows), number),
                np.log(probability),
                evidence.quality[rows],
                evidence.unknown[rows],
                start + terrain.time_s[rows],
            )
        )
        reasons.extend("; ".join(evidence.reasons[row]) for row in rows)
    if not parts:
        none = np.zeros(0)
        return _Looks(
            none.astype(np.int64), none.astype(int), np.zeros((0, len(classes))), none, none.astype(bool), none, ()
        )
    key, drive, log_probability, quality, unknown, seen_s = map(np.concatenate, zip(*parts, strict=True))
    return _Looks(key, drive, log_probability, quality, unknown, seen_s, tuple(reasons))


def _best_whole(cell: np.ndarray, quality: np.ndarray) -> np.ndarray:
    """Weight of each drive's look at a cell: 1 for the cell's best one, its quality for every other."""
    order = np.lexsort((-quality, cell))
    first = np.ones(len(cell), dtype=bool)
    first[1:] = cell[order][1:] != cell[order][:-1]
    weight = quality.copy()
    weight[order[first]] = 1.0
    return weight


def _why_unknown(looks: _Looks, cell: np.ndarray, counts: np.ndarray) -> tuple[np.ndarray, tuple[str, ...]]:
    """For cells that no look recognised, why: the reasons of the last look at them."""
    reason = np.zeros(len(counts), dtype=np.int64)
    texts = {"": 0}
    for row in np.flatnonzero(counts[cell] == 0):  # the last look at a cell wins
        said = looks.reasons[row]
        text = f"{NOT_RECOGNISED}: {said}" if said else NOT_RECOGNISED
        reason[cell[row]] = texts.setdefault(text, len(texts))
    return reason, tuple(texts)
