"""Between the frozen observation types and the tables' rows."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from itertools import chain
from typing import Any

import numpy as np

from ..framework.core.errors import InputError
from ..framework.core.evidence import ClassEvidence
from ..framework.core.findings import Finding, note
from ..framework.core.origin import Offset, Origin
from ..framework.core.quantities import finite_or_none
from ..framework.core.soil import PLAUSIBLE, Quantity, ShearStrength, SoilEstimate
from .observations import Drive, SoilEffect, SoilObservation, TerrainObservations

_PROBABILITY = np.dtype("<f4")

_C_PA, _TAN_PHI = PLAUSIBLE["c_Pa"][1], math.tan(PLAUSIBLE["phi_rad"][1])


def drive_row(drive: Drive) -> dict[str, Any]:
    """The `drive` row."""
    return {
        "id": drive.id,
        "recording_digest": drive.recording_digest,
        "name": drive.name,
        "site": drive.site,
        "vehicle_name": drive.vehicle_name,
        "start_time": drive.started,
        "models": dict(drive.models),
        "method": drive.method,
        "cell_size_m": float(drive.terrain.cell_size_m),
        "classes": list(drive.terrain.evidence.classes),
        "frame": pack_frame(drive),
    }


def pack_frame(drive: Drive) -> dict[str, list[float]] | None:
    """Turn what is known of a drive's frame into JSON; None where that is nothing."""
    packed = {}
    if (origin := drive.origin) is not None:
        packed["origin"] = [origin.latitude_deg, origin.longitude_deg, origin.heading_deg]
    if (offset := drive.offset) is not None:
        packed["offset"] = [offset.x_m, offset.y_m, offset.yaw_rad]
    return packed or None


def unpack_frame(packed: Mapping[str, Any] | None) -> tuple[Origin | None, Offset | None]:
    """Undo `pack_frame`; raises ValueError where it is damaged."""
    if packed is None:
        return None, None
    try:
        parts = {name: tuple(values) for name, values in packed.items()}
        if not (parts.keys() <= {"origin", "offset"} and all(len(each) == 3 for each in parts.values())):
            raise ValueError("expected three numbers of origin and of offset")
        return (
            Origin(*parts["origin"]) if "origin" in parts else None,
            Offset(*parts["offset"]) if "offset" in parts else None,
        )
    except (AttributeError, InputError, TypeError, ValueError) as error:
        raise ValueError(f"frame {packed!r:.80}: {error}") from error


def terrain_columns(drive: Drive) -> dict[str, list[Any]]:
    """The columns of the `terrain_observation` rows, in the order of their identities."""
    terrain, evidence = drive.terrain, drive.terrain.evidence
    identities = drive.row_ids("terrain", len(terrain))
    order = sorted(range(len(terrain)), key=[each.int for each in identities].__getitem__)
    packed = np.ascontiguousarray(evidence.probabilities, dtype=_PROBABILITY).tobytes()
    size = _PROBABILITY.itemsize * len(evidence.classes)
    return {
        "id": [identities[row] for row in order],
        "drive_id": [drive.id] * len(terrain),
        "time_s": terrain.time_s[order].tolist(),
        "cell_x": terrain.cell_x[order].tolist(),
        "cell_y": terrain.cell_y[order].tolist(),
        "sense": np.asarray(terrain.sense, dtype=str)[order].tolist(),
        "quality": evidence.quality[order].tolist(),
        "unknown": evidence.unknown[order].tolist(),
        "probabilities": [packed[size * row : size * (row + 1)] for row in order],
        "reasons": ["\n".join(" ".join(text.split()) for text in evidence.reasons[row]) for row in order],
    }


def soil_rows(drive: Drive) -> Iterator[dict[str, Any]]:
    """The `soil_observation` rows, in the order of their identities."""
    identified = zip(drive.row_ids("soil", len(drive.soils)), drive.soils, strict=True)
    for identity, soil in sorted(identified, key=lambda each: each[0].int):
        yield {"id": identity, "drive_id": drive.id, **_soil_columns(soil)}


def _soil_columns(soil: SoilObservation) -> dict[str, Any]:
    estimate = soil.estimate
    mean = [None, None] if estimate is None else [finite_or_none(value) for value in estimate.mean_c_tan_phi]
    covariance = np.full((2, 2), math.nan) if estimate is None else estimate.covariance_c_tan_phi
    return {
        "start_s": soil.start_s,
        "end_s": soil.end_s,
        "x_m": finite_or_none(soil.x_m),
        "y_m": finite_or_none(soil.y_m),
        "class_probabilities": {name: float(value) for name, value in soil.class_probabilities.items()},
        "c_Pa": mean[0],
        "tan_phi": mean[1],
        "variance_c": finite_or_none(covariance[0, 0]),
        "covariance_c_tan_phi": finite_or_none(covariance[0, 1]),
        "variance_tan_phi": finite_or_none(covariance[1, 1]),
        "normal_stress_low_Pa": finite_or_none(soil.normal_stress_Pa[0]),
        "normal_stress_high_Pa": finite_or_none(soil.normal_stress_Pa[1]),
        "load_N": finite_or_none(soil.load_N),
        "effects": [
            {"slug": effect.slug, "parameters": {name: float(value) for name, value in effect.parameters.items()}}
            for effect in soil.effects
        ],
        "gate_reason": soil.gate_reason,
        "estimate": None if estimate is None else pack_estimate(estimate),
    }


def pack_estimate(estimate: SoilEstimate) -> dict[str, Any]:
    """Turn an estimate into JSON that any database takes: what is not finite becomes a word."""
    return {
        "parameters": {
            name: [_json_number(x) for x in (entry.value, entry.sd, entry.low, entry.high)]
            for name, entry in estimate.parameters.items()
        },
        "mean_c_tan_phi": [_json_number(value) for value in estimate.mean_c_tan_phi],
        "covariance_c_tan_phi": [_json_number(value) for value in np.ravel(estimate.covariance_c_tan_phi)],
        "correlation": {pair: _json_number(value) for pair, value in estimate.correlation.items()},
        "shear_strength": [
            [_json_number(x) for x in (at.normal_stress_Pa, at.value_Pa, at.low_Pa, at.high_Pa)]
            for at in estimate.shear_strength
        ],
        "separable": {name: bool(flag) for name, flag in estimate.separable.items()},
        "advice": estimate.advice,
        "method": estimate.method,
        "channels": list(estimate.channels),
        "n": int(estimate.n),
        "misfit": _json_number(estimate.misfit),
        "findings": [_finding_columns(finding) for finding in estimate.findings],
    }


def _finding_columns(finding: Finding) -> dict[str, Any]:
    """A finding for JSON: a number that is not finite is one that is not known."""
    packed = finding.to_json()
    packed["values"] = {
        name: finite_or_none(value) if isinstance(value, float) else value for name, value in packed["values"].items()
    }
    return packed


def unpack_estimate(packed: Mapping[str, Any]) -> SoilEstimate:
    """Undo `pack_estimate`; raises ValueError where cohesion and tan phi are those of no soil."""
    c_Pa, tan_phi = (float(value) for value in packed["mean_c_tan_phi"])
    if abs(c_Pa) > _C_PA or tan_phi < 0.0 or tan_phi > _TAN_PHI * (1.0 + 1e-9):
        raise ValueError(f"mean_c_tan_phi [{c_Pa:g}, {tan_phi:g}] of no soil")
    return SoilEstimate(
        parameters={name: Quantity(*map(float, entry)) for name, entry in packed["parameters"].items()},
        mean_c_tan_phi=np.array([c_Pa, tan_phi]),
        covariance_c_tan_phi=np.array([float(value) for value in packed["covariance_c_tan_phi"]]).reshape(2, 2),
        correlation={pair: float(value) for pair, value in packed["correlation"].items()},
        shear_strength=tuple(ShearStrength(*map(float, at)) for at in packed["shear_strength"]),
        separable=dict(packed["separable"]),
        advice=packed["advice"],
        method=packed["method"],
        channels=tuple(packed["channels"]),
        n=int(packed["n"]),
        misfit=float(packed["misfit"]),
        findings=_findings(packed),
    )


def _findings(packed: Mapping[str, Any]) -> tuple[Finding, ...]:
    """Read findings; databases written before there were any hold the sentences instead."""
    if "findings" not in packed:
        return tuple(note("stored", text=str(text)) for text in packed["problems"])
    return tuple(Finding(each["code"], each["severity"], dict(each["values"])) for each in packed["findings"])


def drive_of(row: Any, looks: Iterable[Sequence[tuple]], stretches: Sequence[Any]) -> Drive:
    """Read a `drive` row, with its rows of `terrain_observation` (`TERRAIN_COLUMNS`, some at a time) and of
    `soil_observation`.

    Raises
    ------
    ValueError
        One of them is damaged, and which.
    """
    with _reading(f"drive {row.name!r}"):
        if not all(isinstance(name, str) for name in row.classes):
            raise ValueError(f"classes {row.classes!r:.60}, expected names")
        origin, offset = unpack_frame(row.frame)
        return Drive(
            recording_digest=row.recording_digest,
            name=row.name,
            site=row.site,
            vehicle_name=row.vehicle_name,
            start_time=row.start_time,
            models=dict(row.models),
            method=row.method,
            terrain=terrain_observations(looks, row.classes, row.cell_size_m),
            soils=tuple(soil_observation(entry) for entry in stretches),
            origin=origin,
            offset=offset,
        )


@contextmanager
def _reading(what: str) -> Iterator[None]:
    """Say of what is not as it was stored what it belongs to, as a ValueError."""
    try:
        yield
    except KeyError as error:
        raise ValueError(f"{what}: no {error}") from error
    except (AttributeError, OverflowError, TypeError, ValueError) as error:
        raise ValueError(f"{what}: {error}") from error


def soil_observation(row: Any) -> SoilObservation:
    """Read a `soil_observation` row; raises ValueError where it is damaged."""
    with _reading(f"soil from {row.start_s} s to {row.end_s} s"):
        return _soil_observation(row)


def _soil_observation(row: Any) -> SoilObservation:
    with _reading("class_probabilities"):
        probabilities = {name: float(share) for name, share in row.class_probabilities.items()}
    with _reading("effects"):
        effects = tuple(SoilEffect(effect["slug"], dict(effect["parameters"])) for effect in row.effects)
    with _reading("estimate"):
        estimate = None if row.estimate is None else unpack_estimate(row.estimate)
    return SoilObservation(
        start_s=row.start_s,
        end_s=row.end_s,
        x_m=_float(row.x_m),
        y_m=_float(row.y_m),
        class_probabilities=probabilities,
        estimate=estimate,
        normal_stress_Pa=(_float(row.normal_stress_low_Pa), _float(row.normal_stress_high_Pa)),
        load_N=_float(row.load_N),
        effects=effects,
        gate_reason=row.gate_reason,
    )


TERRAIN_COLUMNS = ("time_s", "cell_x", "cell_y", "sense", "quality", "unknown", "probabilities", "reasons")
"""What is read of a `terrain_observation` row."""


def terrain_observations(
    chunks: Iterable[Sequence[tuple]], classes: Sequence[str], cell_size_m: float
) -> TerrainObservations:
    """Read the `terrain_observation` rows of one drive (`TERRAIN_COLUMNS`), some at a time, and put them in order of
    time.
    """
    parts = [_columns(chunk, len(classes)) for chunk in chunks if chunk]
    if not parts:
        return replace(TerrainObservations.nothing(cell_size_m), evidence=ClassEvidence.nothing(classes, ()))
    *numeric, reasons = zip(*parts, strict=True)
    time_s, x, y, sense, quality, unknown, probabilities = map(np.concatenate, numeric)
    said = tuple(chain.from_iterable(reasons))
    order = np.lexsort((np.unique(sense, return_inverse=True)[1], y, x, time_s))
    evidence = ClassEvidence(tuple(classes), probabilities, quality, unknown, said).select(order)
    return TerrainObservations(cell_size_m, x[order], y[order], time_s[order], sense[order], evidence)


def _columns(rows: Sequence[tuple], classes: int) -> tuple:
    """Turn rows into columns: numbers as arrays, reasons as a list of tuples."""
    time_s, x, y, sense, quality, unknown, packed, reasons = zip(*rows, strict=True)
    if set(map(len, packed)) != {_PROBABILITY.itemsize * classes}:
        raise ValueError(f"probabilities of another number of classes than {classes}")
    said = {text: tuple(text.split("\n")) if text else () for text in set(reasons)}
    return (
        np.array(time_s, dtype=float),
        np.array(x, dtype=np.int64),
        np.array(y, dtype=np.int64),
        np.array(sense, dtype=str),
        np.array(quality, dtype=float),
        np.array(unknown, dtype=bool),
        np.frombuffer(b"".join(packed), dtype=_PROBABILITY).reshape(len(rows), classes).astype(float),
        list(map(said.__getitem__, reasons)),
    )


def _float(value: float | None) -> float:
    return math.nan if value is None else float(value)


def _json_number(value: float) -> float | str:
    """A number as JSON knows it; ``"nan"``, ``"inf"`` and ``"-inf"`` where it does not, which `float` reads back."""
    return float(value) if math.isfinite(value) else str(float(value))
