"""How far a classifier's probabilities may be trusted at each quality of the input, learnt on groups held out.

In a logarithmic opinion pool a weight is the inverse of a temperature: probabilities are raised to it. So the weight of
an item of quality q is the exponent w(q) at which its class probabilities are likeliest on groups that the classifier
has not seen. Where they are right as they stand it is 1, whatever the image or sound is like: a classifier that
has seen blur says less of what is blurred by itself.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize_scalar
from sklearn.isotonic import IsotonicRegression

from .calibration import LOG_TEMPERATURE_SD, log_loss, softened

BINS = 10
LEAST_GROUPS = 10
"""A bin of quality with fewer groups is joined to the next."""


@dataclass(frozen=True)
class Trust:
    """The weight of an item by its quality: straight between m points, and from the first one to 0 at quality 0.

    Parameters
    ----------
    quality, weight : (m,)
        Points of the curve, both rising, in (0, 1] [-].
    groups : (m,)
        How many groups held out are behind each point.
    """

    quality: tuple[float, ...]
    weight: tuple[float, ...]
    groups: tuple[int, ...]

    def __post_init__(self) -> None:
        if not len(self.quality) == len(self.weight) == len(self.groups) > 0:
            raise ValueError("qualities, weights and groups of different numbers, or none")
        for name, values in (("quality", self.quality), ("weight", self.weight)):
            if not all(0 < value <= 1 for value in values):
                raise ValueError(f"{name} outside 0 to 1")
        if (np.diff(self.quality) <= 0).any() or (np.diff(self.weight) < 0).any():
            raise ValueError("a weight that falls as quality rises")

    def at(self, quality: np.ndarray) -> np.ndarray:
        """Give the weights of items of these qualities (n,), (n,)."""
        return np.interp(quality, (0.0, *self.quality), (0.0, *self.weight))


def learn_trust(
    probabilities: np.ndarray, y: np.ndarray, group: np.ndarray, quality: np.ndarray, weight: np.ndarray
) -> tuple[Trust | None, list[dict]]:
    """Learn weights from predictions of groups held out.

    In each bin of quality the exponent is the maximum-a-posteriori one, each group counting as one item, with the
    prior of all temperatures here: few groups leave it at 1, which is what calibration over all qualities gives.
    Isotonic regression (weighted by groups) makes the weights rise with quality, and they end at 1: probabilities of a
    sense that says too little of good images are a matter of its temperature, and no reason to distrust the others.

    Parameters
    ----------
    probabilities : (n, k)
    y, group : (n,)
        Class indices and groups.
    quality : (n,)
        In (0, 1] [-].
    weight : (n,)
        How much a row counts.

    Returns
    -------
    trust
        None where there are fewer than `LEAST_GROUPS` groups.
    table
        For each bin its mean quality, n, groups, the mean probability of the top class, the share that was right, and
        the weight (JSON-able).
    """
    table: list[dict] = []
    exponents = []
    for rows in _bins(quality, group):
        p, truth, w = probabilities[rows], y[rows], weight[rows]
        groups = len(np.unique(group[rows]))
        exponents.append(_exponent(p, truth, w, groups))
        table.append(
            {
                "quality": float(np.average(quality[rows], weights=w)),
                "n": len(truth),
                "groups": groups,
                "said": float(np.average(p.max(axis=1), weights=w)),
                "was_right": float(np.average(p.argmax(axis=1) == truth, weights=w)),
            }
        )
    if not table:
        return None, table
    at, groups = (np.array([row[key] for row in table]) for key in ("quality", "groups"))
    weights = np.exp(IsotonicRegression(y_max=0.0).fit(at, exponents, sample_weight=groups).predict(at))
    for row, value in zip(table, weights, strict=True):
        row["weight"] = float(value)
    # Of bins of one weight the first and the last say all.
    inner = np.zeros(len(at), dtype=bool)
    inner[1:-1] = (weights[1:-1] == weights[:-2]) & (weights[1:-1] == weights[2:])
    kept = ~inner
    trust = Trust(tuple(at[kept].tolist()), tuple(weights[kept].tolist()), tuple(groups[kept].tolist()))
    return trust, table


def _bins(quality: np.ndarray, group: np.ndarray) -> list[np.ndarray]:
    """Rows of each bin of quality, from the lowest, of at least `LEAST_GROUPS` groups each."""
    number = np.minimum((quality * BINS).astype(int), BINS - 1)
    bins: list[np.ndarray] = []
    open_ = np.zeros(0, dtype=int)
    for index in range(BINS):
        open_ = np.concatenate([open_, np.flatnonzero(number == index)])
        if len(np.unique(group[open_])) >= LEAST_GROUPS:
            bins.append(open_)
            open_ = open_[:0]
    if bins:
        bins[-1] = np.concatenate([bins[-1], open_])
    return bins


def _exponent(probabilities: np.ndarray, y: np.ndarray, weight: np.ndarray, groups: int) -> float:
    """The logarithm of the likeliest exponent."""

    def loss(log_exponent: float) -> float:
        tempered = softened(probabilities, np.exp(-log_exponent))
        return groups * log_loss(tempered, y, weight) + 0.5 * (log_exponent / LOG_TEMPERATURE_SD) ** 2

    return float(minimize_scalar(loss, bounds=(-3.0, 2.0), method="bounded").x)
