"""The report of a training: what the model is, and how well it does on groups that it has not seen."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .calibration import joined
from .fitting import FOLDS, Fitted, Rows, row_weights, units
from .gate import FALSE_REJECTION_RATE, Gate
from .scores import scores

FEW_GROUPS = 5
"""A class of fewer groups is scored roughly."""


@dataclass
class HeldOut:
    """Predictions of n rows by models that have not seen their group.

    Parameters
    ----------
    probabilities : (n, k)
    correlation : (n,)
        Within groups, as learnt without the row's own.
    scored : (n,)
        True where the row's class was known to the model that predicted it.
    distance : (n,)
        From what was trained on, over the gate's threshold [-].
    fold : (n,)
        Number of the fold that held the row out; -1 where none did.
    """

    probabilities: np.ndarray
    correlation: np.ndarray
    scored: np.ndarray
    distance: np.ndarray
    fold: np.ndarray

    @property
    def rejected(self) -> np.ndarray:
        """True where the gate turns the row away, (n,)."""
        return self.distance > 1.0


def training_report(
    rows: Rows,
    classes: Sequence[str],
    modality: str,
    held: HeldOut,
    degraded: np.ndarray,
    fitted: Fitted,
    chosen: str,
    losses: dict[str, float],
    dropped: int,
    notes: Sequence[str] = (),
) -> dict:
    """Sum up a training (JSON-able).

    The scores on top are of original items; those of items made from them, marked in `degraded` (n,), stand
    apart under ``"degraded"`` (absent where there are none). `notes` on the material stand first among the warnings.
    """
    groups_of = [len(np.unique(rows.group[rows.y == i])) for i in range(len(classes))]
    original = ~degraded if not degraded.all() else np.ones(len(degraded), dtype=bool)
    scored = held.scored & original
    others = _other_ground_rejection(rows, fitted, original)
    untested = [name for i, name in enumerate(classes) if not scored[rows.y == i].any()]
    report = {
        "modality": modality,
        "classes": list(classes),
        "n": len(rows.y),
        "n_degraded": int(degraded.sum()),
        "groups": len(np.unique(rows.group)),
        "rows_by_class": {name: int((rows.y == i).sum()) for i, name in enumerate(classes)},
        "groups_by_class": dict(zip(classes, groups_of, strict=True)),
        "split": f"Scores are from {FOLDS}-fold cross-validation by group (at most), stratified by class. "
        "Model, temperature and gate are chosen within the training side of each fold, by a second such split.",
        "validated": bool(scored.any()),
        "not_validated": untested,
        "warnings": [*notes, *_warnings(classes, groups_of, untested, dropped, bool(losses), others)],
        "model": chosen,
        "selection": losses,
        "temperature": fitted.temperature,
        "correlation_within_groups": fitted.correlation,
        "gate": {
            "threshold": fitted.threshold,
            "false_rejection_rate": FALSE_REJECTION_RATE,
            "held_out_rejection": _rejection(rows, held, scored),
            "other_ground_rejection": others,
        },
    }
    if scored.any():
        part = _part_scores(rows, held, scored, classes)
        report |= part | {"n_scored": part["n"], "n": len(rows.y)}
        report["by_group"] = _scores_by_group(rows, held, scored, classes)
    made = held.scored & ~original
    if made.any():
        worse = _part_scores(rows, held, made, classes)
        report["degraded"] = worse | {"held_out_rejection": _rejection(rows, held, made)}
    return report


def of_the_gate(report: dict) -> str:
    """Say how the scores on top take items that the gate turns away, and how many these are; "" where none is known."""
    share = report["gate"]["held_out_rejection"]
    if share is None:
        return ""
    return f"{share:.1%} of the items as they came are answered 'unknown'; they are scored by their likeliest class."


def _warnings(
    classes: Sequence[str],
    groups_of: Sequence[int],
    untested: Sequence[str],
    dropped: int,
    validated: bool,
    others: float | None,
) -> list[str]:
    warnings = []
    if untested:
        warnings.append(f"Not validated, for want of a second group: {', '.join(untested)}.")
    if dropped:
        items, were = ("item", "was") if dropped == 1 else ("items", "were")
        warnings.append(f"{dropped} {items} had features that are not finite and {were} left out.")
    thin = [name for name, count in zip(classes, groups_of, strict=True) if 1 < count < FEW_GROUPS]
    if thin:
        warnings.append(f"Fewer than five groups, so scores are rough: {', '.join(thin)}.")
    if not validated:
        warnings.append(
            "No group could be held out: the model is neither chosen, calibrated nor gated on unseen groups."
        )
    if others is not None and others < 0.5:
        warnings.append(
            f"Ground of no class is mostly answered as one of these: the gate turned away {others:.0%} of items of "
            "classes that it had not seen."
        )
    elif others is None or min(groups_of) < FEW_GROUPS:
        warnings.append("Whether ground of no class is turned away is untested: it takes three classes of five groups.")
    return warnings


def _other_ground_rejection(rows: Rows, fitted: Fitted, original: np.ndarray) -> float | None:
    """Share of a class's items, of those `original` (n,), that the gate turns away when it has not seen the class.

    The mean over all classes, each left out of the gate in turn; None where fewer than two would be left.
    """
    if rows.n_classes < 3:
        return None
    z = fitted.standardise(rows.x)
    shares = []
    for left_out in range(rows.n_classes):
        own = rows.y == left_out
        gate = Gate.fit(z[~own], rows.y[~own], rows.weight[~own], rows.n_classes, rows.gate_ends)
        if (own & original).any():
            away = gate.distance(z[own & original]) > fitted.threshold
            shares.append(np.average(away, weights=rows.weight[own & original]))
    return float(np.mean(shares))


def _rejection(rows: Rows, held: HeldOut, part: np.ndarray) -> float | None:
    """Share of some rows that the gate turned away; None where there are none."""
    return float(np.average(held.rejected[part], weights=rows.weight[part])) if part.any() else None


def _part_scores(rows: Rows, held: HeldOut, part: np.ndarray, classes: Sequence[str]) -> dict:
    y, group = rows.y[part], rows.group[part]
    return scores(held.probabilities[part], y, group, row_weights(y, group), classes)


def _scores_by_group(rows: Rows, held: HeldOut, part: np.ndarray, classes: Sequence[str]) -> dict:
    """Scores of whole groups, the items of each pooled."""
    y, group, correlation = rows.y[part], rows.group[part], held.correlation[part]
    first, inverse = np.unique(units(y, group), return_index=True, return_inverse=True)[1:]
    together = np.zeros((len(first), len(classes)))
    # Groups of one fold are pooled with what that fold's training side says of their correlation.
    for rho in np.unique(correlation):
        own = correlation[first] == rho
        together[own] = joined(held.probabilities[part], inverse, np.ones(len(y)), len(first), rho)[own]
    return scores(together, y[first], group[first], np.ones(len(first)), classes)
