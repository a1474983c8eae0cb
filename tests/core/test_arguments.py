"""Arguments from Python: numbers and paths that are accepted, and one short line for the rest."""

from __future__ import annotations

import math
from decimal import Decimal
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from bevameter import InputError
from bevameter.framework.core.arguments import number, numbers, path_of, shown, whole

NO_NUMBERS = ("0.2", b"1", None, True, np.bool_(True), [0.2], np.array([0.2]), {}, 1j, 10**400, object())


@pytest.mark.parametrize(
    "value", [0.2, 1, np.float32(0.5), np.int64(3), np.array(0.25), Decimal("0.5"), Fraction(1, 4)]
)
def test_numbers_are_accepted(value):
    assert number("slip", value, "a number") == float(value)
    assert numbers("load_N", [value, value], "numbers").tolist() == [float(value)] * 2


@pytest.mark.parametrize("value", NO_NUMBERS)
def test_a_value_that_is_no_number_is_named_with_its_argument(value):
    with pytest.raises(InputError, match=r"^slip: .*\(expected a number\)$") as caught:
        number("slip", value, "a number")
    assert len(str(caught.value)) < 130


@pytest.mark.parametrize("values", ["a", None, [1.0, None], [1.0, "2"], [[1.0], [1.0, 2.0]], [True], [1j], [10**400]])
def test_values_that_are_no_numbers_are_named_with_their_argument(values):
    with pytest.raises(InputError, match=r"^load_N: .*\(expected numbers\)$"):
        numbers("load_N", values, "numbers")


def test_arrays_keep_their_shape_and_are_copies():
    given = np.arange(6.0).reshape(3, 2)
    taken = numbers("path", given, "numbers")
    taken[0, 0] = 9.0
    assert taken.shape == (3, 2)
    assert given[0, 0] == 0.0
    assert numbers("path", [], "numbers").shape == (0,)
    assert math.isnan(numbers("path", [math.nan], "numbers")[0])


@pytest.mark.parametrize("value", [-1, 1.5, "a", None, True, [1]])
def test_a_seed_is_a_whole_number(value):
    with pytest.raises(InputError, match=r"seed: .*expected a whole number, not negative"):
        whole("seed", value)
    assert whole("seed", np.int32(7)) == 7


def test_a_path_is_a_text_or_a_path():
    assert path_of("file", "a.csv", "a path") == path_of("file", Path("a.csv"), "a path")
    for value in (None, 5, {"radius_m": 0.15}, b"a.csv"):
        with pytest.raises(InputError, match=r"^file: "):
            path_of("file", value, "a path")


def test_values_are_shown_shortened():
    nested: list = []
    for _ in range(100_000):
        nested = [nested]
    assert len(shown("x" * 1000)) == 80
    assert shown(10**5000) == "a int too large to be shown"
    assert shown(nested) == "a list too large to be shown"
