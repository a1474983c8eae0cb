"""Answers as plain rows, for tables, JSON, CSV and GeoJSON. What is not known is None, never a number."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from ..framework.core.evidence import UNKNOWN
from ..framework.core.quantities import finite_or_none
from .answer import GroundAnswer
from .posterior import ClassSoil
from .snapshot import Snapshot

SCHEMA = 1
"""Version of the JSON's meaning (CONTRACTS.md)."""

_PLACE_FIELDS = (
    "x_m",
    "y_m",
    "known",
    "unknown",
    "class",
    "class_probabilities",
    "c_Pa",
    "tan_phi",
    "phi_rad",
    "covariance_c_tan_phi",
    "shear_strength_Pa",
    "shear_strength_lower_Pa",
    "age_s",
    "observations",
    "note",
)
"""What `answer_rows` says of a place, in its order."""


def answer_rows(answer: GroundAnswer) -> list[dict[str, Any]]:
    """Give one row a place: probabilities of classes as a dict, (c, tan phi)'s covariance as [[., .], [., .]]."""
    labels, rows = answer.labels(), []
    for index, label in enumerate(labels):
        known = bool(answer.known[index])
        seen = label != UNKNOWN
        probabilities = dict(zip(answer.class_names, answer.class_probability[index].tolist(), strict=True))
        rows.append(
            {
                "x_m": finite_or_none(answer.x[index]),
                "y_m": finite_or_none(answer.y[index]),
                "known": known,
                "unknown": None if known else str(answer.reason[index]),
                "class": label if seen else None,
                "class_probabilities": probabilities if seen else None,
                "c_Pa": finite_or_none(answer.cohesion[index]),
                "tan_phi": finite_or_none(math.tan(answer.friction_angle[index])),
                "phi_rad": finite_or_none(answer.friction_angle[index]),
                "covariance_c_tan_phi": answer.covariance[index].tolist() if known else None,
                "shear_strength_Pa": finite_or_none(answer.shear_strength[index]),
                "shear_strength_lower_Pa": finite_or_none(answer.shear_strength_lower[index]),
                "age_s": finite_or_none(answer.age[index]),
                "observations": int(answer.observation_count[index]),
                "note": answer.note[index] or None,
            }
        )
    return rows


def class_rows(snapshot: Snapshot, *, normal_stress: float, confidence: float) -> list[dict[str, Any]]:
    """Give one row a class: what a new place of it can be expected to bear, and what that rests on."""
    recognised = snapshot.cells.probability[snapshot.cells.reason == 0]
    best = np.argmax(recognised, axis=1) if snapshot.class_names else np.zeros(0, dtype=int)
    cells = np.bincount(best, minlength=len(snapshot.class_names))
    rows = []
    for index, name in enumerate(snapshot.class_names):
        row: dict[str, Any] = {"class": name, "cells": int(cells[index])}
        soil = snapshot.soils.get(name)
        rows.append(row | (_no_soil(name) if soil is None else _soil_row(snapshot, soil, normal_stress, confidence)))
    return rows


def _soil_row(snapshot: Snapshot, soil: ClassSoil, normal_stress: float, confidence: float) -> dict[str, Any]:
    sure = snapshot.class_answer(soil.name, normal_stress=normal_stress, confidence=confidence)
    covariance = soil.strength.predictive_covariance
    return {
        "known": True,
        "unknown": None,
        "observations": soil.stretches,
        "weight": soil.weight,
        "c_Pa": float(soil.strength.mean[0]),
        "c_sd_Pa": math.sqrt(covariance[0, 0]),
        "tan_phi": float(soil.strength.mean[1]),
        "tan_phi_sd": math.sqrt(covariance[1, 1]),
        "phi_rad": math.atan(soil.strength.mean[1]),
        "covariance_c_tan_phi": covariance.tolist(),
        "mean_covariance_c_tan_phi": soil.strength.mean_covariance.tolist(),
        "shear_strength_Pa": float(sure.shear_strength[0]),
        "shear_strength_lower_Pa": float(sure.shear_strength_lower[0]),
        "k_m": _other(soil, "log_k"),
        "stiffness_Pa": _other(soil, "log_stiffness"),
        "n": _other(soil, "n"),
        "normal_stress_driven_Pa": [finite_or_none(stress) for stress in soil.normal_stress_Pa],
        "load_N": finite_or_none(soil.load_N),
        "misfits": soil.misfits,
        "note": sure.note[0] or None,
    }


def _no_soil(name: str) -> dict[str, Any]:
    return {"known": False, "unknown": f"no soil data for class {name}", "observations": 0}


def _other(soil: ClassSoil, key: str) -> dict[str, float] | None:
    """Median and spread of k and stiffness (logarithmic), mean and spread of n; None where undetermined."""
    effects = soil.others.get(key)
    if effects is None:
        return None
    value, sd = float(effects.mean[0]), math.sqrt(effects.predictive_covariance[0, 0])
    return {"value": value, "sd": sd} if key == "n" else {"value": math.exp(value), "sd": math.exp(value) * sd}


def geojson(rows: Sequence[dict[str, Any]], view: Snapshot, cell_size_m: float | None = None) -> dict[str, Any]:
    """Turn rows with places into a GeoJSON FeatureCollection in the site's own frame, metres.

    GeoJSON means longitude and latitude; here they are x and y [m], as the member ``site_frame`` says.

    Parameters
    ----------
    rows
        Of `answer_rows`.
    view
        The snapshot that they are of.
    cell_size_m
        Draw each place as the square cell around it [m]; a point where absent.
    """
    return {
        "type": "FeatureCollection",
        "schema": SCHEMA,
        "site_frame": {
            "site": view.site,
            "unit": "m",
            "origin": None if view.origin is None else asdict(view.origin),
        },
        "features": [
            {
                "type": "Feature",
                "geometry": _geometry(row["x_m"], row["y_m"], cell_size_m),
                "properties": {name: value for name, value in row.items() if name not in ("x_m", "y_m")},
            }
            for row in rows
        ],
    }


def _geometry(x: float | None, y: float | None, cell_size_m: float | None) -> dict[str, Any] | None:
    if x is None or y is None:
        return None
    if cell_size_m is None:
        return {"type": "Point", "coordinates": [x, y]}
    half = 0.5 * cell_size_m
    corners = [(-half, -half), (half, -half), (half, half), (-half, half), (-half, -half)]
    return {"type": "Polygon", "coordinates": [[[x + dx, y + dy] for dx, dy in corners]]}


def flat(row: dict[str, Any]) -> dict[str, Any]:
    """Spread what a row holds in dicts and lists over columns of their own, for CSV."""
    columns: dict[str, Any] = {}
    for name, value in row.items():
        if name == "class_probabilities":
            columns |= {f"probability_{key}": entry for key, entry in (value or {}).items()}
        elif name.endswith("covariance_c_tan_phi"):
            start = name.removesuffix("covariance_c_tan_phi")
            (c, both), (_, t) = value if value is not None else ((None, None), (None, None))
            columns |= {f"{start}variance_c": c, f"{start}covariance_c_tan_phi": both, f"{start}variance_tan_phi": t}
        elif name == "normal_stress_driven_Pa":
            columns |= {"normal_stress_low_Pa": value[0], "normal_stress_high_Pa": value[1]}
        elif isinstance(value, dict):
            columns |= {name: value["value"], f"{name}_sd": value["sd"]}
        else:
            columns[name] = value
    return columns


def csv_columns(class_names: Sequence[str]) -> list[str]:
    """Give the columns of places as CSV: the same for every answer from a snapshot with these classes."""
    columns: list[str] = []
    for name in _PLACE_FIELDS:
        if name == "class_probabilities":
            columns += [f"probability_{key}" for key in class_names]
        else:
            columns += flat({name: None})
    return columns
