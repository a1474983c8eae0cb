"""What `bevameter run` prints: the ground and its soil, what was not trusted and why, and what to do next."""

from __future__ import annotations

import math
import shlex
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from .printing import counted, print_table
from .results import interval_text

if TYPE_CHECKING:
    from ..batch import Outcome
    from ..summary import LearntSoil, SenseSummary, TraverseSummary

_REASONS_PRINTED = 4
"""Most reasons of one kind; the JSON has all."""


def print_summary(summary: TraverseSummary) -> None:
    """Print a run's answer first, then how far to trust it, then what was stored, and the next command."""
    vehicle = f" by {summary.vehicle}" if summary.vehicle else ""
    places = f", places {summary.places}" if summary.places else ""
    site = f", site {summary.site}" if summary.site else ""
    length = f"{summary.distance_m:.1f} m in {summary.duration_s:.0f} s"
    print(f"{summary.recording}{vehicle}: {length}{places}{site}\n")
    _print_ground(summary)
    _print_soil_notes(summary.soils)
    print()
    if summary.contradictions:
        print(f"the senses contradict each other in {summary.contradictions} cells")
    for sense in summary.senses:
        print(_sense_line(sense))
    if summary.closed_s or summary.used_s:
        seconds = {reason: f"{length:.0f} s" for reason, length in summary.closed_s.items() if length >= 0.5}
        left_out = f"; not used: {_most(seconds)}" if seconds else ""
        print(f"wheels: {summary.used_s:.0f} s used for soil{left_out}")
    for note in summary.notes:
        print(f"note: {note}")
    for problem in summary.problems:
        print(f"not usable: {problem}")
    for warning in summary.warnings:
        print(f"warning: {warning}")
    print(f"{_stored(summary)} in {summary.seconds:.1f} s")
    if not any(_misses(soil) for soil in summary.soils):  # else a warning says what is to be done
        print(f"next: bevameter query classes --db {shlex.quote(summary.database)}")


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


def _print_ground(summary: TraverseSummary) -> None:
    """One row a class: where it is, and the soil of its stretch with the narrowest interval of c."""
    by_class: dict[str, list[LearntSoil]] = {}
    for soil in summary.soils:
        by_class.setdefault(soil.class_name or "unknown", []).append(soil)
    names = list(dict.fromkeys([*summary.track_m, *summary.cells, *by_class]))
    names.sort(key=lambda name: -summary.track_m.get(name, 0.0))
    several = any(len(soils) > 1 for soils in by_class.values())
    rows = []
    for name in names:
        soils = by_class.get(name, [])
        best = min(soils, key=_width, default=None)
        learnt = ["", ""]
        if best is not None:
            digits = {"c_Pa": 2, "phi_rad": 1}
            learnt = [interval_text(best.parameters, each, best.separable, n) for each, n in digits.items()]
        metres = [f"{summary.track_m.get(name, 0.0):.1f}"] if summary.track_m else []
        rows.append([name, *metres, str(summary.cells.get(name, 0)), str(len(soils) or ""), *learnt])
    headers = ["ground", *(["m of track"] if summary.track_m else []), f"cells of {summary.cell_size_m:g} m"]
    print_table([*headers, "stretches", "c [kPa] (95 %)", "phi [deg] (95 %)"], rows)
    if several:
        print("c and phi of the stretch that determines c best; `bevameter identify` lists all")


def _width(soil: LearntSoil) -> float:
    found = soil.parameters.get("c_Pa")
    return float("inf") if found is None else found.high - found.low


def _print_soil_notes(soils: Sequence[LearntSoil]) -> None:
    for name, effects in dict.fromkeys((soil.class_name, soil.effects) for soil in soils if soil.effects):
        print(f"{name}: {', '.join(effects)} known from before and subtracted")
    for soil in soils:
        for finding, problem in zip(soil.findings, soil.problems, strict=True):
            if finding.severity == "warning":
                print(f"{soil.class_name or 'unknown'}, {soil.start_s:.0f} to {soil.end_s:.0f} s: {problem}")
    for advice in dict.fromkeys(soil.advice for soil in soils if soil.advice):
        print(f"to learn more: {advice}")


def _sense_line(sense: SenseSummary) -> str:
    if sense.absent:
        return f"{sense.sense}: {sense.absent}"
    closed = f"; not trusted: {_most(sense.closed)}" if sense.closed else ""
    return f"{sense.sense}: {100 * sense.trusted_share:.1f} % of {sense.items} looks trusted{closed}"


def _most(counts: Mapping[str, object]) -> str:
    shown = list(counts.items())[:_REASONS_PRINTED]
    rest = len(counts) - len(shown)
    text = ", ".join(f"{reason} ({count})" for reason, count in shown)
    return f"{text}, {rest} more" if rest else text


def _stored(summary: TraverseSummary) -> str:
    if summary.known or summary.observations_known:
        return f"nothing added: {summary.database} holds this drive already ({summary.observations_known} observations)"
    if summary.observations_new:
        return f"{counted(summary.observations_new, 'observation')} added to {summary.database}"
    return f"nothing added to {summary.database}: nothing was observed"


def _misses(soil: LearntSoil) -> bool:
    return any(finding.code == "wrong_form" for finding in soil.findings)
