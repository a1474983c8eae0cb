"""Pictures of an explanation: residuals, predictions against measurements, held-out errors against noise."""

from __future__ import annotations

import math

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from scipy.stats import t as t_distribution

from ....framework.core.pictures import STYLE, png_of
from ..explanation import Explanation, Region
from ..quantities import Shown, cycles_a_turn, shown

BEFORE, AFTER = "#d55e00", "#0072b2"
"""Vermilion and blue of M. Okabe and K. Ito's palette (2008), which the colour-blind can distinguish; in print the
shapes of the marks differ, too."""

_LOCATED = "#f0e442"
_GREY = "#555555"
_MARKS = {"before": (BEFORE, "o"), "after": (AFTER, "s")}
_TITLES = {"before": "before: simulation", "after": "after: with what was found"}

MOST_MAPS = 6
"""Residuals against located variables drawn at most: the most significant ones."""

_BINS = 12
_APART = 0.02
"""Values further apart than this share of their range are two levels of a variable."""

_LEAST_IN_BIN = 3

_LEVEL, _MOST_CURVES = 0.1, 6
"""Gap between two levels of the load [its range], and how many levels have a curve each at most."""

_DPI = 150


def residual_maps(explanation: Explanation) -> list[tuple[str, str, bytes]]:
    """Draw residuals against the variables they were located on, before and after.

    Returns
    -------
    list
        Channel, variable and PNG of each map; channels that were not located anywhere come last, against slip.
    """
    return [(*pair, _residual_map(explanation, *pair)) for pair in _pairs(explanation)]


def _residual_map(explanation: Explanation, channel: str, variable: str) -> bytes:
    with rc_context(STYLE):
        figure = Figure(figsize=(9.0, 3.0), layout="constrained")
        sides = _sides(explanation)
        grid = figure.subplots(1, len(sides), squeeze=False, sharey="row", sharex="row")
        _residual_row(grid[0], explanation, channel, variable)
        _head(grid, sides)
        return png_of(figure, _DPI)


def channels_over(explanation: Explanation) -> tuple[bytes, list[str]] | None:
    """Draw each channel, measured and simulated on held-out rows, over slip or the variable that it differs on most.

    Returns
    -------
    png, variables
        The picture, one row a channel, before and after side by side; what each row is drawn over. None where nothing
        varies that it could be drawn over.
    """
    rows, sides = explanation.rows, _sides(explanation)
    # Over an answer of the ground, itself simulated with an error, a curve would say little.
    first = dict(reversed([pair for pair in _pairs(explanation) if pair[1] not in rows.channels]))
    first |= {channel: usual for channel in rows.channels if channel not in first and (usual := _usual(explanation))}
    channels = [channel for channel in rows.channels if channel in first]
    if not channels:
        return None
    with rc_context(STYLE):
        figure = Figure(figsize=(4.5 * len(sides), 2.7 * len(channels) + 0.5), layout="constrained")
        grid = figure.subplots(len(channels), len(sides), squeeze=False, sharey="row", sharex="row")
        for panels, channel in zip(grid, channels, strict=True):
            _channel_row(panels, explanation, channel, first[channel])
        _head(grid, sides)
        for panel in grid[0]:
            if panel.has_data():
                panel.legend(frameon=False, fontsize="small")
        return png_of(figure, _DPI), [first[channel] for channel in channels]


def _channel_row(panels: np.ndarray, explanation: Explanation, channel: str, variable: str) -> None:
    """Draw the measurements as points, the simulation as the means of bins with the noise as a band.

    Trials at a few loads have a curve each: over all of them the load would hide what slip does.
    """
    rows, how = explanation.rows, shown(channel)
    column = rows.channels.index(channel)
    regions = [each for each in explanation.located if (each.channel, each.variable) == (channel, variable)]
    along, by, _ = _along(rows.variables[variable], variable, regions)
    measured, noise = rows.measured[:, column] * how.scale, float(rows.noise[column]) * how.scale
    for panel, name in zip(panels, _sides(explanation), strict=True):
        simulated = getattr(rows, name)[:, column] * how.scale
        seen = np.isfinite(along) & np.isfinite(measured) & np.isfinite(simulated)
        place = along[seen] * by.scale
        panel.set_xlabel(by.label)
        if not len(place):
            continue
        panel.plot(place, measured[seen], "o", color=_GREY, ms=2.6, alpha=_opacity(len(place)), mew=0, label="measured")
        load = rows.variables.get("load_N", np.full(len(along), np.nan))[seen]
        groups = [np.full(len(place), True)] if variable == "load_N" else few_levels(load)
        for number, group in enumerate(groups):
            where, labels = place[group], ("its mean", "noise", "simulated, mean") if number == 0 else (None,) * 3
            middle, mean, _ = bin_means(where, measured[seen][group])
            _, model, _ = bin_means(where, simulated[seen][group])
            # How far the means may differ by chance: what moves both alike is no part of that.
            _, _, half = bin_means(where, (measured - simulated)[seen][group])
            panel.errorbar(middle, mean, yerr=half, fmt="k.", ms=6, lw=1.2, capsize=2.5, label=labels[0], zorder=4)
            colour, mark = _MARKS[name]
            panel.fill_between(middle, model - noise, model + noise, color=colour, alpha=0.2, lw=0, label=labels[1])
            panel.plot(middle, model, mark + "-", color=colour, ms=3.5, lw=1.6, label=labels[2])
            if len(groups) > 1:
                text = f"{np.mean(load[group]):.3g} N"
                at = int(np.argmax(middle))
                panel.annotate(text, (middle[at], model[at]), xytext=(5, 0), textcoords="offset points",
                               va="center", fontsize="small", color=_GREY)  # fmt: skip
    panels[0].set_ylabel(how.label)


def few_levels(values: np.ndarray) -> list[np.ndarray]:
    """Split rows (n,) by the levels of a variable: masks (n,) in order of level; one of all rows if these are many.

    Levels are apart by more than twice the spread within them, and have `_LEAST_IN_BIN` rows each.
    """
    whole = [np.full(len(values), True)]
    if not np.isfinite(values).all() or not len(values):
        return whole
    ordered = np.sort(values)
    gaps = np.flatnonzero(np.diff(ordered) > _LEVEL * np.ptp(values))
    edges = 0.5 * (ordered[gaps] + ordered[gaps + 1])
    level = np.searchsorted(edges, values)
    masks = [level == number for number in range(len(edges) + 1)]
    spread = max(float(np.ptp(values[mask])) for mask in masks)
    apart = float(np.diff(ordered)[gaps].min(initial=np.inf))
    clear = len(masks) <= _MOST_CURVES and min(map(np.sum, masks)) >= _LEAST_IN_BIN and 2.0 * spread < apart
    return masks if clear else whole


def predicted_against_measured(explanation: Explanation) -> bytes:
    """Draw held-out predictions against measurements, before and after, one row a channel."""
    rows = explanation.rows
    with rc_context(STYLE):
        sides = _sides(explanation)
        figure = Figure(figsize=(4.5 * len(sides), 3.3 * len(rows.channels) + 0.3), layout="constrained")
        grid = figure.subplots(len(rows.channels), len(sides), squeeze=False, sharey="row", sharex="row")
        for column, (panels, channel) in enumerate(zip(grid, rows.channels, strict=True)):
            how = shown(channel)
            measured = rows.measured[:, column] * how.scale
            for panel, name in zip(panels, sides, strict=True):
                colour, mark = _MARKS[name]
                predicted = getattr(rows, name)[:, column] * how.scale
                panel.plot(measured, predicted, mark, color=colour, ms=3.2, alpha=_opacity(len(measured)), mew=0)
                _diagonal(panel, measured, float(rows.noise[column]) * how.scale)
                panel.set_xlabel(f"measured {how.label}")
            panels[0].set_ylabel(f"predicted {how.label}")
        _head(grid, sides)
        return png_of(figure, _DPI)


def held_out_errors(explanation: Explanation) -> bytes:
    """Draw each channel's held-out error before and after with its 95 % interval, above the noise floor."""
    fits = explanation.fits
    with rc_context(STYLE):
        figure = Figure(figsize=(max(2.6 * len(fits), 4.0) + 0.6, 3.1), layout="constrained")
        sides = _sides(explanation)
        panels = figure.subplots(1, len(fits), squeeze=False)[0]
        for panel, (channel, fit) in zip(panels, fits.items(), strict=True):
            how = shown(channel)
            panel.axhspan(0.0, fit.noise * how.scale, color="#dddddd", lw=0, label="noise")
            panel.axhline(fit.noise * how.scale, color=_GREY, lw=1.2, ls="--")
            values = {"before": (fit.rmse_before, fit.before_interval), "after": (fit.rmse_after, fit.after_interval)}
            for place, name in enumerate(sides):
                (colour, mark), (value, ends) = _MARKS[name], values[name]
                low, high = (abs(value - end) * how.scale for end in ends)
                panel.errorbar(
                    [place], [value * how.scale], yerr=[[low], [high]], fmt=mark, color=colour, capsize=5, ms=7, lw=1.8
                )  # fmt: skip
            panel.set(
                xticks=range(len(sides)), xticklabels=sides if len(sides) > 1 else ["simulation"],
                xlim=(-0.6, len(sides) - 0.4), ylim=(0.0, None),
                title=how.name, ylabel=Shown("held-out error (rms)", how.unit).label,
            )  # fmt: skip
            panel.grid(visible=False, axis="x")
            panel.annotate(
                "noise",
                (len(sides) - 0.42, fit.noise * how.scale),
                ha="right",
                va="bottom",
                color=_GREY,
                fontsize="small",
            )
        return png_of(figure, _DPI)


def _sides(explanation: Explanation) -> list[str]:
    """Before and after; one of them where nothing was added."""
    return list(_MARKS) if explanation.verdict != "none" else ["before"]


def _head(grid: np.ndarray, sides: list[str]) -> None:
    for panel, name in zip(grid[0], sides, strict=True):
        panel.set_title(_TITLES[name] if len(sides) > 1 else "simulation")


def _pairs(explanation: Explanation) -> list[tuple[str, str]]:
    """Channels and the variables to draw them against: those located; slip, or what there is, for the others."""
    rows = explanation.rows
    pairs = [(region.channel, region.variable) for region in explanation.located]
    pairs = [pair for pair in dict.fromkeys(pairs) if pair[0] in rows.channels and _varies(rows.variables.get(pair[1]))]
    pairs = pairs[:MOST_MAPS]
    if (usual := _usual(explanation)) is not None:
        drawn = {channel for channel, _ in pairs}
        pairs += [(channel, usual) for channel in rows.channels if channel not in drawn]
    return pairs


def _usual(explanation: Explanation) -> str | None:
    """Give the variable to draw channels over that differ nowhere: slip, or what else varies."""
    variables = explanation.rows.variables
    return next((name for name in ("slip", *variables) if _varies(variables.get(name))), None)


def _varies(values: np.ndarray | None) -> bool:
    return values is not None and bool(np.isfinite(values).any()) and float(np.nanmax(values) - np.nanmin(values)) > 0.0


def _residual_row(panels: np.ndarray, explanation: Explanation, channel: str, variable: str) -> None:
    rows = explanation.rows
    column = rows.channels.index(channel)
    regions = [each for each in explanation.located if (each.channel, each.variable) == (channel, variable)]
    along, how, fold = _along(rows.variables[variable], variable, regions)
    residuals = {
        name: (rows.measured[:, column] - getattr(rows, name)[:, column]) / rows.noise[column]
        for name in _sides(explanation)
    }
    reach = _reach(*residuals.values())
    for panel, name in zip(panels, residuals, strict=True):
        for region in regions if not fold else ():
            panel.axvspan(
                region.start * how.scale, region.end * how.scale, color=_LOCATED, alpha=0.3, ec="#b8a800", lw=0.7
            )
        panel.axhspan(-1.0, 1.0, color="#dddddd", lw=0, zorder=0.5)
        panel.axhline(0.0, color=_GREY, lw=0.8)
        _points(panel, along * how.scale, residuals[name], reach, name)
        panel.set(ylim=(-reach, reach), xlabel=how.label)
    panels[0].set_ylabel(f"{shown(channel).words}\nmeasured - simulated [noise]")


def _along(values: np.ndarray, variable: str, regions: list[Region]) -> tuple[np.ndarray, Shown, bool]:
    """Values to draw along, SI, how they are shown, and whether they were folded into one period of the wheel."""
    how = shown(variable)
    if count := cycles_a_turn(regions[0]) if regions else 0:
        folded = f"{how.words}, modulo 1/{count} turn" if count > 1 else f"{how.words}, modulo one turn"
        return np.mod(values, 2.0 * math.pi / count), Shown(folded, how.unit, how.scale), True
    return values, how, False


def _reach(*residuals: np.ndarray) -> float:
    """Half the height of the panels: nearly all points, and never less than four noises."""
    sizes = np.abs(np.concatenate(residuals))
    sizes = sizes[np.isfinite(sizes)]
    return max(1.1 * float(np.quantile(sizes, 0.99)), 4.0) if len(sizes) else 4.0


def _points(panel: Axes, along: np.ndarray, residual: np.ndarray, reach: float, name: str) -> None:
    """Points, those beyond the panel as arrows at its edge, and the means of bins with their 95 % bands over them."""
    colour, mark = _MARKS[name]
    seen = np.isfinite(along) & np.isfinite(residual)
    along, residual = along[seen], residual[seen]
    if not len(along):
        return
    inside = np.abs(residual) <= reach
    panel.plot(along[inside], residual[inside], mark, color=colour, ms=2.6, alpha=_opacity(len(along)), mew=0)
    for sign, arrow in ((1.0, "^"), (-1.0, "v")):
        beyond = sign * residual > reach
        panel.plot(along[beyond], np.full(beyond.sum(), sign * 0.96 * reach), arrow, color=colour, ms=4, mew=0)
    middle, mean, half = bin_means(along, residual)
    panel.errorbar(
        middle, mean, yerr=half, fmt=mark + "-", color="black", mfc=colour, ms=5, lw=1.2, capsize=2.5, zorder=4
    )


def bin_means(along: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Means of bins of equal counts, each level of a variable with few levels being one bin.

    Returns
    -------
    middle, mean, half : (bins,)
        Where the bin lies, its mean, and half its 95 % interval (Student's t, rows independent), NaN where a bin has
        too few rows for one.
    """
    ordered = np.sort(along)
    gaps = np.flatnonzero(np.diff(ordered) > _APART * max(float(np.ptp(along)), 1e-300))
    levels = np.split(ordered, gaps + 1)
    if len(levels) <= _BINS and max(float(np.ptp(level)) for level in levels) <= 2.0 * _APART * float(np.ptp(along)):
        cell = np.searchsorted(0.5 * (ordered[gaps] + ordered[gaps + 1]), along)
    else:
        edges = np.unique(np.quantile(along, np.linspace(0.0, 1.0, min(_BINS, max(len(along) // 6, 2)) + 1)))
        cell = np.clip(np.searchsorted(edges, along, side="right") - 1, 0, len(edges) - 2)
    _, cell = np.unique(cell, return_inverse=True)
    count = np.bincount(cell)
    mean = np.bincount(cell, values) / count
    middle = np.bincount(cell, along) / count
    with np.errstate(invalid="ignore", divide="ignore"):
        variance = np.bincount(cell, (values - mean[cell]) ** 2) / (count - 1)
        half = t_distribution.ppf(0.975, np.maximum(count - 1, 1)) * np.sqrt(variance / count)
    return middle, mean, np.where(count >= _LEAST_IN_BIN, half, np.nan)


def _diagonal(panel: Axes, measured: np.ndarray, noise: float) -> None:
    """Draw the line of perfect prediction, two noises to either side of it."""
    if not np.isfinite(measured).any():
        return
    low, high = float(np.nanmin(measured)), float(np.nanmax(measured))
    margin = 0.05 * (high - low) or 1.0
    ends = np.array([low - margin, high + margin])
    panel.fill_between(ends, ends - 2.0 * noise, ends + 2.0 * noise, color="#dddddd", lw=0, zorder=0.5)
    panel.plot(ends, ends, color=_GREY, lw=1.0)


def _opacity(count: int) -> float:
    return float(np.clip(30.0 / math.sqrt(max(count, 1)) / 1.5, 0.25, 0.8))
