"""What the commands print of their results, in the units that people read.

The modules whose results are printed are not imported here: no command waits for what another one needs.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from rich.markup import escape

from .printing import print_line, print_table

if TYPE_CHECKING:
    from ...identification.estimate.identify import Identification
    from ...identification.explain.explanation import Explanation
    from ..core.findings import Finding
    from ..core.soil import SoilEstimate

_CANDIDATES_PRINTED = 5

_NO_SOIL = "no soil data for class "
"""How the reason begins that several classes may share."""


def print_report(report: dict[str, Any], model: str) -> None:
    """Print a training report: how well the model does on groups it has not seen, and on what that rests.

    Parameters
    ----------
    report
        As `TerrainClassifier.train` gives it.
    model
        Where the model was written.
    """
    from ..core.classifier.report import of_the_gate

    def interval(score: dict[str, float]) -> str:
        return f"{score['value']:.3f} ({score['low']:.3f} to {score['high']:.3f})"

    print_line(
        f"[bold]{report['modality']}[/bold] model written to {escape(model)}: {report['n']} items in "
        f"{report['groups']} groups, {len(report['classes'])} classes"
    )
    if report["validated"]:
        scores = {"one item": report, "a group's items averaged": report["by_group"]}
        print_table(
            ["on groups held out", "n", "balanced accuracy (95 %)", "accuracy (95 %)", "calibration error"],
            [
                [
                    name, str(score.get("n_scored", score["n"])), interval(score["balanced_accuracy"]),
                    interval(score["accuracy"]), f"{score['calibration_error']:.3f}",
                ]
                for name, score in scores.items()
            ],
        )  # fmt: skip
        rows = zip(report["classes"], report["confusion"], strict=True)
        print_table(["truth \\ said", *report["classes"]], [[name, *map(str, counts)] for name, counts in rows])
        print_line(f"{report['split']} {of_the_gate(report)}")
    for warning in report["warnings"]:
        print_line(f"[yellow]{escape(warning)}[/yellow]")


def print_classified(rows: Sequence[dict[str, Any]]) -> None:
    """Print the class of each file and window, or why there is none; reasons of one kind are one, without numbers."""
    from ..sense_map import kind_of_reason

    def seconds(value: float | None) -> str:
        return "" if value is None else f"{value:.2f}"

    def why(reasons: Sequence[str]) -> str:
        kinds: dict[str, list[str]] = {}
        for reason in reasons:
            kinds.setdefault(kind_of_reason(reason), []).append(reason)
        return ", ".join(alike[0] if len(alike) == 1 else kind for kind, alike in kinds.items())

    print_table(
        ["file", "from s", "to s", "class", "probability", "quality", "why not"],
        [
            [
                str(row["file"]), seconds(row.get("start_s")), seconds(row.get("end_s")), row["class"],
                "" if row["unknown"] else f"{row['probabilities'][row['class']]:.2f}", f"{row['quality']:.2f}",
                why(row["reasons"]),
            ]
            for row in rows
        ],
    )  # fmt: skip


def _print_findings(findings: tuple[Finding, ...]) -> None:
    """Print findings in words, each as the note or the warning that it is."""
    from ...identification.estimate.words import sentences

    for finding, text in zip(findings, sentences(findings), strict=True):
        print(f"{finding.severity}: {text}")


def print_identification(result: Identification) -> None:
    """Print what became of each stretch, then the estimate over all of them, where one soil explains them."""
    from ...identification.estimate.tables import stretch_table

    if not any(segment.used for segment in result.segments):
        print("No row could be used:")
    print_table(*stretch_table(result), title="Soil by stretch, with 95 % intervals")
    if result.overall is not None:
        print()
        _print_estimate(result.overall)
    for name, estimate in result.by_soil.items():
        print()
        _print_estimate(estimate, f"Soil {name}")
    print()
    _print_findings(result.findings)


def _print_estimate(found: SoilEstimate, name: str = "Soil") -> None:
    from ...identification.estimate.tables import parameter_table, strength_table

    print(f"{name} from {found.n} rows of {', '.join(found.channels)} (method {found.method})")
    print_table(*parameter_table(found))
    print_table(*strength_table(found), title="Shear strength over the stresses driven")
    if found.advice:
        print(f"Advice: {found.advice}.")
    _print_findings(found.findings)


def print_explanation(answer: Explanation) -> None:
    """Print the answer, where the channels differ, what is missing, what it gains, the sound, and what to rely on."""
    from ...identification.explain.quantities import listed
    from ...identification.explain.report.sound import sound_lines
    from ...identification.explain.report.tables import candidate_table, fit_table, located_table, soil_table
    from ...identification.explain.words import details, headline, missing_lines, predicted_worse

    print(headline(answer))
    for text in (details(answer), answer.trust):
        if text:
            print(text)
    print()
    print_table(*located_table(answer), title="Where simulation and recording differ")
    if answer.located:
        print()
    for each in answer.missing:
        print(*missing_lines(each), "", sep="\n")
    print_table(*fit_table(answer), title=f"Error on held-out rows: {answer.split}")
    print()
    headers, rows = candidate_table(answer.candidates[:_CANDIDATES_PRINTED])
    title = f"Most probable of {len(answer.candidates)} candidates"
    print_table(headers[:-1], [row[:-1] for row in rows], title=title)
    print()
    print_table(*soil_table(answer), title="Soil")
    print()
    if answer.sound is not None:
        print("Sound", *sound_lines(answer.sound), "", sep="\n")
    if worse := predicted_worse(answer):
        print(f"note: predicted worse than before: {listed(worse)}")
    for note in answer.notes:
        print(f"note: {note}")


def print_places(rows: Sequence[dict[str, Any]], stress_Pa: float, confidence: float) -> None:
    """Print the answers of `bevameter query` for places (`database.exports.answer_rows`)."""
    texts = []
    for row in rows:
        ranked = sorted((row["class_probabilities"] or {}).items(), key=lambda entry: -entry[1])
        terrain = ", ".join(f"{name} {share:.0%}" for name, share in ranked[:3] if share >= 0.005)
        place = ["unknown" if row[axis] is None else f"{row[axis]:.2f}" for axis in ("x_m", "y_m")]
        seen = [_age(row["age_s"]), str(row["observations"])]
        texts.append([*place, terrain or "unknown", *_strength(row), *seen])
    headers = ["x [m]", "y [m]", "terrain", *_STRENGTH, "age", "drives"]
    print_table(headers, texts, empty="unknown: nobody has seen ground there")
    _print_notes(rows, stress_Pa, confidence)


def print_classes(rows: Sequence[dict[str, Any]], stress_Pa: float, confidence: float) -> None:
    """Print the answers of `bevameter query` for classes (`database.exports.class_rows`)."""
    seen = [row for row in rows if row["cells"] or row["observations"]] or rows
    texts = [[row["class"], str(row["cells"]), str(row["observations"]), *_strength(row)] for row in seen]
    headers = ["class", "cells", "stretches", *_STRENGTH]
    print_table(headers, texts, empty="unknown: no class was recognised yet")
    _print_notes(seen, stress_Pa, confidence)
    if unseen := [row["class"] for row in rows if row not in seen]:
        print(f"not seen yet: {', '.join(unseen)}")


_STRENGTH = ("c [kPa]", "phi [deg]", "strength [kPa]", "lower [kPa]")


def _strength(row: dict[str, Any]) -> list[str]:
    if not row["known"]:
        return ["unknown", "", "", ""]
    (variance, _), (_, variance_tan) = row["covariance_c_tan_phi"]
    degrees = math.degrees(math.sqrt(variance_tan) / (1.0 + row["tan_phi"] ** 2))
    return [
        f"{row['c_Pa'] / 1e3:.2f} ± {math.sqrt(variance) / 1e3:.2f}",
        f"{math.degrees(row['phi_rad']):.1f} ± {degrees:.1f}",
        f"{row['shear_strength_Pa'] / 1e3:.2f}",
        f"{row['shear_strength_lower_Pa'] / 1e3:.2f}",
    ]


def _age(seconds: float | None) -> str:
    if seconds is None:
        return "unknown"
    for unit, length in (("d", 86400.0), ("h", 3600.0), ("min", 60.0)):
        if abs(seconds) >= length:
            return f"{seconds / length:.1f} {unit}"
    return f"{seconds:.0f} s"


def _print_notes(rows: Sequence[dict[str, Any]], stress_Pa: float, confidence: float) -> None:
    """Say below a table what its strengths are, and why what is not known is not: each reason once."""
    if any(row["known"] for row in rows):
        print(
            f"± one standard deviation; shear strength at {stress_Pa / 1e3:g} kPa normal stress, "
            f"lower bound at confidence {confidence:.4g}"
        )
    for note in dict.fromkeys(row["note"] for row in rows if row.get("note")):
        print(f"note: {note}")
    for row in rows:
        if row.get("misfits"):
            print(
                f"note: {row['class']}: the textbook wheel does not fit the measurements; its stretches count as one "
                "place"
            )
    reasons = Counter(row["unknown"] for row in rows if not row["known"])
    without = [reason.removeprefix(_NO_SOIL) for reason, count in reasons.items() if reason.startswith(_NO_SOIL)]
    if len(without) > 1 and all(reasons[_NO_SOIL + name] == 1 for name in without):
        print(f"unknown: {_NO_SOIL}{', '.join(without)}")
        reasons = Counter({reason: count for reason, count in reasons.items() if not reason.startswith(_NO_SOIL)})
    for reason, count in reasons.items():
        print(f"unknown: {reason}" + (f" ({count} of {len(rows)})" if count > 1 else ""))
