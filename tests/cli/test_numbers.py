"""Numbers, intervals and advice as people read them."""

import numpy as np
import pytest
from bevameter.framework.core.errors import InputError
from bevameter.framework.core.numbers import figures, value_and_interval
from bevameter.framework.core.soil import PLAUSIBLE, Quantity, ShearStrength
from bevameter.framework.core.vehicle_templates import vehicle_template
from bevameter.identification.estimate.identifiability import advise, is_unbounded
from bevameter.identification.estimate.tables import interval_text


@pytest.mark.parametrize(
    ("value", "text"),
    [(0.0, "0"), (48843.2, "48800"), (0.87931, "0.879"), (12.996, "13"), (0.00012345, "0.000123"), (-5.5512, "-5.55"),
     (99.96, "100"), (180.0, "180")],
)  # fmt: skip
def test_three_figures(value, text):
    assert figures(value) == text


@pytest.mark.parametrize(
    ("numbers", "low_open", "high_open", "shown"),
    [((1.733e-5, 0.0, 5.39), False, False, ("0", "0 to 5.39")),
     ((1.087, 0.1, 200.0), True, True, ("unknown", "not bounded by these data")),
     ((0.0, 0.0, 200.0), False, True, ("unknown", "not bounded by these data")),
     ((0.961, 0.1531, 3.0), False, True, ("0.961", "above 0.153")),
     ((0.5, 0.1, 0.9), True, False, ("0.5", "below 0.9")), ((0.8, 1e-9, 2.49), False, False, ("0.8", "0 to 2.49"))],
)  # fmt: skip
def test_values_with_their_intervals(numbers, low_open, high_open, shown):
    assert value_and_interval(*numbers, low_open=low_open, high_open=high_open) == shown


def test_a_parameter_that_is_not_determined_is_an_interval_alone():
    found = {"c_Pa": Quantity(0.0, 1e3, 0.0, 5e3), "phi_rad": Quantity(1.0, 0.1, 0.0, PLAUSIBLE["phi_rad"][1])}
    assert interval_text(found, "c_Pa", {"c_Pa": False}) == "not determined: 0.00 to 5.00"
    assert interval_text(found, "c_Pa", {"c_Pa": True}) == "0.00 (0.00 to 5.00)"
    assert interval_text(found, "phi_rad", {"phi_rad": False}) == "not determined: not bounded"
    assert interval_text(found, "k_m", {}) == ""


def _advice(low_Pa, high_Pa, *, loads=(80.0, 80.0), slips=(0.03, 0.55), determined=()):
    n = 40
    channels = np.column_stack([
        np.linspace(*loads, n), np.ones(n), np.full(n, 0.01), np.linspace(*slips, n), np.ones(n)
    ])  # fmt: skip
    names = ("c_Pa", "phi_rad", "k_m", "stiffness_Pa", "n")
    strength = [ShearStrength(5e3, 4e3, low_Pa, high_Pa)]
    return advise(channels, {name: name in determined for name in names}, strength, 1.0)


def test_advice_agrees_with_the_intervals_and_with_what_was_driven():
    assert "though the shear strength c + sigma tan(phi) is: vary the load" in _advice(3.8e3, 4.3e3)
    assert "nor is the shear strength: vary the load by half" in _advice(0.0, 200e3)
    assert "(now 80 to 80 N)" in _advice(3.8e3, 4.3e3)
    assert "for the load varies enough (" in _advice(3.8e3, 4.3e3, loads=(60.0, 110.0))
    assert "for slip varies enough (0.06 to 0.52)" not in _advice(3.8e3, 4.3e3, slips=(0.1, 0.2))
    assert "measure at slips from 0.05 to 0.3, too (now 0.10 to 0.20)" in _advice(3.8e3, 4.3e3, slips=(0.1, 0.2))
    assert "slips from" not in _advice(3.8e3, 4.3e3, slips=(0.01, 0.44))
    assert _advice(3.8e3, 4.3e3, determined=("c_Pa", "k_m", "stiffness_Pa", "n")).startswith(
        "friction is not determined"
    )


def test_a_strength_is_bounded_where_its_end_is_not_where_the_search_stops():
    def unbounded(high_Pa, high_rad):
        return is_unbounded(ShearStrength(9e3, 3.5e3, 3e3, high_Pa), {"phi_rad": Quantity(0.3, 0.1, 0.0, high_rad)})

    assert unbounded(200e3, 0.5)
    assert unbounded(19e3, np.radians(60.0))
    assert not unbounded(19e3, np.radians(59.0))
    assert not unbounded(9e3, np.radians(60.0))


@pytest.mark.parametrize(("given", "near"), [("husky", "husky-a200"), ("jakal", "jackal-j100"), ("A200", "husky-a200")])
def test_the_nearest_template_is_named(given, near):
    with pytest.raises(InputError, match=f"no template '{given}' .expected {near}: bevameter vehicle {near}; or"):
        vehicle_template(given)
