"""Sums over looks at cells of the ground: they add up, whatever part of a drive each is of."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .pooling import rows_of_keys

# Columns of the sums kept for a cell: open looks, closed looks, sum q, sum q^2, sum q |l|^2.
OPEN, CLOSED, Q, QQ, SQUARES = range(5)


@dataclass(frozen=True)
class CellSums:
    """Sums over looks at n cells.

    Parameters
    ----------
    keys : (n,)
        The cells, as `cell_keys`, sorted.
    sums : (n, 5)
        Numbers of open and closed looks; sums of q, q^2 and q |l|^2 of qualities q and centred log-probabilities l.
    logs : (n, k)
        Sum of q l, by class.
    reasons : (n, r)
        Number of closed looks, by reason.
    last_s : (n,)
        Time of the last look [s].
    """

    keys: np.ndarray
    sums: np.ndarray
    logs: np.ndarray
    reasons: np.ndarray
    last_s: np.ndarray

    @staticmethod
    def none() -> CellSums:
        """Give those of no look."""
        return CellSums(np.empty(0, dtype=np.int64), np.empty((0, 5)), np.empty((0, 0)), np.empty((0, 0)), np.empty(0))

    def plus(self, other: CellSums) -> CellSums:
        """Give those over the looks of both; neither is changed."""
        if not len(self.keys) or not len(other.keys):
            return other if len(other.keys) else self
        union = np.union1d(self.keys, other.keys)
        old, row = np.searchsorted(union, self.keys), np.searchsorted(union, other.keys)

        def added(some: np.ndarray, more: np.ndarray) -> np.ndarray:
            answer = np.zeros((len(union), max(some.shape[1], more.shape[1])))
            answer[old, : some.shape[1]] = some
            answer[row, : more.shape[1]] += more
            return answer

        last = np.full(len(union), -np.inf)
        last[old] = self.last_s
        last[row] = np.maximum(last[row], other.last_s)
        sums, logs, reasons = (added(getattr(self, name), getattr(other, name)) for name in ("sums", "logs", "reasons"))
        return CellSums(union, sums, logs, reasons, last)

    def among(self, keys: np.ndarray) -> CellSums:
        """Give those of the cells with such keys."""
        row = rows_of_keys(self.keys, keys)
        row = np.sort(row[row >= 0])
        return CellSums(self.keys[row], self.sums[row], self.logs[row], self.reasons[row], self.last_s[row])

    def main_reasons(self, names: Sequence[str]) -> tuple[str, ...]:
        """Say why most of the closed looks at each cell were closed; the first in the alphabet of equals."""
        counts = self.reasons
        if not counts.shape[1]:
            return ("",) * len(counts)
        order = np.argsort(names[: counts.shape[1]])
        counts, in_order = counts[:, order], [names[index] for index in order]
        return tuple(
            in_order[best] if total else ""
            for best, total in zip(np.argmax(counts, axis=1).tolist(), counts.sum(axis=1).tolist(), strict=True)
        )
