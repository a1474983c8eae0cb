"""Numbers and their intervals as people read them."""

from __future__ import annotations

import math

FIGURES = 3
"""Significant figures."""

_NOTHING = 0.005
"""Share of the largest of a value and the ends of its interval below which the value, or an end, is none [-]."""

NOT_BOUNDED = "not bounded by these data"


def figures(value: float) -> str:
    """Give a number with three significant figures and without an exponent: 48800, 0.88, 0."""
    if value == 0.0 or not math.isfinite(value):
        return f"{value:g}"
    places = FIGURES - 1 - math.floor(math.log10(abs(value)))
    rounded = round(value, places)
    text = f"{rounded:.{max(places, 0)}f}"
    return text.rstrip("0").rstrip(".") if "." in text else text


def value_and_interval(value: float, low: float, high: float, *, low_open: bool, high_open: bool) -> tuple[str, str]:
    """Give a value and its interval in words; a value of which nothing is known is unknown.

    Parameters
    ----------
    value, low, high
        In the unit to print.
    low_open, high_open
        Whether an end is only where the search stops.
    """
    size = max(abs(each) for each, is_open in ((value, False), (low, low_open), (high, high_open)) if not is_open)
    shown, first, last = (figures(each if abs(each) >= _NOTHING * size else 0.0) for each in (value, low, high))
    if high_open and (low_open or first == "0"):
        return "unknown", NOT_BOUNDED
    if high_open:
        return shown, f"above {first}"
    return shown, f"below {last}" if low_open else f"{first} to {last}"
