"""What is known of one cell, as HTML: the planner's answer, and the looks behind it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from html import escape
from urllib.parse import urlencode

import numpy as np
from scipy.stats import f as fisher

from ...database.answer import GroundAnswer
from ...database.exports import answer_rows
from ...database.posterior import ClassSoil
from ...database.snapshot import Snapshot
from ...database.speed import speed_limit_of_each
from ..core.errors import InputError
from ..core.html import table
from .layers import Question
from .recordings import Recordings
from .site import Look, Site
from .words import UNKNOWN, age, capital, moment, number, titled, with_sd

LEAST_SHOWN = 0.05
"""Classes of less probability have no region of their own in the picture of c and phi [-]."""

_CORNERS = 73


def cell_html(site: Site, cell: tuple[int, int], question: Question) -> str:
    """Say what is known of a cell, seen or not: class and strength first."""
    x, y = site.centre_of(cell)
    answer = site.snapshot.at(x, y, normal_stress=question.normal_stress, confidence=question.confidence)
    row = answer_rows(answer)[0]
    parts = [
        f"<h2>Cell at x = {x:.2f} m, y = {y:.2f} m</h2>",
        f"<p class=verdict>{escape(_verdict(row, question))}</p>",
        _strength(row, _speed(answer, question), question),
        _classes(row),
    ]
    return "".join(parts)


def _verdict(row: dict, question: Question) -> str:
    name = row["class"]
    of_class = f"{capital(name)}, {100 * row['class_probabilities'][name]:.1f} % probable" if name else "Class unknown"
    if not row["known"]:
        return f"{of_class}. Soil unknown: {row['unknown']}."
    return (
        f"{of_class}. It bears at least {number(row['shear_strength_lower_Pa'] / 1e3)} kPa of shear under "
        f"{question.normal_stress / 1e3:g} kPa normal stress ({100 * question.confidence:g} %)."
    )


def _speed(answer: GroundAnswer, question: Question) -> tuple[tuple[str, str], ...]:
    """Give the row of the speed limit, where a vehicle was chosen, with what binds it."""
    if question.vehicle is None:
        return ()
    name = f"speed limit of {question.vehicle.name}"
    try:
        found = speed_limit_of_each(answer, question.vehicle, sight_m=question.sight_m, most_m_s=question.most_m_s)
    except InputError as error:  # such as a vehicle of unknown weight where no load was recorded
        return ((f"{name}: {error}", UNKNOWN),)
    return ((f"{name}: {found.reason[0]}", number(float(found.limit_m_s[0]), "m/s")),)


def _strength(row: dict, speed: tuple[tuple[str, str], ...], question: Question) -> str:
    def scaled(key: str, scale: float) -> float | None:
        return None if row[key] is None else row[key] * scale

    covariance = row["covariance_c_tan_phi"]
    if covariance is None:
        cohesion = friction = UNKNOWN
    else:
        cohesion = with_sd(row["c_Pa"] / 1e3, math.sqrt(covariance[0][0]) / 1e3, "kPa")
        per_radian = 1.0 / (1.0 + row["tan_phi"] ** 2)
        friction = with_sd(
            math.degrees(row["phi_rad"]), math.degrees(math.sqrt(covariance[1][1]) * per_radian), "deg"
        )  # fmt: skip
    stress, level = f"{question.normal_stress / 1e3:g} kPa", f"{100 * question.confidence:g} %"
    rows = [
        (f"shear strength at {stress}, lower bound ({level})", number(scaled("shear_strength_lower_Pa", 1e-3), "kPa")),
        (f"shear strength at {stress}, expected", number(scaled("shear_strength_Pa", 1e-3), "kPa")),
        ("cohesion c", cohesion),
        ("friction angle phi", friction),
        *speed,
        ("age of the newest look", age(row["age_s"])),
        ("drives that recognised it", str(row["observations"])),
    ]
    note = f"<p class=note>{escape(capital(row['note']))}.</p>" if row["note"] else ""
    return table(("", "value"), rows) + note


def _classes(row: dict) -> str:
    if not row["class_probabilities"]:
        return ""
    sorted_ = sorted(row["class_probabilities"].items(), key=lambda each: -each[1])
    return "<h3>Classes</h3>" + table(
        ("class", "probability"), [(name, f"{100 * value:.1f} %") for name, value in sorted_]
    )


def looks_html(looks: Sequence[Look], recordings: Recordings) -> str:
    """Say what drives saw of a cell, with the frames and the sound of that moment where the recording was found."""
    if not looks:
        return "<h3>Observations</h3><p>No drive has seen this cell.</p>"
    return "<h3>Observations</h3>" + "".join(_look(look, recordings) for look in looks)


def _look(look: Look, recordings: Recordings) -> str:
    best = sorted(look.probabilities.items(), key=lambda each: -each[1])[:3]
    said = ", ".join(f"{name} {100 * share:.1f} %" for name, share in best if share >= 5e-4) or "not recognised"
    clock = f"{look.time_s:.1f} s on the recording's clock"
    when = clock if look.when is None else f"{moment(look.when)}, {clock}"
    reasons = f"<p class=note>{escape('; '.join(look.reasons))}</p>" if look.reasons else ""
    return (
        f"<div class=look><h4>{escape(titled(look.drive))}</h4><p>{escape(said)}; quality {look.quality:.2f}; last "
        f"seen at {escape(when)}</p>{reasons}{_media(look, recordings)}</div>"
    )


def _media(look: Look, recordings: Recordings) -> str:
    """Give the frame and the sound of that moment, or say why there is none."""
    found = recordings.of(look.drive.recording_digest)
    if found is None:
        return f"<p class=note>{escape(recordings.why_not(look.drive))}</p>"
    query = urlencode({"recording": look.drive.recording_digest, "t": f"{look.time_s:.3f}"})
    parts = []
    if found.camera is not None:
        alt = f"camera frame of {look.drive.name} nearest to {look.time_s:.1f} s"
        parts.append(
            f'<figure><img loading=lazy src="frame?{query}" alt="{escape(alt)}"><figcaption>camera, nearest frame to '
            f"{look.time_s:.1f} s</figcaption></figure>"
        )
    if found.sound is not None:
        parts.append(
            f'<figure><audio controls preload=none src="sound?{query}"></audio><figcaption>microphone, two seconds '
            f"around {look.time_s:.1f} s</figcaption></figure>"
        )
    return "".join(parts) or "<p class=note>The recording has neither camera nor sound.</p>"


def regions(snapshot: Snapshot, cell_probability: np.ndarray, question: Question) -> dict[str, np.ndarray]:
    """Give the 95 % regions of cohesion and friction angle that a cell may have, by class.

    Parameters
    ----------
    snapshot
        What is known.
    cell_probability : (k,)
        Of the snapshot's classes; NaN where the cell is not known.

    Returns
    -------
    dict
        By name of the classes of at least `LEAST_SHOWN` whose soil is known: corners (n, 2) of the region, c [Pa] and
        phi [rad].
    """
    shares = zip(snapshot.class_names, cell_probability.tolist(), strict=True)
    likely = [name for name, share in shares if share >= LEAST_SHOWN and name in snapshot.soils]
    return {name: region_of(snapshot.soils[name], question.normal_stress) for name in likely}


def region_of(soil: ClassSoil, normal_stress: float, level: float = 0.95) -> np.ndarray:
    """Give the region that c [Pa] and phi [rad] of a new place of a class lie in with a probability, (n, 2).

    An ellipse in c and tan phi: that of a Student t in two dimensions, with the degrees of freedom that the prediction
    of strength has at that normal stress [Pa].
    """
    strength = soil.strength
    freedom = strength.predict(np.array([1.0, normal_stress]))[2]
    radius = math.sqrt(2.0 * float(fisher.ppf(level, 2, freedom)))
    values, vectors = np.linalg.eigh(strength.predictive_covariance)
    angle = np.linspace(0.0, 2.0 * math.pi, _CORNERS)
    circle = np.column_stack([np.cos(angle), np.sin(angle)])
    c, tan_phi = (strength.mean + radius * (circle * np.sqrt(np.maximum(values, 0.0))) @ vectors.T).T
    return np.column_stack([np.maximum(c, 0.0), np.arctan(np.maximum(tan_phi, 0.0))])
