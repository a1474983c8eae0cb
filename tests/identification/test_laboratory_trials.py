"""Tables of a laboratory's trials, from the file to the soil."""

import pandas as pd
import pytest
from bevameter import identify
from bevameter.framework.cli.main import app
from bevameter.framework.core.recording.wheel_file import read_wheel
from trial_table import LOAM, SAND, VEHICLE, trials
from typer.testing import CliRunner


@pytest.fixture
def write(tmp_path):
    (tmp_path / "vehicle.toml").write_text(VEHICLE)

    def write_table(frame, name="lab.csv"):
        path = tmp_path / name
        frame.to_csv(path, index=False)
        return path

    return write_table


def _identified(path, **options):
    return identify(path, vehicle=path.parent / "vehicle.toml", **options)


def test_soils_that_a_column_names_are_identified_each_by_itself(write):
    both = pd.concat([trials(SAND).assign(Material="sand"), trials(LOAM, seed=1).assign(Material="loam")])
    path = write(both.assign(Operator="HM"))
    found = _identified(path)
    assert found.overall is None
    for name, soil in (("sand", SAND), ("loam", LOAM)):
        alone = _identified(write((trials(soil, seed=int(name == "loam"))), "alone.csv")).overall
        assert found.by_soil[name].parameters == alone.parameters
        phi = found.by_soil[name].parameters["phi_rad"]
        assert phi.low < soil.phi_rad < phi.high
    assert [segment.soil for segment in found.segments] == ["sand", "loam"]
    assert _identified(path, on="loam").overall.parameters == found.by_soil["loam"].parameters
    printed = CliRunner().invoke(app, ["identify", str(path), "--vehicle", str(path.parent / "vehicle.toml")]).output
    assert "steady-state trials, loam" in printed
    assert "columns of text not used: Operator" in printed


def test_a_column_that_may_name_the_soil_is_named_with_the_line_that_says_so(write):
    both = pd.concat([trials().assign(Bett="A"), trials(LOAM).assign(Bett="B")])
    (problem,) = read_wheel(write(both)).problems
    assert problem.endswith(
        'columns of text not used: Bett; where one names the soil: soil = "Bett" under [columns] in a column map'
    )
    path = write(both)
    (path.parent / "columns.toml").write_text('[columns]\nsoil = "Bett"\n')
    assert set(read_wheel(path, path.parent / "columns.toml").table.soil) == {"A", "B"}
    remarks = trials().assign(Soil=[f"as found {row}" for row in range(24)])
    assert read_wheel(write(remarks)).table.soil is None
