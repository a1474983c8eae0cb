"""What a program hands over in Python: a number, a path or an object of ours, or one line that names the argument."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from .errors import InputError

_SHOWN = 80
"""Characters of a value that are shown at most [-]."""


def shown(value: object) -> str:
    """Give a value for a message, shortened: some are too large, or nested too deeply, to be written."""
    try:
        return f"{value!r:.{_SHOWN}}"
    except (ValueError, RecursionError):
        return f"a {type(value).__name__} too large to be shown"


def refused(name: str, value: object, expected: str) -> InputError:
    """Give the error that an argument of that name is not what was `expected`."""
    return InputError(name, shown(value), expected=expected)


def number(name: str, value: object, expected: str) -> float:
    """Give one number.

    Raises
    ------
    InputError
        It is none: a text that reads as one, a truth value and an array are none either.
    """
    try:
        if isinstance(value, bool | np.bool_ | str | bytes | bytearray) or getattr(value, "ndim", 0):
            raise refused(name, value, expected)
        return float(value)  # type: ignore[arg-type]
    except (TypeError, ValueError, OverflowError):
        raise refused(name, value, expected) from None


def numbers(name: str, values: ArrayLike, expected: str) -> np.ndarray:
    """Give an array of numbers, of whatever shape.

    Raises
    ------
    InputError
        One of them is none, as `number` has it, or rows are of several lengths.
    """
    try:
        array = np.asarray(values)
    except (TypeError, ValueError):
        raise refused(name, values, expected) from None
    if array.dtype.kind == "O":
        try:
            return np.array([number(name, each, expected) for each in array.flat], dtype=float).reshape(array.shape)
        except InputError:
            raise refused(name, values, expected) from None
    if array.dtype.kind not in "iuf":
        raise refused(name, values, expected)
    return array.astype(float)


def whole(name: str, value: object, expected: str = "a whole number, not negative") -> int:
    """Give a whole number that is not negative.

    Raises
    ------
    InputError
        It is none.
    """
    if isinstance(value, bool) or not isinstance(value, int | np.integer) or value < 0:
        raise refused(name, value, expected)
    return int(value)


def path_of(name: str, value: object, expected: str) -> Path:
    """Give a path.

    Raises
    ------
    InputError
        It is none.
    """
    if not isinstance(value, str | os.PathLike):
        raise refused(name, value, expected)
    return Path(value)
