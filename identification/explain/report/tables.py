"""Tables of an explanation as people read them, shared by the report and the command line."""

from __future__ import annotations

from collections.abc import Iterable

from ..explanation import Candidate, Estimate, Explanation
from ..quantities import (
    KINDS,
    effect,
    estimate,
    ground_name,
    interval,
    number,
    p_value,
    percent,
    shown,
    signed,
    with_interval,
    with_sd,
)

Table = tuple[list[str], list[list[str]]]
"""Headers and rows."""


def located_table(explanation: Explanation) -> Table:
    """Give the regions, the first three columns text."""
    return (
        ["channel", "depends on", "differs for", "share of misfit", "mean residual [sensor noise]", "p"],
        [
            [
                shown(region.channel).name, shown(region.variable).name, interval(region),
                f"{100.0 * region.share:.0f} %", signed(region.mean), p_value(region.p_value),
            ]
            for region in explanation.located
        ],
    )  # fmt: skip


def fit_table(explanation: Explanation) -> Table:
    """Give held-out errors, in the units that people read."""
    rows = []
    for name, fit in explanation.fits.items():
        how = shown(name)
        before = with_interval(fit.rmse_before, fit.before_interval, how.scale)
        after = with_interval(fit.rmse_after, fit.after_interval, how.scale)
        rows.append([how.label, before, after, number(fit.noise, how.scale), str(fit.n)])
    return ["channel", "error before (95 %)", "error after (95 %)", "noise", "rows"], rows


def candidate_table(candidates: Iterable[Candidate]) -> Table:
    """Give candidates; effect, kind and parameters are text."""
    return (
        ["effect", "kind", "probability", "evidence [nats]", "held out [nats]", "parameters"],
        [
            [
                effect(each.effect), KINDS.get(each.kind, each.kind), percent(each.probability),
                signed(each.evidence_nats), signed(each.heldout_nats),
                "; ".join(estimate(name.rpartition(".")[2], value) for name, value in each.parameters.items()),
            ]
            for each in candidates
        ],
    )  # fmt: skip


def parameter_table(parameters: dict[str, Estimate]) -> Table:
    """Give an effect's parameters."""
    rows = []
    for name, each in parameters.items():
        how = shown(name, each.unit)
        rows.append([how.name, with_sd(each.value, each.sd, how.scale), how.unit or "-"])
    return ["parameter", "value ± standard deviation", "unit"], rows


def soil_table(explanation: Explanation) -> Table:
    """Give the soils fitted without and with what was found; one where nothing was added, or one for each ground."""
    soils = {"textbook wheel": explanation.soil_textbook, "with what was found": explanation.soil}
    if len(explanation.grounds) > 1:
        soils = {ground_name(each): each.soil for each in explanation.grounds}
    elif explanation.verdict == "none":
        soils = {"value ± standard deviation": explanation.soil or explanation.soil_textbook}
    rows = []
    for name in dict.fromkeys(name for soil in soils.values() for name in soil):
        how, values = shown(name), [soil.get(name) for soil in soils.values()]
        cells = ["" if each is None else with_sd(each.value, each.sd, how.scale) for each in values]
        rows.append([how.name, *cells, how.unit or "-"])
    return ["parameter", *soils, "unit"], rows
