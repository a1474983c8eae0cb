"""Evidence on square cells of the ground: the key of a cell, and the logarithmic opinion pool of class probabilities.

Cell (i, j) of size s covers ``[i s, (i + 1) s) x [j s, (j + 1) s)`` in the site's own frame.

The pool is Genest & Zidek (1986), *Statistical Science* 1(1), 114-135, Eq. 3.9, doi:10.1214/ss/1177013825: a weighted
sum of log-probabilities, normalised. Weights that sum to one average opinions that share their errors; weights of one
each are Bayes' rule for independent ones and a uniform prior.
"""

from __future__ import annotations

import numpy as np
from scipy.special import softmax

LARGEST_CELL_INDEX = 2**31 - 1
"""Cell indices lie within +- this, so that two of them make one 64-bit key."""

PROBABILITY_FLOOR = 1e-3
"""No look rules a class out further than this, nor does a model that does not know the class [-]."""


def cells_of(x_m: np.ndarray, y_m: np.ndarray, cell_size_m: float) -> np.ndarray:
    """Give the cells in which points (n,) [m] lie: (n, 2) int64.

    Raises
    ------
    ValueError
        A place is not finite or lies beyond `LARGEST_CELL_INDEX` cells from the origin.
    """
    cells = np.floor(np.column_stack([x_m, y_m]) / cell_size_m)
    if not np.all(np.abs(cells) <= LARGEST_CELL_INDEX):
        raise ValueError("a place is not finite or too far from the origin for the grid")
    return cells.astype(np.int64)


def cell_keys(cells: np.ndarray) -> np.ndarray:
    """Make one int64 of each cell (n, 2), sorted by x first, so that looking one up is one binary search."""
    cells = np.asarray(cells, dtype=np.int64)
    return (cells[:, 0] << 32) + cells[:, 1]


def cells_from_keys(keys: np.ndarray) -> np.ndarray:
    """Turn `cell_keys` back into cells, (n, 2)."""
    cell_y = (keys + 2**31 & 0xFFFFFFFF) - 2**31
    return np.column_stack([(keys - cell_y) >> 32, cell_y])


def rows_of_keys(sorted_keys: np.ndarray, keys: np.ndarray) -> np.ndarray:
    """Find keys (m,) among sorted ones (n,): their rows (m,), -1 where one is not there."""
    if not len(sorted_keys):
        return np.full(len(keys), -1)
    row = np.minimum(np.searchsorted(sorted_keys, keys), len(sorted_keys) - 1)
    return np.where(sorted_keys[row] == keys, row, -1)


def centred_logs(probabilities: np.ndarray) -> np.ndarray:
    """Floored log-probabilities less their mean over the classes (Aitchison's centred log-ratio): (m, k)."""
    logs = np.log(np.maximum(probabilities, PROBABILITY_FLOOR))
    return logs - logs.mean(axis=1, keepdims=True) if logs.size else logs


def sums_by(group: np.ndarray, values: np.ndarray, n: int) -> np.ndarray:
    """Sum rows of values (m, k) by the number of their group (m,), of n: (n, k)."""
    columns = [np.bincount(group, column, n).astype(float) for column in values.T]  # of nothing: whole numbers
    return np.column_stack(columns) if columns else np.zeros((n, 0))


def pooled(logs: np.ndarray) -> np.ndarray:
    """Normalise weighted sums of log-probabilities (n, k) to probabilities; a class of log -inf has none."""
    return softmax(logs, axis=1) if logs.size else logs
