"""In which of a table's ground cells a place lies: a hash table over the cells' keys, with linear probing."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit

from ..framework.core.pooling import LARGEST_CELL_INDEX

NOWHERE, UNSEEN = -2, -1
"""Rows of a place that is no finite number, and of ground that nobody has seen."""

_GOLDEN = np.uint64(0x9E3779B97F4A7C15)
"""2^64 over the golden ratio: its multiples scatter evenly (D. E. Knuth, "The Art of Computer Programming" 3, 6.4)."""

_EMPTY = -1


@dataclass(frozen=True)
class CellIndex:
    """Finds the rows of cells.

    key : (m,) int64
        Keys of the cells (`pooling.cell_keys`), each once.
    slots : (2^b,) int32
        Row of a key at its hash or in one of the next slots, -1 where empty.
    shift
        Bits of a product that its hash leaves out.
    cell_size_m
        Edge of a cell [m].
    """

    key: np.ndarray
    slots: np.ndarray
    shift: np.uint64
    cell_size_m: float

    @staticmethod
    def of(key: np.ndarray, cell_size_m: float) -> CellIndex:
        """Index cells by their keys (m,)."""
        bits = max(len(key).bit_length() + 1, 1)  # at most half of the slots are taken
        slots = np.full(1 << bits, _EMPTY, dtype=np.int32)
        shift = np.uint64(64 - bits)
        _fill(key, slots, shift)
        return CellIndex(key, slots, shift, cell_size_m)

    def rows(self, places: np.ndarray) -> np.ndarray:
        """Rows (n,) of the cells in which places (n, 2) [m] lie; `UNSEEN` or `NOWHERE` where there is none."""
        return _rows(places, self.cell_size_m, self.key, self.slots, self.shift)


@njit(cache=True)
def _fill(key, slots, shift):
    last = len(slots) - 1
    for row in range(len(key)):
        slot = np.int64((np.uint64(key[row]) * _GOLDEN) >> shift)
        while slots[slot] != _EMPTY:
            slot = (slot + 1) & last
        slots[slot] = row


@njit(cache=True, nogil=True)
def _rows(places, cell_size_m, keys, slots, shift):
    rows, last = np.empty(len(places), dtype=np.int64), len(slots) - 1
    for at in range(len(places)):
        x, y = np.floor(places[at, 0] / cell_size_m), np.floor(places[at, 1] / cell_size_m)
        rows[at] = UNSEEN
        if not (np.isfinite(places[at, 0]) and np.isfinite(places[at, 1])):
            rows[at] = NOWHERE
        elif abs(x) <= LARGEST_CELL_INDEX and abs(y) <= LARGEST_CELL_INDEX:
            key = (np.int64(x) << 32) + np.int64(y)
            slot = np.int64((np.uint64(key) * _GOLDEN) >> shift)
            while slots[slot] != _EMPTY:
                if keys[slots[slot]] == key:
                    rows[at] = slots[slot]
                    break
                slot = (slot + 1) & last
    return rows
