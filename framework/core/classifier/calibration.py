"""Calibration of probabilities on groups held out: temperatures, and what near copies of one thing say together."""

from __future__ import annotations

import numpy as np
from scipy.optimize import minimize_scalar

from ..pooling import pooled, sums_by

SPREAD_MASS = 0.01
"""Mass spread evenly over all classes, so that no single item can rule a class out."""
LOG_TEMPERATURE_SD = 0.4
"""How far the logarithm of a temperature is from 0, before a group was held out [-]: the prior that few groups are
weighed against, lest two photographs that happen to be classified rightly make a model certain of everything."""
CORRELATION_MEAN, CORRELATION_SD = 0.85, 0.25
"""What is taken for the correlation within groups before a group was held out [-]: items of one are nearly copies."""

COMMITTEE = "committee"
"""The mean of all candidates' probabilities; it takes part in the choice where there are several candidates."""


def softened(raw: np.ndarray, temperature: float) -> np.ndarray:
    """Temperature scaling (Guo et al. 2017, arXiv:1706.04599, Eq. 9) of probabilities (n, k)."""
    return pooled(np.log(np.maximum(raw, 1e-6)) / temperature)


def calibrated(raw: np.ndarray, temperature: float) -> np.ndarray:
    """Temperature scaling with a floor under each class."""
    return _spread(softened(raw, temperature))


def _spread(probabilities: np.ndarray) -> np.ndarray:
    return (1 - SPREAD_MASS) * probabilities + SPREAD_MASS / probabilities.shape[1]


def log_loss(probabilities: np.ndarray, y: np.ndarray, weight: np.ndarray) -> float:
    """Weighted log loss [nat] of probabilities (n, k) of classes y (n,)."""
    chosen = np.maximum(probabilities[np.arange(len(y)), y], 1e-12)
    return float(-(weight * np.log(chosen)).sum() / weight.sum())


def _temperature(raw: np.ndarray, y: np.ndarray, weight: np.ndarray, n_units: int) -> float:
    """The maximum-a-posteriori temperature, where each of the units that rows come from counts as one item."""

    def loss(log_t: float) -> float:
        return n_units * log_loss(calibrated(raw, np.exp(log_t)), y, weight) + 0.5 * (log_t / LOG_TEMPERATURE_SD) ** 2

    best = minimize_scalar(loss, bounds=(-2.0, 3.0), method="bounded")
    return float(np.exp(best.x))


def choose(
    raw: dict[str, np.ndarray], y: np.ndarray, weight: np.ndarray, n_units: int
) -> tuple[dict[str, np.ndarray], dict[str, float], dict[str, float]]:
    """Held-out probabilities, the committee's among them, the best temperature of each, and its log loss then."""
    temperatures = {name: _temperature(values, y, weight, n_units) for name, values in raw.items()}
    if len(raw) > 1:
        raw = raw | {COMMITTEE: np.mean([softened(raw[name], t) for name, t in temperatures.items()], axis=0)}
        temperatures[COMMITTEE] = _temperature(raw[COMMITTEE], y, weight, n_units)
    losses = {name: log_loss(calibrated(values, temperatures[name]), y, weight) for name, values in raw.items()}
    return raw, temperatures, losses


def joined(
    probabilities: np.ndarray, unit: np.ndarray, weight: np.ndarray, n_units: int, correlation: float
) -> np.ndarray:
    """Join what near copies say, each bringing only what it adds.

    The log opinion pool of m items of one unit, raised to the number m / (1 + (m - 1) rho) of independent items
    that they are worth (Kish 1965, the design effect).

    Parameters
    ----------
    probabilities : (n, k)
    unit, weight : (n,)
        Index of the unit of each item, and how much the item counts.
    n_units
        Number of units u; one without items of any weight has even probabilities.
    correlation
        rho, in [0, 1] [-].

    Returns
    -------
    (u, k)
    """
    mass = np.bincount(unit, weight, n_units)
    square = np.bincount(unit, weight**2, n_units)
    count = np.where(square > 0, mass**2 / np.where(square > 0, square, 1.0), 0.0)
    worth = np.where(count > 0, count / (1 + np.maximum(count - 1, 0.0) * correlation), 0.0)
    sums = sums_by(unit, np.log(np.maximum(probabilities, 1e-12)) * weight[:, None], n_units)
    return _spread(pooled(sums * (worth / np.where(mass > 0, mass, 1.0))[:, None]))


def likeliest_correlation(probabilities: np.ndarray, y: np.ndarray, unit: np.ndarray) -> float:
    """The maximum-a-posteriori correlation within groups, by the log loss of joined probabilities, classes even."""
    first, unit = np.unique(unit, return_index=True, return_inverse=True)[1:]
    truth = y[first]
    by_class = np.bincount(truth)
    weight = len(truth) / np.count_nonzero(by_class) / by_class[truth]
    even = np.ones(len(y))

    def loss(rho: float) -> float:
        chosen = joined(probabilities, unit, even, len(first), rho)[np.arange(len(first)), truth]
        return float(-(weight * np.log(chosen)).sum() + 0.5 * ((rho - CORRELATION_MEAN) / CORRELATION_SD) ** 2)

    return float(minimize_scalar(loss, bounds=(1e-3, 1.0), method="bounded").x)
