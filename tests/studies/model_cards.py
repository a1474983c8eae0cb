"""The cards of the models that come with the package: what was measured of a model, laid out in Markdown."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path

import numpy as np
from bevameter.framework.core.classifier.classifier import TerrainClassifier
from bevameter.framework.core.classifier.labelled import LabelledFile
from bevameter.framework.core.classifier.scores import accuracy_intervals, confusion_by_unit
from bevameter.framework.senses import sense_named
from measured import write


@dataclass(frozen=True)
class Measured:
    """Answers to n items that the model was not trained on, and how they compare with the truth.

    `balanced` is the balanced accuracy with its 95 % interval, unknown counting as wrong; None where no item is of a
    class that the model knows. `said` is the mean probability of the answers that are not unknown, `right` the share of
    them that is right; `sure` how many have a probability above 0.9, `sure_wrong` how many of these are wrong.
    """

    what: str
    n: int
    balanced: dict | None
    unknown: float
    said: float
    right: float
    sure: int
    sure_wrong: int

    @staticmethod
    def of(what: str, rows: Sequence[dict], truth: Sequence[str], groups: Sequence[str]) -> Measured:
        answer = np.array([row["class"] for row in rows])
        truths, top = np.asarray(truth), np.array([max(row["probabilities"].values()) for row in rows])
        known = ~np.array([row["unknown"] for row in rows])
        wrong, sure = answer != truths, known & (top > 0.9)
        names = [*sorted({*truths, *rows[0]["probabilities"]}), "unknown"]
        balanced = None
        if set(truths) & set(rows[0]["probabilities"]):
            indices = (np.array([names.index(each) for each in part]) for part in (truths, answer))
            table = confusion_by_unit(*indices, np.unique(groups, return_inverse=True)[1], len(names))
            balanced = accuracy_intervals(table)["balanced_accuracy"]
        said, right = (float(part[known].mean()) if known.any() else 0.0 for part in (top, ~wrong))
        return Measured(
            what, len(rows), balanced, float(1 - known.mean()), said, right, int(sure.sum()), int((sure & wrong).sum())
        )

    @property
    def overconfidence(self) -> float:
        return self.said - self.right


@dataclass(frozen=True)
class Made:
    """A model, what was measured, and what its card says. `judged` is what decides whether it is a default.

    `chosen` says what was chosen on the data that the scores are from.
    """

    model: TerrainClassifier
    sources: str
    measured: tuple[Measured, ...]
    judged: Measured | None
    in_short: str
    limits: str
    never: tuple[str, ...]
    example: Callable[[Path], Path]
    chosen: str = ""


def classified(sense: str, model: TerrainClassifier, items: Iterable[LabelledFile], what: str) -> Measured:
    """Measure answers to labelled files."""
    rows, truth, groups = [], [], []
    for item in items:
        found = sense_named(sense).classify([item.file], model)
        rows += found
        truth += [item.class_name] * len(found)
        groups += [item.group] * len(found)
    return Measured.of(what, rows, truth, groups)


def scored(score: dict) -> str:
    return f"{score['value']:.3f} ({score['low']:.3f} to {score['high']:.3f})"


def card(name: str, made: Made, default: bool, seed: int) -> str:
    """Write the card; all figures are those of the training report and of what was measured."""
    report, model = made.model.report, made.model
    counts = "\n".join(
        f"| {each} | {report['rows_by_class'][each]} | {report['groups_by_class'][each]} |" for each in model.classes
    )
    recalls = [row[i] / max(sum(row), 1) for i, row in enumerate(report["by_group"]["confusion"])]
    recalled = ", ".join(f"{each} {share:.2f}" for each, share in zip(model.classes, recalls, strict=True))
    parts = {"one item": report, "a group's items together": report["by_group"]}
    if "degraded" in report:
        parts["one degraded copy"] = report["degraded"]
    for key, what in (("as_it_came", "a photograph as it came"), ("degraded", "a photograph degraded as a whole")):
        if part := report.get("together", {}).get(key):
            parts |= {what: part}
    scores = "\n".join(
        f"| {what} | {part.get('n_scored', part['n'])} | {scored(part['balanced_accuracy'])} "
        f"| {scored(part['accuracy'])} | {part['calibration_error']:.3f} |"
        for what, part in parts.items()
    )
    others = "\n".join(
        f"| {each.what} | {each.n} | {scored(each.balanced) if each.balanced else ''} | {each.unknown:.2f} "
        f"| {each.said:.2f} | {each.right:.2f} | {each.sure_wrong} of {each.sure} |"
        for each in made.measured
    )
    elsewhere = (
        f"""
## On what it was not trained on

"Unknown" counts as wrong in the balanced accuracy. The last columns are of the other answers.

| | n | balanced accuracy (95 %) | unknown | mean probability | right | wrong of those above 0.9 |
|---|---|---|---|---|---|---|
{others}
"""
        if made.measured
        else ""
    )
    used = ("bevameter", "numpy", "scikit-learn", "opencv-python-headless", "librosa")
    libraries = ", ".join(f"{each} {version(each)}" for each in used)
    rejection = report["gate"]["other_ground_rejection"]
    left_out = ", photographs are left out" if "together" in report else ""
    scored_how = f'Items that are answered "unknown" are scored by their likeliest class{left_out}. {made.chosen}'
    never = "\n".join(f"- {text}" for text in made.never)
    warnings = "\n".join(f"- {text}" for text in report["warnings"])
    ground = "synthetic" if name.endswith("-synthetic") else "real"
    taken = (
        f"`bevameter run` takes it on recordings of {ground} ground where there is no model of your own."
        if default
        else f"`bevameter run` takes it only where it is named, `--models {name}`: {made.limits}."
    )
    return f"""# {name}

A model for {model.modality}, of {ground} ground. Classes: {", ".join(model.classes)}.
{made.in_short[0].upper() + made.in_short[1:]} (95 % interval in brackets).
{taken}

## Not to be trusted for

{never}

## Data

{made.sources}

All of it is free of rights (CC0, or made by the package).

| class | items, copies included | groups |
|---|---|---|
{counts}

{warnings}

## On groups held out

{report["split"]}

| | n | balanced accuracy (95 %) | accuracy (95 %) | calibration error |
|---|---|---|---|---|
{scores}

{scored_how.strip()}
Right by class, a group's items together: {recalled}.
Items of a class that the gate had not seen, each left out in turn, of which it turned away: {rejection:.1%}.
{elsewhere}
## How it was made

- `make models`, seed {seed}, {datetime.now(UTC):%Y-%m-%d}, {libraries}
- chosen on inner folds: {report["model"]}; {len(model.feature_names)} features
- version (SHA-256 of the content): {model.version}
"""


def table(entries: Mapping[str, Mapping]) -> list[tuple[str, ...]]:
    """Rows of the documentation's table, of entries of the index."""
    return [
        (f"`{name}`", each["measured"], each["limits"], "yes" if each["default"] else "no")
        for name, each in entries.items()
    ]


def write_table(entries: Mapping[str, Mapping]) -> None:
    """Write docs/measured/models-shipped.json."""
    write(
        "models-shipped", ("model", "measured", "limits", "by default"), table(entries),
        data="Real and simulated (synthetic); n are photographs, windows of sound and runs of real ground, looks and "
        "windows of synthetic ground", command="make models",
    )  # fmt: skip
