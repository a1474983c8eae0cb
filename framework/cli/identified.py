"""How `bevameter identify` prints what it found."""

from __future__ import annotations

import math

from ...identification.estimate.identifiability import is_search_limit
from ...identification.estimate.identify import Identification, Segment
from ...identification.estimate.words import sentences
from ..core.findings import Finding
from ..core.soil import Quantity, SoilEstimate
from .printing import print_rows

_SHOWN = {
    "c_Pa": ("cohesion c", "kPa", 1e-3),
    "phi_rad": ("friction angle phi", "deg", 180.0 / math.pi),
    "k_m": ("shear modulus k", "mm", 1e3),
    "stiffness_Pa": ("stiffness k1 + k2 b", "kPa", 1e-3),
    "n": ("sinkage exponent n", "-", 1.0),
}


def print_findings(findings: tuple[Finding, ...]) -> None:
    """Print findings in words, each as the note or the warning that it is."""
    for finding, text in zip(findings, sentences(findings), strict=True):
        print(f"{finding.severity}: {text}")


def print_identification(result: Identification) -> None:
    """Print the overall estimate, then what became of each stretch."""
    print_findings(result.findings)
    if result.overall is not None:
        _print_estimate(result.overall)
        print()
    elif not any(segment.used for segment in result.segments):
        print("No row could be used:")
    print_rows(
        ["stretch", "rows", "c [kPa]", "phi [deg]", "why not"],
        [_segment_row(segment) for segment in result.segments],
        title="Stretches",
    )


def _print_estimate(estimate: SoilEstimate) -> None:
    print(f"Soil from {estimate.n} rows of {', '.join(estimate.channels)} (method {estimate.method})")
    rows = []
    for name, quantity in estimate.parameters.items():
        label, unit, scale = _SHOWN[name]
        determined = "yes" if estimate.separable[name] else "no"
        if quantity.low == quantity.high:
            determined = "given"
        rows.append([label, unit, f"{quantity.value * scale:.4g}", _interval(name, quantity, scale), determined])
    print_rows(["parameter", "unit", "value", "95 % interval", "determined"], rows)
    print_rows(
        ["normal stress [kPa]", "shear strength [kPa]", "95 % interval"],
        [
            [
                f"{strength.normal_stress_Pa / 1e3:.3g}",
                f"{strength.value_Pa / 1e3:.3g}",
                f"{strength.low_Pa / 1e3:.3g} to {strength.high_Pa / 1e3:.3g}",
            ]
            for strength in estimate.shear_strength
        ],
        title="Shear strength over the stresses driven",
    )
    if estimate.advice:
        print(f"Advice: {estimate.advice}.")
    print_findings(estimate.findings)


def _interval(name: str, quantity: Quantity, scale: float) -> str:
    low, high = (
        "open" if is_search_limit(name, end) else f"{end * scale:.4g}" for end in (quantity.low, quantity.high)
    )
    return f"{low} to {high}"


def _segment_row(segment: Segment) -> list[str]:
    where = "steady-state trials" if math.isnan(segment.start_s) else f"{segment.start_s:.1f} to {segment.end_s:.1f} s"
    if segment.wheel:
        where = f"{where}, {segment.wheel}"
    if segment.estimate is None:
        return [where, str(segment.n), "", "", segment.reason]
    c, phi = segment.estimate.parameters["c_Pa"], segment.estimate.parameters["phi_rad"]
    degrees = 180.0 / math.pi
    return [
        where,
        str(segment.estimate.n),
        f"{c.value / 1e3:.2f} ({c.low / 1e3:.2f} to {c.high / 1e3:.2f})",
        f"{phi.value * degrees:.1f} ({phi.low * degrees:.1f} to {phi.high * degrees:.1f})",
        "",
    ]
