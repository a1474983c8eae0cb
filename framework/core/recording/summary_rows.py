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


def unnamed_means(numbers: Sequence[np.ndarray]) -> np.ndarray:
    """Find rows at the end, (n,) of bool, from one on whose every value is the mean, or the sum, of those above.

    Parameters
    ----------
    numbers
        Columns of channels, each (n,); NaN where there is no value.
    """
    table = np.column_stack(numbers)
    table = np.where(np.abs(table) < _BEYOND, table, np.nan)
    found = np.zeros(len(table), dtype=bool)
    for row in range(max(len(table) - _LAST, _FEWEST), len(table)):
        above, seen = table[:row], np.isfinite(table[row])
        above = above[:, seen & np.isfinite(above).any(axis=0)]
        values = table[row][seen & np.isfinite(table[:row]).any(axis=0)]
        size = np.nanmax(np.abs(above), axis=0, initial=0.0)
        varying = np.nanstd(above, axis=0) > _VARIES * size
        for statistic in (np.nanmean(above, axis=0), np.nansum(above, axis=0)):
            if varying.sum() >= _FEWEST_CHANNELS and np.all(np.abs(values - statistic) <= _NEAR * np.abs(statistic)):
                found[row:] = True
                return found
    return found
