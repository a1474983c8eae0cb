"""Templates of common robots: each reads as it is, or its reading names the number that is to be measured."""

from __future__ import annotations

import re

import pytest
from bevameter.framework.cli.main import app
from bevameter.framework.core.errors import InputError
from bevameter.framework.core.vehicle import load_vehicle
from bevameter.framework.core.vehicle_templates import vehicle_template, vehicle_templates
from typer.testing import CliRunner

TEMPLATES = vehicle_templates()


@pytest.mark.parametrize("name", TEMPLATES)
def test_every_number_has_a_source_and_what_has_none_is_named(name, tmp_path):
    template = TEMPLATES[name]
    assert template.data["name"] == name
    sources = set(re.findall(r"^#   \[(\d)\] https://\S+/blob/\w{12}/\S+$", template.text, re.MULTILINE))
    assert sources == set(re.findall(r"\[(\d)\]", template.text))
    first = template.text.split("[[wheels]]")[1]
    stated = [
        line
        for line in (template.text.split("[[wheels]]")[0] + first).splitlines()
        if re.match(r"\w+ = -?[\d\[]", line)
    ]
    assert stated
    assert all(re.search(r"  # .*\[\d\]|\[\d, \d\]", line) for line in stated), stated
    path = tmp_path / "vehicle.toml"
    assert CliRunner().invoke(app, ["vehicle", name, "--out", str(path)]).exit_code == 0
    missing = [each for each in template.left_out if each in ("width_m", "radius_m")]
    if missing:
        with pytest.raises(InputError, match=rf"key wheels\.0\.{missing[0]}"):
            load_vehicle(path)
    else:
        assert len(load_vehicle(path).wheels) == len(template.data["wheels"])


def test_geometry_agrees_with_what_the_makers_state():
    """The Leo Rover's drive states a wheel separation of 0.358 m, the Husky's driver a wheel diameter of 0.3302 m."""
    leo, husky = (vehicle_template(name).data["wheels"] for name in ("leo-rover", "husky-a200"))
    assert leo[0]["position_m"][1] - leo[1]["position_m"][1] == pytest.approx(0.358, abs=1e-3)
    assert 2 * husky[0]["radius_m"] == pytest.approx(0.3302)


def test_no_file_is_written_over(tmp_path):
    path = tmp_path / "vehicle.toml"
    path.write_text("mine")
    for arguments in (["husky-a200", "--out", str(path)], ["huskey"], []):
        result = CliRunner().invoke(app, ["vehicle", *arguments])
        assert result.exit_code == 2
        assert len(result.stderr.splitlines()) == 1
    assert path.read_text() == "mine"
