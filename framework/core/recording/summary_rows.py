"""Rows of a table that are no trials: means, sums, extremes and scatter of those above, and lines of words.

Spreadsheets have them below their trials, with a word such as ``Mean`` in a cell or without one.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from .numerals import MISSING

# pyarrow makes its functions when it is imported, which no type checker sees
# pyright: reportAttributeAccessIssue=false

_MEANS = (
    "mean, average, avg, median, grand mean, overall mean, mean value, ø, x̄, Mittelwert, Mittel, Durchschnitt, "
    "moyenne, médiane, media, promedio"
)
_OTHERS = (
    "sum, total, totals, grand total, min, max, minimum, maximum, range, std, stdev, stddev, sd, s.d., sigma, σ, "
    "std dev, std. dev., std deviation, standard deviation, standard error, sem, rms, rsd, variance, count, "
    "coefficient of variation, Summe, Gesamt, Spannweite, Stabw, Stabwn, Standardabweichung, Varianz, Anzahl, somme, "
    "écart-type, écart type"
)
_WORDS = {word.casefold(): words is _MEANS for words in (_MEANS, _OTHERS) for word in words.split(", ")}
"""Words for statistics, and whether they are of the middle of the trials."""

_SCREENED = r"(?i)^[\s(\[]*(" + "|".join(re.escape(word) for word in _WORDS) + r")\b"
_BEYOND = 1e12
"""Numbers so large stand for missing values [SI]."""

_LAST, _NEAR, _VARIES = 8, 0.005, 0.02
"""Rows at the end of a table that may be a summary without a word, how near to the mean each of their values is, and
from which scatter on a channel counts, both as a share of the largest value [-]."""

_SELDOM, _MOST_ROWS = 1.0 / 3.0, 5000
"""Below this share of empty cells a column is one that trials have filled [-]; and the most rows of a table that has
means between its trials, beyond which it is a recording."""

_FEWEST, _FEWEST_CHANNELS = 3, 3
"""Fewest trials, and channels that vary, for a summary without a word."""


def summaries(columns: Sequence[pa.ChunkedArray], n: int) -> np.ndarray:
    """Find rows, (n,) of bool, that a word in a cell calls a statistic of others.

    In a column that has such a word in most rows, as in a table of the means and deviations of repeated trials, those
    of means are trials.

    Parameters
    ----------
    columns
        Of text without blanks around it, each (n,).
    n
        Number of rows.
    """
    found = np.zeros(n, dtype=bool)
    for column in columns:
        middle, other = np.zeros(len(found), dtype=bool), np.zeros(len(found), dtype=bool)
        for row in np.flatnonzero(_matches(column, _SCREENED)):
            is_mean = _WORDS.get(_word(column[int(row)].as_py()))
            middle[row], other[row] = is_mean is True, is_mean is False
        if 2 * np.count_nonzero(middle | other) <= len(found):
            found |= middle | other
        elif middle.any():
            found |= other
    return found


def _matches(column: pa.ChunkedArray, pattern: str) -> np.ndarray:
    return pc.fill_null(pc.match_substring_regex(column, pattern), False).to_numpy()


def _word(cell: str) -> str:
    """Give a cell without what stands in brackets or behind a colon: Mean (n = 5), SD:."""
    return re.sub(r"\(.*?\)|\[.*?\]|[:=].*$", "", cell.casefold()).strip()


def words_only(columns: Sequence[pa.ChunkedArray]) -> np.ndarray:
    """Find rows, (n,) of bool, of columns that are to be numbers, with words and not one number: lines of remarks."""
    digits = np.any([_matches(column, r"\d") for column in columns], axis=0)
    missing = pa.array(MISSING)
    words = np.any([~pc.is_in(column, value_set=missing).to_numpy() for column in columns], axis=0)
    return words & ~digits


def headings(columns: Sequence[pa.ChunkedArray]) -> np.ndarray:
    """Find rows, (n,) of bool, of which the first cell has words and no other has anything: headings of blocks.

    Parameters
    ----------
    columns
        Of text without blanks around it, each (n,).
    """
    first, *others = columns
    if len(others) < _FEWEST_CHANNELS - 1 or not len(first):
        return np.zeros(len(first), dtype=bool)
    blank = np.all([pc.equal(pc.fill_null(column, ""), "").to_numpy() for column in others], axis=0)
    return blank & _matches(first, r"\p{L}")


def gaps(columns: Sequence[pa.ChunkedArray]) -> np.ndarray:
    """Find rows, (n,) of bool, with an empty cell in a column that is filled in most rows.

    Parameters
    ----------
    columns
        Of text without blanks around it, each (n,).
    """
    if not 0 < len(columns[0]) <= _MOST_ROWS:
        return np.zeros(len(columns[0]), dtype=bool)
    empty = np.array([pc.equal(pc.fill_null(column, ""), "").to_numpy() for column in columns])
    return np.any(empty[empty.mean(axis=1) < _SELDOM], axis=0)


def unnamed_means(numbers: Sequence[np.ndarray], gap: np.ndarray) -> np.ndarray:
    """Find rows, (n,) of bool, whose every value is the mean, or the sum, of those above; and the rows of statistics
    behind them.

    They stand at the table's end, or below each block of trials with an empty cell where trials have a number or a
    name.

    Parameters
    ----------
    numbers
        Columns of channels, each (n,); NaN where there is no value.
    gap : (n,)
        Whether the row has such an empty cell.
    """
    table = np.column_stack(numbers)
    table = np.where(np.abs(table) < _BEYOND, table, np.nan)
    found = np.zeros(len(table), dtype=bool)
    end = max(len(table) - _LAST, _FEWEST)
    block = 0
    for row in np.flatnonzero(gap | (np.arange(len(table)) >= end)).tolist():
        trials = table[:row][~found[:row]]
        above = table[block:row]
        if (row > block and _summed_up(above, table[row])) or _summed_up(trials, table[row]):
            if row >= end and not gap[row]:
                found[row:] = True
                return found
            found[row] = True
        found[row] |= gap[row] and row > 0 and found[row - 1]
        block = row + 1 if found[row] else block
    return found


def _summed_up(above: np.ndarray, values: np.ndarray) -> bool:
    """Say whether every value of a row, (k,), is the mean or the sum of the rows above, (m, k)."""
    both = np.isfinite(values) & np.isfinite(above).any(axis=0)
    if len(above) < _FEWEST or both.sum() < _FEWEST_CHANNELS:
        return False
    above, values = above[:, both], values[both]
    size = np.nanmax(np.abs(above), axis=0)
    varying = np.nanstd(above, axis=0) > _VARIES * size
    return bool(varying.sum() >= _FEWEST_CHANNELS) and any(
        bool(np.all(np.abs(values - statistic) <= _NEAR * np.abs(statistic)))
        for statistic in (np.nanmean(above, axis=0), np.nansum(above, axis=0))
    )
