"""Accuracies with intervals that hold for few groups, and where all that was tried came out right."""

from __future__ import annotations

import numpy as np
from scipy.stats import beta, t

_TAIL = 0.025


def accuracy_intervals(by_unit: np.ndarray) -> dict[str, dict[str, float]]:
    """Give accuracy and balanced accuracy with 95 % intervals.

    The exact binomial interval of Clopper and Pearson (1934, doi:10.1093/biomet/26.4.404) at the number of independent
    items that would have the variance which whole units show, less what few units say of a variance (Korn and Graubard
    1998, Survey Methodology 24, 193-201). Units that all agree show none: each then counts once for
    each of its classes.

    Parameters
    ----------
    by_unit : (u, k, k)
        Counts of truth (rows) against prediction in each unit: all rows of one group.

    Returns
    -------
    dict
        ``accuracy`` and ``balanced_accuracy``: value, low, high [-]. Classes without rows are left out.
    """
    hits = np.diagonal(by_unit, axis1=1, axis2=2)
    rows = by_unit.sum(axis=2)
    total = rows.sum(axis=0)
    seen = total > 0
    even = np.where(seen, 1.0 / (max(seen.sum(), 1) * np.where(seen, total, 1.0)), 0.0)
    main = rows.argmax(axis=1)
    return {
        "accuracy": _interval(hits, rows, np.full(len(seen), 1.0 / total.sum()), main),
        "balanced_accuracy": _interval(hits, rows, even, main),
    }


def _interval(hits: np.ndarray, rows: np.ndarray, worth: np.ndarray, main: np.ndarray) -> dict[str, float]:
    """Interval of the sum of hits (u, k), each worth `worth` (k,), of units whose main classes are `main` (u,)."""
    value = min(float((hits @ worth).sum()), 1.0)
    # What a unit adds to the error of an estimate that is a ratio in each class, or in all if rows are worth the same.
    rate = value if np.ptp(worth) == 0 else hits.sum(axis=0) / np.maximum(rows.sum(axis=0), 1)
    variance = _variance((hits - rate * rows) @ worth, main)
    if variance > 0 and 0 < value < 1:
        freedom = max(len(main) - len(np.unique(main)), 1)
        count = value * (1 - value) / variance * (t.ppf(_TAIL, np.inf) / t.ppf(_TAIL, freedom)) ** 2
    else:
        count = 1.0 / float(((rows * worth) ** 2).sum())
    right, wrong = value * count, (1 - value) * count
    low = float(beta.ppf(_TAIL, right, wrong + 1)) if right > 0 else 0.0
    high = float(beta.ppf(1 - _TAIL, right + 1, wrong)) if wrong > 0 else 1.0
    return {"value": value, "low": low, "high": high}


def _variance(parts: np.ndarray, stratum: np.ndarray) -> float:
    """Variance of the sum of independent parts (u,), those of one stratum alike."""
    variance = 0.0
    for index in np.unique(stratum):
        own = parts[stratum == index]
        variance += len(own) / max(len(own) - 1, 1) * float(((own - own.mean()) ** 2).sum())
    return variance
