"""Pictures of an identification: the estimate converging along the drive, and what cohesion and friction may be."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from scipy.stats import chi2

from ...framework.core.files import whole
from ...framework.core.recording.types import Recording
from ...framework.core.soil import SoilEstimate, SoilKnowledge
from ..rows.select import SelectedRows, as_trials, select_wheel_rows
from .estimate import LEAST_ROWS, solve, usable
from .identify import Identification, measured_rows
from .noise_likelihood import solve_with_noise
from .solution import Measured

CHECKPOINTS = 24
"""Points of the convergence curve of one stretch."""

_DEGREES = 180.0 / math.pi
_TWO_SIDED = 1.96
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
    rows, known = as_trials(select_wheel_rows(recording)), soil or SoilKnowledge()
    timed = "time_s" in rows.table
    figure, panels = plt.subplots(1, 3 if timed else 1, figsize=(13.0 if timed else 5.0, 4.0), layout="constrained")
    panels = np.atleast_1d(panels)
    used = [segment for segment in result.segments if segment.used]
    if timed:
        for segment, colour in zip(used, _cycle(len(used)), strict=True):
            inside = (rows.table["time_s"] >= segment.start_s) & (rows.table["time_s"] <= segment.end_s)
            _converge(panels[:2], rows, np.flatnonzero(inside & (rows.reasons == "")), known, colour)
        panels[0].set(xlabel="time [s]", ylabel="cohesion c [kPa]", ylim=(0.0, None))
        panels[1].set(xlabel="time [s]", ylabel="friction angle phi [deg]", ylim=(0.0, 60.0))
    for segment, colour in zip(used, _cycle(len(used)), strict=True):
        if segment.estimate is not None:
            where = "steady-state trials" if not timed else f"{segment.start_s:.0f} to {segment.end_s:.0f} s"
            where = ", ".join(filter(None, (segment.wheel, segment.soil, where)))
            _region(panels[-1], segment.estimate, colour, where)
    panels[-1].set(xlabel="cohesion c [kPa]", ylabel="friction angle phi [deg]", ylim=(0.0, 60.0))
    panels[-1].set_xlim(left=0.0)
    if used:
        panels[-1].legend(frameon=False, fontsize="small")
    for panel in panels:
        panel.spines[["top", "right"]].set_visible(False)
    figure.suptitle(f"{recording.name}: soil identified, 95 % intervals and regions")
    with whole(Path(out)) as part:
        figure.savefig(part, dpi=110)
    plt.close(figure)


def _cycle(count: int) -> list[str]:
    return [_COLOURS[index % len(_COLOURS)] for index in range(count)]


def _converge(panels: np.ndarray, rows: SelectedRows, chosen: np.ndarray, known: SoilKnowledge, colour: str) -> None:
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


def _at(measured: Measured, end: int, rows: SelectedRows, known: SoilKnowledge) -> tuple[float, float, float, float]:
    """Cohesion [Pa] and phi [deg] from the first `end` samples, each with the half of its Wald interval."""
    part = replace(measured, channels=measured.channels[:end], order=measured.order[:end])
    solution = solve(part, rows.wheel, known)
    sd = np.sqrt(np.maximum(np.diag(solution.covariance())[:2], 0.0))
    phi = math.atan(solution.fit.vector[1])
    return (
        max(float(solution.fit.vector[0]), 0.0),
        _TWO_SIDED * float(sd[0]),
        phi * _DEGREES,
        _TWO_SIDED * float(sd[1]) * math.cos(phi) ** 2 * _DEGREES,
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
