"""The pages that are plain HTML: classes and drives; explanations have a module of their own."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from html import escape
from typing import TYPE_CHECKING

import numpy as np

from ...database.exports import class_rows
from ...database.observations import Drive
from ...database.posterior import ClassSoil, measured_class
from ...database.snapshot import Snapshot
from ..core.html import picture, table
from .layers import DEFAULT_CONFIDENCE, Question
from .pictures import tightening, timeline
from .site import Site
from .words import UNKNOWN, capital, interval, moment, number, titled, with_sd

if TYPE_CHECKING:
    from .server import Shared

_CLASS_COLUMNS = ("class", "cells", "stretches", "c [kPa]", "phi [deg]", "strength, expected", "lower bound (95 %)")
_MOST_DETAILED = 8
"""Drives that are shown in detail at once."""

_MODEL_LETTERS = 8
"""Letters of a model's digest that are shown."""

_TIMELINE = (
    "Above: the cells that were last seen at that time, by what they were recognised as. Below: stretches on which the "
    "wheels measured soil, and hatched those on which they did not."
)


def classes(site: Site, shared: Shared, drive: str) -> str:
    """Say what is known of every class, and how that came drive by drive."""
    stress = Question().normal_stress
    rows = class_rows(site.snapshot, normal_stress=stress, confidence=DEFAULT_CONFIDENCE)
    if not rows:
        return "<h1>Classes</h1><p>No drive has brought a class yet.</p>"
    history = site.soil_history()
    body = [
        "<h1>Classes</h1>",
        f"<p>Strength is shear strength at {stress / 1e3:g} kPa normal stress at a new place of the class; ± is one "
        "standard deviation of such a place.</p>",
        table(_CLASS_COLUMNS, [_class_row(row) for row in rows]),
    ]
    soils = [soil for drive in site.drives for soil in drive.soils]
    for row in rows:
        name = row["class"]
        if name not in history and not row["cells"]:
            continue  # a class that a model knows and no drive has seen
        body.append(f"<h2 id='{escape(name)}'>{escape(name)}</h2>")
        if name not in history:
            body.append(
                f"<p class=warn>Soil unknown: {escape(row['unknown'])}. Drive slowly on it with wheel sensors.</p>"
            )
            continue
        steps = history[name]
        bounds = [_lower_bound(site.snapshot, name, soil, stress) for _, soil in steps]
        drawn = tightening(name, steps, soils, stress, bounds)
        body += [
            f"<p class=note>{escape(capital(row['note']))}.</p>" if row["note"] else "",
            picture(drawn, "png", f"region of c and phi of {name}, and its strength, after each drive"),
            table(
                ("after the drive", "when", "stretches", "c [kPa]", "phi [deg]", "lower bound of strength"),
                [_step(drive, soil, bound) for (drive, soil), bound in zip(steps, bounds, strict=True)],
                text_columns=(0, 1),
            ),
        ]
    return "".join(body)


def _lower_bound(snapshot: Snapshot, name: str, soil: ClassSoil, stress: float) -> float:
    """Give the lower bound of a class's strength [Pa] by what was known of it then."""
    then = Snapshot(snapshot.site, snapshot.cell_size_m, (name,), snapshot.cells, {name: soil}, 0)
    return float(then.class_answer(name, normal_stress=stress).shear_strength_lower[0])


def _class_row(row: Mapping) -> tuple[str, ...]:
    first = (row["class"], str(row["cells"]), str(row["observations"]))
    if not row["known"]:
        return (*first, *[UNKNOWN] * 4)
    return (
        *first,
        with_sd(row["c_Pa"] / 1e3, row["c_sd_Pa"] / 1e3, ""),
        _phi(row["tan_phi"], row["tan_phi_sd"]),
        number(row["shear_strength_Pa"] / 1e3, "kPa"),
        number(row["shear_strength_lower_Pa"] / 1e3, "kPa"),
    )


def _step(drive: Drive, soil: ClassSoil, bound: float) -> tuple[str, ...]:
    (c, tan_phi), covariance = soil.strength.mean, soil.strength.predictive_covariance
    return (
        drive.name, moment(drive.started), str(soil.stretches),
        with_sd(c / 1e3, math.sqrt(covariance[0, 0]) / 1e3, ""), _phi(tan_phi, math.sqrt(covariance[1, 1])),
        number(bound / 1e3, "kPa"),
    )  # fmt: skip


def _phi(tan_phi: float, sd: float) -> str:
    """Write a friction angle [deg] of tan phi and its standard deviation."""
    return with_sd(math.degrees(math.atan(tan_phi)), math.degrees(sd / (1.0 + tan_phi**2)), "")


def drives(site: Site, shared: Shared, drive: str) -> str:
    """List the drives, and say of one, or of the newest, what was seen and measured when, and why the rest was not."""
    found = list(reversed(site.drives))
    if not found:
        return "<h1>Drives</h1><p>The database holds no drive yet.</p>"
    head = ("drive", "when", "vehicle", "cells", "recognised", "stretches", "with soil", "recording")
    rows = [_drive_row(drive, shared) for drive in found]
    body = ["<h1>Drives</h1>", table(head, rows, text_columns=(0, 1, 2, 7))]
    shown = [each for each in found if str(each.id) == drive] or found[:_MOST_DETAILED]
    if len(found) > _MOST_DETAILED:
        body.append(_choice(found, shown, site))
    for each in shown:
        body.append(f"<h2>{escape(each.name)}</h2>")
        drawn = timeline(each)
        if drawn is not None:
            drawn = picture(drawn, "png", f"what {each.name} recognised and measured, over time")
            body.append(f"<figure>{drawn}<figcaption>{_TIMELINE}</figcaption></figure>")
        body += [_stretches(each), _reasons(each), f"<p class=note>{escape(_made_by(each))}</p>"]
    return "".join(body)


def _choice(found: Sequence[Drive], shown: Sequence[Drive], site: Site) -> str:
    """Let one drive be chosen, where there are too many to show all."""
    newest = f"the newest {_MOST_DETAILED}"
    options = [f"<option value=''>{newest}</option>"]
    for each in found:
        chosen = " selected" if [each] == list(shown) else ""
        options.append(f"<option value='{each.id}'{chosen}>{escape(titled(each))}</option>")
    return (
        f"<form method=get><input type=hidden name=site value='{escape(site.name)}'><label>Details of "
        f'<select name=drive onchange="this.form.submit()">{"".join(options)}</select></label></form>'
    )


def _drive_row(drive: Drive, shared: Shared) -> tuple[str, ...]:
    evidence = drive.terrain.evidence
    measured = sum(measured_class(soil) is not None for soil in drive.soils)
    share = f"{100 * np.mean(~evidence.unknown):.1f} %" if len(evidence) else "none seen"
    there = "found" if shared.recordings.of(drive.recording_digest) is not None else "not found"
    return (
        drive.name, moment(drive.started), drive.vehicle_name or UNKNOWN, str(len(evidence)), share,
        str(len(drive.soils)), str(measured), there,
    )  # fmt: skip


def _made_by(drive: Drive) -> str:
    models = ", ".join(f"{sense} {_short(version)}" for sense, version in sorted(drive.models.items()))
    return f"Models: {models or 'none'}. Method: {drive.method}."


def _short(version: str) -> str:
    """Shorten the digest that a model's version ends with."""
    *before, digest = version.split(" ")
    return " ".join([*before, digest[:_MODEL_LETTERS]])


def _stretches(drive: Drive) -> str:
    if not drive.soils:
        return "<p>No stretch on which the wheels could have measured soil.</p>"
    rows = []
    for soil in sorted(drive.soils, key=lambda each: each.start_s):
        name = measured_class(soil)
        belief = soil.class_probabilities
        best = max(belief, key=lambda each: belief[each]) if belief else None
        ground = f"{best} {100 * belief[best]:.0f} %" if best is not None else UNKNOWN
        estimate = soil.estimate
        if estimate is None or soil.gate_reason:
            c = phi = "not measured"
            why = soil.gate_reason
        else:
            c = interval(estimate.parameters["c_Pa"], 1e-3, "")
            phi = interval(estimate.parameters["phi_rad"], math.degrees(1.0), "")
            why = "" if name is not None else "no class is probable enough"
        rows.append((f"{soil.start_s:.1f} to {soil.end_s:.1f} s", ground, c, phi, why))
    return "<h3>Soil by the wheels</h3>" + table(
        ("stretch", "ground", "c [kPa] (95 %)", "phi [deg] (95 %)", "why it is not used"), rows, text_columns=(0, 1, 4)
    )


def _reasons(drive: Drive) -> str:
    """Count why cells were not recognised, and what was said of those that were."""
    evidence = drive.terrain.evidence
    counts = [Counter(), Counter()]
    for unknown, reasons in zip(evidence.unknown.tolist(), evidence.reasons, strict=True):
        counts[bool(unknown)].update(reasons or (["no reason stored"] if unknown else []))
    rows = [
        (text, "not recognised" if unknown else "recognised, with a reservation", str(count))
        for unknown in (True, False)
        for text, count in counts[unknown].most_common(8)
    ]
    return "<h3>Ground by the senses</h3>" + (
        table(("said", "", "cells"), rows, text_columns=(0, 1)) if rows else "<p>Every cell was recognised.</p>"
    )


def _explanations(site: Site, shared: Shared, drive: str) -> str:
    from .explanations import explanations  # with the mechanics of wheels, which take a second to import

    return explanations(site, shared)


PAGE_BODIES: Mapping[str, Callable[[Site, Shared, str], str]] = {
    "classes": classes, "drives": drives, "physics": _explanations,
}  # fmt: skip
"""The pages' bodies as HTML by path, of a site, and of the drive of an identity where one was chosen."""
