"""Numbers and names as the pages write them: with units, and "unknown" where there is none."""

from __future__ import annotations

import math
from datetime import UTC, datetime

from ...database.observations import Drive
from ..core.soil import Quantity

UNKNOWN = "unknown"


def number(value: float | None, unit: str = "", digits: int = 3) -> str:
    """Write a number; "unknown" where it is None or not finite."""
    if value is None or not math.isfinite(value):
        return UNKNOWN
    return f"{value:.{digits}g} {unit}".rstrip()


def with_sd(value: float, sd: float, unit: str) -> str:
    """Write a number and its standard deviation to the same decimals, two significant ones of the latter."""
    if not math.isfinite(value):
        return UNKNOWN
    if not (math.isfinite(sd) and sd > 0.0):
        return number(value, unit)
    decimals = max(0, 1 - math.floor(math.log10(sd)))
    return f"{value:.{decimals}f} ± {sd:.{decimals}f} {unit}"


def interval(quantity: Quantity, scale: float, unit: str) -> str:
    """Write an estimate and its 95 % interval."""
    value, low, high = (scale * each for each in (quantity.value, quantity.low, quantity.high))
    return f"{number(value)} ({number(low)} to {number(high)}) {unit}"


def moment(when: datetime | None) -> str:
    """Write a moment in UTC."""
    return "time unknown" if when is None else when.astimezone(UTC).strftime("%Y-%m-%d %H:%M:%S UTC")


def age(seconds: float | None) -> str:
    """Write an age in the unit that suits it."""
    if seconds is None or not math.isfinite(seconds):
        return UNKNOWN
    for size, unit in ((86400.0 * 365.25, "years"), (86400.0, "days"), (3600.0, "hours"), (60.0, "minutes")):
        if abs(seconds) >= 2.0 * size:
            return f"{seconds / size:.1f} {unit}"
    return f"{seconds:.0f} s"


def titled(drive: Drive) -> str:
    """Name a drive, and say when it was."""
    return f"{drive.name}, {moment(drive.started)}"


def capital(text: str) -> str:
    """Begin a sentence."""
    return text[:1].upper() + text[1:]
