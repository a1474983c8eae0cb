"""The report of an identification: one HTML page that needs nothing from elsewhere."""

from __future__ import annotations

from collections.abc import Iterable
from html import escape
from pathlib import Path

from ...framework.core.files import write_text
from ...framework.core.findings import codes
from ...framework.core.html import bullets, figure, marked, page, table, unbroken
from ...framework.core.pictures import png_of
from ...framework.core.recording.types import Recording
from ...framework.core.soil import SoilEstimate, SoilKnowledge
from .identify import Identification
from .picture import channels_figure, identification_figure
from .tables import learnt, parameter_table, strength_table, stretch_table
from .words import sentences

_DPI = 110


def write_report(
    recording: Recording, result: Identification, path: str | Path, *, soil: SoilKnowledge | None = None
) -> None:
    """Write the report, whole or not at all.

    Parameters
    ----------
    recording
        What was identified from.
    result
        What `identify` made of it.
    path
        The HTML file.
    soil
        What was known beforehand.

    Raises
    ------
    InputError
        The file cannot be written.
    """
    write_text(report_html(recording, result, soil=soil), Path(path))


def report_html(recording: Recording, result: Identification, *, soil: SoilKnowledge | None = None) -> str:
    """Give the report as a page of HTML; text from files is escaped."""
    named = {"": result.overall, **result.by_soil} if result.overall is not None else dict(result.by_soil)
    estimates = {name: each for name, each in named.items() if each is not None}
    sections = [
        f"<h1>Soil under the wheels: {escape(recording.name)}</h1>",
        *(_answer(name, each) for name, each in estimates.items()),
        "" if estimates else "<p class=verdict>No one soil explains the drive: see its stretches.</p>",
        _pictures(recording, result, soil),
        "<h2>Stretches, with 95 % intervals</h2>" + table(*stretch_table(result), text_columns=(0, 4)),
        *(_tables(name, each) for name, each in estimates.items()),
        _findings(result, estimates.values()),
    ]
    return page(f"Bevameter: soil of {recording.name}", "".join(sections))


def _answer(name: str, found: SoilEstimate) -> str:
    c, phi = learnt(found.parameters, found.separable, with_unit=True)
    of = f"{name}: " if name else ""
    advice = f"<p>{marked(found.advice)}.</p>" if found.advice else ""
    return (
        f"<p class=verdict>{unbroken(f'{of}cohesion c {c}, friction angle phi {phi}')}</p>{_warnings(found)}"
        f"<p>From {found.n} rows of {escape(', '.join(found.channels))}; in brackets 95 % intervals.</p>{advice}"
    )


def _warnings(found: SoilEstimate) -> str:
    """Say what limits the answer, where it is read; `explain` names what a wrong form lacks."""
    serious = [finding for finding in found.findings if finding.severity == "warning"]
    said = list(sentences(serious))
    if "wrong_form" in codes(serious):
        said.append("`bevameter explain` on this recording says what the simulated wheel lacks")
    return "".join(f"<p class=warn>{marked(text)}.</p>" for text in said)


def _pictures(recording: Recording, result: Identification, soil: SoilKnowledge | None) -> str:
    body = ""
    channels = channels_figure(recording, result)
    if channels is not None:
        text = "Measured, and simulated by the textbook's wheel on the soil found, at each row's load and slip."
        body += figure(png_of(channels, _DPI), text)
    if result.method == "ml" and any(segment.used for segment in result.segments):
        text = "95 % regions of cohesion and friction angle; along a drive, how the estimate settles."
        body += figure(png_of(identification_figure(recording, result, soil=soil), _DPI), text)
    return body


def _tables(name: str, found: SoilEstimate) -> str:
    title = f"Soil {name}" if name else "Soil over all stretches"
    return (
        f"<h2>{escape(title)}</h2>"
        + table(*parameter_table(found), text_columns=(0, 1, 4))
        + "<h3>Shear strength over the stresses driven</h3>"
        + table(*strength_table(found))
    )


def _findings(result: Identification, estimates: Iterable[SoilEstimate]) -> str:
    said = list(sentences(result.findings))
    for each in estimates:
        said += sentences(finding for finding in each.findings if finding.severity != "warning")
    return f"<h2>What to know of it</h2>{bullets(dict.fromkeys(said))}" if said else ""
