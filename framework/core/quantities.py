"""Quantities that people write, a number and its unit, and numbers that files hold."""

from __future__ import annotations

import math
import re

_WRITTEN = re.compile(r"\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:e[+-]?\d+)?)(?![\d.,_])\s*(.*?)\s*", re.ASCII | re.IGNORECASE)
_UNIT = re.compile(r"(?:[^\W\d]|[%° ·*/()⁻]|(?<=[^\W\d])(?:\*\*|\^)?-?\d(?!\d)|(?<!\w)1(?=/))*")
"""Letters, and powers of these of one digit: no arithmetic, which may take for ever."""

_LONGEST = 80
"""Letters of a quantity: of many more it takes minutes to say that they are no unit."""


def magnitude(text: str, unit: str) -> float:
    """Read one number with a decimal point, and its unit if it has one of its own.

    Parameters
    ----------
    text
        As written: ``"20 kPa"``.
    unit
        Of the answer, as pint spells it, and of the number where it has none.

    Raises
    ------
    ValueError
        It is something else: arithmetic, a decimal comma, another dimension.
    """
    import pint

    written = _WRITTEN.fullmatch(text) if len(text) <= _LONGEST else None
    if written is None or _UNIT.fullmatch(written[2]) is None:
        raise ValueError(f"{text!r} is no number with a unit")
    try:
        return float(pint.Quantity(float(written[1]), written[2] or unit).m_as(unit))
    except Exception as error:  # pint raises its own, and the tokenizer's, errors for what it cannot read
        raise ValueError(f"{written[2]!r} is no unit like {unit!r}") from error


def finite_or_none(value: float) -> float | None:
    """Give a number, or None where it is not finite: neither JSON nor SQL knows NaN alike everywhere."""
    return float(value) if math.isfinite(value) else None
