"""The newest rows of a table of numbers, in memory that does not grow."""

from __future__ import annotations

import numpy as np

_FIRST_ROWS = 256


class Columns:
    """Rows of numbers, the first of each a time that does not decrease; those older than `kept_s` [s] are let go.

    Parameters
    ----------
    width
        Numbers in a row.
    kept_s
        How long a row is kept after the newest [s].
    """

    def __init__(self, width: int, kept_s: float):
        self._values = np.empty((_FIRST_ROWS, width))
        self._end = 0
        self._kept_s = kept_s

    def append(self, row: tuple[float, ...]) -> None:
        """Add a row."""
        if self._end == len(self._values):
            self._make_room()
        self._values[self._end] = row
        self._end += 1

    def _make_room(self) -> None:
        rows = self.rows()
        rows = rows[np.searchsorted(rows[:, 0], rows[-1, 0] - self._kept_s) :]
        values = (
            self._values if 2 * len(rows) <= len(self._values) else np.empty((2 * len(self._values), rows.shape[1]))
        )
        values[: len(rows)] = rows.copy()
        self._values, self._end = values, len(rows)

    def rows(self) -> np.ndarray:
        """Give the rows, (n, width): a view that the next `append` may change."""
        return self._values[: self._end]

    def __len__(self) -> int:
        return self._end
