"""Tables of an explanation as people read them, shared by the report and the command line."""

from __future__ import annotations

from ..explanation import Explanation
from . import readable
from .readable import number, shown

_WORSE = 1.03
"""Ratio of held-out errors above which a channel counts as predicted worse [-]."""


def located_headers() -> list[str]:
    """Headers of the table of regions."""
    return ["channel", "depends on", "differs for", "share of misfit", "mean residual [noise]", "p"]


def located_rows(explanation: Explanation) -> list[list[str]]:
    """Rows of the table of regions, the first three columns text."""
    return [
        [
            shown(region.channel).label,
            shown(region.variable).label,
            readable.interval(region),
            f"{100.0 * region.share:.0f} %",
            f"{region.mean:+.1f}",
            readable.p_value(region.p_value),
        ]
        for region in explanation.located
    ]


def fit_headers() -> list[str]:
    """Headers of the table of held-out errors."""
    return ["channel", "error before (95 %)", "error after (95 %)", "noise", "rows"]


def fit_rows(explanation: Explanation) -> list[list[str]]:
    """Rows of the table of held-out errors, in the units that people read."""
    answer = []
    for name, fit in explanation.fits.items():
        how = shown(name)
        before, after = (
            f"{number(value, how.scale)} ({number(low, how.scale)} to {number(high, how.scale)})"
            for value, (low, high) in ((fit.rmse_before, fit.before_interval), (fit.rmse_after, fit.after_interval))
        )
        answer.append([how.label, before, after, number(fit.noise, how.scale), str(fit.n)])
    return answer


def predicted_worse(explanation: Explanation) -> list[str]:
    """Say of each channel that its held-out error grows by more than a few per cent, where something was found."""
    return [
        f"{shown(name).name} is predicted worse than before"
        for name, fit in explanation.fits.items()
        if explanation.verdict != "none" and fit.rmse_after > _WORSE * fit.rmse_before
    ]


def soil_table(explanation: Explanation) -> tuple[list[str], list[list[str]]]:
    """Headers and rows of the table of soils, with and without what was left out."""
    with_it, textbook = explanation.soil, explanation.soil_textbook
    added = explanation.verdict != "none"
    headers = ["parameter", "simulation without it", *(["with what was left out"] if added else []), "unit"]
    rows = []
    for name in dict.fromkeys([*textbook, *with_it]):
        how = shown(name)
        # Where nothing is added both are one fit, and the soil's own interval holds what was not excluded beside it.
        values = [textbook.get(name), with_it.get(name)] if added else [with_it.get(name, textbook.get(name))]
        cells = ["" if each is None else readable.spread(each.value, each.sd, how.scale) for each in values]
        rows.append([how.name, *cells, how.unit or "-"])
    return headers if added else ["parameter", "value ± standard deviation", "unit"], rows
