"""How well a classifier does on groups it has not seen: scores, with intervals that hold for few groups."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.stats import beta, t

CALIBRATION_BINS = 10
COVERAGES = tuple(round(0.05 * step, 2) for step in range(1, 21))
"""Shares of the items that are answered, the surest first, at which the error is reported [-]."""
_TAIL = 0.025


def confusion_by_unit(truth: np.ndarray, predicted: np.ndarray, unit: np.ndarray, n_classes: int) -> np.ndarray:
    """Count truth against prediction within each unit.

    Parameters
    ----------
    truth, predicted, unit : (n,)
        Class indices and the index of the unit (all rows of one group) that a row belongs to.
    n_classes
        Number of classes k.

    Returns
    -------
    (u, k, k)
        Counts; rows are the truth.
    """
    n_units = int(unit.max()) + 1 if len(unit) else 0
    counts = np.zeros((n_units, n_classes, n_classes))
    np.add.at(counts, (unit, truth, predicted), 1.0)
    return counts


def calibration_error(probabilities: np.ndarray, truth: np.ndarray, weight: np.ndarray) -> tuple[float, list[dict]]:
    """Give the expected calibration error and the reliability table of the top class.

    The mean distance between the probability given to the top class and how often it is right, over equal-width
    bins weighted by their mass (Naeini, Cooper, Hauskrecht 2015, Eq. 3).

    Parameters
    ----------
    probabilities : (n, k)
    truth : (n,)
    weight : (n,)
        How much a row counts.
    """
    top = probabilities.max(axis=1)
    right = probabilities.argmax(axis=1) == truth
    bins = np.minimum((top * CALIBRATION_BINS).astype(int), CALIBRATION_BINS - 1)
    mass = np.bincount(bins, weight, CALIBRATION_BINS)
    said = np.bincount(bins, weight * top, CALIBRATION_BINS)
    was = np.bincount(bins, weight * right, CALIBRATION_BINS)
    rows = np.bincount(bins, minlength=CALIBRATION_BINS)
    table = [
        {"said": float(said[i] / mass[i]), "was_right": float(was[i] / mass[i]), "n": int(rows[i])}
        for i in np.flatnonzero(mass > 0)
    ]
    return float(np.abs(said - was).sum() / mass.sum()), table


def risk_by_coverage(probabilities: np.ndarray, truth: np.ndarray, weight: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Give the error among the items that are most sure, for each share of them that is answered.

    Parameters
    ----------
    probabilities : (n, k)
    truth, weight : (n,)

    Returns
    -------
    coverage, error : (n,)
        Items of one probability are answered together: they have the same coverage and error.
    """
    top = probabilities.max(axis=1)
    order = np.argsort(-top, kind="stable")
    coverage = np.cumsum(weight[order])
    error = np.cumsum(weight[order] * (probabilities.argmax(axis=1) != truth)[order]) / coverage
    last = np.searchsorted(-top[order], -top[order], side="right") - 1
    return coverage[last] / coverage[-1], error[last]


def selective_error(probabilities: np.ndarray, truth: np.ndarray, weight: np.ndarray, coverage: float) -> float:
    """Give the error where at least this share of the items, the surest ones, is answered; see `risk_by_coverage`."""
    share, error = risk_by_coverage(probabilities, truth, weight)
    return float(error[min(np.searchsorted(share, coverage - 1e-9), len(share) - 1)])


def scores(
    probabilities: np.ndarray,
    truth: np.ndarray,
    unit: np.ndarray,
    weight: np.ndarray,
    classes: Sequence[str],
) -> dict:
    """Score predictions on held-out rows; intervals are of whole units (`accuracy_intervals`).

    Parameters
    ----------
    probabilities : (n, k)
    truth, unit : (n,)
        Class index of each row, and the group it belongs to.
    weight : (n,)
        How much a row counts in log loss and calibration error.

    Returns
    -------
    dict
        JSON-able: n, accuracy and balanced_accuracy (value, low, high: 95 %), log_loss [nat], calibration_error,
        reliability, recall by class, confusion (rows are the truth), risk (error by coverage).
    """
    predicted = probabilities.argmax(axis=1)
    _, unit = np.unique(unit, return_inverse=True)
    by_unit = confusion_by_unit(truth, predicted, unit, len(classes))
    confusion = by_unit.sum(axis=0)
    error, table = calibration_error(probabilities, truth, weight)
    chosen = np.maximum(probabilities[np.arange(len(truth)), truth], 1e-12)
    totals = confusion.sum(axis=1)
    return {
        "n": len(truth),
        **accuracy_intervals(by_unit),
        "log_loss": float(-(weight * np.log(chosen)).sum() / weight.sum()),
        "calibration_error": error,
        "reliability": table,
        "risk": [
            {"coverage": share, "error": selective_error(probabilities, truth, weight, share)} for share in COVERAGES
        ],
        "recall": {name: float(confusion[i, i] / totals[i]) if totals[i] else None for i, name in enumerate(classes)},
        "confusion": confusion.astype(int).tolist(),
    }


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
    # Where all are right the sum may round to less than 1, and an interval about that is not finite.
    value = 1.0 if np.array_equal(hits, rows) else float((hits @ worth).sum())
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
