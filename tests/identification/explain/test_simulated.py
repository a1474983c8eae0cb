"""Another simulator's file instead of the textbook wheel: what that simulator lacks is named."""

import csv
from pathlib import Path

import numpy as np
import pytest
from bevameter import explain
from bevameter.framework.scenario import mechanics
from concealed.conceal import conceal


def write_simulation(path: Path, made) -> None:
    """Write what another integrator of the textbook predicts for the recorded load and slip, on the true soil."""
    columns, soil, vehicle = made.recorded.columns, made.truth["soil"], made.vehicle
    load, slip = columns["load_N"], columns["slip"]
    true_soil = mechanics.Soil(*(soil[name] for name in ("c_Pa", "phi_rad", "k_m", "stiffness_Pa", "n")))
    state = mechanics.equilibrium(vehicle["radius_m"], vehicle["width_m"], true_soil, load, slip)
    given = {
        "time_s": columns["time_s"], "load_N": load, "slip": slip, "torque_Nm": state.torque_Nm,
        "sinkage_m": state.sinkage_m, "drawbar_pull_N": state.drawbar_pull_N,
    }  # fmt: skip
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(given)
        writer.writerows(np.column_stack(list(given.values())).tolist())


@pytest.fixture
def made():
    return conceal(5, ("torque_offset",), "plain", "field", samples=80)


def test_a_zero_of_the_recording_is_named_against_another_simulator(tmp_path, made):
    made.write(tmp_path / "drive")
    write_simulation(tmp_path / "simulated.csv", made)
    considered = ("torque_offset", "slip_sinkage")
    answer = explain(tmp_path / "drive", simulated=tmp_path / "simulated.csv", catalogue=considered)
    assert [each.effect for each in answer.missing] == ["torque_offset"]
    found = answer.missing[0].parameters["T_0"]
    assert abs(found.value - made.truth["effects"][0]["comparable"]["T_0"]) < 4.0 * found.sd
    torque = answer.fits["torque_Nm"]
    assert torque.rmse_after < 0.7 * torque.rmse_before
