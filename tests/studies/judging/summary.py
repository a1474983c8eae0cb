"""Summary of many scores: shares with Wilson's intervals, quantiles and calibration, in one table."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.stats import binomtest, quantile_test

from .grounds import SOIL
from .scorer import CONFIDENT

Scores = Sequence[Mapping[str, Any]]

LEVELS = ("plain", "hidden", "buried")

BINS = (0.0, 0.5, 0.7, 0.85, 0.95, 1.0)
"""Borders of the bins in which stated probabilities are compared with how often they were right [-]."""


def share(right: Sequence[bool]) -> str:
    """Give a share in per cent with its 95 % interval (Wilson 1927); a dash where nothing was counted."""
    if not right:
        return "-"
    found = binomtest(sum(right), len(right))
    low, high = found.proportion_ci(method="wilson")
    return f"{100 * found.statistic:.1f} % ({100 * low:.1f}-{100 * high:.1f}; {sum(right)} of {len(right)})"


def quantile(values: Sequence[float], at: float) -> str:
    """Give a quantile with its 95 % interval from order statistics, open where there are too few values."""
    if not values:
        return "-"
    ends = quantile_test(values, p=at).confidence_interval()
    low, high = ("" if np.isnan(end) else f"{end:.3g}" for end in ends)
    return f"{np.quantile(values, at):.3g} ({low}-{high})"


def cells(columns: Mapping[str, Scores]) -> list[tuple[str, ...]]:
    """Give the measures as rows of cells, headers first, one column for each tool's scores."""
    found = [measures(scores) for scores in columns.values()]
    return [("measure (95 % interval)", *columns), *((name, *(each[name] for each in found)) for name in found[0])]


def table(columns: Mapping[str, Scores]) -> str:
    """Give the measures as a Markdown table."""
    lines = [f"| {' | '.join(row)} |" for row in cells(columns)]
    return "\n".join([lines[0], "|---" * (1 + len(columns)) + "|", *lines[1:]])


def measures(scores: Scores) -> dict[str, str]:
    """Give each measure in words; recordings that missed their level are left out of the levels and of the pairs."""

    def of(case: str, measure: str, where: Callable[[Mapping[str, Any]], bool] = lambda _: True) -> str:
        cases = case.split("|")
        return share([s[measure] for s in scores if s["case"] in cases and s[measure] is not None and where(s)])

    both, sure = "single|pair", f"confident wrong name (from {CONFIDENT:g})"
    ratios = [float(np.mean([*s["error_ratio"].values()])) for s in scores if s["error_ratio"]]
    seconds = [float(s["seconds"]) for s in scores if s["seconds"] is not None]
    statements = [statement for s in scores for statement in s["statements"]]
    drives = [s for s in scores if s["of_drive"]]
    return {
        "recordings": str(len(scores)),
        **{f"named right, {level}": of("single", "named", lambda s, level=level: _at(s, level)) for level in LEVELS},
        "both of a pair named": of("pair", "both_named", lambda s: s["reached"]),
        "at least one of a pair named": of("pair", "named", lambda s: s["reached"]),
        "false alarm on nulls": of("null", "false_alarm"),
        "falsely named, in addition or instead": of(both, "falsely_named"),
        "named as one of a group said to be indistinguishable": of(both, "indistinguishable", lambda s: s["named"]),
        f"{sure}, cause beyond the catalogue": of("beyond", "confident_wrong"),
        "nothing found, cause beyond the catalogue": of("beyond", "silent"),
        f"{sure}, effect left out of the catalogue": of("left_out", "confident_wrong"),
        "nothing found, effect left out of the catalogue": of("left_out", "silent"),
        "physics or instrument right, by all that is listed": of("single", "kind_right"),
        "physics or instrument right, by the most probable name": of("single", "first_kind_right"),
        "channel located": of("single", "located_channel"),
        "variable located": of("single", "located_variable"),
        "patch located along the track": of("single", "located_interval"),
        "parameter's interval holds the truth": share([held for s in scores for held in s["intervals"]]),
        **(of_drives(drives) if drives else {}),
        "held-out error over the oracle's, median": quantile(ratios, 0.5),
        "held-out error over the oracle's, 95 % quantile": quantile(ratios, 0.95),
        **calibration(statements),
        "seconds, median": quantile(seconds, 0.5),
        "seconds, 95 % quantile": quantile(seconds, 0.95),
        "seconds, most": f"{max(seconds):.3g}" if seconds else "-",
        "failures": share([s["failed"] for s in scores]),
    }  # fmt: skip


def of_drives(scores: Scores) -> dict[str, str]:
    """Give the measures that only whole drives have."""
    single = [s for s in scores if s["case"] == "single" and s["reached"]]
    places = {"everywhere": "everywhere", "class": "on one class", "wheel": "on one wheel"}
    named = {
        f"named right, {words}": share([s["named"] for s in single if s["acts_on"] == place])
        for place, words in places.items()
    }
    told = {
        f"where it acts told right, {words}, of those named": share([
            right for s in scores if s["reached"] for place, right in s["where_right"] if place == key
        ])
        for key, words in places.items()
    }  # fmt: skip
    intervals = {
        f"{name} of a ground in its interval, {words}": share([
            held for s in scores if s["case"] in cases for held in s["soil_intervals"].get(name, ())
        ])
        for name in SOIL
        for words, cases in (("nulls", ("null",)), ("cause named", ("single", "pair")))
    }  # fmt: skip
    belongs = {
        "ground or vehicle right, by the most probable name": share([
            s["belongs_right"] for s in scores if s["case"] == "single" and s["belongs_right"] is not None
        ])
    }  # fmt: skip
    return {**named, **told, **belongs, **intervals}


def _at(score: Mapping[str, Any], level: str) -> bool:
    return score["level"] == level and score["reached"]


def calibration(statements: Sequence[Sequence[Any]]) -> dict[str, str]:
    """Give how often statements were right, by the probability that they stated."""
    found = {}
    for low, high in pairwise(BINS):
        inside = [(p, right) for p, right in statements if low <= p < high or p == high == BINS[-1]]
        stated = f", {np.mean([p for p, _ in inside]):.3f} on average" if inside else ""
        found[f"right where {low:g} to {high:g} was stated"] = share([right for _, right in inside]) + stated
    return found


def each(scores: Mapping[str, Mapping[str, Any]]) -> str:
    """Give a line for each recording, by name."""
    lines = ["| recording | case | level | hidden | verdict | said | right | seconds |", "|---" * 8 + "|"]
    for name, s in scores.items():
        said = ", ".join(f"{slug} {float(p or 0.0):.2f}" for slug, p in s["asserted"])
        right = s["named"]
        if right is None and not s["failed"]:
            right = not (s["false_alarm"] or s["confident_wrong"])
        seconds = "" if s["seconds"] is None else f"{s['seconds']:.3g}"
        cells = (name, s["case"], s["level"], ", ".join(s["hidden"]), s["verdict"] or "failed", said, right, seconds)
        lines.append(f"| {' | '.join(map(str, cells))} |")
    return "\n".join(lines)
