"""`simulate`: files in, wheel channels out."""

from __future__ import annotations

import numpy as np
import pytest
from bevameter import InputError, SoilKnowledge, simulate
from bevameter.framework.core.recording.wheel_file import read_wheel_file
from bevameter.framework.core.recording.write import write_wheel_file
from bevameter.framework.core.vehicle import Vehicle, Wheel
from bevameter.identification.wheel_soil import Soil, equilibrium

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
    blind = tmp_path / "blind.csv"
    blind.write_text("time_s,load_N\n0,100\n")
    with pytest.raises(InputError, match="no column slip"):
        simulate(VEHICLE, SOIL, blind)
