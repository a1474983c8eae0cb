"""From fused observations to one belief over classes for every ground cell, whatever drives saw it."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from ..framework.core.pooling import cell_keys, cells_of, centred_logs, pooled, rows_of_keys, sums_by
from .observations import Drive, TerrainObservations

NO_PLACE = "the place is not a finite number"
NOT_SEEN = "nobody has seen this ground"
OUTSIDE = "outside the bounds of this snapshot"
NOT_RECOGNISED = "seen, but not recognised"


@dataclass(frozen=True)
class Cells:
    """Belief over k classes of m ground cells, sorted by key.

    Parameters
    ----------
    key : (m,) int64
        Both cell indices in one number (`pooling.cell_keys`).
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


@dataclass(frozen=True)
class _Looks:
    """Fused looks of all drives, one row each: cell key, drive number, evidence over the union of classes."""

    key: np.ndarray
    drive: np.ndarray
    logs: np.ndarray
    quality: np.ndarray
    unknown: np.ndarray
    seen_s: np.ndarray
    reasons: tuple[tuple[str, ...], ...]


def grid_size(drives: Sequence[Drive]) -> float:
    """Cell size of a common grid [m]: the coarsest of the drives', so that no look is stretched over other ground."""
    sizes = [drive.terrain.cell_size_m for drive in drives if len(drive.terrain)]
    return max(sizes, default=1.0)


def keys_of(drives: Sequence[Drive], cell_size_m: float) -> np.ndarray:
    """Keys of the cells that drives looked at, sorted, each once."""
    seen = [_keys(drive.terrain, _fused(drive.terrain), cell_size_m) for drive in drives]
    return np.unique(np.concatenate(seen)) if seen else np.zeros(0, dtype=np.int64)


def classes_of(drives: Sequence[Drive], soils: Iterable[str]) -> tuple[str, ...]:
    """Names of the classes that drives or soils know, sorted."""
    return tuple(sorted({name for drive in drives for name in drive.terrain.evidence.classes}.union(soils)))


def combine(
    drives: Sequence[Drive], classes: tuple[str, ...], cell_size_m: float, among: np.ndarray | None = None
) -> Cells:
    """Combine the fused looks of several drives into one belief per cell; only of cells `among` keys where given.

    Looks of one drive share its light, its sound and its place's peculiarities, so they are pooled (geometric mean,
    weighted by quality) and count once. Different drives count as independent: their probabilities multiply, the
    best look of a cell whole and every further one tempered by its quality, as looks by similar models share
    their faults. Classes are equally probable beforehand.
    """
    looks = _gather(drives, classes, cell_size_m, among)
    keys, cell = np.unique(looks.key, return_inverse=True)
    number = len(keys)
    seen_s = np.full(number, -np.inf)
    np.fmax.at(seen_s, cell, looks.seen_s)
    open_ = ~looks.unknown
    pair, pair_row = np.unique(cell[open_] * max(len(drives), 1) + looks.drive[open_], return_inverse=True)
    share = np.maximum(looks.quality[open_], 1e-6)
    mean = sums_by(pair_row, share[:, None] * looks.logs[open_], len(pair))
    mean /= np.bincount(pair_row, weights=share, minlength=len(pair))[:, None]
    best = np.zeros(len(pair))
    np.maximum.at(best, pair_row, looks.quality[open_])
    pair_cell = pair // max(len(drives), 1)
    probability = pooled(sums_by(pair_cell, _best_whole(pair_cell, best)[:, None] * mean, number))
    counts = np.bincount(pair_cell, minlength=number).astype(np.int32)
    reason, reasons = _why_unknown(looks, cell, counts)
    probability[counts == 0] = np.nan
    return Cells(keys, probability, np.where(np.isinf(seen_s), np.nan, seen_s), counts, reason, reasons)


def put_in(new: Cells, cells: Cells, among: np.ndarray) -> Cells:
    """Give cells in which those with keys `among` are as in `new`, and gone where `new` has none of them."""
    kept = rows_of_keys(among, cells.key) < 0
    key = np.concatenate([cells.key[kept], new.key])
    order = np.argsort(key, kind="stable")  # of two sorted runs: linear in time

    def both(old: np.ndarray, other: np.ndarray) -> np.ndarray:
        return np.concatenate([old[kept], other])[order]

    texts = {text: number for number, text in enumerate(dict.fromkeys((*cells.reasons, *new.reasons)))}
    old_number, new_number = (
        np.array([texts[text] for text in part.reasons], dtype=np.int32)[part.reason] for part in (cells, new)
    )
    return Cells(
        key[order], both(cells.probability, new.probability), both(cells.seen_s, new.seen_s),
        both(cells.looks, new.looks), both(old_number, new_number), tuple(texts),
    )  # fmt: skip


def _fused(terrain: TerrainObservations) -> np.ndarray:
    return np.flatnonzero(np.asarray(terrain.sense) == "fused")


def _keys(terrain: TerrainObservations, rows: np.ndarray, cell_size_m: float) -> np.ndarray:
    return cell_keys(cells_on_grid(terrain.cell_x[rows], terrain.cell_y[rows], terrain.cell_size_m, cell_size_m))


def _gather(
    drives: Sequence[Drive], classes: tuple[str, ...], cell_size_m: float, among: np.ndarray | None = None
) -> _Looks:
    parts: list[tuple[np.ndarray, ...]] = []
    reasons: list[tuple[str, ...]] = []
    for number, drive in enumerate(drives):
        terrain, evidence = drive.terrain, drive.terrain.evidence
        rows = _fused(terrain)
        key = _keys(terrain, rows, cell_size_m)
        if among is not None:
            wanted = rows_of_keys(among, key) >= 0
            rows, key = rows[wanted], key[wanted]
        if not len(rows):
            continue
        probability = np.zeros((len(rows), len(classes)))
        probability[:, [classes.index(name) for name in evidence.classes]] = evidence.probabilities[rows]
        start = math.nan if drive.started is None else drive.started.timestamp()
        parts.append(
            (
                key,
                np.full(len(rows), number),
                centred_logs(probability),
                evidence.quality[rows],
                evidence.unknown[rows],
                start + terrain.time_s[rows],
            )
        )
        reasons.extend(map(evidence.reasons.__getitem__, rows.tolist()))
    if not parts:
        none = np.zeros(0)
        return _Looks(
            none.astype(np.int64), none.astype(int), np.zeros((0, len(classes))), none, none.astype(bool), none, ()
        )
    key, drive, logs, quality, unknown, seen_s = map(np.concatenate, zip(*parts, strict=True))
    return _Looks(key, drive, logs, quality, unknown, seen_s, tuple(reasons))


def cells_on_grid(cell_x: np.ndarray, cell_y: np.ndarray, cell_size_m: float, common_m: float) -> np.ndarray:
    """Cells (n, 2) of a coarser grid in which the centres of cells (n,) of a drive's own grid lie; sizes in [m]."""
    return cells_of((cell_x + 0.5) * cell_size_m, (cell_y + 0.5) * cell_size_m, common_m)


def _best_whole(cell: np.ndarray, quality: np.ndarray) -> np.ndarray:
    """Weight of each drive's look at a cell (sorted): 1 for the cell's best one, its quality for every other."""
    new = np.diff(cell, prepend=-1) > 0
    run = np.cumsum(new) - 1
    greatest = np.maximum.reduceat(quality, np.flatnonzero(new)) if len(cell) else quality
    best = np.flatnonzero(quality == greatest[run])
    weight = quality.copy()
    weight[best[np.diff(run[best], prepend=-1) > 0]] = 1.0  # of equally good looks the first
    return weight


def _why_unknown(looks: _Looks, cell: np.ndarray, counts: np.ndarray) -> tuple[np.ndarray, tuple[str, ...]]:
    """For cells that no look recognised, why: the reasons of the last look at them."""
    reason = np.zeros(len(counts), dtype=np.int32)
    texts = {"": 0}
    for row in np.flatnonzero(counts[cell] == 0):  # the last look at a cell wins
        said = "; ".join(looks.reasons[row])
        text = f"{NOT_RECOGNISED}: {said}" if said else NOT_RECOGNISED
        reason[cell[row]] = texts.setdefault(text, len(texts))
    return reason, tuple(texts)
