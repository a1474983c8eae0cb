"""`simulate`: files in, wheel channels out."""

from __future__ import annotations

import numpy as np
import pytest
from bevameter import InputError, SoilKnowledge, simulate
from bevameter.framework.cli.main import app
from bevameter.framework.core.recording.types import WheelTable
from bevameter.framework.core.recording.wheel_file import read_wheel_file, write_wheel_file
from bevameter.framework.core.vehicle import Vehicle, Wheel
from bevameter.identification.effects.catalogue import SLUGS, forms_by_name
from bevameter.identification.effects.parse import NamedEffect, specimen
from bevameter.identification.mechanics.soil import Soil
from bevameter.identification.mechanics.textbook import equilibrium
from bevameter.identification.simulate import notes
from typer.testing import CliRunner

WHEEL = Wheel(radius_m=0.15, width_m=0.12)
VEHICLE = Vehicle(wheels=(WHEEL,))
SOIL = Soil(c_Pa=300.0, phi_rad=np.radians(31.0), k_m=0.012, stiffness_Pa=9e4, n=0.9)


@pytest.fixture
def drive_file(tmp_path):
    path = tmp_path / "drive.csv"
    path.write_text("time_s,load_N,slip,x_m\n0,100,0.1,0\n0.1,120,0.2,1\n0.2,,0.3,2\n0.3,90,-0.2,3\n")
    return path


def test_channels_are_those_of_equilibrium_and_unknown_stays_unknown(drive_file):
    table = simulate(VEHICLE, SOIL, drive_file)
    state = equilibrium(WHEEL, SOIL, np.array([100.0, 120.0, 90.0]), np.array([0.1, 0.2, -0.2]))
    rows = [0, 1, 3]
    np.testing.assert_allclose(table["torque_Nm"][rows], state.torque_Nm)
    np.testing.assert_allclose(table["drawbar_pull_N"][rows], state.drawbar_pull_N)
    assert np.isnan(table["sinkage_m"][2])
    assert list(table["x_m"]) == [0.0, 1.0, 2.0, 3.0]


def test_slip_comes_from_the_two_speeds(tmp_path):
    path = tmp_path / "drive.csv"
    path.write_text("time_s,load_N,wheel_speed_rad_s,travel_speed_m_s\n0,100,1.0,0.12\n")
    assert simulate(VEHICLE, SOIL, path)["slip"][0] == pytest.approx(0.2)


def test_written_tables_are_read_back(tmp_path, drive_file):
    table = simulate(VEHICLE, SOIL, drive_file)
    for name in ("sim.csv", "sim.csv.gz", "sim.parquet"):
        write_wheel_file(table, tmp_path / name)
        again = read_wheel_file(tmp_path / name)
        np.testing.assert_allclose(again["torque_Nm"], table["torque_Nm"], rtol=1e-12)
    with pytest.raises(InputError, match="expected"):
        write_wheel_file(table, tmp_path / "sim.txt")


def test_bad_input_is_named(tmp_path, drive_file):
    with pytest.raises(InputError, match="k_m, stiffness_Pa, n missing"):
        simulate(VEHICLE, SoilKnowledge({"c_Pa": 1.0, "phi_rad": 0.5}), drive_file)
    with pytest.raises(InputError, match="no_such_effect"):
        simulate(VEHICLE, SOIL, drive_file, effects=["no_such_effect"])
    lifted = tmp_path / "lifted.csv"
    lifted.write_text("time_s,load_N,slip\n0,-100,0.1\n0.1,-120,0.2\n")
    with pytest.raises(InputError, match=r"lifted\.csv, column load_N: -110"):
        simulate(VEHICLE, SOIL, lifted)
    blind = tmp_path / "blind.csv"
    blind.write_text("time_s,load_N\n0,100\n")
    with pytest.raises(InputError, match="no column slip"):
        simulate(VEHICLE, SOIL, blind)


def test_no_effect_changes_nothing_and_one_at_its_null_almost_nothing(drive_file):
    plain = simulate(VEHICLE, SOIL, drive_file)
    null = simulate(VEHICLE, SOIL, drive_file, effects=["slip_sinkage:n1=0"])
    rows = [0, 1, 3]
    for column in ("torque_Nm", "sinkage_m"):
        np.testing.assert_allclose(null[column][rows], plain[column][rows], rtol=2e-4)
    assert np.isnan(null["sinkage_m"][2])


def test_effects_act_together(drive_file):
    plain = simulate(VEHICLE, SOIL, drive_file, effects=["slip_sinkage:n1=0"])
    both = simulate(VEHICLE, SOIL, drive_file, effects=["slip_sinkage:n1=0.5", "torque_offset:T_0=20 N cm"])
    once = simulate(VEHICLE, SOIL, drive_file, effects=["slip_sinkage:n1=0.5"])
    rows = [0, 1, 3]
    assert (both["sinkage_m"][rows] > plain["sinkage_m"][rows]).all()
    np.testing.assert_allclose((both["torque_Nm"] - once["torque_Nm"])[rows], 0.2, rtol=1e-9)


def test_rows_come_back_in_their_own_order(tmp_path):
    columns = {
        "time_s": np.array([0.2, 0.0, 0.1]), "load_N": np.full(3, 100.0), "slip": np.full(3, 0.1),
        "pitch_rad": np.array([0.1, 0.2, np.nan]),
    }  # fmt: skip
    drive = WheelTable(columns, None, None, tmp_path / "drive.csv")
    table = simulate(VEHICLE, SOIL, drive, effects=["slope_gravity:s=1"])
    flat = simulate(VEHICLE, SOIL, drive, effects=["slip_sinkage:n1=0"])
    pull = table["drawbar_pull_N"] - flat["drawbar_pull_N"]
    np.testing.assert_allclose(pull[:2], -100.0 * np.tan([0.1, 0.2]))
    assert np.isnan(table["drawbar_pull_N"][2])  # its pitch is not known


@pytest.mark.parametrize(
    ("effect", "said"),
    [
        ("slope_gravity:s=1", "no column pitch_rad"),
        ("multipass_compaction:A=0.3", "no column pass"),
        ("grousers:a_T=0.1,form=ripple", "no column wheel_angle_rad"),
        ("grousers:s=0.5", "no lugs"),
        ("rate_dependence:m=0.1", "no column wheel_speed_rad_s"),
        ("inertia:m=3", r"no column travel_speed_m_s.*time_s"),
        ("slip_sinkage:n1=1e9", "expected 0 to"),
    ],
)
def test_an_effect_that_the_drive_cannot_show_names_what_it_lacks(drive_file, effect, said):
    with pytest.raises(InputError, match=said):
        simulate(VEHICLE, SOIL, drive_file, effects=[effect])


@pytest.mark.parametrize("effect", ["drift:form=torque,d=0.1,tau=5", "drift:form=torque,d1=0.1"])
def test_what_wanders_with_time_needs_a_clock_that_runs(tmp_path, effect):
    path = tmp_path / "drive.csv"
    path.write_text("time_s,load_N,slip\n5,100,0.1\n")
    with pytest.raises(InputError, match=r"column time_s: the same in all rows \(expected a clock that runs"):
        simulate(VEHICLE, SOIL, path, effects=[effect])


@pytest.mark.parametrize("slug", SLUGS)
def test_every_effect_of_the_catalogue_can_be_simulated_on_a_drive_that_has_all_columns(slug, tmp_path):
    situation = specimen()
    drive, rows = situation.drive, len(situation.drive)
    columns = {
        "time_s": drive.time_s, "load_N": drive.load_N, "slip": drive.slip, "pass": drive.pass_number,
        "wheel_speed_rad_s": drive.rim_speed_m_s / 0.15, "travel_speed_m_s": drive.travel_speed_m_s,
        "wheel_angle_rad": drive.wheel_angle_rad, "pitch_rad": drive.pitch_rad, "x_m": drive.x_m,
        "y_m": drive.y_m,
    }  # fmt: skip
    table = WheelTable(columns, None, None, tmp_path / "drive.csv")
    vehicle = Vehicle(wheels=(situation.wheel,))
    for effect in forms_by_name(slug, situation):
        values = {p.name: p.low + 0.4 * (p.high - p.low) for p in effect.parameters}
        answer = simulate(vehicle, SOIL, table, [NamedEffect(slug, values, effect.form)])
        assert np.isfinite(answer["torque_Nm"]).sum() > 0.8 * rows, effect.name


def test_the_command_takes_effects(drive_file, tmp_path):
    vehicle, soil = tmp_path / "vehicle.toml", tmp_path / "soil.toml"
    vehicle.write_text("[wheel]\nradius_m = 0.15\nwidth_m = 0.12\n")
    soil.write_text("c_Pa = 300\nphi_deg = 31\nk_m = 0.012\nstiffness_Pa = 9e4\nn = 0.9\n")
    out = tmp_path / "sim.csv"
    arguments = [
        "simulate", str(drive_file), "--vehicle", str(vehicle), "--soil", str(soil), "--out", str(out),
        "--effect", "slip_sinkage:n1=0.4", "--effect", "bulldozing:s=1",
    ]  # fmt: skip
    assert CliRunner().invoke(app, arguments).exit_code == 0
    written = read_wheel_file(out)
    expected = simulate(VEHICLE, SOIL, drive_file, ["slip_sinkage:n1=0.4", "bulldozing:s=1"])
    np.testing.assert_allclose(written["drawbar_pull_N"], expected["drawbar_pull_N"], rtol=1e-9)
    out.unlink()
    refused = CliRunner().invoke(app, [*arguments, "--effect", "slip_sinkage:n7=1"])
    assert refused.exit_code == 2
    assert "'n7'" in refused.stderr
    assert "exponent]: n1" in refused.stderr
    assert not out.exists()


def test_a_wheel_behind_runs_on_what_the_one_in_front_left():
    """What one wheel leaves on two passes is what the front one leaves for the rear one."""
    place = np.tile(np.linspace(0.0, 4.0, 100), 2)
    later = np.repeat([False, True], 100)
    columns = {
        "time_s": np.tile(0.1 * np.arange(100.0), 2), "load_N": np.full(200, 100.0), "x_m": place,
        "slip": np.where(later, 0.2, np.where(place < 2.0, 0.05, 0.6)), "pass": 1.0 + later,
    }  # fmt: skip
    compaction = ["multipass_compaction:form=by slip,A=1.5,i0=0.2,q=0"]
    alone = {**columns, "time_s": columns["time_s"] + 60.0 * later}
    expected = simulate(VEHICLE, SOIL, WheelTable(alone, None, None, "one wheel"), effects=compaction)["sinkage_m"]
    two = Vehicle(wheels=tuple(Wheel(radius_m=0.15, width_m=0.12, name=name) for name in ("front", "rear")))
    table = WheelTable(columns, np.where(later, "rear", "front"), None, "two wheels")
    found = simulate(two, SOIL, table, effects=compaction)["sinkage_m"]
    np.testing.assert_allclose(found, expected, rtol=1e-9)
    assert expected[later & (place < 1.5)].mean() > 1.1 * expected[later & (place > 2.5)].mean()


def test_rows_without_an_answer_are_counted_and_the_reason_is_reported(tmp_path):
    for name, text in (
        ("vehicle.toml", "[wheel]\nradius_m = 0.15\nwidth_m = 0.12\n"),
        ("soil.toml", "c_Pa = 300\nphi_deg = 31\nk_m = 0.012\nstiffness_Pa = 9e4\nn = 0.9\n"),
        ("drive.csv", "time_s,load_N,slip\n0,-100,.2\n1,0,.2\n2,100,.2\n3,1e6,.2\n4,100,\n5,,0.2\n"),
    ):
        (tmp_path / name).write_text(text)
    files = [str(tmp_path / name) for name in ("drive.csv", "vehicle.toml", "soil.toml", "out.csv")]
    options = ("--vehicle", "--soil", "--out")
    arguments = [files[0], *(each for pair in zip(options, files[1:], strict=True) for each in pair)]
    result = CliRunner().invoke(app, ["simulate", *arguments])
    assert result.exit_code == 0, result.output
    assert "2 of 6 rows have no answer: load or slip is missing" in result.output
    assert "2 of 6 rows have no answer: the load is not above 0 N" in result.output
    assert "1 of 6 rows have no answer: the soil does not carry the load" in result.output
    assert "lugs" not in result.output


def test_lugs_that_are_stated_and_left_out_are_reported(drive_file):
    lugged = Vehicle(wheels=(Wheel(radius_m=0.15, width_m=0.12, grouser_height_m=0.01, grouser_count=12),))
    table = simulate(lugged, SOIL, drive_file)
    assert any("lugs are left out" in note for note in notes(lugged, table))
    assert not any("lugs" in note for note in notes(lugged, table, ["grousers"]))
    assert not any("lugs" in note for note in notes(VEHICLE, table))


def test_several_wheels_need_a_column_that_tells_them_apart(drive_file):
    two = Vehicle(
        wheels=(Wheel(radius_m=0.15, width_m=0.12, name="front"), Wheel(radius_m=0.2, width_m=0.12, name="rear"))
    )
    with pytest.raises(InputError, match=r"drive\.csv: no column wheel.*front or rear"):
        simulate(two, SOIL, drive_file)
