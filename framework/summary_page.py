"""The report of a run: one HTML page that needs nothing from elsewhere."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from importlib.metadata import version
from pathlib import Path

from ..database.store import TerrainDatabase
from .core.files import write_text
from .core.html import bullets, figure, marked, page, table, unbroken
from .core.pictures import png_of
from .core.recording.types import Recording
from .map import map_figure
from .summary import TraverseSummary
from .summary_text import (
    agreement_table,
    ground_table,
    heading,
    next_step,
    sense_lines,
    several_stretches,
    soil_lines,
    stored,
)

_SENSES = ("sense", "looks", "trusted", "mean quality", "cells", "model")


def write_report(summary: TraverseSummary, recording: Recording, path: str | Path) -> None:
    """Write the report, whole or not at all.

    Parameters
    ----------
    summary
        What `run_traverse` answered.
    recording
        What it was run over.
    path
        The HTML file.

    Raises
    ------
    InputError
        The file cannot be written, or the database cannot be read.
    """
    write_text(report_html(summary, recording), Path(path))


def report_html(summary: TraverseSummary, recording: Recording) -> str:
    """Give the report as a page of HTML; text from files is escaped."""
    sections = [
        f"<h1>Ground driven: {escape(summary.recording)}</h1>",
        f"<p class=verdict>{unbroken(_verdict(summary))}</p>",
        f"<p>{unbroken(heading(summary))}. {marked(stored(summary))}.</p>",
        _next(summary),
        _ground(summary),
        _list("What to know of the soil", soil_lines(summary.soils)),
        _senses(summary),
        _map(summary, recording),
        _list("Not usable", summary.problems),
        _list("How this was made", [*summary.notes, f"Bevameter {version('bevameter')}, {summary.seconds:.1f} s"]),
    ]
    return page(f"Bevameter: ground driven, {summary.recording}", "".join(sections))


def _verdict(summary: TraverseSummary) -> str:
    """Give the shares of the ground and how many soils were measured, in a sentence."""
    ground = sorted((summary.track_m or summary.cells).items(), key=lambda each: -each[1])
    total = sum(size for _, size in ground)
    shares = [f"{name} {100.0 * size / total:.0f} %" for name, size in ground if total and size / total >= 0.005]
    over = "Driven" if summary.track_m else "Cells seen"
    measured = dict.fromkeys(soil.class_name or "ground of no class" for soil in summary.soils)
    soils = f"Soil was measured on {', '.join(measured)}" if measured else "No soil was measured"
    return f"{over}: {', '.join(shares)}. {soils}." if shares else f"No ground was put on the map. {soils}."


def _next(summary: TraverseSummary) -> str:
    warnings = "".join(f"<p class=warn>{marked(text)}</p>" for text in summary.warnings)
    command = next_step(summary)
    return warnings + (f"<p>Next: <code>{escape(command)}</code></p>" if command else "")


def _map(summary: TraverseSummary, recording: Recording) -> str:
    if not summary.cells:
        return ""
    with TerrainDatabase(summary.database, must_exist=True) as database:
        if not len(database.snapshot(summary.site).cells.key):
            return "<h2>Map</h2><p>There is no map: no ground of the site was seen.</p>"
        drawn = map_figure(database, site=summary.site, tracks=[recording])
    text = "All that the database knows of the site, and this drive's way; in bold where soil was measured."
    return f"<h2>Map</h2>{figure(png_of(drawn, 110), text)}"


def _ground(summary: TraverseSummary) -> str:
    note = "c and phi are of the stretch that determines c best; <code>bevameter identify</code> lists all."
    several = f"<p class=note>{note}</p>" if several_stretches(summary) else ""
    return f"<h2>Ground and soil</h2>{table(*ground_table(summary))}{several}"


def _senses(summary: TraverseSummary) -> str:
    rows = [
        [
            one.sense, str(one.items), f"{100.0 * one.trusted_share:.1f} %",
            f"{one.mean_quality:.2f}" if one.trusted_share else "", str(one.cells), one.model,
        ]
        for one in summary.senses if not one.absent
    ]  # fmt: skip
    trusted = table(_SENSES, rows, text_columns=(0, 5)) if rows else ""
    agreed = table(*agreement_table(summary)) if summary.agreement else ""
    return f"<h2>How far the senses were trusted</h2>{agreed}{trusted}{bullets(sense_lines(summary))}"


def _list(title: str, texts: Sequence[str]) -> str:
    return f"<h2>{title}</h2>{bullets(texts)}" if texts else ""
