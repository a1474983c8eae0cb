"""Identification as the JSON that CONTRACTS.md fixes: `bevameter identify --json`."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from ...framework.core.findings import Finding
from ...framework.core.quantities import finite_or_none
from ...framework.core.soil import Quantity, SoilEstimate
from .identifiability import is_search_limit
from .identify import Identification
from .words import sentences


def identification_json(result: Identification) -> dict[str, Any]:
    """Lay out an identification for JSON: SI units, `low` and `high` are 95 % intervals, null where not known."""
    overall = result.overall
    return {
        "schema": 1,
        "method": result.method,
        "channels": list(overall.channels) if overall else [],
        "n": overall.n if overall else 0,
        "overall": estimate_json(overall) if overall else None,
        "segments": [
            {
                "start_s": finite_or_none(segment.start_s),
                "end_s": finite_or_none(segment.end_s),
                "used": segment.used,
                "reason": segment.reason,
                "rows": segment.n,
                **({"wheel": segment.wheel} if segment.wheel else {}),
                **({"soil": segment.soil} if segment.soil else {}),
                **(estimate_json(segment.estimate) if segment.estimate else {}),
            }
            for segment in result.segments
        ],
        **({"by_soil": {name: estimate_json(each) for name, each in result.by_soil.items()}} if result.by_soil else {}),
        **_findings(result.findings),
    }


def estimate_json(estimate: SoilEstimate) -> dict[str, Any]:
    """Lay out one estimate for JSON."""
    return {
        **{name: _quantity(name, quantity) for name, quantity in estimate.parameters.items()},
        "correlation": dict(estimate.correlation),
        "shear_strength": [asdict(strength) for strength in estimate.shear_strength],
        "separable": {name: bool(value) for name, value in estimate.separable.items()},
        "advice": estimate.advice,
        "misfit": finite_or_none(estimate.misfit),
        "channels": list(estimate.channels),
        **_findings(estimate.findings),
    }


def _findings(findings: tuple[Finding, ...]) -> dict[str, Any]:
    """Lay out findings: in words, and as data."""
    return {"problems": list(sentences(findings)), "findings": [each.to_json() for each in findings]}


def _quantity(name: str, quantity: Quantity) -> dict[str, Any]:
    """Lay out a quantity; `unbounded` names the ends of the interval that the data leave open."""
    ends = {"low": quantity.low, "high": quantity.high}
    return {
        "value": finite_or_none(quantity.value),
        "sd": finite_or_none(quantity.sd),
        "low": finite_or_none(quantity.low),
        "high": finite_or_none(quantity.high),
        "unbounded": [end for end, value in ends.items() if is_search_limit(name, value)],
    }
