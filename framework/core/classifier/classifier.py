"""The classifier that camera, microphone and vibration share: training, calibration, gate, evidence.

A sense offers features, groups and a quality; everything that makes a probability worth believing is here. Models
are chosen, calibrated and gated on groups held out of the training data, and the score that is reported comes from
an outer split that took no part in any of these choices (nested cross-validation: Varma and Simon 2006,
doi:10.1186/1471-2105-7-91).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from ..class_names import check_class_names
from ..errors import InputError
from ..evidence import ClassEvidence
from .calibration import joined
from .fitting import CANDIDATES, USUAL, Fitted, Rows, fit, folds, row_weights
from .gate import room
from .labelled import LabelledFile
from .learning import LearningCurve, learning_curve
from .mistakes import Mistake, worst_mistakes
from .report import HeldOut, training_report
from .together import HeldOutFold, Wholes, learn_together, raised
from .trust import learn_trust

_BATCH_ROWS = 8192


@dataclass(frozen=True)
class TrainingOutcome:
    """A trained classifier, how well it does on groups it has not seen (JSON-able), and what it was trained on."""

    classifier: TerrainClassifier
    report: dict
    material: Material | None = None


@dataclass(frozen=True)
class Material:
    """What a classifier was trained on and how it did there, for a closer look.

    Parameters
    ----------
    rows, candidates
        The n rows, and the kinds of classifiers to choose from.
    held
        Predictions of the rows by models that had not seen their group.
    quality : (n,)
        Score of each row's image or sound, less what its distance from the training leaves of it [-].
    original : (n,)
        True for items as they came, False for degraded copies.
    samples
        The labelled files, or stretches of files, that rows are of; none where rows came without.
    sample_of : (n,)
        Index of the sample that a row is of.
    """

    rows: Rows
    candidates: tuple[str, ...]
    held: HeldOut
    quality: np.ndarray
    original: np.ndarray
    samples: tuple[LabelledFile, ...]
    sample_of: np.ndarray

    def learning_curve(
        self, rng: np.random.Generator, progress: Callable[[float], None] | None = None
    ) -> LearningCurve | None:
        """Measure what further groups would bring, which takes up to as long as the training; see `learning_curve`."""
        return learning_curve(self.rows, self.candidates, self.held, self.original, rng, progress)

    def mistakes(self, classes: Sequence[str]) -> tuple[Mistake, ...]:
        """Give the samples that were got wrong most surely; see `worst_mistakes`."""
        return worst_mistakes(self.samples, self.sample_of, self.held, self.original, classes)


@dataclass(frozen=True)
class TerrainClassifier:
    """A terrain classifier of one sense.

    Parameters
    ----------
    modality
        Which sense: ``"vision"``, ``"audio"``, ``"vibration"``.
    classes
        The k class names, sorted.
    feature_names
        The d features, in order.
    settings
        How features were made (JSON-able): patch size, sample rate ...
    report
        Held-out scores (JSON-able).
    version
        SHA-256 of everything in the model, hexadecimal; the same after saving and loading.
    file
        Where it was read from; None where it was trained just now.
    """

    modality: str
    classes: tuple[str, ...]
    feature_names: tuple[str, ...]
    settings: dict
    report: dict
    fitted: Fitted
    version: str = field(default="")
    file: Path | None = field(default=None, compare=False)

    @property
    def source(self) -> str:
        """What to name in an error: the file, or the sense."""
        return str(self.file or f"model for {self.modality}")

    @staticmethod
    def train(
        features: np.ndarray,
        labels: Sequence[str] | np.ndarray,
        groups: Sequence[str] | np.ndarray,
        *,
        modality: str,
        feature_names: Sequence[str],
        settings: dict,
        rng: np.random.Generator,
        candidates: Sequence[str] | None = None,
        columns: Mapping[str, tuple[int, int]] | None = None,
        gate_ends: tuple[int, ...] = (),
        degraded: np.ndarray | None = None,
        quality: np.ndarray | None = None,
        samples: Sequence[LabelledFile] = (),
        sample_of: np.ndarray | None = None,
        wholes: Wholes | None = None,
        source: str | Path = "training data",
        notes: Sequence[str] = (),
        progress: Callable[[float], None] | None = None,
    ) -> TrainingOutcome:
        """Train on labelled features.

        Parameters
        ----------
        features : (n, d)
            Rows with a value that is not finite are left out, and counted in the report.
        labels, groups : (n,)
            Class name, and what must stay on one side of a split (site, session, clip, photograph).
        candidates
            Names from `CANDIDATES`; `USUAL` by default.
        columns
            By name of a candidate, the first column that it sees and the one after the last; all by default.
        gate_ends
            The gate looks at the columns in blocks that end there, each for itself; at all in one block by default.
        degraded : (n,)
            True for rows that are no items as they came but made from them: with blur, noise or a channel less. They
            teach as all rows do; their scores are reported apart, under ``"degraded"``.
        quality : (n,)
            How far the sense trusts each row by what the image or sound is like, in [0, 1]. From it and groups held out
            the weight of an item at each quality is learnt (`trust`).
        samples, sample_of : (n,)
            Labelled files or stretches of files, and the index of the one that each row is of: for a report's mistakes.
        wholes
            Things that are judged by several items each, of classes and groups of these rows, degraded copies among
            them: how far to trust what their items say together is learnt from them.
        source
            What to name in an error.
        notes
            What the report is to say of the material first, among its warnings.
        progress
            Called with the share done, 0 to 1.

        Raises
        ------
        InputError
            A class has no row whose values are finite, or a name that none may have; there are fewer than two classes,
            or the shapes do not agree.
        """
        from .store import content_digest

        made = np.zeros(len(labels), dtype=bool) if degraded is None else np.asarray(degraded, dtype=bool)
        rated = np.zeros(len(labels)) if quality is None else np.asarray(quality, dtype=float)
        x, y, group, kept, classes = _checked(features, labels, groups, feature_names, source)
        made, rated = made[kept], rated[kept]
        names = tuple(candidates or USUAL)
        if unknown := set(names) - set(CANDIDATES):
            raise InputError(source, f"no candidate {sorted(unknown)}", expected="of " + ", ".join(CANDIDATES))
        step = progress or (lambda share: None)
        rows = Rows(x, y, group, row_weights(y, group), len(classes), dict(columns or {}), gate_ends)
        held, parts = _outer_predictions(rows, names, np.asarray(groups, dtype=str)[kept], rng, step)
        fitted, chosen, losses = fit(rows, names, rng)
        step(1.0)
        rated = rated * room(held.distance)
        open_ = held.scored & (rated > 0)
        weight = row_weights(y[open_], group[open_]) if open_.any() else np.zeros(0)
        trust, table = learn_trust(held.probabilities[open_], y[open_], group[open_], rated[open_], weight)
        fitted = replace(fitted, trust=trust)
        dropped = int((~kept).sum())
        report = training_report(rows, classes, modality, held, made, fitted, chosen, losses, dropped, notes)
        if table:
            report["trust"] = table
        if wholes is not None:

            def answer(part: Fitted, things: Wholes) -> ClassEvidence:
                one = TerrainClassifier(modality, classes, tuple(feature_names), {}, {}, replace(part, trust=trust))
                return one.pool(one.evidence(things.features, things.quality), things.unit, len(things.labels))

            together, report["together"] = learn_together(wholes, classes, parts, answer)
            fitted = replace(fitted, together=together)
        model = TerrainClassifier(modality, classes, tuple(feature_names), dict(settings), report, fitted)
        object.__setattr__(model, "version", content_digest(model))
        owner = np.arange(len(labels)) if sample_of is None else sample_of
        material = Material(rows, names, held, rated, ~made | made.all(), tuple(samples), owner[kept])
        return TrainingOutcome(model, report, material)

    def evidence(
        self, features: np.ndarray, quality: np.ndarray, reasons: Sequence[tuple[str, ...]] | None = None
    ) -> ClassEvidence:
        """Say what the features are evidence of.

        Parameters
        ----------
        features : (n, d)
        quality : (n,)
            How far the sense trusts each item, in [0, 1]; an item of quality 0 is unknown.
        reasons
            n tuples: why quality is low.

        Returns
        -------
        ClassEvidence
            Calibrated probabilities. An item is unknown where its quality is 0, a feature is not finite, or it is
            unlike anything trained on; quality falls to 0 over the last fifth before that gate, with a reason
            where that costs a fifth of it or more. The quality given is the weight that was learnt for it, where
            one was (`trust.Trust`).

        Raises
        ------
        ValueError
            The shapes do not agree.
        """
        features = np.asarray(features, dtype=float)
        quality = np.asarray(quality, dtype=float)
        said: list[tuple[str, ...]] = [()] * len(features) if reasons is None else [tuple(item) for item in reasons]
        if features.ndim != 2 or features.shape[1] != len(self.feature_names):
            raise ValueError(f"features must be (n, {len(self.feature_names)}), got {features.shape}")
        if not len(features) == len(quality) == len(said):
            raise ValueError(f"{len(features)} rows, {len(quality)} qualities and {len(said)} reasons do not agree")
        finite = np.isfinite(features).all(axis=1)
        trusted = np.where(np.isfinite(quality), np.clip(quality, 0.0, 1.0), 0.0)
        probabilities = np.full((len(features), len(self.classes)), 1.0 / len(self.classes))
        distance = np.full(len(features), np.inf)
        usable = np.flatnonzero(finite & (trusted > 0))
        for start in range(0, len(usable), _BATCH_ROWS):
            index = usable[start : start + _BATCH_ROWS]
            z = self.fitted.standardise(features[index])
            distance[index] = self.fitted.gate.distance(z)
            inside = distance[index] <= self.fitted.threshold
            if inside.any():
                probabilities[index[inside]] = self.fitted.probabilities(z[inside])
        outside = distance > self.fitted.threshold
        unknown = outside | ~finite | (trusted <= 0)
        inner = room(distance / self.fitted.threshold)
        trusted *= np.where(unknown, 0.0, inner)
        if self.fitted.trust is not None:
            trusted = self.fitted.trust.at(trusted)
        for index in np.flatnonzero(~finite):
            said[index] = (*said[index], "features are not finite")
        for index in np.flatnonzero(outside & np.isfinite(distance)):
            said[index] = (*said[index], f"unlike anything trained on ({self._place(distance[index])})")
        for index in np.flatnonzero(~unknown & (inner < 0.8)):
            said[index] = (*said[index], f"nearly unlike anything trained on ({self._place(distance[index])})")
        for index in np.flatnonzero(finite & unknown):
            said[index] = said[index] or ("quality is 0",)
        return ClassEvidence(self.classes, probabilities, trusted, unknown, tuple(said))

    def _place(self, distance: float) -> str:
        return f"distance {distance:.1f}, gate {self.fitted.threshold:.1f}"

    def pool(self, evidence: ClassEvidence, unit: np.ndarray, n_units: int | None = None) -> ClassEvidence:
        """Join the evidence of items that are near copies: patches of a photograph, windows of a clip.

        Parameters
        ----------
        evidence
            What `evidence` gave for n items.
        unit : (n,)
            Index of the thing that each item belongs to, 0 to u - 1.
        n_units
            u, where the last units may have no item; they are unknown.

        Returns
        -------
        ClassEvidence
            One item for each unit: known items are joined by quality, with the correlation within groups that
            was learnt on held-out groups; quality is their mean, over all items of the unit, and the reasons are
            the union. Where it was learnt how far to trust what items say together (`together`), by their quality,
            probabilities are raised to that. A unit is unknown where more of its items are unknown than known.
        """
        unit = np.asarray(unit, dtype=int)
        u = int(unit.max(initial=-1)) + 1 if n_units is None else n_units
        weight = np.where(evidence.unknown, 0.0, evidence.quality)
        probabilities = joined(evidence.probabilities, unit, weight, u, self.fitted.correlation)
        count = np.bincount(unit, minlength=u)
        unknown = 2 * np.bincount(unit, ~evidence.unknown, u) < np.maximum(count, 1)
        quality = np.where(unknown, 0.0, np.bincount(unit, weight, u) / np.maximum(count, 1))
        if self.fitted.together is not None:
            probabilities = raised(probabilities, self.fitted.together.at(quality))
        probabilities[unknown] = 1.0 / len(self.classes)
        said: list[dict[str, None]] = [{} for _ in range(u)]
        for index, reasons in zip(unit, evidence.reasons, strict=True):
            said[index].update(dict.fromkeys(reasons))
        reasons = tuple(
            tuple(item) or (("nothing to go by",) if n == 0 else ()) for item, n in zip(said, count, strict=True)
        )
        return ClassEvidence(self.classes, probabilities, quality, unknown, reasons)

    def save(self, path: str | Path) -> None:
        """Write the model (skops); an existing file is replaced only once the new one is whole."""
        from .store import save

        save(self, Path(path))

    @staticmethod
    def load(path: str | Path, modality: str | None = None) -> TerrainClassifier:
        """Read a model that `save` wrote.

        Raises
        ------
        InputError
            The file is missing, is no model of this program, holds a type that is not allowed, is too large or
            damaged, or is of another modality.
        """
        from .store import load

        return load(Path(path), modality)


def _checked(features, labels, groups, feature_names, source):
    x = np.asarray(features, dtype=float)
    labels = np.asarray(labels, dtype=str)
    groups = np.asarray(groups, dtype=str)
    if x.ndim != 2 or x.shape[1] != len(feature_names) or not len(x) == len(labels) == len(groups):
        raise InputError(
            source,
            f"features {x.shape}, {len(labels)} labels, {len(groups)} groups",
            expected=f"one label and one group for each row of {len(feature_names)} features",
        )
    finite = np.isfinite(x).all(axis=1)
    classes, y = np.unique(labels[finite], return_inverse=True)
    if len(classes) < 2:
        found = f"only class {str(classes[0])!r}" if len(classes) else "no usable item"
        raise InputError(source, found, expected="items of at least two classes")
    if lost := sorted(set(labels.tolist()) - set(classes.tolist())):
        raise InputError(
            source, f"none of {int((labels == lost[0]).sum())} items has features that are finite",
            expected="usable items of every class", place=f"class {lost[0]!r}",
        )  # fmt: skip
    check_class_names(map(str, classes), source)
    _, group = np.unique(groups[finite], return_inverse=True)
    return x[finite], y, group, finite, tuple(str(name) for name in classes)


def _outer_predictions(
    rows: Rows, names: Sequence[str], groups: np.ndarray, rng: np.random.Generator, step
) -> tuple[HeldOut, list[HeldOutFold]]:
    """Predict each group by a model whose every choice was made without it; give these models, too.

    `groups` (n,) are the names of the rows' groups.
    """
    n, parts = len(rows.y), []
    held = HeldOut(np.zeros((n, rows.n_classes)), np.ones(n), np.zeros(n, dtype=bool), np.zeros(n), np.full(n, -1))
    splits = folds(rows, rng)
    for index, (train, test) in enumerate(splits):
        part = rows.take(train)
        fitted, _, _ = fit(part, names, rng)
        z = fitted.standardise(rows.x[test])
        held.probabilities[test] = fitted.probabilities(z)
        held.correlation[test] = fitted.correlation
        held.distance[test] = fitted.gate.distance(z) / fitted.threshold
        held.fold[test] = index
        held.scored[test] = np.isin(rows.y[test], part.y)
        parts.append(HeldOutFold(fitted, np.unique(groups[test])))
        step((index + 1) / (len(splits) + 1))
    return held, parts
