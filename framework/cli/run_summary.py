"""The summary of a run, as a terminal shows it."""

from __future__ import annotations

import math
from collections.abc import Mapping

from rich.markup import escape
from rich.panel import Panel

from ..core.soil import Quantity
from ..traverse_summary import LearntSoil, SenseSummary, TraverseSummary
from .printing import out, print_rows

_REASONS_SHOWN = 6


def print_summary(summary: TraverseSummary) -> None:
    """Print what a run found: the drive, the ground, the senses, the soil, and what was stored."""
    console = out()
    for warning in summary.warnings:
        console.print(Panel(escape(warning), title="mind", border_style="yellow", expand=False))
    vehicle = f" by {escape(summary.vehicle)}" if summary.vehicle else ""
    places = f", places {summary.places}" if summary.places else ""
    console.print(
        f"[bold]{escape(summary.recording)}[/bold]{vehicle}: {summary.distance_m:.1f} m in {summary.duration_s:.0f} s"
        f"{places}",
        soft_wrap=True,
    )
    _print_ground(summary)
    _print_senses(summary.senses)
    _print_soils(summary)
    for problem in summary.problems:
        console.print(f"[yellow]not usable:[/yellow] {escape(problem)}", soft_wrap=True)
    _print_stored(summary)


def _print_ground(summary: TraverseSummary) -> None:
    names = list(dict.fromkeys([*summary.track_m, *summary.cells]))
    if not names:
        return
    cells = f"cells of {summary.cell_size_m:g} m"
    if summary.known:
        rows = [[name, str(summary.cells[name])] for name in names]
        print_rows(["ground", cells], rows, title="\nseen and heard, as it was stored")
    else:
        names.sort(key=lambda name: -summary.track_m.get(name, 0.0))
        rows = [[name, f"{summary.track_m.get(name, 0.0):.1f}", str(summary.cells.get(name, 0))] for name in names]
        print_rows(["ground", "m of track", cells], rows, title="\nseen and heard")
    if summary.contradictions:
        out().print(f"camera and microphone contradict each other in {summary.contradictions} cells")


def _print_senses(senses: tuple[SenseSummary, ...]) -> None:
    rows = []
    for sense in senses:
        if sense.absent:
            rows.append([sense.sense, "", "", "", "", sense.absent])
            continue
        rows.append(
            [
                sense.sense,
                str(sense.items),
                f"{100 * sense.trusted_share:.1f} %",
                f"{sense.mean_quality:.2f}",
                str(sense.cells),
                _most(sense.closed),
            ]
        )
    print_rows(
        ["sense", "looks", "trusted", "mean quality", "cells", "not trusted because"], rows, title="\nhow far to trust"
    )


def _most(counts: Mapping[str, int]) -> str:
    shown = list(counts.items())[:_REASONS_SHOWN]
    rest = len(counts) - len(shown)
    text = "; ".join(f"{reason} ({count})" for reason, count in shown)
    return f"{text}; {rest} more" if rest else text


def _print_soils(summary: TraverseSummary) -> None:
    rows = [
        [
            soil.class_name or "unknown",
            f"{soil.class_probability:.2f}" if soil.class_name else "",
            f"{soil.start_s:.0f} to {soil.end_s:.0f}",
            str(soil.n),
            _interval(soil, "c_Pa", 1e-3),
            _interval(soil, "phi_rad", 180.0 / math.pi),
        ]
        for soil in summary.soils
    ]
    if rows:
        print_rows(
            ["class", "probability", "from .. to s", "n", "c [kPa] (95 %)", "phi [deg] (95 %)"],
            rows,
            title="\nsoil learnt",
        )
    for soil in summary.soils:
        for problem in soil.problems:
            out().print(f"note, {soil.start_s:.0f} to {soil.end_s:.0f} s: {escape(problem)}", soft_wrap=True)
    for advice in dict.fromkeys(soil.advice for soil in summary.soils if soil.advice):
        out().print(f"to learn more: {escape(advice)}", soft_wrap=True)
    closed = [[f"{seconds:.0f}", reason] for reason, seconds in list(summary.closed_s.items())[:_REASONS_SHOWN]]
    if closed:
        print_rows(["s", f"not used for soil because ({summary.used_s:.0f} s were used)"], closed)


def _interval(soil: LearntSoil, name: str, scale: float) -> str:
    quantity: Quantity | None = soil.parameters.get(name)
    if quantity is None:
        return ""
    text = f"{quantity.value * scale:.2f} ({quantity.low * scale:.2f} to {quantity.high * scale:.2f})"
    return text if soil.separable.get(name, True) else f"{text}, not determined"


def _print_stored(summary: TraverseSummary) -> None:
    database = escape(summary.database)
    if summary.known or summary.observations_known:
        text = f"nothing added: {database} holds this drive already ({summary.observations_known} observations)"
    elif summary.observations_new:
        text = f"{summary.observations_new} observations added to {database}"
    else:
        text = f"nothing added to {database}: nothing was observed"
    out().print(f"\n[bold]{text}[/bold] in {summary.seconds:.1f} s", soft_wrap=True)
