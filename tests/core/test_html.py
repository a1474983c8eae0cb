"""Sentences on a page of HTML."""

import pytest
from bevameter.framework.core.html import marked


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("the load varies", "The load varies"),
        ("stiffness, and n", "Stiffness, and n"),
        ("c and phi hold", "c and phi hold"),
        ("load_N was not sensed", "load_N was not sensed"),
        ("wheel.csv: no torque", "wheel.csv: no torque"),
        ("vision-real knows sand", "vision-real knows sand"),
        ("", ""),
    ],
)
def test_a_sentence_begins_with_a_capital_and_a_name_as_it_is_written(text, shown):
    assert marked(text) == shown
