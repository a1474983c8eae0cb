"""What many scores say together: shares with intervals, calibration, and the table for the documentation."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from .rivals import CANNOT_TELL
from .scorer import Z95
from .strength import LEVELS

BINS = (0.0, 0.5, 0.7, 0.9, 0.97, 1.0)
"""Borders of the bins in which stated probabilities are compared with how often they were right."""


def wilson(right: int, count: int) -> tuple[float, float, float]:
    """Give a share and its 95 % interval.

    E. B. Wilson, *Probable inference, the law of succession, and statistical inference* (1927).

    Raises
    ------
    ValueError
        Nothing was counted.
    """
    if count < 1:
        raise ValueError("a share of nothing")
    share = right / count
    middle = (share + Z95**2 / (2.0 * count)) / (1.0 + Z95**2 / count)
    half = Z95 * math.sqrt(share * (1.0 - share) / count + Z95**2 / (4.0 * count**2)) / (1.0 + Z95**2 / count)
    return share, max(middle - half, 0.0), min(middle + half, 1.0)


def bootstrap_median(values: Sequence[float], draws: int = 2000, seed: int = 0) -> tuple[float, float, float]:
    """Give a median and its 95 % interval by the percentile bootstrap (B. Efron 1979).

    Raises
    ------
    ValueError
        There are no values.
    """
    if not len(values):
        raise ValueError("a median of nothing")
    data = np.asarray(values, dtype=float)
    rng = np.random.default_rng(seed)
    medians = np.median(data[rng.integers(0, len(data), (draws, len(data)))], axis=1)
    low, high = np.quantile(medians, [0.025, 0.975])
    return float(np.median(data)), float(low), float(high)


def calibration(statements: Iterable[Sequence[Any]]) -> list[dict[str, float]]:
    """Give, for each bin of stated probability, how many statements fell into it and how many of them were right."""
    pairs = [(float(p), bool(right)) for p, right in statements]
    rows = []
    for low, high in pairwise(BINS):
        inside = [(p, right) for p, right in pairs if low <= p < high or (high == 1.0 and p == 1.0)]
        if inside:
            share, least, most = wilson(sum(right for _, right in inside), len(inside))
            stated = float(np.mean([p for p, _ in inside]))
            rows.append({
                "from": low, "to": high, "count": len(inside), "stated": stated, "right": share, "low": least,
                "high": most,
            })  # fmt: skip
    return rows


def _share(scores: Iterable[Mapping[str, Any]], measure: Callable[[Mapping[str, Any]], bool | None]) -> str:
    answers = [value for value in map(measure, scores) if value is not None]
    return _shown(answers)


def _shown(answers: Sequence[bool]) -> str:
    if not answers:
        return "-"
    share, low, high = wilson(sum(answers), len(answers))
    return f"{100 * share:.1f} % ({100 * low:.1f}-{100 * high:.1f}; {sum(answers)} of {len(answers)})"


def table(scores: Sequence[Mapping[str, Any]]) -> str:
    """Give the study's measures as a Markdown table; recordings that missed their level are left out of the levels."""
    nulls = [s for s in scores if not s["hidden"]]
    single = [s for s in scores if len(s["hidden"]) == 1]
    pairs = [s for s in scores if len(s["hidden"]) == 2]
    rows = [(f"named right, {level}", _named(single, level)) for level in LEVELS]
    rows += [
        ("named as one of a group said to be indistinguishable", _share(single, _grouped)),
        ("named falsely beside or instead", _share(single, lambda s: s["falsely_named"])),
        (f"not named, and another effect fits as well (within {CANNOT_TELL:g} nats)", _share(single, _hopeless)),
        ("false alarm on nulls", _share(nulls, lambda s: s["false_alarm"])),
        ("physics told from instrument, by all that is listed", _share(single, lambda s: s["kind_right"])),
        ("physics told from instrument, by the most probable name", _share(single, _first_kind)),
        ("both of a pair named", _share(pairs, lambda s: s["both_named"] if s["reached"] else None)),
        ("one of a pair at least named", _share(pairs, lambda s: s["named"] if s["reached"] else None)),
        ("channel located", _share(single, lambda s: s["located_channel"])),
        ("variable located", _share(single, lambda s: s["located_variable"])),
        ("patch located along the track", _share(single, lambda s: s["located_interval"])),
        ("true parameter within its 95 % interval", _shown([held for s in single for held in s["intervals"]])),
        *_spreads(scores),
        ("failures", _share(scores, lambda s: s["failed"])),
    ]  # fmt: skip
    lines = ["| measure | result (95 % interval) |", "|---|---|", *(f"| {name} | {value} |" for name, value in rows)]
    return "\n".join(lines)


def _first_kind(row: Mapping[str, Any]) -> bool | None:
    # Older results do not have it.
    return row.get("first_kind_right")


def _grouped(row: Mapping[str, Any]) -> bool | None:
    return row["indistinguishable"] if row["named"] else None


def _hopeless(row: Mapping[str, Any]) -> bool | None:
    """Of the recordings that were compared with all other effects: does one explain it as well as the truth?"""
    behind = row.get("rivals")
    return min(behind.values()) < CANNOT_TELL if behind else None


def _named(single: Sequence[Mapping[str, Any]], level: str) -> str:
    return _share(single, lambda s: s["named"] if s["level"] == level and s["reached"] else None)


def _spreads(scores: Sequence[Mapping[str, Any]]) -> list[tuple[str, str]]:
    ratios = [float(np.mean(list(s["error_ratio"].values()))) for s in scores if s["error_ratio"] and s["hidden"]]
    seconds = [float(s["seconds"]) for s in scores if s["seconds"] is not None]
    rows = []
    for name, values, unit in (
        ("held-out error over the oracle's, median", ratios, ""),
        ("time, median", seconds, " s"),
    ):
        if values:
            median, low, high = bootstrap_median(values)
            worst = float(np.quantile(values, 0.95))
            rows.append((name, f"{median:.3g}{unit} ({low:.3g}-{high:.3g}); 95 % below {worst:.3g}{unit}"))
    return rows


def by_effect(scores: Sequence[Mapping[str, Any]]) -> str:
    """Give, effect by effect, how many were hidden alone and named, and what was said where they were not."""
    lines = ["| hidden | named | where not: said instead |", "|---|---|---|"]
    single = [s for s in scores if len(s["hidden"]) == 1 and s["reached"]]
    for slug in sorted({s["hidden"][0] for s in single}):
        own = [s for s in single if s["hidden"][0] == slug]
        missed = [", ".join(s["asserted"]) or str(s["verdict"]) for s in own if not s["named"]]
        counts = {said: missed.count(said) for said in dict.fromkeys(missed)}
        said = "; ".join(f"{name} ({count})" for name, count in sorted(counts.items(), key=lambda item: -item[1]))
        lines.append(f"| `{slug}` | {sum(bool(s['named']) for s in own)} of {len(own)} | {said} |")
    return "\n".join(lines)


def calibration_table(scores: Sequence[Mapping[str, Any]]) -> str:
    """Give the calibration of the stated probabilities as a Markdown table."""
    lines = ["| stated probability | statements | mean stated | right (95 % interval) |", "|---|---|---|---|"]
    lines += [
        f"| {row['from']:g} to {row['to']:g} | {row['count']:.0f} | {row['stated']:.3f} "
        f"| {row['right']:.3f} ({row['low']:.3f}-{row['high']:.3f}) |"
        for row in calibration(pair for s in scores for pair in s["statements"])
    ]
    return "\n".join(lines)


def left_out_table(scores: Sequence[Mapping[str, Any]]) -> str:
    """Give the leave-one-out study as a Markdown table."""
    rows = [
        ("unknown, undecided, or a look-alike of low probability", _share(scores, lambda s: s["right"])),
        ("nothing found", _share(scores, lambda s: s["silent"])),
        ("confident wrong name", _share(scores, lambda s: s["confident_wrong"])),
        ("failures", _share(scores, lambda s: s["failed"])),
    ]
    return "\n".join(["| answer | share (95 % interval) |", "|---|---|", *(f"| {n} | {v} |" for n, v in rows)])
