"""A run's summary in words and tables of text."""

from __future__ import annotations

import shlex
from collections.abc import Mapping, Sequence

from ..identification.estimate.tables import learnt
from .stated_ground import OPERATOR
from .summary import LearntSoil, SenseSummary, TraverseSummary

_REASONS_SAID = 4
"""Most reasons of one kind; the JSON has all."""


def heading(summary: TraverseSummary) -> str:
    """Say what was driven, by what, and where."""
    vehicle = f" by {summary.vehicle}" if summary.vehicle else ""
    places = f", places {summary.places}" if summary.places else ""
    site = f", site {summary.site}" if summary.site else ""
    return f"{summary.recording}{vehicle}: {summary.distance_m:.1f} m in {summary.duration_s:.0f} s{places}{site}"


def ground_table(summary: TraverseSummary) -> tuple[list[str], list[list[str]]]:
    """Give a row a class: where it is, and the soil of its stretch with the narrowest interval of c."""
    by_class = _by_class(summary.soils)
    names = list(dict.fromkeys([*summary.track_m, *summary.cells, *by_class]))
    names.sort(key=lambda name: -summary.track_m.get(name, 0.0))
    rows = []
    for name in names:
        soils = by_class.get(name, [])
        best = min(soils, key=_width, default=None)
        soil = ["", ""] if best is None else learnt(best.parameters, best.separable)
        metres = [f"{summary.track_m.get(name, 0.0):.1f}"] if summary.track_m else []
        rows.append([name, *metres, str(summary.cells.get(name, 0)), str(len(soils) or ""), *soil])
    headers = ["ground", *(["m of track"] if summary.track_m else []), f"cells of {summary.cell_size_m:g} m"]
    return [*headers, "stretches", "c [kPa] (95 %)", "phi [deg] (95 %)"], rows


def several_stretches(summary: TraverseSummary) -> bool:
    """Say whether the table of the ground shows one of several stretches of a class."""
    return any(len(soils) > 1 for soils in _by_class(summary.soils).values())


def soil_lines(soils: Sequence[LearntSoil]) -> list[str]:
    """Say what is to be minded of the soils, and what would determine more."""
    lines = [
        f"{name}: {', '.join(effects)} known from before and subtracted"
        for name, effects in dict.fromkeys((soil.class_name, soil.effects) for soil in soils if soil.effects)
    ]
    for soil in soils:
        for finding, problem in zip(soil.findings, soil.problems, strict=True):
            if finding.severity == "warning":
                lines.append(f"{soil.class_name or 'unknown'}, {soil.start_s:.0f} to {soil.end_s:.0f} s: {problem}")
    nameless = sum(soil.class_name is None for soil in soils)
    if nameless:
        stretches = "1 stretch is" if nameless == 1 else f"{nameless} stretches are"
        lines.append(
            f"the soil of {stretches} in no query: no class is probable enough there. Photographs of it mend that: "
            "`bevameter train vision PHOTOS --out MODELS/vision.skops`, then `bevameter run` with --models MODELS. "
            "If the whole drive is on ground of one class that you know, state it: `bevameter run` with --ground CLASS"
        )
    return lines + [
        f"to learn more: {advice}" for advice in dict.fromkeys(soil.advice for soil in soils if soil.advice)
    ]


def agreement_table(summary: TraverseSummary) -> tuple[list[str], list[list[str]]]:
    """Give a row a sense, and one for all together: how far the recording's labels agree."""
    rows = []
    for each in summary.agreement:
        parts = each.right_m, each.wrong_m, each.unknown_m
        rows.append([each.sense, *(f"{length:.1f}" for length in parts), f"{100 * parts[0] / sum(parts):.1f}"])
    return ["against the labels, m of track", "right", "wrong", "unknown", "right %"], rows


def sense_lines(summary: TraverseSummary) -> list[str]:
    """Say how far each sense and the wheels were trusted, and why not."""
    lines = []
    if summary.contradictions:
        lines.append(f"the senses contradict each other in {summary.contradictions} cells")
    lines += [_sense_line(sense) for sense in summary.senses]
    if summary.closed_s or summary.used_s:
        seconds = {reason: f"{length:.0f} s" for reason, length in summary.closed_s.items() if length >= 0.5}
        left_out = f"; not used: {_most(seconds)}" if seconds else ""
        lines.append(f"wheels: {summary.used_s:.0f} s used for soil{left_out}")
    return lines


def stored(summary: TraverseSummary) -> str:
    """Say what was added to the database."""
    if summary.known or summary.observations_known:
        return f"nothing added: {summary.database} holds this drive already ({summary.observations_known} observations)"
    if summary.observations_new:
        plural = "s" * (summary.observations_new != 1)
        return f"{summary.observations_new} observation{plural} added to {summary.database}"
    return f"nothing added to {summary.database}: nothing was observed"


def next_step(summary: TraverseSummary) -> str:
    """Give the command to go on with; empty where a warning says what is to be done."""
    if any(finding.code == "wrong_form" for soil in summary.soils for finding in soil.findings):
        return ""
    return f"bevameter query classes --db {shlex.quote(summary.database)}"


def _by_class(soils: Sequence[LearntSoil]) -> dict[str, list[LearntSoil]]:
    found: dict[str, list[LearntSoil]] = {}
    for soil in soils:
        found.setdefault(soil.class_name or "unknown", []).append(soil)
    return found


def _width(soil: LearntSoil) -> float:
    found = soil.parameters.get("c_Pa")
    return float("inf") if found is None else found.high - found.low


def _sense_line(sense: SenseSummary) -> str:
    if sense.absent:
        return f"{sense.sense}: {sense.absent}"
    if sense.sense == OPERATOR:
        return f"{sense.sense}: {', '.join(sense.said)}, as stated for the whole recording"
    if not sense.items:
        return f"{sense.sense}: nothing of the ground was observed with it"
    closed = f"; not trusted: {_most(sense.closed)}" if sense.closed else ""
    return f"{sense.sense}: {100 * sense.trusted_share:.1f} % of {sense.items} looks trusted{closed}"


def _most(counts: Mapping[str, object]) -> str:
    shown = list(counts.items())[:_REASONS_SAID]
    rest = len(counts) - len(shown)
    text = ", ".join(f"{reason} ({count})" for reason, count in shown)
    return f"{text}, {rest} more" if rest else text
