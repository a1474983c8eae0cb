"""The report of a training, as a terminal shows it."""

from __future__ import annotations

from typing import Any

from rich.markup import escape

from .printing import out, print_rows


def print_report(report: dict[str, Any], model: str) -> None:
    """Print a training report: how well the model does on groups it has not seen, and on what that rests.

    Parameters
    ----------
    report
        As `TerrainClassifier.train` gives it.
    model
        Where the model was written.
    """
    console = out()
    console.print(
        f"[bold]{report['modality']}[/bold] model written to {escape(model)}: {report['n']} items in "
        f"{report['groups']} groups, {len(report['classes'])} classes",
        soft_wrap=True,
    )
    if report["validated"]:
        scores = {"one item": report, "a group's items averaged": report["by_group"]}
        print_rows(
            ["on groups held out", "n", "balanced accuracy (95 %)", "accuracy (95 %)", "calibration error"],
            [
                [
                    name,
                    str(score.get("n_scored", score["n"])),
                    _interval(score["balanced_accuracy"]),
                    _interval(score["accuracy"]),
                    f"{score['calibration_error']:.3f}",
                ]
                for name, score in scores.items()
            ],
        )
        rows = zip(report["classes"], report["confusion"], strict=True)
        print_rows(["truth \\ said", *report["classes"]], [[name, *map(str, counts)] for name, counts in rows])
        console.print(report["split"], soft_wrap=True)
    for warning in report["warnings"]:
        console.print(f"[yellow]{escape(warning)}[/yellow]", soft_wrap=True)


def _interval(score: dict[str, float]) -> str:
    return f"{score['value']:.3f} ({score['low']:.3f} to {score['high']:.3f})"
