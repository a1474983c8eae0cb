"""What the items of one thing say together, such as the crops of a photograph: how far to trust it, by its quality.

What is wrong with an image is wrong with all of its crops. Items of a training set were degraded one by one, so that
what is wrong averages out over a group, and the correlation within groups that is learnt from them is too low for an
image that is blurred as a whole. So things are degraded as a whole, and the exponent of their joint answer is learnt on
groups held out, by quality, as the weight of single items is (`trust`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..evidence import ClassEvidence
from ..pooling import pooled
from .fitting import Fitted, row_weights
from .scores import accuracy_intervals, calibration_error, confusion_by_unit
from .trust import Trust, learn_trust

if TYPE_CHECKING:
    from collections.abc import Callable


@dataclass(frozen=True)
class Wholes:
    """Things that are judged by several items each, as they came and degraded as a whole.

    Parameters
    ----------
    features : (r, d)
        Of all items.
    quality : (r,)
        What the sense makes of each item [-].
    unit : (r,)
        Index of the thing that an item is of, 0 to u - 1.
    labels, groups : (u,)
        Class and group of each thing, by name.
    degraded : (u,)
        True for those that were degraded.
    share
        Share of the degraded ones in what is learnt [-].
    """

    features: np.ndarray
    quality: np.ndarray
    unit: np.ndarray
    labels: np.ndarray
    groups: np.ndarray
    degraded: np.ndarray
    share: float

    def take(self, chosen: np.ndarray) -> Wholes:
        """Give the things of a mask (u,)."""
        rows, number = chosen[self.unit], np.cumsum(chosen) - 1
        return Wholes(
            self.features[rows], self.quality[rows], number[self.unit[rows]], self.labels[chosen], self.groups[chosen],
            self.degraded[chosen], self.share,
        )  # fmt: skip


@dataclass(frozen=True)
class HeldOutFold:
    """A model that was fitted without some groups, and the names of these."""

    fitted: Fitted
    groups: np.ndarray


def learn_together(
    wholes: Wholes,
    classes: Sequence[str],
    folds: Sequence[HeldOutFold],
    answer: Callable[[Fitted, Wholes], ClassEvidence],
) -> tuple[Trust | None, dict]:
    """Learn the exponent of joint answers by their quality, and measure what it does on groups held out of that, too.

    Parameters
    ----------
    wholes
        Things of the training set, degraded copies among them.
    classes
        Names of the k classes.
    folds
        Models, each with the groups that it has not seen.
    answer
        Gives the joint answers of a model to things.

    Returns
    -------
    trust
        None where there are too few groups.
    report
        ``"table"`` as `learn_trust` gives it; and for things as they came and degraded n, ``accuracy`` and
        ``balanced_accuracy`` with 95 % intervals, and the calibration error with and without the exponent, learnt in
        each fold on the others (JSON-able).
    """
    parts = []
    for number, fold in enumerate(folds):
        own = np.isin(wholes.groups, fold.groups)
        there = answer(fold.fitted, wholes.take(own))
        known = ~there.unknown & (there.quality > 0)
        index = np.flatnonzero(own)[known]
        parts.append((there.probabilities[known], there.quality[known], index, np.full(len(index), number)))
    if not parts:
        return None, {}
    p, quality, index, fold_of = (np.concatenate(part) for part in zip(*parts, strict=True))
    y = np.searchsorted(classes, wholes.labels[index])
    group = np.unique(wholes.groups[index], return_inverse=True)[1]
    degraded = wholes.degraded[index]

    def learnt(rows: np.ndarray) -> tuple[Trust | None, list[dict]]:
        shares = np.where(degraded[rows], wholes.share, 1.0 - wholes.share)
        shares /= np.bincount(degraded[rows], minlength=2)[degraded[rows].astype(int)]
        weight = row_weights(y[rows], group[rows]) * shares
        return learn_trust(p[rows], y[rows], group[rows], quality[rows], weight * len(weight) / weight.sum())

    trust, table = learnt(np.arange(len(y)))
    if trust is None:
        return None, {}
    tempered = p.copy()
    for number in np.unique(fold_of):
        other, _ = learnt(np.flatnonzero(fold_of != number))
        if other is not None:
            own = fold_of == number
            tempered[own] = raised(p[own], other.at(quality[own]))
    report: dict = {"table": table}
    for name, rows in (("as_it_came", ~degraded), ("degraded", degraded)):
        if rows.any():
            even = row_weights(y[rows], group[rows])
            report[name] = {
                "n": int(rows.sum()),
                **accuracy_intervals(confusion_by_unit(y[rows], p[rows].argmax(axis=1), group[rows], len(classes))),
                "calibration_error": calibration_error(tempered[rows], y[rows], even)[0],
                "calibration_error_without": calibration_error(p[rows], y[rows], even)[0],
            }
    return trust, report


def raised(probabilities: np.ndarray, exponent: np.ndarray) -> np.ndarray:
    """Raise probabilities (n, k) to a power each (n,), and normalise them."""
    return pooled(np.log(np.maximum(probabilities, 1e-12)) * exponent[:, None])
