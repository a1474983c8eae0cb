"""An identification in tables of text, in the units that people read."""

from __future__ import annotations

import math
from collections.abc import Mapping

from ...framework.core.numbers import figures, value_and_interval
from ...framework.core.soil import Quantity, SoilEstimate
from .identifiability import is_search_limit, is_unbounded
from .identify import Identification, Segment

Table = tuple[list[str], list[list[str]]]
"""Headers and rows."""

_SOIL = {
    "c_Pa": ("cohesion c", "kPa", 1e-3),
    "phi_rad": ("friction angle phi", "deg", 180.0 / math.pi),
    "k_m": ("shear modulus k", "mm", 1e3),
    "stiffness_Pa": ("stiffness k1 + k2 b", "kPa", 1e-3),
    "n": ("sinkage exponent n", "-", 1.0),
}
"""By name: in words, unit, and how many of it are one in SI."""

_DIGITS = {"c_Pa": 2, "phi_rad": 1}


def stretch_table(result: Identification) -> Table:
    """Give what became of each stretch."""
    return ["stretch", "rows", "c [kPa]", "phi [deg]", "why not"], [_segment_row(each) for each in result.segments]


def parameter_table(found: SoilEstimate) -> Table:
    """Give the parameters with their 95 % intervals, and whether the data determine them."""
    rows = []
    for name, quantity in found.parameters.items():
        label, unit, scale = _SOIL[name]
        ends_open = [is_search_limit(name, end) for end in (quantity.low, quantity.high)]
        value, interval = value_and_interval(
            *(each * scale for each in (quantity.value, quantity.low, quantity.high)),
            low_open=ends_open[0], high_open=ends_open[1],
        )  # fmt: skip
        determined = "given" if quantity.low == quantity.high else "yes" if found.separable[name] else "no"
        rows.append([label, unit, value, interval, determined])
    return ["parameter", "unit", "value", "95 % interval", "determined"], rows


def strength_table(found: SoilEstimate) -> Table:
    """Give the shear strength over the normal stresses that were driven."""
    rows = [
        [figures(each.normal_stress_Pa / 1e3), *value_and_interval(
            *(1e-3 * stress for stress in (each.value_Pa, each.low_Pa, each.high_Pa)),
            low_open=False, high_open=is_unbounded(each, found.parameters),
        )]
        for each in found.shear_strength
    ]  # fmt: skip
    return ["normal stress [kPa]", "shear strength [kPa]", "95 % interval"], rows


def learnt(parameters: Mapping[str, Quantity], determined: Mapping[str, bool], *, with_unit: bool = False) -> list[str]:
    """Give cohesion [kPa] and friction angle [deg] with their intervals."""
    return [
        interval_text(parameters, name, determined, digits, f" {_SOIL[name][1]}" if with_unit else "")
        for name, digits in _DIGITS.items()
    ]


def interval_text(
    quantities: Mapping[str, Quantity], name: str, determined: Mapping[str, bool], digits: int = 2, unit: str = ""
) -> str:
    """Give a quantity with its 95 % interval in the unit that people read; of one that is not determined the interval
    alone, and nothing where there is no quantity.
    """
    if name not in quantities:
        return ""
    one, scale = quantities[name], _SOIL[name][2]
    value, low, high = (f"{each * scale:.{digits}f}" for each in (one.value, one.low, one.high))
    interval = f"{low} to {high}"
    if is_search_limit(name, one.high):
        interval = f"above {low}" if float(low) else "not bounded"
    return f"{value}{unit} ({interval})" if determined.get(name, True) else f"not determined: {interval}{unit}"


def where(segment: Segment) -> str:
    """Say which stretch it is."""
    when = "steady-state trials" if math.isnan(segment.start_s) else f"{segment.start_s:.1f} to {segment.end_s:.1f} s"
    return ", ".join(filter(None, (when, segment.wheel, segment.soil)))


def _segment_row(segment: Segment) -> list[str]:
    if segment.estimate is None:
        return [where(segment), str(segment.n), "", "", segment.reason]
    found = segment.estimate
    return [where(segment), str(found.n), *learnt(found.parameters, found.separable), ""]
