"""Pictures of the plain pages, drawn by matplotlib as those of the reports."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from ...database.observations import Drive, SoilObservation
from ...database.posterior import ClassSoil, measured_class
from ..colours import UNKNOWN_COLOUR, class_colours
from ..core.pictures import STYLE, png_of
from .cell import region_of
from .raster import HATCH_COLOUR

_DPI = 120
_INK = "#222222"
_BINS = 200


@contextmanager
def _drawn(width: float, height: float, into: list[bytes]) -> Iterator[Figure]:
    """Give a figure [inch] to draw on, and add it as PNG to a list."""
    with rc_context({**STYLE, "hatch.color": HATCH_COLOUR}):
        figure = Figure(figsize=(width, height), layout="constrained")
        yield figure
        into.append(png_of(figure, _DPI))


def tightening(
    name: str, history: Sequence[tuple[Drive, ClassSoil]], soils: Sequence[SoilObservation], stress: float,
    bounds: Sequence[float],
) -> bytes:  # fmt: skip
    """Draw how the region of c and phi of a class, and the lower bound of its strength, changed drive by drive.

    Parameters
    ----------
    name
        The class.
    history
        What was known after each drive.
    soils
        Stretches; those that measured the class are drawn.
    stress
        Normal stress of the strength [Pa].
    bounds
        Lower bound of strength after each drive [Pa].
    """
    done: list[bytes] = []
    colour = class_colours([name])[name]
    with _drawn(9.0, 3.6, done) as figure:
        left, right = figure.subplots(1, 2)
        for number, (_, soil) in enumerate(history, 1):
            last = number == len(history)
            c, phi = region_of(soil, stress).T
            style = {"lw": 2.2, "color": _INK} if last else {"lw": 1.0, "color": "#999999", "ls": "--"}
            left.plot(c / 1e3, np.degrees(phi), **style)
            if last:
                left.fill(c / 1e3, np.degrees(phi), color=colour, alpha=0.35, lw=0)
        estimates = [
            soil.estimate.mean_c_tan_phi for soil in soils if soil.estimate is not None and measured_class(soil) == name
        ]
        if estimates:
            c, tan_phi = np.array(estimates).T
            left.plot(c / 1e3, np.degrees(np.arctan(tan_phi)), "+", color=_INK, ms=7)
        left.set(xlabel="cohesion c [kPa]", ylabel="friction angle phi [deg]", title="95 % region of a new place")
        figure.legend(
            handles=[
                Line2D([], [], color=_INK, lw=2.2, label="now"),
                Line2D([], [], color="#999999", ls="--", label="after earlier drives"),
                Line2D([], [], color=_INK, marker="+", ls="none", label="one stretch"),
                Line2D([], [], color=_INK, marker="o", label="strength, expected"),
                Line2D([], [], color="#0072b2", marker="s", ls="--", label="lower bound (95 %)"),
            ],
            loc="outside lower center", ncols=5, fontsize=8, frameon=False,
        )  # fmt: skip
        expected = [float(soil.strength.mean @ (1.0, stress)) / 1e3 for _, soil in history]
        numbers = np.arange(1, len(history) + 1)
        right.plot(numbers, expected, "o-", color=_INK)
        right.plot(numbers, np.array(bounds) / 1e3, "s--", color="#0072b2")
        right.set(
            xlabel="drive that measured it", ylabel="shear strength [kPa]", xticks=numbers, ylim=(0.0, None),
            title=f"at {stress / 1e3:g} kPa normal stress",
        )  # fmt: skip
    return done[0]


def timeline(drive: Drive) -> bytes | None:
    """Draw when a drive's ground was recognised and as what, and when its soil was measured; None where nothing was.

    Only what the database stores is drawn: when each cell was last seen, and the stretches.
    """
    terrain, soils = drive.terrain, drive.soils
    ends = [*terrain.time_s.tolist(), *(soil.end_s for soil in soils)]
    if not ends:
        return None
    names = [*dict.fromkeys([*terrain.evidence.classes, *(n for s in soils for n in s.class_probabilities)])]
    colours = class_colours(sorted(names))
    done: list[bytes] = []
    with _drawn(9.5, 1.9, done) as figure:
        axes = figure.subplots()
        present = _recognised(axes, drive, max(ends), colours)
        for soil in soils:
            name = measured_class(soil)
            width = max(soil.end_s - soil.start_s, 0.002 * max(ends))
            used = soil.estimate is not None and not soil.gate_reason
            face = colours[name] if name is not None and used else "white" if used else UNKNOWN_COLOUR
            axes.barh(
                0.0, width, 0.7, soil.start_s, color=face, edgecolor=_INK if used else HATCH_COLOUR,
                hatch="" if used else "////", lw=1.0,
            )  # fmt: skip
            if name is not None and used:
                present.add(name)
        axes.set(yticks=[0.0, 1.0], yticklabels=["soil by the wheels", "ground by the senses"], ylim=(-0.5, 1.5),
                 xlim=(0.0, 1.02 * max(ends)), xlabel="time on the recording's clock [s]")  # fmt: skip
        axes.grid(visible=False, axis="y")
        handles = [Patch(facecolor=colours[name], edgecolor=_INK, lw=0.6, label=name) for name in sorted(present)]
        handles.append(
            Patch(facecolor=UNKNOWN_COLOUR, edgecolor=HATCH_COLOUR, hatch="////", label="unknown, not measured")
        )
        figure.legend(handles=handles, loc="outside upper left", ncols=8, frameon=False, fontsize=8)
    return done[0]


def _recognised(axes: Any, drive: Drive, end_s: float, colours: Mapping[str, str]) -> set[str]:
    """Draw shares of the cells by class and time, unknown ones hatched; give the classes that are there."""
    terrain, evidence = drive.terrain, drive.terrain.evidence
    fused = np.asarray(terrain.sense) == "fused"
    edges = np.linspace(0.0, end_s * (1.0 + 1e-9), _BINS + 1)
    where = np.clip(np.searchsorted(edges, terrain.time_s[fused], side="right") - 1, 0, _BINS - 1)
    names = [*evidence.classes, ""]
    if evidence.classes:
        best = np.argmax(evidence.probabilities[fused], axis=1)
        best = np.where(evidence.unknown[fused], len(evidence.classes), best)
    else:
        best = np.zeros(fused.sum(), dtype=int)
    counts = np.zeros((_BINS, len(names)))
    np.add.at(counts, (where, best), 1.0)
    total = counts.sum(axis=1)
    shares = np.divide(counts, total[:, None], out=np.zeros_like(counts), where=total[:, None] > 0)
    base = np.full(_BINS, 0.65)
    for index, name in enumerate(names):
        top = base + 0.7 * shares[:, index]
        style = {"facecolor": colours[name]} if name else {"facecolor": UNKNOWN_COLOUR, "hatch": "////"}
        low, high = (np.append(each, each[-1]) for each in (base, top))
        axes.fill_between(edges, low, high, step="post", lw=0, **style)
        base = top
    return {name for index, name in enumerate(names) if name and counts[:, index].any()}


def curves(
    title: str, unit: str, slip: np.ndarray, before: np.ndarray, after: np.ndarray, measured: np.ndarray | None
) -> bytes:
    """Draw a channel over slip: simulated without and with what was found, and measured where that is known.

    Parameters
    ----------
    title, unit
        Of the channel.
    slip : (n,)
        [-].
    before, after : (n,)
        Simulated by the textbook wheel on the soil that was fitted with what was found, and with that.
    measured : (n,)
        Measured in the same rows; None where no recording is there, and the simulations are curves.
    """
    done: list[bytes] = []
    with _drawn(4.4, 3.0, done) as figure:
        axes = figure.subplots()
        if measured is None:
            axes.plot(slip, before, "--", color="#d55e00", label="textbook wheel, same soil")
            axes.plot(slip, after, "-", color="#0072b2", label="with what was found")
        else:
            axes.plot(slip, measured, ".", color="#888888", ms=2.5, label="measured")
            for values, colour, mark, label in (
                (before, "#d55e00", "o--", "textbook wheel, same soil"),
                (after, "#0072b2", "s-", "with what was found"),
            ):  # fmt: skip
                axes.plot(*_medians(slip, values), mark, color=colour, ms=4, label=label)
            axes.plot(*_medians(slip, measured), "k^-", ms=4, lw=1.0, label="measured, median")
        axes.set(xlabel="slip [-]", ylabel=f"{title} [{unit}]")
        axes.legend(fontsize=7.5, framealpha=0.85, edgecolor="white")
    return done[0]


def _medians(slip: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Medians of values in twelve bins of slip that hold equally many rows."""
    fine = np.isfinite(slip) & np.isfinite(values)
    parts = [part for part in np.array_split(np.argsort(slip[fine]), 12) if len(part)]
    pairs = [(np.median(slip[fine][part]), np.median(values[fine][part])) for part in parts]
    return np.array([each[0] for each in pairs]), np.array([each[1] for each in pairs])
