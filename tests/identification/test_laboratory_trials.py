"""Tables of a laboratory's trials, from the file to the soil."""

import pickle

import numpy as np
import pandas as pd
import pytest
from bevameter import identify, inspect_recording, read_recording
from bevameter.framework.cli.main import app
from bevameter.framework.core.errors import InputError, InputErrors
from bevameter.framework.core.recording.types import Recording, WheelTable
from bevameter.framework.core.recording.wheel_file import read_wheel
from bevameter.framework.core.vehicle import Vehicle
from bevameter.identification.mechanics.soil import Soil
from bevameter.identification.simulate import simulate
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


def _otherwise_defined():
    table = trials()
    slip = table.pop("Slip [%]").to_numpy() / 100.0
    speeds = {"omega [rad/s]": 0.05 / (0.15 * (1.0 - slip)), "V [m/s]": np.full(len(slip), 0.05)}
    return table, slip, speeds


@pytest.mark.parametrize(
    ("definition", "values"),
    [("relative_to_travel", lambda slip: slip / (1.0 - slip)), ("speed_ratio", lambda slip: 1.0 - slip),
     ("rim_to_travel", lambda slip: 1.0 / (1.0 - slip)), ("relative_to_rim", lambda slip: slip)],
)  # fmt: skip
def test_slip_of_another_definition_is_converted_as_the_column_map_says(definition, values, write):
    table, slip, speeds = _otherwise_defined()
    path = write(table.assign(Slip=values(slip)))
    columns = path.parent / "columns.toml"
    columns.write_text(f'[columns]\nslip = {{ column = "Slip", unit = "-", definition = "{definition}" }}\n')
    read = read_wheel(path, columns)
    np.testing.assert_allclose(read.table["slip"], slip, atol=1e-9)
    assert any(f'(definition = "{definition}")' in note for note in read.notes)
    if definition in ("relative_to_travel", "speed_ratio"):  # the speeds contradict what would be assumed
        modest = slip < 0.5
        path = write(table.assign(**{"Slip [-]": values(slip)}, **speeds)[modest])
        line = 'slip = { column = "Slip [-]", definition = "' + definition + '" } under [columns]'
        with pytest.raises(InputError, match=r"by the two speeds and a radius of 0\.15 m") as error:
            _identified(path)
        assert line in str(error.value)


def test_a_definition_that_cannot_be_is_refused_with_the_line_that_mends_it(write):
    table, slip, _ = _otherwise_defined()
    with pytest.raises(InputError, match=r"torque_Nm and drawbar_pull_N fall at like loads .*\"speed_ratio\" }"):
        _identified(write(table.assign(**{"Slip [-]": 1.0 - slip})))
    with pytest.raises(InputError, match=r"1.5.*if it is \(r omega - V\)/V: slip = { column = \"Slip \[-\]\", definit"):
        _identified(write(table.assign(**{"Slip [-]": slip / (1.0 - slip)})))
    columns = write(table).parent / "columns.toml"
    columns.write_text('[columns]\nload_N = { column = "Fz [N]", definition = "slip" }\n')
    with pytest.raises(InputError, match="load_N has a definition, expected one of slip only"):
        read_wheel(columns.parent / "lab.csv", columns)


def test_what_slip_is_taken_for_is_said(write):
    notes = read_wheel(write(trials())).notes
    assert any("slip is 1 - V/(r omega) when driving and r omega/V - 1 when braked" in note for note in notes)


@pytest.mark.parametrize("loads", [(100.0,), (60.0, 150.0)])
def test_trials_with_the_time_of_each_are_trials_however_slip_goes_on(loads, write):
    table = trials(loads=loads, slips=tuple(np.linspace(0.05, 0.6, 12)))
    path = write(table.assign(**{"Time [s]": 10.0 * np.arange(len(table))}))
    found = _identified(path)
    assert found.overall is not None
    assert found.overall.parameters == _identified(write(table, "plain.csv")).overall.parameters
    assert inspect_recording(path, vehicle=path.parent / "vehicle.toml").soil.possible


def test_trials_that_last_seconds_are_one_soils_together(tmp_path):
    """Each is shorter than a stretch of a drive may be, and starts its clock anew."""
    wheel, count, rng = {"radius_m": 0.15, "width_m": 0.12}, 40, np.random.default_rng(2)
    slips, loads = np.meshgrid(np.linspace(0.1, 0.5, 4), [80.0, 120.0, 160.0])
    columns = {
        "time_s": np.tile(0.1 * np.arange(count), 12), "slip": np.repeat(slips.ravel(), count),
        "load_N": np.repeat(loads.ravel(), count),
    }  # fmt: skip
    run = np.repeat([f"t{each}" for each in range(12)], count).astype(object)
    vehicle, soil = Vehicle.model_validate({"wheel": wheel}), Soil(900.0, 0.5, 0.015, 2e5, 1.0)
    table = simulate(vehicle, soil, WheelTable(columns, None, run, tmp_path / "w.csv"))
    noisy = {
        name: values if name == "time_s" else values * (1.0 + 0.01 * rng.standard_normal(len(values)))
        for name, values in table.columns.items()
    }
    found = identify(
        Recording("r", tmp_path, vehicle, None, "", "0" * 64, wheel=WheelTable(noisy, None, run, tmp_path))
    )
    assert [each.n for each in found.segments if each.used] == [480]
    for name in ("c_Pa", "phi_rad"):
        assert found.overall.parameters[name].low <= getattr(soil, name) <= found.overall.parameters[name].high


def test_where_no_row_can_be_used_the_next_command_is_said(write):
    path = write(trials().assign(**{"Sinkage [mm]": 0.1}))
    result = CliRunner().invoke(app, ["identify", str(path), "--vehicle", str(path.parent / "vehicle.toml")])
    assert result.exit_code == 0
    assert "ground too hard to sink into" in result.output
    assert f"next: bevameter inspect {path} --vehicle" in result.output.replace("\n", " ")
    missing = inspect_recording(path, vehicle=path.parent / "vehicle.toml").soil.missing
    assert [(each.what, each.mend) for each in missing] == [
        ("ground that yields", "softer ground or more load; or another unit of sinkage_m")
    ]


def test_columns_without_units_and_unknown_ones_are_named_with_the_faults(write):
    table = trials().rename(columns={"Fz [N]": "Force top", "T [Nm]": "T", "Sinkage [mm]": "Sinkage", "DP [N]": "DP"})
    with pytest.raises(InputErrors) as error:
        read_wheel(write(table))
    first, *lines = str(error.value).splitlines()
    assert first.endswith("1 fault, and 3 in doubt")
    for said in (
        'or sinkage_m = { column = "Sinkage", unit = "mm" } under [columns]',
        'column T: no unit, taken to be SI (expected SI, or torque_Nm = { column = "T", unit = "Nmm" } under [columns]',
        'CHANNEL = { column = "Force top", unit = "..." } under [columns]',
    ):
        assert any(said in line for line in lines), said
    assert [type(each) for each in pickle.loads(pickle.dumps(error.value)).errors] == [InputError]


def test_channels_that_lack_are_named_at_once_with_columns_that_may_be_theirs(write):
    with pytest.raises(InputErrors) as error:
        _identified(write(trials().rename(columns={"Fz [N]": "Force top", "Slip [%]": "Gleiten"})))
    for channel in ("load_N", "slip"):
        line = f'{channel} = {{ column = "Force top", unit = "..." }} under [columns] in a column map (--columns)'
        assert any(f"no column {channel}" in each.problem and line in each.expected for each in error.value.errors)


@pytest.mark.parametrize("channel", ["drawbar_pull_N", "slip"])
def test_an_inverted_channel_is_refused_with_a_line_that_turns_it(channel, write):
    column = {"drawbar_pull_N": "DP [N]", "slip": "Slip [%]"}[channel]
    table = trials()
    path = write(table.assign(**{column: -table[column]}))
    with pytest.raises(InputError) as error:
        _identified(path)
    line = f'{channel} = {{ column = "{column}", scale = -1.0 }}'
    assert f"{line} under [columns] in a column map (--columns)" in str(error.value)
    columns = path.parent / "columns.toml"
    columns.write_text(f"[columns]\n{line}\n")
    turned = read_recording(path, vehicle=path.parent / "vehicle.toml", topics=columns)
    assert identify(turned).overall.parameters == _identified(write(table, "plain.csv")).overall.parameters
