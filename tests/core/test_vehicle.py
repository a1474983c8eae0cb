"""Faults of a vehicle file are named by key and value."""

from __future__ import annotations

import re

import numpy as np
import pytest
from bevameter.framework.core.errors import InputError
from bevameter.framework.core.recording.topic_map import load_topic_map
from bevameter.framework.core.soil import load_soil
from bevameter.framework.core.vehicle import Wheel, load_vehicle


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("[wheel]\nradius_m = 454\nwidth_m = 300\n", r"key wheel\.radius_m: 454.*less than or equal to 10"),
        ("[wheel]\nradius_m = 0.2\nwidth_m = 0\n", r"key wheel\.width_m: 0.*greater than 0"),
        ("[wheel]\nradius_m = 0.2\n", r"key wheel\.width_m: Field required"),
        ("[[wheels]]\nradius_m = 0.2\nwidth_m = 'b'\n", r"key wheels\.0\.width_m: 'b'"),
        ("[wheel]\nradius_m = '0.2'\nwidth_m = 0.1\n", r"key wheel\.radius_m: '0\.2', expected a number"),
        ("[wheel]\nradius_m = true\nwidth_m = 0.1\n", r"key wheel\.radius_m: True, expected a number"),
        ("[wheel]\nradius_m = nan\nwidth_m = 0.1\n", r"key wheel\.radius_m: nan, expected metres"),
        ("[wheel]\nradius_m = 0.2\nwidth_m = 0.1\ngrouser_count = true\n", r"grouser_count: True, expected a number"),
        (
            "[wheel]\nradius_m = 0.15\nwidth_m = 0.1\ngrouser_height_m = 15.0\n",
            r"key wheel\.grouser_height_m: 15, expected metres, at most the wheel's radius, 0\.15",
        ),
        ("[wheel]\nradius_m = -1\nwidth_m = 0.1\ngrouser_height_m = 15.0\n", r"key wheel\.radius_m: -1, expected"),
        ("[wheel]\ndiameter_m = 0.4\nwidth_m = 0.1\n", r"key wheel: diameter_m = 0\.4, .*radius_m = diameter / 2"),
        ("[wheel]\nradus_m = 0.2\nwidth_m = 0.1\n", r"key wheel\.radus_m: no such key"),
        ("[wheel]\nradius_m = 0.2\nwidth_m = 0.1\n[noise]\nload_N = true\n", r"key noise\.load_N: True"),
    ],
)
def test_a_fault_is_named_by_its_key_and_value(tmp_path, text, said):
    """A radius of 454 m is one in millimetres."""
    path = tmp_path / "vehicle.toml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=said):
        load_vehicle(path)


@pytest.mark.parametrize(
    ("width", "said"),
    [
        ("1" + 400 * "0", r"key wheel\.width_m: a whole number of 401 digits .*no more than 64 bits"),
        ("[0, [9223372036854775808]]", r"key wheel\.width_m\.1\.0: a whole number of 19 digits"),
        (5001 * "1", r"x\.toml: a whole number of more than \d+ digits .*no more than 64 bits"),
        (3000 * "[" + 3000 * "]", r"x\.toml: nested too deeply"),
        (f"'{400 * 'a'}'", r"key wheel\.width_m: 'a{79}, expected a number$"),
    ],
)
@pytest.mark.parametrize("read", [load_vehicle, load_soil, load_topic_map])
def test_numbers_and_nesting_that_toml_does_not_have_are_one_short_line(tmp_path, width, said, read):
    path = tmp_path / "x.toml"
    path.write_text(f"[wheel]\nradius_m = 0.2\nwidth_m = {width}\n", encoding="utf-8")
    with pytest.raises(InputError) as caught:
        read(path)
    assert len(str(caught.value)) < len(str(path)) + 200
    if read is load_vehicle or "'" not in said:
        assert re.search(said, str(caught.value))


@pytest.mark.parametrize("coefficients", ["0.1", "1e300, 1e300", "0.1, 0.1, 0.1, 0.1, 0.1, 0.1"])
def test_a_lens_has_four_or_five_coefficients(tmp_path, coefficients):
    path = tmp_path / "vehicle.toml"
    camera = (
        "matrix = [[400.0, 0, 320], [0, 400, 240], [0, 0, 1]]\nwidth_px = 640\nheight_px = 480\nheight_m = 1\n"
        "pitch_rad = 0.4\n"
    )
    wheel = "[wheel]\nradius_m = 0.2\nwidth_m = 0.1\n"
    path.write_text(f"{wheel}[camera]\n{camera}distortion = [{coefficients}]\n", encoding="utf-8")
    with pytest.raises(InputError, match=r"key camera\.distortion: \d numbers, expected k1, k2, p1, p2"):
        load_vehicle(path)
    path.write_text(f"{wheel}[camera]\n{camera}distortion = [0.1, 0, 0, 0, 0.01]\n", encoding="utf-8")
    assert load_vehicle(path).camera.distortion[0] == 0.1


def test_numbers_of_other_libraries_and_a_byte_order_mark_are_taken(tmp_path):
    path = tmp_path / "vehicle.toml"
    path.write_text("[wheel]\nradius_m = 0.2\nwidth_m = 0.1\n", encoding="utf-8-sig")
    wheel = Wheel(radius_m=np.float32(0.25), width_m=np.float64(0.1), grouser_count=np.int64(8))
    assert load_vehicle(path).wheels[0].radius_m == 0.2
    assert (wheel.radius_m, wheel.grouser_count) == (0.25, 8)


@pytest.mark.parametrize("key", ["position_m", "position"])
def test_the_place_of_a_wheel_has_two_names(tmp_path, key):
    path = tmp_path / "vehicle.toml"
    path.write_text(f"[[wheels]]\nradius_m = 0.2\nwidth_m = 0.1\n{key} = [0.4, -0.3]\n", encoding="utf-8")
    assert load_vehicle(path).wheels[0].position_m == (0.4, -0.3)
