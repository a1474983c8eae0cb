"""Pictures of an identification: the estimate converging along the drive, and what cohesion and friction may be."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from scipy.stats import chi2

from ...framework.core.files import whole
from ...framework.core.recording.types import Recording
from ...framework.core.soil import SoilEstimate, SoilKnowledge
from ..mechanics.soil import soil_vector
from ..mechanics.textbook import TextbookWheel
from ..rows.geometry import by_geometry, by_soil
from ..rows.select import SelectedRows, as_trials, select_wheel_rows
from .estimate import LEAST_ROWS, solve, usable
from .identifiability import TWO_SIDED
from .identify import Identification, Segment, measured_rows
from .noise_likelihood import solve_with_noise
from .solution import Measured
from .tables import where

CHECKPOINTS = 24
"""Points of the convergence curve of one stretch."""

MOST_STRETCHES = 6
"""Stretches whose channels are drawn."""

_HEADROOM = 1.5
"""Height of the panel of cohesion, over the upper end of the settled interval [-]."""

_FEW = 200
"""Rows that are drawn as large marks."""

_ANSWERS = {1: ("torque T [N m]", 1.0), 2: ("sinkage z [mm]", 1e3), 4: ("drawbar pull DP [N]", 1.0)}
"""Channels that the soil answers with, by their column: name, and how many of its unit are one in SI."""

_DEGREES = 180.0 / math.pi
_COLOURS = ("#1b6ca8", "#c4572e", "#3a7d44", "#7b4fa3", "#a67c00", "#2a9d8f", "#b5446e", "#5c6b73")


def draw_identification(
    recording: Recording, result: Identification, out: str | Path, *, soil: SoilKnowledge | None = None
) -> None:
    """Draw estimates along the drive with their 95 % intervals, and the 95 % regions of (c, phi), to an image file.

    Parameters
    ----------
    recording
        What was identified from.
    result
        What `identify` made of it, by maximum likelihood.
    out
        The file; its ending decides on the format.
    soil
        What was known beforehand.
    """
    figure = identification_figure(recording, result, soil=soil)
    figure.suptitle(f"{recording.name}: soil identified, 95 % intervals and regions")
    with whole(Path(out)) as part:
        figure.savefig(part, dpi=110)


def identification_figure(
    recording: Recording, result: Identification, *, soil: SoilKnowledge | None = None
) -> Figure:  # fmt: skip
    """Give the picture of `draw_identification`, without a title."""
    rows, known = as_trials(select_wheel_rows(recording)), soil or SoilKnowledge()
    timed = "time_s" in rows.table
    figure = Figure(figsize=(13.0 if timed else 5.0, 4.0), layout="constrained")
    panels = np.atleast_1d(figure.subplots(1, 3 if timed else 1))
    used = [segment for segment in result.segments if segment.used]
    if timed:
        settled = [
            _converge(panels[:2], rows, _rows_of(segment, rows), known, colour)
            for segment, colour in zip(used, _cycle(len(used)), strict=True)
        ]
        panels[0].set(xlabel="time [s]", ylabel="cohesion c [kPa]", ylim=(0.0, max(settled, default=0.0) or None))
        panels[1].set(xlabel="time [s]", ylabel="friction angle phi [deg]", ylim=(0.0, 60.0))
    for segment, colour in zip(used, _cycle(len(used)), strict=True):
        if segment.estimate is not None:
            _region(panels[-1], segment.estimate, colour, where(segment))
    panels[-1].set(xlabel="cohesion c [kPa]", ylabel="friction angle phi [deg]", ylim=(0.0, 60.0))
    panels[-1].set_xlim(left=0.0)
    if used:
        panels[-1].legend(frameon=False, fontsize="small")
    for panel in panels:
        panel.spines[["top", "right"]].set_visible(False)
    return figure


def channels_figure(recording: Recording, result: Identification) -> Figure | None:
    """Draw what the soil answered with, measured and simulated at each row's load and slip, over slip.

    Returns
    -------
    Figure or None
        A row of panels for each stretch, at most `MOST_STRETCHES` of those with most rows; None where none was used.
    """
    drawn = sorted(_compared(recording, result), key=lambda each: -len(each.measured))[:MOST_STRETCHES]
    if not drawn:
        return None
    channels = [index for index in _ANSWERS if any(np.isfinite(each.measured[:, index]).any() for each in drawn)]
    figure = Figure(figsize=(3.1 * len(channels), 2.6 * len(drawn)), layout="constrained")
    grid = figure.subplots(len(drawn), len(channels), squeeze=False)
    for panels, each in zip(grid, drawn, strict=True):
        for panel, index in zip(panels, channels, strict=True):
            label, scale = _ANSWERS[index]
            slip = each.measured[:, 3]
            size = 5.0 if len(slip) <= _FEW else 2.5
            panel.plot(slip, scale * each.measured[:, index], "o", color="#999999", ms=size, mew=0, label="measured")
            panel.plot(slip, scale * each.simulated[:, index], "x", color=_COLOURS[0], ms=size, label="simulated")
            panel.set(xlabel="slip i", ylabel=label)
            panel.spines[["top", "right"]].set_visible(False)
        panels[0].set_title(each.name, loc="left", fontsize="small")
    grid[0, 0].legend(frameon=False, fontsize="small")
    return figure


@dataclass(frozen=True)
class _Compared:
    """A stretch: channels (n, 5) as measured, and simulated on its soil."""

    name: str
    measured: np.ndarray
    simulated: np.ndarray


def _compared(recording: Recording, result: Identification) -> Iterator[_Compared]:
    wheels = by_geometry(recording)
    for part in [part for wheel in wheels for part in by_soil(wheel)]:
        wheel = part.vehicle.name if len(wheels) > 1 and part.vehicle is not None else ""
        soil = "" if part.wheel is None or part.wheel.soil is None else str(part.wheel.soil[0])
        mine = [each for each in result.segments if each.estimate and (each.wheel, each.soil) == (wheel, soil)]
        if not mine:
            continue
        rows = as_trials(select_wheel_rows(part))
        for segment in mine:
            assert segment.estimate is not None
            measured = measured_rows(rows, _rows_of(segment, rows)).channels
            measured = measured[np.isfinite(measured[:, [0, 3]]).all(axis=1)]
            vector = soil_vector({name: each.value for name, each in segment.estimate.parameters.items()})
            start = np.full(len(measured), np.nan)
            simulated = TextbookWheel(rows.wheel).predict(measured[:, [0, 3]], vector, start).channels
            yield _Compared(where(segment), measured, simulated)


def _rows_of(segment: Segment, rows: SelectedRows) -> np.ndarray:
    """Numbers of the rows of a stretch that are used."""
    inside = rows.reasons == ""
    if not math.isnan(segment.start_s):
        inside &= (rows.table["time_s"] >= segment.start_s) & (rows.table["time_s"] <= segment.end_s)
    return np.flatnonzero(inside)


def _cycle(count: int) -> list[str]:
    return [_COLOURS[index % len(_COLOURS)] for index in range(count)]


def _converge(panels: np.ndarray, rows: SelectedRows, chosen: np.ndarray, known: SoilKnowledge, colour: str) -> float:
    """Draw how the estimate settles; the top of the panel of cohesion that shows where it has settled [kPa]."""
    measured, _, _ = solve_with_noise(usable(measured_rows(rows, chosen)), rows.wheel, known)
    count = len(measured.channels)
    first = min(max(5 * LEAST_ROWS, count // CHECKPOINTS), count)
    ends = np.unique(np.linspace(first, count, CHECKPOINTS).astype(int))
    curve = np.array([_at(measured, end, rows, known) for end in ends])
    times = measured.order[ends - 1]
    for panel, column, scale in zip(panels, (0, 2), (1e-3, 1.0), strict=True):
        value, half = scale * curve[:, column], scale * curve[:, column + 1]
        panel.plot(times, value, color=colour)
        panel.fill_between(times, np.maximum(value - half, 0.0), value + half, color=colour, alpha=0.2, lw=0)
    last = len(curve) // 2
    return _HEADROOM * 1e-3 * float(np.max(curve[last:, 0] + curve[last:, 1], initial=0.0))


def _at(measured: Measured, end: int, rows: SelectedRows, known: SoilKnowledge) -> tuple[float, float, float, float]:
    """Cohesion [Pa] and phi [deg] from the first `end` samples, each with the half of its Wald interval."""
    solution = solve(measured.select(slice(end)), rows.wheel, known)
    sd = np.sqrt(np.maximum(np.diag(solution.covariance())[:2], 0.0))
    phi = math.atan(solution.fit.vector[1])
    return (
        max(float(solution.fit.vector[0]), 0.0),
        TWO_SIDED * float(sd[0]),
        phi * _DEGREES,
        TWO_SIDED * float(sd[1]) * math.cos(phi) ** 2 * _DEGREES,
    )


def _region(panel: Axes, estimate: SoilEstimate, colour: str, label: str) -> None:
    """Outline the 95 % region of (c, phi): an ellipse in (c, tan phi), cut where either would be negative."""
    values, vectors = np.linalg.eigh(estimate.covariance_c_tan_phi)
    angle = np.linspace(0.0, 2.0 * math.pi, 361)
    circle = np.stack([np.cos(angle), np.sin(angle)])
    radius = math.sqrt(float(chi2.ppf(0.95, 2)))
    outline = estimate.mean_c_tan_phi[:, None] + radius * vectors @ (np.sqrt(np.maximum(values, 0.0))[:, None] * circle)
    c, tan_phi = np.maximum(outline, 0.0)
    panel.fill(c / 1e3, np.arctan(tan_phi) * _DEGREES, color=colour, alpha=0.15, lw=0)
    panel.plot(c / 1e3, np.arctan(tan_phi) * _DEGREES, color=colour, lw=1)
    c_value, phi = estimate.parameters["c_Pa"].value, estimate.parameters["phi_rad"].value
    panel.plot([c_value / 1e3], [phi * _DEGREES], "o", color=colour, label=label)
