"""The report of a training as one page of HTML that needs nothing from elsewhere."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from html import escape

from ..html import page, table
from .labelled import LabelledFile
from .learning import LearningCurve
from .mistakes import Mistake
from .report import of_the_gate

SIZE = 240
"""Side of a chart [px]."""
_LEFT, _TOP = 42, 12
_BLUE, _GREY = "#0072b2", "#bbb"


def report_html(
    report: dict,
    *,
    learning: LearningCurve | None = None,
    mistakes: Sequence[Mistake] = (),
    excerpt: Callable[[LabelledFile], str] = lambda sample: "",
) -> str:
    """Show a training report.

    Parameters
    ----------
    report
        As `TerrainClassifier.train` gives it; every name in it is escaped.
    learning
        What further groups would bring (`Material.learning_curve`).
    mistakes
        The worst mistakes (`Material.mistakes`).
    excerpt
        Shows a labelled sample, as HTML.
    """
    classes = report["classes"]
    warnings = "".join(f"<p class=warn>{escape(text)}</p>" for text in report["warnings"])
    counts = [[name, str(report["rows_by_class"][name]), str(report["groups_by_class"][name])] for name in classes]
    body = (
        f"<h1>Terrain classifier: {escape(report['modality'])}</h1>{_verdict(report)}"
        f"<p>{report['n']} items ({report['n_degraded']} of them degraded copies), {report['groups']} groups, "
        f"{len(classes)} classes. {escape(report['split'])} "
        f"{escape(of_the_gate(report))}</p>{warnings}"
        f"{_held_out(report)}{_learning(learning)}{_mistakes(mistakes, excerpt)}{_trust(report.get('trust', []))}"
        f"{_together(report.get('together', {}))}"
        f"<h2>Material</h2>{table(['class', 'items', 'groups'], counts)}{_model(report)}"
    )
    return page(f"Bevameter: {report['modality']}", body)


_ERRORS = ("calibration_error_without", "calibration_error")


def _verdict(report: dict) -> str:
    if not report["validated"]:
        return "<p class=verdict>How well it does on ground that it has not seen is not known.</p>"
    group = report["by_group"]["balanced_accuracy"]
    return (
        f"<p class=verdict>On groups held out it recognises {report['balanced_accuracy']['value']:.0%} of single items "
        f"and {group['value']:.0%} of whole groups (95 %: {group['low']:.0%} to {group['high']:.0%}), classes counted "
        "evenly.</p>"
    )


def _held_out(report: dict) -> str:
    if not report["validated"]:
        return ""
    classes = report["classes"]
    parts = {
        "Per item as it came, held out by group": report | {"n": report["n_scored"]},
        "Per group: its items pooled": report["by_group"],
    }
    if "degraded" in report:
        parts["Per degraded item (blur, noise or a channel less was added), held out by group"] = report["degraded"]
    return "".join(_scores(title, classes, score) for title, score in parts.items())


def _scores(title: str, classes: Sequence[str], score: dict) -> str:
    risk = score["risk"]
    most = next(row["error"] for row in risk if row["coverage"] >= 0.8)
    return (
        f"<h2>{escape(title)}</h2><p>n = {score['n']}; balanced accuracy {_interval(score['balanced_accuracy'])}; "
        f"accuracy {_interval(score['accuracy'])}; log loss {score['log_loss']:.3f} nat; "
        f"calibration error {score['calibration_error']:.3f}. Error: {risk[-1]['error']:.3f} "
        f"where all are answered, {most:.3f} among the surest 80&nbsp;%.</p>"
        f"{_confusion(classes, score['confusion'])}"
        f"<div class=row>{_reliability(score['reliability'])}{_risk(risk)}</div>"
    )


def _interval(score: dict) -> str:
    return f"{score['value']:.3f} (95 %: {score['low']:.3f} to {score['high']:.3f})"


def _confusion(classes: Sequence[str], confusion: Sequence[Sequence[int]]) -> str:
    head = "".join(f"<th>{escape(name)}</th>" for name in classes)
    body = []
    for name, row in zip(classes, confusion, strict=True):
        total = max(sum(row), 1)
        cells = "".join(f'<td style="background:rgba(0,114,178,{n / total * 0.7:.2f})">{int(n)}</td>' for n in row)
        body.append(f"<tr><th>{escape(name)}</th>{cells}<td>{row[len(body)] / total:.2f}</td></tr>")
    return (
        f"<div class=wide><table><tr><th>truth \\ said</th>{head}<th>recall</th></tr>{''.join(body)}</table></div>"
        "<p class=note>Rows are the truth, columns what was said.</p>"
    )


# Charts ---------------------------------------------------------------------------------------------------------------


def _place(x: float, y: float) -> str:
    """Pixels of a point of the unit square."""
    return f"{_LEFT + x * SIZE:.1f},{_TOP + (1 - y) * SIZE:.1f}"


def _chart(drawn: str, x: tuple[str, str, str], y: tuple[str, str, str], caption: str) -> str:
    """A square chart: what is drawn in it, and for each axis what it is of and the numbers at its ends."""
    low, bottom = _TOP + SIZE, _TOP + SIZE + 16
    texts = (
        f'<text x="{_LEFT}" y="{bottom}">{x[1]}</text>'
        f'<text x="{_LEFT + SIZE}" y="{bottom}" text-anchor="end">{x[2]}</text>'
        f'<text x="{_LEFT + SIZE / 2}" y="{bottom + 8}" text-anchor="middle">{x[0]}</text>'
        f'<text x="{_LEFT - 5}" y="{low}" text-anchor="end">{y[1]}</text>'
        f'<text x="{_LEFT - 5}" y="{_TOP + 9}" text-anchor="end">{y[2]}</text>'
        f'<text transform="translate(14 {_TOP + SIZE / 2}) rotate(-90)" text-anchor="middle">{y[0]}</text>'
    )
    return (
        f'<figure><svg width="{_LEFT + SIZE + 10}" height="{bottom + 16}" role="img" aria-label="{escape(caption)}" '
        f'font-size="12" fill="#222"><rect x="{_LEFT}" y="{_TOP}" width="{SIZE}" height="{SIZE}" fill="none" '
        f'stroke="{_GREY}"/>{drawn}{texts}</svg><figcaption>{escape(caption)}</figcaption></figure>'
    )


def _line(points: Sequence[tuple[float, float]], colour: str = _BLUE) -> str:
    places = " ".join(_place(x, y) for x, y in points)
    return f'<polyline points="{places}" fill="none" stroke="{colour}" stroke-width="1.5"/>'


def _dot(x: float, y: float, radius: float, title: str) -> str:
    across, down = _place(x, y).split(",")
    return f'<circle cx="{across}" cy="{down}" r="{radius:.1f}" fill="{_BLUE}"><title>{escape(title)}</title></circle>'


def _reliability(bins: Sequence[dict]) -> str:
    dots = "".join(
        _dot(
            row["said"], row["was_right"], 3 + min(row["n"], 400) ** 0.5 / 3,
            f"said {row['said']:.2f}, right {row['was_right']:.2f}, n = {row['n']}",
        )
        for row in bins
    )  # fmt: skip
    caption = "How often the top class was right, by its stated probability: on the diagonal where they agree."
    return _chart(_line(((0, 0), (1, 1)), _GREY) + dots, ("stated", "0", "1"), ("right", "0", "1"), caption)


def _risk(risk: Sequence[dict]) -> str:
    most = max(*(row["error"] for row in risk), 0.01)
    line = _line([(row["coverage"], row["error"] / most) for row in risk])
    caption = "The error if only the surest items are answered, by the share that is."
    return _chart(line, ("share answered", "0", "1"), ("error", "0", f"{most:.2f}"), caption)


# What to do -----------------------------------------------------------------------------------------------------------


def _learning(curve: LearningCurve | None) -> str:
    title = "<h2>What more data would bring</h2>"
    if curve is None:
        return f"{title}<p>Not measured: that takes five groups or more of each class.</p>"
    most, across = max(curve.error), max(curve.groups)
    points = [(number / across, error / most) for number, error in zip(curve.groups, curve.error, strict=True)]
    dots = "".join(
        _dot(x, y, 4, f"{number:.0f} groups: error {error:.3f}")
        for (x, y), number, error in zip(points, curve.groups, curve.error, strict=True)
    )
    gains = [
        [f"{gain.more} more groups", f"{100 * gain.value:+.1f}", f"{100 * gain.low:+.1f} to {100 * gain.high:+.1f}"]
        for gain in curve.gains
    ]
    caption = "Error on groups held out, classes counted evenly, by the number of groups trained on."
    return (
        f"{title}<p>There are {curve.total} groups. More of the same kinds, shared among the classes as these are, "
        "would be expected to raise the accuracy (classes counted evenly) by:</p>"
        f"{table(['with', 'gain [percentage points]', '95 %'], gains)}"
        f"{_chart(_line(points) + dots, ('groups', '0', f'{across:.0f}'), ('error', '0', f'{most:.2f}'), caption)}"
        "<p class=note>From models of a quarter, a half and all of the groups of each training side, extended as a "
        "power law. Groups of other places, sources or seasons than these may bring more.</p>"
    )


def _mistakes(mistakes: Sequence[Mistake], excerpt: Callable[[LabelledFile], str]) -> str:
    if not mistakes:
        return ""
    shown = "".join(
        f"<figure>{excerpt(mistake.sample)}<figcaption>{escape(_name(mistake.sample))}: labelled "
        f"<b>{escape(mistake.sample.class_name)}</b>, said <b>{escape(mistake.said)}</b> "
        f"({mistake.probability:.2f})</figcaption></figure>"
        for mistake in mistakes
    )
    return (
        "<h2>Worst mistakes</h2><p>The samples that were taken for another class most surely, by models that had not "
        f"seen their group; one of each group. Look for wrong labels first.</p><div class=row>{shown}</div>"
    )


def _name(sample: LabelledFile) -> str:
    stretch = (
        "" if sample.start_s is None or sample.end_s is None else f", {sample.start_s:.1f} to {sample.end_s:.1f} s"
    )
    return f"{sample.file.parent.name}/{sample.file.name}{stretch}"


def _together(learnt: dict) -> str:
    if not learnt:
        return ""
    names = {"as_it_came": "as they came", "degraded": "degraded as a whole"}
    rows = [
        [name, str(part["n"]), _interval(part["balanced_accuracy"]), *(f"{part[each]:.3f}" for each in _ERRORS)]
        for key, name in names.items()
        if (part := learnt.get(key))
    ]
    head = ["", "n", "balanced accuracy", "calibration error without", "with"]
    return (
        "<h2>All items of one thing together</h2><p>How often that is right, and how far what is stated is from it: "
        "without, and with, an exponent by quality that was learnt on other groups.</p>"
        f"{table(head, rows)}{_curve(learnt['table'], 'exponent')}"
    )


def _curve(rows: Sequence[dict], weight: str) -> str:
    cells = [
        [f"{row[key]:.2f}" for key in ("quality", "said", "was_right", "weight")] + [str(row["n"]), str(row["groups"])]
        for row in rows
    ]
    return table(["quality", "stated", "right", weight, "n", "groups"], cells, ())


def _trust(rows: Sequence[dict]) -> str:
    if not rows:
        return ""
    return (
        "<h2>Trust by quality</h2><p>How often the top class was right where the image or sound was of a quality, and "
        "the weight that such evidence has in the fusion.</p>"
        f"{_curve(rows, 'weight')}"
    )


def _model(report: dict) -> str:
    gate = report["gate"]
    rejected, others = gate["held_out_rejection"], gate["other_ground_rejection"]
    text = f"Items further than {gate['threshold']:.2f} from what was trained on are answered 'unknown'" + (
        "." if rejected is None else f": {rejected:.1%} of held-out items were."
    )
    if others is not None:
        text += f" Of classes that the gate had not seen, each left out in turn, {others:.1%} of items were."
    losses = [[name, f"{loss:.3f}"] for name, loss in report["selection"].items()]
    return (
        f"<h2>Model</h2><p>Chosen on inner folds: {escape(report['model'])}; temperature {report['temperature']:.2f}. "
        f"{escape(text)}</p>{table(['candidate', 'inner log loss [nat]'], losses)}"
    )
