"""The report of an explanation: one HTML page that needs nothing from elsewhere."""

from __future__ import annotations

from base64 import b64encode
from html import escape
from importlib.metadata import version
from pathlib import Path

from ....framework.core.files import write_text
from ....framework.core.html import page, table, unbroken
from ..explanation import Candidate, Explanation, Missing
from . import pictures, readable
from .headline import verdict
from .readable import likelihood, shown
from .sound_section import sound_section
from .tables import fit_headers, fit_rows, located_headers, located_rows, predicted_worse, soil_table

_CANDIDATES_SHOWN = 25
"""Candidates in the table that is seen at once; the others unfold."""

_PROBABILITIES = (
    "Probabilities: virtually certain from 99 %, very likely from 90 %, likely from 66 %, about as likely as not "
    "from 33 %, unlikely below. They weigh the candidates of this page against each other by how well each predicts "
    "held-out rows."
)


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
        _head(explanation),
        _located(explanation),
        _left_out(explanation),
        _predictions(explanation),
        _candidates(explanation),
        _soil(explanation),
        sound_section(explanation.sound) if explanation.sound is not None else "",
        _origin(explanation),
    ]
    return page(f"Bevameter: {Path(explanation.source).name}, simulation against recording", "".join(sections))


def _head(explanation: Explanation) -> str:
    return (
        f"<h1>Simulation against recording: {escape(Path(explanation.source).name)}</h1>"
        f"<p class=verdict>{unbroken(verdict(explanation))}</p>"
        f"<p>{escape(explanation.summary)}</p><p>{_gain(explanation)}</p><p class=note>{_PROBABILITIES}</p>"
    )


def _gain(explanation: Explanation) -> str:
    if explanation.verdict == "none":
        far = readable.above_noise(explanation)
        why = "of what was tried nothing gains enough on rows held out" if far else "held-out rows ask for nothing"
        return f"Nothing was added to the simulation: {why}."
    gain = explanation.heldout_nats
    smooth = any(each.kind == "unknown" and not readable.is_like(each) for each in explanation.missing)
    unknown = "what fits best and a smooth correction" if smooth else "what fits best"
    named = {"cannot_tell": "what fits best", "unknown": unknown}
    with_it = named.get(explanation.verdict, "what was left out")
    return (
        f"On held-out rows the simulation with {with_it} gains {readable.spread(gain.value, gain.sd)} nats of "
        "log-likelihood: the logarithm of how many times more probable it makes them."
    )


def _located(explanation: Explanation) -> str:
    body = "<h2>Where simulation and recording differ</h2>"
    if explanation.located:
        body += table(located_headers(), located_rows(explanation), text_columns=(0, 1, 2))
        body += (
            "<p class=note>A residual is measured less simulated, in units of the channel's noise. The first line is "
            "what accounts for most of the misfit, each further one what adds to it; the share is of all that they "
            "account for together. p is the question's, corrected for the number of questions asked. The table asks of "
            "the simulation on the soil that was found with what was left out, without that. Of variables that go "
            "together in this recording (slip and speed, say) one is named: that through which the effect found "
            "acts, else the usual one.</p>"
        )
    else:
        why = "held-out rows ask for nothing, or a variation of the ground explains it"
        if readable.above_noise(explanation):
            why = "held-out rows do not tell on what it depends that channels are missed by more than noise"
        body += f"<p>No place is listed: {why}.</p>"
    maps = pictures.residual_maps(explanation)
    if maps:
        body += (
            "<p class=note>In the pictures, black lines are means of bins with 95 % intervals, rows taken as "
            "independent; grey is one noise to either side: what sensors, load and slip and ground that varies do "
            "by themselves, as under the next heading; triangles are points beyond the edge. Yellow is where the "
            "table locates the difference; the simulation on the left has a soil refitted without what was left out, "
            "which hides part of it in one place and shows it in others.</p>"
        )
        if predicted_worse(explanation):
            body += (
                "<p class=note>Where points lie farther from zero on the right than on the left, what was found makes "
                "the rows likelier by how they differ from each other, and counts on ground that varies for the rest. "
                "The pictures do not follow that ground, nor would a prediction elsewhere.</p>"
            )
    for channel, variable, png in maps:
        caption = f"Residuals of {shown(channel).name} on held-out rows against {shown(variable).name}."
        body += _figure(png, caption, caption)
    return body


def _left_out(explanation: Explanation) -> str:
    if not explanation.missing:
        return ""
    title = "What may have been left out" if explanation.verdict == "cannot_tell" else "What was left out"
    return f"<h2>{title}</h2>" + "".join(_one_missing(each) for each in explanation.missing)


def _one_missing(missing: Missing) -> str:
    what = readable.EFFECTS.get(missing.effect, ("", ""))[1]
    form = f" Form: {missing.form}." if missing.form else ""
    kind = readable.KINDS.get(missing.kind, missing.kind)
    body = (
        f"<h3>{escape(readable.effect(missing.effect))}: {likelihood(missing.probability)}</h3>"
        f"<p>{escape(what[:1].upper() + what[1:])}{'.' if what else ''}{escape(form)} "
        f"Kind: {escape(kind)}. Name in files: <code>{escape(missing.effect)}</code>.</p>"
        f"<p>Equation: <code>{escape(missing.equation)}</code><br>Source: {escape(missing.source)}</p>"
    )
    if missing.description:
        body += f"<p>Shape: {escape(missing.description)}.</p>"
    if missing.parameters:
        body += table(
            ["parameter", "value ± standard deviation", "unit"],
            [
                [how.name, readable.spread(each.value, each.sd, how.scale), how.unit or "-"]
                for name, each in missing.parameters.items()
                for how in [shown(name, each.unit)]
            ],
        )
    if missing.indistinguishable_from:
        body += f"<p>These data do not tell it from: {escape(readable.effects(missing.indistinguishable_from))}.</p>"
    if missing.would_tell:
        body += f"<p>What would tell: {escape(missing.would_tell)}.</p>"
    return body


def _predictions(explanation: Explanation) -> str:
    body = "<h2>Prediction of held-out rows</h2>"
    body += f"<p>{escape(explanation.split[:1].upper() + explanation.split[1:])}.</p>"
    body += _figure(
        pictures.held_out_errors(explanation),
        "Held-out error of each channel before and after, against the noise",
        "Root-mean-square error on rows that soil and effects were not fitted to, with 95 % intervals from "
        "resampling the blocks held out. The dashed line is the noise: of the sensors, of load and slip, and of ground "
        "that varies, all of which were estimated with these rows by the model that fits best. Where that is wrong, "
        "what it misses may pass for ground that varies, and the line lies too high.",
    )
    body += table(fit_headers(), fit_rows(explanation))
    body += "".join(f"<p class=warn>{escape(text)}.</p>" for text in predicted_worse(explanation))
    return body + _figure(
        pictures.predicted_against_measured(explanation),
        "Held-out predictions against measurements",
        "Held-out predictions against measurements. On the line they agree; grey: two noises (dashed above) to either "
        "side.",
    )


def _candidates(explanation: Explanation) -> str:
    body = (
        "<h2>Everything that was considered</h2>"
        "<p>Each candidate was fitted together with the soil. Nats: log-likelihood gained over the simulation without "
        "it, on held-out rows or in the fit, whichever is less. Probabilities of single effects, above, count all sets "
        "that they are in; something unknown may be there beside them.</p>"
    )
    candidates = explanation.candidates
    body += _candidate_table(candidates[:_CANDIDATES_SHOWN])
    if len(candidates) > _CANDIDATES_SHOWN:
        others = candidates[_CANDIDATES_SHOWN:]
        body += f"<details><summary>{len(others)} more</summary>{_candidate_table(others)}</details>"
    if explanation.screened:
        names = "; ".join(f"{readable.effect(each.effect)} ({each.promised_nats:.1f})" for each in explanation.screened)
        body += (
            "<details><summary>Not fitted: their first step promised too few nats</summary>"
            f"<p class=note>{escape(names)}</p></details>"
        )
    return body


def _candidate_table(candidates: tuple[Candidate, ...]) -> str:
    return table(
        ["candidate", "kind", "held-out nats", "probability", "parameters", "why"],
        [
            [
                readable.effect(each.effect),
                readable.KINDS.get(each.kind, each.kind),
                f"{each.heldout_nats:+.1f}",
                readable.percent(each.probability),
                "; ".join(readable.estimate(name.rpartition(".")[2], value) for name, value in each.parameters.items()),
                each.why,
            ]
            for each in candidates
        ],
        text_columns=(0, 1, 4, 5),
    )


def _soil(explanation: Explanation) -> str:
    return (
        "<h2>Soil, and what can be trusted</h2>"
        + table(*soil_table(explanation))
        + f"<p><strong>{escape(explanation.trust)}</strong></p>"
        + "<p class=note>A better fit does not certify the parameters: a model of the wrong form can predict well with "
        "parameters that are wrong, and standard deviations do not know it.</p>"
    )


def _origin(explanation: Explanation) -> str:
    notes = "".join(f"<li>{escape(note)}</li>" for note in explanation.notes)
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
        + "<p class=note>“Measured” on this page means the channels of the recording. Whether they come from a real "
        "wheel or from another simulator, the recording does not say.</p>"
    )


def _figure(png: bytes, alt: str, caption: str) -> str:
    data = b64encode(png).decode("ascii")
    picture = f'<img alt="{escape(alt)}" src="data:image/png;base64,{data}">'
    return f"<figure>{picture}<figcaption>{escape(caption)}</figcaption></figure>"
