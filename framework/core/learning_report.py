"""How well a classifier does on groups it has not seen: scores with intervals, and the page that shows them."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape

import numpy as np

from .html import page
from .learning_interval import accuracy_intervals

CALIBRATION_BINS = 10


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
        reliability, recall by class, confusion (rows are the truth).
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
        "recall": {name: float(confusion[i, i] / totals[i]) if totals[i] else None for i, name in enumerate(classes)},
        "confusion": confusion.astype(int).tolist(),
    }


def _percent(score: dict) -> str:
    return f"{score['value']:.3f} (95 %: {score['low']:.3f} to {score['high']:.3f})"


def _confusion_table(classes: Sequence[str], confusion: Sequence[Sequence[int]]) -> str:
    head = "".join(f"<th>{escape(name)}</th>" for name in classes)
    body = []
    for name, row in zip(classes, confusion, strict=True):
        total = max(sum(row), 1)
        cells = "".join(f'<td style="background:rgba(40,110,180,{n / total * 0.7:.2f})">{int(n)}</td>' for n in row)
        body.append(f"<tr><th>{escape(name)}</th>{cells}<td>{row[len(body)] / total:.2f}</td></tr>")
    return f"<table><tr><th>truth \\ said</th>{head}<th>recall</th></tr>{''.join(body)}</table>"


def _reliability_chart(table: Sequence[dict]) -> str:
    """An inline drawing of how often the top class was right against the probability given to it."""
    size = 220

    def place(x: float, y: float) -> str:
        return f"{20 + x * size:.1f},{20 + (1 - y) * size:.1f}"

    dots = ""
    for row in table:
        x, y = place(row["said"], row["was_right"]).split(",")
        title = f"said {row['said']:.2f}, right {row['was_right']:.2f}, n = {row['n']}"
        radius = 3 + min(row["n"], 400) ** 0.5 / 3
        dots += f'<circle cx="{x}" cy="{y}" r="{radius:.1f}" fill="#286eb4"><title>{title}</title></circle>'
    return (
        f'<svg width="{size + 40}" height="{size + 40}" role="img" aria-label="reliability">'
        f'<polyline points="{place(0, 0)} {place(0, 1)} {place(1, 1)} {place(1, 0)} {place(0, 0)}" fill="none" '
        f'stroke="#999"/><polyline points="{place(0, 0)} {place(1, 1)}" stroke="#bbb" fill="none"/>{dots}</svg>'
    )


def _score_section(title: str, classes: Sequence[str], score: dict) -> str:
    return (
        f"<h2>{escape(title)}</h2><p>n = {score['n']}; balanced accuracy {_percent(score['balanced_accuracy'])}; "
        f"accuracy {_percent(score['accuracy'])}; log loss {score['log_loss']:.3f} nat; "
        f"calibration error {score['calibration_error']:.3f}.</p>"
        f"{_confusion_table(classes, score['confusion'])}"
        f"<p class=note>Probability given to the top class (across) against how often it was right (up):</p>"
        f"{_reliability_chart(score['reliability'])}"
    )


def report_html(report: dict) -> str:
    """Show a training report as one page of HTML that needs nothing from elsewhere.

    Parameters
    ----------
    report
        As `TerrainClassifier.train` gives it; every name in it is escaped.
    """
    classes = report["classes"]
    counts = "".join(
        f"<tr><th>{escape(name)}</th><td>{report['rows_by_class'][name]}</td><td>{report['groups_by_class'][name]}</td></tr>"
        for name in classes
    )
    warnings = "".join(f"<p class=warn>{escape(text)}</p>" for text in report["warnings"])
    if report["validated"]:
        shown = report | {"n": report["n_scored"]}
        sections = _score_section("Per item as it came, held out by group", classes, shown)
        sections += _score_section("Per group: its items pooled", classes, report["by_group"])
        if "degraded" in report:
            title = "Per degraded item (blur, noise or a channel less was added), held out by group"
            sections += _score_section(title, classes, report["degraded"])
    else:
        sections = ""
    selection = "".join(
        f"<tr><th>{escape(name)}</th><td>{loss:.3f}</td></tr>" for name, loss in report["selection"].items()
    )
    gate = report["gate"]
    rejected, others = gate["held_out_rejection"], gate["other_ground_rejection"]
    gate_text = f"Items further than {gate['threshold']:.2f} from what was trained on are answered 'unknown'" + (
        "." if rejected is None else f": {rejected:.1%} of held-out items were."
    )
    if others is not None:
        gate_text += f" Of classes that the gate had not seen, each left out in turn, {others:.1%} of items were."
    body = (
        f"<h1>Terrain classifier: {escape(report['modality'])}</h1>"
        f"<p>{report['n']} items ({report['n_degraded']} of them degraded copies), {report['groups']} groups, "
        f"{len(classes)} classes. {escape(report['split'])}</p>"
        f"{warnings}{sections}<h2>Material</h2><table><tr><th>class</th><th>items</th><th>groups</th></tr>{counts}</table>"
        f"<h2>Model</h2><p>Chosen on inner folds: {escape(report['model'])}; temperature {report['temperature']:.2f}. "
        f"{escape(gate_text)}</p><table><tr><th>candidate</th><th>inner log loss [nat]</th></tr>{selection}</table>"
    )
    return page(f"Bevameter: {report['modality']}", body)
