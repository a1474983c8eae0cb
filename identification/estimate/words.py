"""The sentences of the findings of an identification."""

from __future__ import annotations

import math
from collections.abc import Iterable

from ...framework.core.findings import Finding, Sentence, Values, in_words
from ...framework.core.soil import WRONG_FORM
from ..rows import words as of_rows


def _wrong_form(values: Values) -> str:
    left = values["misfit_with_freedom"]
    remains = "" if left <= WRONG_FORM else f" ({left:.1f} times with all published departures)"
    misses = f"it misses the channels by {values['misfit']:.1f} times the sensors' noise{remains}"
    if values["misfit"] < 1.05:
        misses = "a form with more parameters fits better than chance allows, though by less than the sensors' noise"
    return (
        f"the textbook's form does not hold: {misses}. c and phi hold only for what was driven. The intervals include "
        f"the fit with more parameters: {values['c_Pa'] / 1e3:.2f} kPa and {math.degrees(values['phi_rad']):.1f} deg"
    )


def _unsteady(values: Values) -> str:
    name, unit = ("the load", " N") if values["channel"] == "load_N" else (values["channel"], "")
    return (
        f"{name} really changes from row to row, because the other channels follow it. Its noise is estimated at "
        f"{values['noise']:.2g}{unit}, less than the {values['shown']:.2g}{unit} by which neighbours differ"
    )


def _autocorrelated(values: Values) -> str:
    larger = ", and its estimate is larger than neighbours differ by" if values["larger"] else ""
    return f"the sensors' noise is autocorrelated: about {values['rows']:.0f} neighbouring rows count as one{larger}"


def _several_soils(values: Values) -> str:
    return f"{len(values['soils'])} soils by name ({', '.join(values['soils'])}), each identified by itself"


SENTENCES: dict[str, Sentence] = {
    **of_rows.SENTENCES,
    "autocorrelated_noise": _autocorrelated,
    "grousers_left_out": "the wheel's lugs are left out, as the textbook wheel has none: `explain` models them",
    "ground_variation": "one soil misses the channels by {misfit:.1f} times the sensors' noise, because the ground "
    "varies along the track. The intervals include that variation",
    "least_squares_intervals": "the intervals are those of ordinary least squares, without the method's bias",
    "mixed_soils": "the stretches differ in soil: no one soil explains all of them",
    "negative_cohesion": "the closed form gives a cohesion of {c_Pa:.0f} Pa, not physical: 0 is reported",
    "recording": "{text}",
    "stored": "{text}",
    "several_soils": _several_soils,
    "several_wheels": "{wheels} wheels, each identified by itself; there is no estimate over all of them",
    "thinned": "stretches of more than {rows} rows are thinned evenly to that number",
    "unsteady_input": _unsteady,
    "wrong_form": _wrong_form,
}
"""A template for `str.format`, or a function of the values, by code."""


def sentences(findings: Iterable[Finding]) -> tuple[str, ...]:
    """Put findings about an identification, or about the rows that it is from, into words."""
    return tuple(in_words(finding, SENTENCES) for finding in findings)
