"""What further groups would be expected to bring: the error on held-out groups against how many were trained on."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import t

from .fitting import Rows, fit, row_weights
from .report import HeldOut

SHARES = (0.25, 0.5)
"""Shares of the groups of each fold's training side that are trained on; the whole of it is the cross-validation's."""
_LEAST_GROUPS = 4
"""A class needs so many groups on each training side: a quarter of them is one."""
_TAIL = 0.025


@dataclass(frozen=True)
class Gain:
    """By how much the error is expected to fall with further groups, and its 95 % interval [-]."""

    more: int
    value: float
    low: float
    high: float


@dataclass(frozen=True)
class LearningCurve:
    """Error by number of groups.

    Parameters
    ----------
    groups, error : (m,)
        Mean number of groups trained on, and the error on groups held out, classes even [-].
    total
        Groups that the model itself was trained on.
    gains
        What is expected of more groups, of the same kinds and shared among the classes as these are.
    """

    groups: tuple[float, ...]
    error: tuple[float, ...]
    total: int
    gains: tuple[Gain, ...]


def learning_curve(
    rows: Rows,
    names: Sequence[str],
    held: HeldOut,
    original: np.ndarray,
    rng: np.random.Generator,
    progress: Callable[[float], None] | None = None,
) -> LearningCurve | None:
    """Train on a quarter and a half of the groups of each fold, and predict the groups that it holds out.

    It takes up to as long as the training did.

    Parameters
    ----------
    rows, names
        What the model was trained on, and the candidates that it was chosen from.
    held
        Predictions by models of the whole of each training side, and the folds.
    original : (n,)
        True for rows that are scored: items as they came.
    rng
        Draws which groups are trained on.
    progress
        Called with the share done, 0 to 1.

    Returns
    -------
    LearningCurve or None
        None where a class has too few groups for a quarter of them.
    """
    folds = np.unique(held.fold[held.fold >= 0])
    sums, counts = [], []
    for place, fold in enumerate(folds):
        test = np.flatnonzero((held.fold == fold) & held.scored & original)
        train = np.flatnonzero(held.fold != fold)
        parts = _subsets(rows, train, rng)
        if parts is None or not len(test):
            return None
        weight = row_weights(rows.y[test], rows.group[test])
        wrong = []
        for part in parts:
            fitted, _, _ = fit(rows.take(part), names, rng)
            said = fitted.probabilities(fitted.standardise(rows.x[test])).argmax(axis=1)
            wrong.append(np.sum(weight * (said != rows.y[test])))
        wrong.append(np.sum(weight * (held.probabilities[test].argmax(axis=1) != rows.y[test])))
        sums.append([*wrong, weight.sum()])
        counts.append([len(np.unique(rows.group[part])) for part in (*parts, train)])
        if progress is not None:
            progress((place + 1) / len(folds))
    if len(folds) < 3:
        return None
    return curve_of(np.array(sums), np.array(counts), len(np.unique(rows.group)))


def _subsets(rows: Rows, train: np.ndarray, rng: np.random.Generator) -> list[np.ndarray] | None:
    """Rows of a quarter and of a half of the groups of each class, the former among the latter."""
    chosen: list[list[int]] = [[] for _ in SHARES]
    for index in range(rows.n_classes):
        groups = rng.permutation(np.unique(rows.group[train][rows.y[train] == index]))
        if len(groups) < _LEAST_GROUPS:
            return None
        for own, share in zip(chosen, SHARES, strict=True):
            own += groups[: round(share * len(groups))].tolist()
    return [train[np.isin(rows.group[train], own)] for own in chosen]


def curve_of(sums: np.ndarray, counts: np.ndarray, total: int) -> LearningCurve:
    """Give the curve and what it promises, from what was counted in each fold.

    The error is taken to fall as a power of the number of groups (Hestness et al. 2017, arXiv:1712.00409, Eq. 1, with
    no error left over at the end), by least squares of the logarithms; what is gained with more is then the last error
    times what that power leaves out. The interval is Student's, of the jackknife over folds with the correction for
    training sides that overlap (Nadeau and Bengio 2003, doi:10.1023/A:1024068626366, Eq. 7).

    Parameters
    ----------
    sums : (f, m + 1)
        By fold the weight of the rows that each of m models gets wrong, and of all rows.
    counts : (f, m)
        Groups that each was trained on.
    total
        Groups that there are.
    """
    folds = len(sums)
    whole = _error(sums)
    more = sorted({10, total})

    def gains(part: np.ndarray, groups: np.ndarray) -> np.ndarray:
        error, number = _error(part), groups.mean(axis=0)
        power = -np.polyfit(np.log(number), np.log(error), 1)[0]
        now = error[-1] * (number[-1] / total) ** power
        return np.array([now * (1.0 - (total / (total + extra)) ** power) for extra in more])

    value = gains(sums, counts)
    without = np.array([gains(np.delete(sums, i, axis=0), np.delete(counts, i, axis=0)) for i in range(folds)])
    spread = folds * value - (folds - 1) * without
    variance = spread.var(axis=0, ddof=1) * (1.0 / folds + 1.0 / (folds - 1))
    reach = -t.ppf(_TAIL, folds - 1) * np.sqrt(variance)
    return LearningCurve(
        tuple(counts.mean(axis=0).tolist()),
        tuple(whole.tolist()),
        total,
        tuple(
            Gain(extra, float(v), float(v - r), float(v + r)) for extra, v, r in zip(more, value, reach, strict=True)
        ),
    )


def _error(sums: np.ndarray) -> np.ndarray:
    """Errors of m models (m,); none is less than half an error in a thousand, as logarithms are taken of them."""
    return np.maximum(sums[:, :-1].sum(axis=0) / sums[:, -1].sum(), 5e-4)
