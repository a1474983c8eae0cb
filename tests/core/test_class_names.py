"""Names of classes: those that nothing would match are refused."""

from __future__ import annotations

import pytest
from bevameter import InputError
from bevameter.framework.core.class_names import check_spelling


@pytest.mark.parametrize("name", ["Sand", "sand ", " sand", "s and", "ｓand", "Grès", "GRÈS"])
def test_a_name_is_spelt_as_it_is_known(name):
    with pytest.raises(InputError, match=r"class_name: a class named .*expected '(sand|grès)', as it is spelt here"):
        check_spelling(name, ({"sand", "grès"},), "class_name")


@pytest.mark.parametrize("name", ["unknown", "Unknown ", "", " ", "a\nb"])
def test_an_invalid_name_is_refused_though_it_is_known(name):
    with pytest.raises(InputError, match="class_name"):
        check_spelling(name, ({name},), "class_name")


def test_a_name_that_is_known_or_of_a_class_to_come_is_taken():
    check_spelling("sand ", ({"sand "},), "class_name")
    check_spelling("moon dust", ({"sand"}, set()), "class_name")
    with pytest.raises(InputError, match="no spaces at its ends"):
        check_spelling("moon dust ", ({"sand"},), "class_name")


def test_the_first_names_that_are_alike_count():
    check_spelling("sand", ({"sand"}, {"Sand"}), "class_name")
    with pytest.raises(InputError, match="'sand'"):
        check_spelling("Sand", ({"sand"}, {"Sand"}), "class_name")
    with pytest.raises(InputError, match="'Sand'"):
        check_spelling("sand", ({"clay"}, {"Sand"}), "class_name")
