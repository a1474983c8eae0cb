"""Choosing, calibrating and gating a classifier on groups held out of its training rows."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize_scalar
from sklearn.covariance import LedoitWolf
from sklearn.ensemble import ExtraTreesClassifier
from sklearn.kernel_approximation import Nystroem
from sklearn.linear_model import LogisticRegression
from sklearn.model_selection import StratifiedGroupKFold
from sklearn.pipeline import Pipeline

FOLDS = 5
INNER_FOLDS = 4
SELECTION_ROWS = 2000
"""Rows (thinned within groups) that take part in choosing, calibrating and gating."""
TREES = 80
FALSE_REJECTION_RATE = 0.02
"""Share of held-out, in-distribution items that the gate may turn away."""
INTRA_GROUP_CORRELATION = 0.1
PROBABILITY_FLOOR = 0.01
"""Mass spread evenly over all classes, so that no single item can rule a class out."""
CLIP = 8.0
LOG_TEMPERATURE_SD = 0.4
"""How far the logarithm of a temperature is from 0, before a group was held out [-]: the prior that few groups are
weighed against, lest two photographs that happen to be told apart make a model sure of everything."""
CORRELATION_MEAN, CORRELATION_SD = 0.85, 0.25
"""What is taken for the correlation within groups before a group was held out [-]: items of one are nearly copies."""


def _logistic(d: int, seed: int) -> LogisticRegression:
    return LogisticRegression(C=0.1, max_iter=500)


def _free_logistic(d: int, seed: int) -> LogisticRegression:
    return LogisticRegression(C=1.0, max_iter=500)


def _kernel(d: int, seed: int) -> Pipeline:
    return _kernel_machine(d, seed, 250, 3.0)


def _fine_kernel(d: int, seed: int) -> Pipeline:
    return _kernel_machine(d, seed, 800, 30.0)


def _kernel_machine(d: int, seed: int, components: int, freedom: float) -> Pipeline:
    # A Nystroem map of an RBF kernel stands in for a kernel machine: the cost of a prediction does not grow with n.
    return Pipeline(
        [
            ("map", Nystroem(gamma=0.5 / d, n_components=components, random_state=seed)),
            ("logistic", LogisticRegression(C=freedom, max_iter=500)),
        ]
    )


def _trees(d: int, seed: int) -> ExtraTreesClassifier:
    return ExtraTreesClassifier(TREES, min_samples_leaf=4, max_features="sqrt", random_state=seed)


CANDIDATES: dict[str, Callable[[int, int], LogisticRegression | Pipeline | ExtraTreesClassifier]] = {
    "logistic": _logistic,
    "kernel": _kernel,
    "trees": _trees,
    "free logistic": _free_logistic,
    "fine kernel": _fine_kernel,
}
"""Kinds of classifiers by name; the last two are for many groups: they are less held back, and cost more."""
USUAL = ("logistic", "kernel", "trees")
"""Candidates where none are named."""
COMMITTEE = "committee"
"""The mean of all candidates' probabilities; it takes part in the choice where there are several candidates."""


@dataclass(frozen=True)
class Gate:
    """Distance in standardised feature space to the nearest class, with the covariance within classes (shrunk).

    The Mahalanobis distance of Lee et al. 2018 (arXiv:1807.03888, Eq. 2) with the covariance of Ledoit and Wolf
    2004 (doi:10.1016/S0047-259X(03)00096-4), over sqrt(d): about 1 for an item of the training classes.
    """

    whitening: np.ndarray
    centres: np.ndarray

    @staticmethod
    def fit(z: np.ndarray, y: np.ndarray, weight: np.ndarray, n_classes: int) -> Gate:
        """Fit to standardised features z (n, d) of classes y (n,), each row counting as `weight` (n,) says."""
        present = np.flatnonzero(np.bincount(y, minlength=n_classes))
        mean = np.stack([np.average(z[y == index], axis=0, weights=weight[y == index]) for index in present])
        residual = z - mean[np.searchsorted(present, y)]
        residual *= np.sqrt(weight / weight.mean())[:, None]
        values, vectors = np.linalg.eigh(LedoitWolf(assume_centered=True).fit(residual).covariance_)
        whitening = vectors / np.sqrt(np.maximum(values, 1e-6)) / np.sqrt(z.shape[1])
        return Gate(whitening, mean @ whitening)

    def distance(self, z: np.ndarray) -> np.ndarray:
        """Give the distance of each row of z (n, d) to the nearest class centre, (n,) [-]."""
        w = z @ self.whitening
        square = (w**2).sum(axis=1)[:, None] - 2 * w @ self.centres.T + (self.centres**2).sum(axis=1)
        return np.sqrt(np.maximum(square.min(axis=1), 0.0))


@dataclass(frozen=True)
class Fitted:
    """What was learnt: standardisation, members whose probabilities are averaged, temperatures, gate.

    Each member has its own temperature, so that none shouts the others down; `temperature` is for their mean.
    """

    mean: np.ndarray
    scale: np.ndarray
    members: tuple[LogisticRegression | Pipeline | ExtraTreesClassifier, ...]
    member_temperatures: tuple[float, ...]
    n_classes: int
    gate: Gate
    temperature: float
    threshold: float
    correlation: float

    def standardise(self, features: np.ndarray) -> np.ndarray:
        """Give features (n, d) as standard scores, limited to where arithmetic stays finite."""
        return np.clip((features - self.mean) / self.scale, -1e3, 1e3)

    def probabilities(self, z: np.ndarray) -> np.ndarray:
        """Give calibrated probabilities (n, k) of standardised rows z (n, d)."""
        parts = zip(self.members, self.member_temperatures, strict=True)
        raw = np.mean([_softened(_full(member, z, self.n_classes), t) for member, t in parts], axis=0)
        return _calibrated(raw, self.temperature)


@dataclass(frozen=True)
class Rows:
    """Training rows: features x (n, d), class indices y (n,), groups (n,), and how much each row counts."""

    x: np.ndarray
    y: np.ndarray
    group: np.ndarray
    weight: np.ndarray
    n_classes: int

    def take(self, index: np.ndarray) -> Rows:
        """Give some rows, weighed anew."""
        y, group = self.y[index], self.group[index]
        return Rows(self.x[index], y, group, row_weights(y, group), self.n_classes)


def units(y: np.ndarray, group: np.ndarray) -> np.ndarray:
    """Index of the (group, class) that each row belongs to, (n,)."""
    return np.unique(np.stack([group, y]), axis=1, return_inverse=True)[1].reshape(-1)


def row_weights(y: np.ndarray, group: np.ndarray) -> np.ndarray:
    """Weigh rows so that every class counts the same, and a group by what its near copies are worth.

    n items of a group that correlate by rho are worth n / (1 + (n - 1) rho) (Kish 1965, the design effect). The
    weights add up to the worth of all rows, so that a regularised model sees how little n copies say.
    """
    unit = units(y, group)
    rows = np.bincount(unit)
    worth = rows / (1 + (rows - 1) * INTRA_GROUP_CORRELATION)
    weight = (worth / rows)[unit]
    by_class = np.bincount(y, weight)
    present = np.count_nonzero(by_class)
    return weight * (by_class.sum() / present / np.where(by_class > 0, by_class, 1.0))[y]


def _thin(rows: Rows, limit: int, rng: np.random.Generator) -> np.ndarray:
    """Indices of at most about `limit` rows, the same number from each (group, class) that has so many."""
    if len(rows.y) <= limit:
        return np.arange(len(rows.y))
    unit = units(rows.y, rows.group)
    order = rng.permutation(len(unit))
    order = order[np.argsort(unit[order], kind="stable")]
    counts = np.bincount(unit)
    rank = np.arange(len(unit)) - np.repeat(np.cumsum(counts) - counts, counts)
    quota = int(np.searchsorted(np.cumsum(np.bincount(rank)), limit, side="right"))
    return np.sort(order[rank < max(quota, 1)])


def folds(rows: Rows, rng: np.random.Generator, most: int = FOLDS) -> list[tuple[np.ndarray, np.ndarray]]:
    """Splits by group, classes spread evenly; none where there are too few groups to hold any out."""
    n_groups = len(np.unique(rows.group))
    splits = min(most, n_groups, int(np.bincount(rows.y).max()))
    if splits < 2:
        return []
    seed = int(rng.integers(2**31))
    with warnings.catch_warnings():
        # A class of fewer rows than folds is expected here, and is scored where it can be.
        warnings.filterwarnings("ignore", message="The least populated class")
        pairs = list(StratifiedGroupKFold(splits, shuffle=True, random_state=seed).split(rows.x, rows.y, rows.group))
    return [(train, test) for train, test in pairs if len(test) and len(np.unique(rows.y[train])) > 1]


def _full(member, z: np.ndarray, n_classes: int) -> np.ndarray:
    """Probabilities (n, k) over all classes, also of a member that has not seen each."""
    answer = np.zeros((len(z), n_classes))
    answer[:, member.classes_] = member.predict_proba(np.clip(z, -CLIP, CLIP))
    return answer


def _softened(raw: np.ndarray, temperature: float) -> np.ndarray:
    """Temperature scaling (Guo et al. 2017, arXiv:1706.04599, Eq. 9) of probabilities (n, k)."""
    logits = np.log(np.maximum(raw, 1e-6)) / temperature
    soft = np.exp(logits - logits.max(axis=1, keepdims=True))
    return soft / soft.sum(axis=1, keepdims=True)


def _calibrated(raw: np.ndarray, temperature: float) -> np.ndarray:
    """Temperature scaling with a floor under each class."""
    return (1 - PROBABILITY_FLOOR) * _softened(raw, temperature) + PROBABILITY_FLOOR / raw.shape[1]


def _loss(raw: np.ndarray, y: np.ndarray, weight: np.ndarray, temperature: float) -> float:
    """Weighted log loss [nat]."""
    chosen = _calibrated(raw, temperature)[np.arange(len(y)), y]
    return float(-(weight * np.log(chosen)).sum() / weight.sum())


def _temperature(raw: np.ndarray, y: np.ndarray, weight: np.ndarray, n_units: int) -> float:
    """The likeliest temperature, where each of the units that rows come from counts as one item."""

    def loss(log_t: float) -> float:
        return n_units * _loss(raw, y, weight, np.exp(log_t)) + 0.5 * (log_t / LOG_TEMPERATURE_SD) ** 2

    best = minimize_scalar(loss, bounds=(-2.0, 3.0), method="bounded")
    return float(np.exp(best.x))


def _choose(
    raw: dict[str, np.ndarray], y: np.ndarray, weight: np.ndarray, n_units: int
) -> tuple[dict[str, np.ndarray], dict[str, float], dict[str, float]]:
    """Held-out probabilities, the committee's among them, the best temperature of each, and its log loss then."""
    temperatures = {name: _temperature(values, y, weight, n_units) for name, values in raw.items()}
    if len(raw) > 1:
        raw = raw | {COMMITTEE: np.mean([_softened(raw[name], t) for name, t in temperatures.items()], axis=0)}
        temperatures[COMMITTEE] = _temperature(raw[COMMITTEE], y, weight, n_units)
    losses = {name: _loss(values, y, weight, temperatures[name]) for name, values in raw.items()}
    return raw, temperatures, losses


def pooled(
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
    logs = np.log(np.maximum(probabilities, 1e-12)) * weight[:, None]
    sums = np.stack([np.bincount(unit, column, n_units) for column in logs.T], axis=1)
    logits = sums * (worth / np.where(mass > 0, mass, 1.0))[:, None]
    soft = np.exp(logits - logits.max(axis=1, keepdims=True))
    soft /= soft.sum(axis=1, keepdims=True)
    return (1 - PROBABILITY_FLOOR) * soft + PROBABILITY_FLOOR / probabilities.shape[1]


def _correlation(probabilities: np.ndarray, y: np.ndarray, unit: np.ndarray) -> float:
    """The likeliest correlation within groups, by the log loss of pooled probabilities, classes even."""
    first, unit = np.unique(unit, return_index=True, return_inverse=True)[1:]
    truth = y[first]
    by_class = np.bincount(truth)
    weight = len(truth) / np.count_nonzero(by_class) / by_class[truth]
    even = np.ones(len(y))

    def loss(rho: float) -> float:
        chosen = pooled(probabilities, unit, even, len(first), rho)[np.arange(len(first)), truth]
        return float(-(weight * np.log(chosen)).sum() + 0.5 * ((rho - CORRELATION_MEAN) / CORRELATION_SD) ** 2)

    return float(minimize_scalar(loss, bounds=(1e-3, 1.0), method="bounded").x)


def _base(rows: Rows, names: Sequence[str], seed: int):
    """Standardisation, the candidates fitted, and the gate."""
    mean = np.average(rows.x, axis=0, weights=rows.weight)
    scale = np.sqrt(np.average((rows.x - mean) ** 2, axis=0, weights=rows.weight))
    scale = np.where(scale > 1e-9 * np.maximum(1.0, np.abs(mean)), scale, 1.0)
    z = np.clip((rows.x - mean) / scale, -1e3, 1e3)
    members = {}
    for name in names:
        member = CANDIDATES[name](rows.x.shape[1], seed)
        if isinstance(member, Pipeline):
            member.set_params(map__n_components=min(member.named_steps["map"].n_components, len(z)))
            member.fit(np.clip(z, -CLIP, CLIP), rows.y, logistic__sample_weight=rows.weight)
        else:
            member.fit(np.clip(z, -CLIP, CLIP), rows.y, sample_weight=rows.weight)
        members[name] = member
    return mean, scale, members, Gate.fit(z, rows.y, rows.weight, rows.n_classes)


def _weighted_quantile(values: np.ndarray, weight: np.ndarray, q: float) -> float:
    order = np.argsort(values)
    mass = np.cumsum(weight[order])
    return float(values[order][min(np.searchsorted(mass, q * mass[-1]), len(values) - 1)])


def fit(rows: Rows, names: Sequence[str], rng: np.random.Generator) -> tuple[Fitted, str, dict[str, float]]:
    """Choose, calibrate and gate on inner held-out groups, then fit the choice to all rows."""
    few = rows.take(_thin(rows, SELECTION_ROWS, rng))
    seed = int(rng.integers(2**31))
    n, k = len(few.y), rows.n_classes
    raw = {name: np.zeros((n, k)) for name in names}
    distance = np.full(n, np.nan)
    for train, test in folds(few, rng, INNER_FOLDS):
        part = few.take(train)
        mean, scale, members, gate = _base(part, names, seed)
        z = np.clip((few.x[test] - mean) / scale, -1e3, 1e3)
        seen = np.isin(few.y[test], part.y)
        distance[test[seen]] = gate.distance(z[seen])
        for name in names:
            raw[name][test] = _full(members[name], z, k)
    held = np.isfinite(distance)
    if held.any():
        y, weight = few.y[held], few.weight[held]
        unit = units(y, few.group[held])
        candidates = {name: values[held] for name, values in raw.items()}
        pooled, temperatures, losses = _choose(candidates, y, weight, len(np.unique(unit)))
        chosen = min(losses, key=lambda name: losses[name])
        calibrated = _calibrated(pooled[chosen], temperatures[chosen])
        correlation = _correlation(calibrated, y, unit)
        threshold = _weighted_quantile(distance[held], weight, 1 - FALSE_REJECTION_RATE)
    else:
        chosen, temperatures, losses, threshold, correlation = names[0], {names[0]: 2.0}, {}, np.nan, 1.0
    final = names if chosen == COMMITTEE else (chosen,)
    mean, scale, members, gate = _base(rows, final, seed)
    if not np.isfinite(threshold):
        # Nothing could be held out: items as far as twice the furthest one trained on are still let through.
        threshold = 2.0 * float(gate.distance(np.clip((rows.x - mean) / scale, -1e3, 1e3)).max())
    fitted = Fitted(
        mean,
        scale,
        tuple(members[name] for name in final),
        tuple(temperatures[name] if chosen == COMMITTEE else 1.0 for name in final),
        k,
        gate,
        temperatures[chosen],
        max(threshold, 1e-6),
        correlation,
    )
    return fitted, chosen, losses
