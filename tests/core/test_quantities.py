"""Numbers with units, as people write them."""

from __future__ import annotations

import pytest
from bevameter.framework.core.quantities import magnitude


@pytest.mark.parametrize(
    ("text", "unit", "value"),
    [
        ("20 kPa", "Pa", 2e4), ("20kPa", "Pa", 2e4), ("1.5e3", "Pa", 1500.0), (" +.5 m ", "m", 0.5), ("5.", "m", 5.0),
        ("-3 deg", "rad", -0.05235987755982989), ("30 °", "rad", 0.5235987755982988), ("3 %", "dimensionless", 0.03),
        ("2 1/s", "1/s", 2.0), ("2 s^-1", "1/s", 2.0), ("2 kN m", "N*m", 2000.0), ("2 kN*m", "N*m", 2000.0),
        ("4 cm**2", "m**2", 4e-4), ("4 cm^2", "m**2", 4e-4), ("3 N/(m s)", "N/m/s", 3.0), ("1 MPa/m²", "Pa/m**2", 1e6),
        ("7 µm", "m", 7e-6), ("20 kN·m⁻²", "Pa", 2e4), ("200 mm_Hg", "Pa", 26664.477483),
    ],
)  # fmt: skip
def test_a_number_has_the_unit_written_or_the_usual_one(text, unit, value):
    assert magnitude(text, unit) == pytest.approx(value, rel=1e-12)


@pytest.mark.parametrize(
    "text",
    [
        "20,5 kPa", "1,5", "0.2,5", "2,0", "1_000", "1 000 Pa", "9**9**9", "9**9**9 Pa", "1 Pa**9**9", "1 (9**9**9)",
        "2*3 Pa", "1+1", "1 Pa + 1 Pa", "5 m", "", "Pa", "inf", "nan Pa", "1 furious", "1 Pa**12", "1 Pa; x", "1..2 Pa",
        "1 " + "a" * 10**6,
    ],
)  # fmt: skip
def test_anything_else_is_refused_at_once(text):
    with pytest.raises(ValueError, match=r"no number with a unit|no unit like"):
        magnitude(text, "Pa")
