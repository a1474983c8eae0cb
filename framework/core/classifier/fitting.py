"""Choosing, calibrating and gating a classifier on groups held out of its training rows."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.spatial.distance import cdist
from scipy.special import softmax
from sklearn.decomposition import PCA
from sklearn.ensemble import ExtraTreesClassifier
from sklearn.kernel_approximation import Nystroem
from sklearn.linear_model import LogisticRegression
from sklearn.model_selection import StratifiedGroupKFold
from sklearn.pipeline import Pipeline

from .calibration import COMMITTEE, calibrated, choose, likeliest_correlation, softened
from .gate import Gate, gate_threshold
from .trust import Trust

FOLDS = 5
INNER_FOLDS = 4
SELECTION_ROWS = 2000
"""Rows (thinned within groups) that take part in choosing, calibrating and gating."""
TREES = 80
INTRA_GROUP_CORRELATION = 0.1
"""Correlation of the items of a group in the weights of training rows [-]."""
CLIP = 8.0
"""Standard scores are limited to this before a member sees them [-]."""


def _kernel_machine(d: int, seed: int, components: int, freedom: float) -> Pipeline:
    # A Nystroem map of an RBF kernel replaces a kernel machine: the cost of a prediction does not grow with n.
    mapping = Nystroem(gamma=0.5 / d, n_components=components, random_state=seed)
    return Pipeline([("map", mapping), ("logistic", LogisticRegression(C=freedom, max_iter=500))])


def _reduced(seed: int, components: int, freedom: float) -> Pipeline:
    # Principal components first: for many columns and few groups, such as the features of a deep network.
    reduce = PCA(components, svd_solver="randomized", random_state=seed)
    return Pipeline([("map", reduce), ("logistic", LogisticRegression(C=freedom, max_iter=500))])


def fold_map(machine: Pipeline) -> None:
    """Fold the square matrix of a Nystroem map into the linear model behind it: the same answers, a fifth of the file.

    The map of x is k(x) N', k being the kernel with its components; so that of the logistic model C is k(x) (C N)'.
    """
    mapping, linear = machine.named_steps["map"], machine.named_steps["logistic"]
    if isinstance(mapping, Nystroem):
        linear.coef_ = linear.coef_ @ mapping.normalization_
        mapping.normalization_ = np.eye(len(mapping.normalization_))


CANDIDATES: dict[str, Callable[[int, int], LogisticRegression | Pipeline | ExtraTreesClassifier]] = {
    "logistic": lambda d, seed: LogisticRegression(C=0.1, max_iter=500),
    "stiff logistic": lambda d, seed: LogisticRegression(C=0.02, max_iter=500),
    "kernel": lambda d, seed: _kernel_machine(d, seed, 250, 3.0),
    "trees": lambda d, seed: ExtraTreesClassifier(TREES, min_samples_leaf=4, max_features="sqrt", random_state=seed),
    "reduced logistic": lambda d, seed: _reduced(seed, 128, 0.01),
    "whitened logistic": lambda d, seed: LogisticRegression(C=0.02, max_iter=500),
}
"""Kinds of classifiers by name; the stiff one is for few groups. The whitened one sees features of which the covariance
within classes is the identity, so that what varies from group to group counts little (Hatch, Kajarekar and Stolcke
2006, within-class covariance normalization); it takes a dozen groups or more of a kind."""
USUAL = ("logistic", "kernel", "trees")
"""Candidates where none are named."""


@dataclass(frozen=True)
class Fitted:
    """What was learnt: standardisation, members whose probabilities are averaged, temperatures, gate.

    Each member has its own temperature, so that none shouts the others down, and sees its own columns, from the first
    to before the last of `member_columns`; `temperature` is for their mean. `trust` gives the weight of an item by its
    quality; without it that is the quality itself. `together` gives the exponent of what the items of one thing say
    together, by its quality; without it that is 1.
    """

    mean: np.ndarray
    scale: np.ndarray
    members: tuple[LogisticRegression | Pipeline | ExtraTreesClassifier, ...]
    member_temperatures: tuple[float, ...]
    member_columns: tuple[tuple[int, int], ...]
    n_classes: int
    gate: Gate
    temperature: float
    threshold: float
    correlation: float
    trust: Trust | None = None
    together: Trust | None = None

    def standardise(self, features: np.ndarray) -> np.ndarray:
        """Give features (n, d) as standard scores, limited to where arithmetic stays finite."""
        return np.clip((features - self.mean) / self.scale, -1e3, 1e3)

    def probabilities(self, z: np.ndarray) -> np.ndarray:
        """Give calibrated probabilities (n, k) of standardised rows z (n, d)."""
        parts = zip(self.members, self.member_temperatures, self.member_columns, strict=True)
        raw = np.mean([softened(_full(member, z[:, a:b], self.n_classes), t) for member, t, (a, b) in parts], axis=0)
        return calibrated(raw, self.temperature)


@dataclass(frozen=True)
class Rows:
    """Training rows: features x (n, d), class indices y (n,), groups (n,), and how much each row counts.

    `columns` gives the first column that a candidate sees and the one after the last, by the candidate's name; of all
    where it is not named. The gate sees blocks of columns that end at `gate_ends`; all in one where there are none.
    """

    x: np.ndarray
    y: np.ndarray
    group: np.ndarray
    weight: np.ndarray
    n_classes: int
    columns: Mapping[str, tuple[int, int]] = field(default_factory=dict)
    gate_ends: tuple[int, ...] = ()

    def take(self, index: np.ndarray) -> Rows:
        """Give some rows, with weights of their own."""
        y, group = self.y[index], self.group[index]
        return replace(self, x=self.x[index], y=y, group=group, weight=row_weights(y, group))

    def seen_by(self, name: str) -> tuple[int, int]:
        """Give the first column that a candidate sees, and the one after the last."""
        return self.columns.get(name, (0, self.x.shape[1]))


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
    answer[:, member.classes_] = _predicted(member, np.clip(z, -CLIP, CLIP))
    return answer


def _predicted(member, z: np.ndarray) -> np.ndarray:
    """Give what `predict_proba` gives, without its checks, which take several times as long as one answer."""
    if isinstance(member, ExtraTreesClassifier):
        single = np.ascontiguousarray(z, dtype=np.float32)
        return np.mean([tree.tree_.predict(single) for tree in member.estimators_], axis=0)
    linear = member
    if isinstance(member, Pipeline):
        mapping, linear = (step for _, step in member.steps)
        if isinstance(mapping, PCA):
            z = (z - mapping.mean_) @ np.asarray(mapping.components_).T
        else:
            z = np.exp(-mapping.gamma * cdist(z, mapping.components_, "sqeuclidean"))  # `fold_map` took the rest
    score = z @ linear.coef_.T + linear.intercept_
    return softmax(score if score.shape[1] > 1 else np.column_stack([np.zeros(len(z)), score]), axis=1)


def _base(rows: Rows, names: Sequence[str], seed: int):
    """Standardisation, the candidates fitted, and the gate."""
    mean = np.average(rows.x, axis=0, weights=rows.weight)
    scale = np.sqrt(np.average((rows.x - mean) ** 2, axis=0, weights=rows.weight))
    scale = np.where(scale > 1e-9 * np.maximum(1.0, np.abs(mean)), scale, 1.0)
    z = np.clip((rows.x - mean) / scale, -1e3, 1e3)
    members = {}
    for name in names:
        first, last = rows.seen_by(name)
        seen = np.clip(z[:, first:last], -CLIP, CLIP)
        member = CANDIDATES[name](last - first, seed)
        if isinstance(member, Pipeline):
            mapping = member.named_steps["map"]
            most = min(seen.shape) if isinstance(mapping, PCA) else len(seen)
            mapping.set_params(n_components=min(mapping.n_components, most))
            member.fit(seen, rows.y, logistic__sample_weight=rows.weight)
            fold_map(member)
        elif isinstance(member, LogisticRegression) and name == "whitened logistic":
            gate = Gate.fit(seen, rows.y, rows.weight, rows.n_classes)
            whitening = gate.whitening * np.sqrt(last - first)
            member.fit(seen @ whitening, rows.y, sample_weight=rows.weight)
            member.coef_ = member.coef_ @ whitening.T  # the same answers to features as they are
        else:
            member.fit(seen, rows.y, sample_weight=rows.weight)
        members[name] = member
    return mean, scale, members, Gate.fit(z, rows.y, rows.weight, rows.n_classes, rows.gate_ends)


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
            first, last = rows.seen_by(name)
            raw[name][test] = _full(members[name], z[:, first:last], k)
    held = np.isfinite(distance)
    if held.any():
        y, weight = few.y[held], few.weight[held]
        unit = units(y, few.group[held])
        candidates = {name: values[held] for name, values in raw.items()}
        members_too, temperatures, losses = choose(candidates, y, weight, len(np.unique(unit)))
        chosen = min(losses, key=lambda name: losses[name])
        correlation = likeliest_correlation(calibrated(members_too[chosen], temperatures[chosen]), y, unit)
        threshold = gate_threshold(distance[held], weight)
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
        tuple(rows.seen_by(name) for name in final),
        k,
        gate,
        temperatures[chosen],
        max(threshold, 1e-6),
        correlation,
    )
    return fitted, chosen, losses
