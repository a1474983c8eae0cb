"""What `bevameter run` prints: the ground and its soil, what was not trusted and why, and what to do next."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from typing import TYPE_CHECKING

from .printing import counted, print_table

if TYPE_CHECKING:
    from ..batch import Outcome
    from ..summary import TraverseSummary


def print_summary(summary: TraverseSummary) -> None:
    """Print a run's answer first, then how far to trust it, then what was stored, and the next command."""
    from ..summary_text import (
        agreement_table,
        ground_table,
        heading,
        next_step,
        sense_lines,
        several_stretches,
        soil_lines,
        stored,
    )

    print(f"{heading(summary)}\n")
    print_table(*ground_table(summary))
    if several_stretches(summary):
        print("c and phi of the stretch that determines c best; `bevameter identify` lists all")
    for line in soil_lines(summary.soils):
        print(line)
    print()
    if summary.agreement:
        print_table(*agreement_table(summary))
        print()
    for line in sense_lines(summary):
        print(line)
    for note in summary.notes:
        print(f"note: {note}")
    for problem in summary.problems:
        print(f"not usable: {problem}")
    for warning in summary.warnings:
        print(f"warning: {warning}")
    print(f"{stored(summary)} in {summary.seconds:.1f} s")
    if command := next_step(summary):
        print(f"next: {command}")


def print_outcomes(outcomes: Sequence[Outcome]) -> None:
    """Print what a run over several recordings found: a row each, then what to mind and what of them was not usable."""
    from ..batch import FailedRecording

    print_table(
        ["recording", "site", "m", "s", "ground (m of track)", "soils", "observations", "took s"],
        [
            [each.source, "", "", "", "", "", "failed", ""] if isinstance(each, FailedRecording) else _outcome_row(each)
            for each in outcomes
        ],
    )
    summaries = [each for each in outcomes if not isinstance(each, FailedRecording)]
    for summary in summaries:
        for problem in summary.problems:
            print(f"not usable: {summary.source}: {problem}")
    models = dict.fromkeys(f"{one.sense} {one.model}" for each in summaries for one in each.senses if one.model)
    if models:
        print(f"models: {', '.join(models)}")
    for warning in dict.fromkeys(warning for summary in summaries for warning in summary.warnings):
        print(f"warning: {warning}")
    new, known = (sum(getattr(each, name) for each in summaries) for name in ("observations_new", "observations_known"))
    database = f" to {summaries[0].database}" if summaries else ""
    print(f"{counted(new, 'observation')} added{database}, {known} were there already")


def _site(summary: TraverseSummary) -> str:
    """Name the site, and how the recording was moved into its frame."""
    if summary.offset is None:
        return summary.site
    moved = f"{summary.offset.x_m:.1f} m, {summary.offset.y_m:.1f} m, {math.degrees(summary.offset.yaw_rad):.0f} deg"
    return f"{summary.site} (moved by {moved})"


def _outcome_row(summary: TraverseSummary) -> list[str]:
    ground = sorted(summary.track_m.items(), key=lambda entry: -entry[1])
    soils = Counter(soil.class_name or "unknown" for soil in summary.soils)
    return [
        summary.source, _site(summary), f"{summary.distance_m:.1f}", f"{summary.duration_s:.0f}",
        ", ".join(f"{name} {metres:.0f}" for name, metres in ground if metres >= 0.5),
        ", ".join(f"{name} {count}" for name, count in soils.items()),
        "known" if summary.known else f"{summary.observations_new} new", f"{summary.seconds:.1f}",
    ]  # fmt: skip
