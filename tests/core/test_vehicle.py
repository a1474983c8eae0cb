"""A vehicle file's faults are named as they were written."""

from __future__ import annotations

import pytest
from bevameter.framework.core.errors import InputError
from bevameter.framework.core.vehicle import load_vehicle


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("[wheel]\nradius_m = 454\nwidth_m = 300\n", r"key wheel\.radius_m: 454.*less than or equal to 10"),
        ("[wheel]\nradius_m = 0.2\nwidth_m = 0\n", r"key wheel\.width_m: 0.*greater than 0"),
        ("[wheel]\nradius_m = 0.2\n", r"key wheel\.width_m: Field required"),
        ("[[wheels]]\nradius_m = 0.2\nwidth_m = 'b'\n", r"key wheels\.0\.width_m: 'b'"),
    ],
)
def test_a_fault_is_told_by_its_key_and_value(tmp_path, text, said):
    """A wheel of 454 m was one whose file is in millimetres."""
    path = tmp_path / "vehicle.toml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=said):
        load_vehicle(path)


@pytest.mark.parametrize("key", ["position_m", "position"])
def test_the_place_of_a_wheel_has_two_names(tmp_path, key):
    path = tmp_path / "vehicle.toml"
    path.write_text(f"[[wheels]]\nradius_m = 0.2\nwidth_m = 0.1\n{key} = [0.4, -0.3]\n", encoding="utf-8")
    assert load_vehicle(path).wheels[0].position_m == (0.4, -0.3)
