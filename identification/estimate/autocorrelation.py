"""Autocorrelation of residuals, and how many neighbouring rows count as one because of it."""

from __future__ import annotations

import numpy as np

_STANDS_OUT = 3.0
"""Neighbours are alike from so many standard deviations on of what white noise shows by chance [-]."""

_REMEMBERED = 0.4
"""Correlation of neighbours from which on it is the noise that is autocorrelated [-]: a misfit that noise hides has
less."""

_HALF = 0.5
"""What is driven has changed where its autocorrelation has fallen to this [-]."""

_FEWEST = 8
"""Fewest values of an autocorrelation."""


def autocorrelations(values: np.ndarray) -> np.ndarray:
    """Autocorrelation of a series (n,) that is not all zero, at lags from 0 to n // 2 - 1."""
    spectrum = np.fft.rfft(values, 2 * len(values))
    covariance = np.fft.irfft(np.abs(spectrum) ** 2)[: len(values) // 2]
    return covariance / covariance[0]


def correlation_time(values: np.ndarray) -> float:
    """Number of neighbouring samples that say the same: 1 + 2 sum of autocorrelations, the largest over columns (n, m).

    The sum runs while pairs of autocorrelations are positive (C. J. Geyer, Statist. Sci. 7 (1992), Sec. 3.3).
    """
    longest = 1.0
    for column in values.T:
        correlation = _of_observed(column)
        pairs = correlation[1:-1:2] + correlation[2::2]
        positive = int(np.argmax(pairs <= 0.0)) if (pairs <= 0.0).any() else len(pairs)
        longest = max(longest, 1.0 + 2.0 * float(pairs[:positive].sum()))
    return min(longest, max(len(values) / 4.0, 1.0))


def are_correlated(values: np.ndarray) -> np.ndarray:
    """Say of columns (n, m) where neighbours are more alike than white noise's: (m,) of bool."""
    least = _STANDS_OUT * np.sqrt(2.0 / max(len(values), 1))
    return np.array([_of_observed(column)[1:3].sum() > least for column in values.T], dtype=bool)


def rows_in_noise(residuals: np.ndarray, driven: np.ndarray) -> float:
    """Number of neighbouring rows of residuals (n, m) that count as one because the sensors' noise is autocorrelated.

    It is 1 where the residuals are not, or where what is `driven` (n, m), in units of the noise, changes as fast as
    they forget: a misfit that follows it would.
    """
    correlated = residuals[:, are_correlated(residuals)]
    correlated = correlated[:, [bool(_of_observed(column)[1] > _REMEMBERED) for column in correlated.T]]
    if not correlated.size:
        return 1.0
    least = _STANDS_OUT / np.sqrt(len(residuals))
    forgotten = max(_first_below(_of_observed(column), least) for column in correlated.T)
    swing = np.nan_to_num(driven - np.nanmean(driven, axis=0))
    together = np.sum([each @ each * autocorrelations(each) for each in swing.T if each.any()], axis=0)
    return correlation_time(correlated) if 2 * forgotten <= _first_below(together, _HALF) else 1.0


def _of_observed(column: np.ndarray) -> np.ndarray:
    """Autocorrelations of what was seen of a column (n,); 1 and nothing after it where that is too little."""
    values = column[np.isfinite(column)]
    return autocorrelations(values) if len(values) >= _FEWEST and values.any() else np.ones(1)


def _first_below(correlation: np.ndarray, least: float) -> int:
    """First lag at which autocorrelations, in proportion, fall below a value."""
    below = np.asarray(correlation) < least * correlation[0]
    return int(np.argmax(below)) if below.any() else len(below)
