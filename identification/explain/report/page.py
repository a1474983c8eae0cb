"""The report of an explanation: one HTML page that needs nothing from elsewhere."""

from __future__ import annotations

from html import escape
from importlib.metadata import version
from pathlib import Path

from ....framework.core.files import write_text
from ....framework.core.html import figure, page, table, unbroken
from ..explanation import Candidate, Explanation
from ..quantities import capital, effect, listed, shown, signed, with_sd
from ..words import details, headline, predicted_worse
from . import pictures
from .missing import missing_section
from .sound import sound_section
from .tables import candidate_table, fit_table, located_table, soil_table

_CANDIDATES_SHOWN = 15
"""Candidates in the table that is seen at once; the others unfold."""


def write_report(explanation: Explanation, path: str | Path) -> None:
    """Write the report, whole or not at all.

    Parameters
    ----------
    explanation
        What `explain` answers.
    path
        The HTML file.

    Raises
    ------
    InputError
        The file cannot be written.
    """
    write_text(report_html(explanation), Path(path))


def report_html(explanation: Explanation) -> str:
    """Give the report as a page of HTML; text from files is escaped."""
    sections = [
        _answer(explanation),
        _channels(explanation),
        _located(explanation),
        _missing(explanation),
        _predictions(explanation),
        _candidates(explanation),
        _soil(explanation),
        sound_section(explanation.sound) if explanation.sound is not None else "",
        _origin(explanation),
    ]
    return page(f"Bevameter: {Path(explanation.source).name}, simulation against recording", "".join(sections))


def _answer(explanation: Explanation) -> str:
    said = details(explanation)
    return (
        f"<h1>Simulation against recording: {escape(Path(explanation.source).name)}</h1>"
        f"<p class=verdict>{unbroken(headline(explanation))}</p>"
        + (f"<p>{unbroken(said)}</p>" if said else "")
        + f"<p>{unbroken(explanation.trust)}</p>"
    )


def _channels(explanation: Explanation) -> str:
    drawn = pictures.channels_over(explanation)
    if drawn is None:
        return ""
    png, variables = drawn
    over = listed(list(dict.fromkeys(shown(each).words for each in variables)))
    return figure(
        png,
        f"Measured and simulated on held-out rows, over {over}; a curve for each load where there are few. Points: "
        "rows. Black: means of bins, with the 95 % interval of their difference from the simulation. Line: simulated, "
        "mean of the same bins. Band: plus and minus one noise of a row.",
    )


def _located(explanation: Explanation) -> str:
    body = "<h2>Where simulation and recording differ</h2>"
    if explanation.located:
        body += table(*located_table(explanation), text_columns=(0, 1, 2))
        body += _note(
            "Residual: measured less simulated on the soil that was found, in units of the sensor's noise. Each line "
            "adds to the lines above it; the share is of all that they explain together. p is corrected for the number "
            "of tests. The pictures show the simulation on a soil refitted by itself, which hides part of it."
        )
    else:
        body += "<p>No channel departs from the simulation over an interval of any variable.</p>"
    maps = pictures.residual_maps(explanation)
    for channel, variable, png in maps:
        body += figure(png, f"Residuals of {shown(channel).words} on held-out rows against {shown(variable).words}.")
    if maps:
        body += _note(
            "Noise: of sensors, load and slip, and the ground's variation. Grey: plus and minus one noise. Black: "
            "means of bins with 95 % intervals, rows taken as independent. Triangles: points beyond the edge. Yellow: "
            "the interval in the table."
        )
    return body


def _missing(explanation: Explanation) -> str:
    if not explanation.missing:
        return ""
    title = "What may be missing" if explanation.verdict == "cannot_tell" else "What is missing"
    return f"<h2>{title}</h2>" + "".join(missing_section(each) for each in explanation.missing)


def _predictions(explanation: Explanation) -> str:
    body = f"<h2>Prediction of held-out rows</h2><p>{escape(capital(explanation.split))}.</p>"
    if explanation.verdict != "none":
        gain = explanation.heldout_nats
        body += f"<p>Log-likelihood of held-out rows gained: {unbroken(with_sd(gain.value, gain.sd))} nats.</p>"
    body += figure(
        pictures.held_out_errors(explanation),
        "Root-mean-square error of held-out rows, with 95 % intervals from resampling blocks. Dashed: the noise, as "
        "estimated for sensors, load and slip, and the ground's variation.",
    )
    body += table(*fit_table(explanation))
    if worse := predicted_worse(explanation):
        body += f"<p class=warn>Predicted worse than before: {escape(listed(worse))}.</p>"
    return body + figure(
        pictures.predicted_against_measured(explanation),
        "Held-out predictions against measurements. Line: equality. Grey: plus and minus two noises.",
    )


def _candidates(explanation: Explanation) -> str:
    first, others = explanation.candidates[:_CANDIDATES_SHOWN], explanation.candidates[_CANDIDATES_SHOWN:]
    body = f"<h2>Candidates</h2>{_candidate_table(first)}"
    if others:
        body += f"<details><summary>{len(others)} more</summary>{_candidate_table(others)}</details>"
    if explanation.screened:
        names = "; ".join(f"{effect(each.effect)} ({signed(each.expected_nats)})" for each in explanation.screened)
        body += (
            "<details><summary>Not fitted: a score test expects too little of them</summary>"
            f"<p class=note>Expected nats: {escape(names)}</p></details>"
        )
    return body + _note(
        "Each set of effects is fitted together with the soil. Evidence: ln of the Bayes factor over the textbook "
        "wheel, parameters integrated out. Held out: log-likelihood gained on rows that were not fitted. The "
        "probability of one effect, above, is the sum over all sets that hold it."
    )


def _candidate_table(candidates: tuple[Candidate, ...]) -> str:
    return table(*candidate_table(candidates), text_columns=(0, 1, 5))


def _soil(explanation: Explanation) -> str:
    return (
        "<h2>Soil</h2>"
        + table(*soil_table(explanation))
        + _note("Standard deviations hold if the form of the model is right; a better fit does not prove that it is.")
    )


def _origin(explanation: Explanation) -> str:
    notes = "".join(f"<li>{escape(capital(note))}</li>" for note in explanation.notes)
    return (
        "<h2>How this was made</h2>"
        + (f"<ul>{notes}</ul>" if notes else "")
        + table(
            ["recording", explanation.source],
            [
                ["rows compared", str(explanation.n)],
                ["held out", explanation.split],
                ["seed", str(explanation.seed)],
                ["seconds", f"{explanation.seconds:.1f}"],
                ["Bevameter", version("bevameter")],
            ],
            text_columns=(0, 1),
        )
        + _note("“Measured” means the channels of the recording, whether of a real wheel or of another simulator.")
    )


def _note(text: str) -> str:
    return f"<p class=note>{unbroken(text)}</p>"
