"""Another simulator's answers put beside a recording's rows: only where it has some, or close by on both sides."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from bevameter import InputError, explain
from bevameter.framework.core.recording.types import WheelTable
from bevameter.framework.core.recording.wheel_file import read_wheel_file
from bevameter.framework.core.recording.write import write_wheel_file
from bevameter.framework.core.soil import SoilKnowledge
from bevameter.framework.scenario.concealed.conceal import conceal
from bevameter.identification.identify import felt_rows, open_recording
from bevameter.identification.mismatch.fit.load_and_slip import gathered
from bevameter.identification.mismatch.fit.samples import SIMULATED
from bevameter.identification.mismatch.fit.simulated import as_differences, attach
from bevameter.identification.mismatch.fit.textbook import fit_textbook
from bevameter.identification.simulate import simulate

TIME_S = 0.1 * np.arange(300)


def beside(folder, time_s, wheel=None) -> np.ndarray:
    """Simulated torque (300,) beside a recording's rows, where it is a ramp of time."""
    path = folder / "sim.csv"
    write_wheel_file(WheelTable({"time_s": time_s, "torque_Nm": 2.0 * time_s}, wheel, None, path), path)
    imposed = {"load_N": np.full(300, 60.0), "slip": np.full(300, 0.1)}
    recorded = WheelTable({"time_s": TIME_S, "torque_Nm": np.zeros(300), **imposed}, wheel, None, "made")
    return attach(recorded, path)[SIMULATED + "torque_Nm"]


@pytest.mark.parametrize("every", [1, 2])
def test_a_simulation_at_half_the_rate_is_interpolated(tmp_path, every):
    times = beside(tmp_path, TIME_S[::every])
    covered = TIME_S[::every][-1] >= TIME_S
    np.testing.assert_allclose(times[covered], 2.0 * TIME_S[covered], atol=1e-9)
    assert np.isnan(times[~covered]).all()


@pytest.mark.parametrize("every", [3, 7])
def test_a_coarser_one_answers_at_its_own_rows_only(tmp_path, every):
    """Between them load and slip may have stepped: a straight line there was once taken for a patch of soil."""
    times = beside(tmp_path, TIME_S[::every])
    answered = np.isfinite(times)
    np.testing.assert_array_equal(np.flatnonzero(answered), np.arange(0, 300, every))
    np.testing.assert_allclose(times[answered], 2.0 * TIME_S[::every], atol=1e-9)


def test_one_that_answers_too_seldom_is_refused(tmp_path, explained):
    folder, write = explained
    write(slice(None, None, 7))
    with pytest.raises(InputError, match=r"values for \d+ of \d+ rows .*as often as it was recorded"):
        folder_explained(folder)


def test_rows_that_were_not_simulated_are_said_to_be_left_out(explained):
    folder, write = explained
    write(slice(None, 900))
    answer = folder_explained(folder)
    assert any("rows have no simulated value: they are left out" in note for note in answer.notes)
    assert 890 < answer.n <= 900, "gross errors aside"


def test_what_is_simulated_but_was_not_recorded_is_left_out(tmp_path):
    made = conceal(404, ("torque_offset",), "plain", protocol="steady")
    folder = made.write(tmp_path / "made")
    recorded = read_wheel_file(folder / "wheel.csv")
    soil = SoilKnowledge({"c_Pa": 1000.0, "phi_rad": 0.5, "k_m": 0.02, "stiffness_Pa": 2e5, "n": 0.9})
    write_wheel_file(simulate(folder / "vehicle.toml", soil, recorded), tmp_path / "sim.csv")
    without = {name: values for name, values in recorded.columns.items() if name != "drawbar_pull_N"}
    write_wheel_file(replace(recorded, columns=without), folder / "wheel.csv")
    answer = explain(folder, simulated=tmp_path / "sim.csv", catalogue=["torque_offset"])
    assert set(answer.fits) == {"torque_Nm", "sinkage_m"}
    assert "drawbar_pull_N is simulated but not recorded: it is left out" in answer.notes
    simulated = read_wheel_file(tmp_path / "sim.csv")
    pull = {name: simulated[name] for name in ("load_N", "slip", "drawbar_pull_N")}
    write_wheel_file(replace(simulated, columns=pull), tmp_path / "sim.csv")
    with pytest.raises(InputError, match=r"has no answer that was recorded \(expected torque_Nm or sinkage_m\)"):
        explain(folder, simulated=tmp_path / "sim.csv", catalogue=["torque_offset"])


@pytest.mark.parametrize(("protocol", "at"), [("field", "recorded"), ("bench", "its own"), ("steady", "its own")])
def test_our_own_wheel_as_the_other_simulator_leaves_what_it_leaves_alone(tmp_path, protocol, at):
    """Errors of load and slip, which the simulator was given as well, once counted twice."""
    made = conceal(405, (), "plain", protocol=protocol)
    folder = made.write(tmp_path / "made")
    drive = read_wheel_file(folder / "wheel.csv")
    if at == "its own":
        drive = replace(drive, columns={**drive.columns, "load_N": 1.1 * drive["load_N"], "slip": 0.9 * drive["slip"]})
    soil = SoilKnowledge(made.truth["soil"])
    write_wheel_file(simulate(folder / "vehicle.toml", soil, drive), tmp_path / "sim.csv")
    rows = felt_rows(open_recording(folder, None))
    samples = gathered(attach(rows.table, tmp_path / "sim.csv"), rows.wheel, rows.vehicle, SoilKnowledge())
    differences, own = as_differences(samples, tmp_path / "sim.csv")
    alone, beside = (fit_textbook(each)[1] for each in (samples, differences))
    np.testing.assert_allclose(beside.noise.answers, alone.noise.answers, rtol=0.02)
    assert beside.score == pytest.approx(alone.score, abs=1.0)
    np.testing.assert_array_equal(own, samples.measured - samples.simulated)


def test_a_simulated_wheel_that_is_stuck_answers_nothing(tmp_path):
    torque, slip, load = np.ones(300), np.linspace(-1.0, 1.0, 300), np.full(300, 50.0)
    load[:3] = -1.0
    columns = {"time_s": TIME_S, "torque_Nm": torque, "slip": slip, "load_N": load}
    path = tmp_path / "sim.csv"
    write_wheel_file(WheelTable(columns, None, None, path), path)
    recorded = {"time_s": TIME_S, "torque_Nm": np.zeros(300), "slip": np.full(300, 0.1), "load_N": np.full(300, 60.0)}
    beside_it = attach(WheelTable(recorded, None, None, "made"), path)
    np.testing.assert_array_equal(np.isfinite(beside_it[SIMULATED + "torque_Nm"]), (slip < 0.995) & (load > 0.0))
    np.testing.assert_allclose(beside_it[SIMULATED + "slip"], slip)
    columns["slip"] = np.ones(300)
    write_wheel_file(WheelTable(columns, None, None, path), path)
    with pytest.raises(InputError, match=r"a wheel that carries load and moves \(expected load_N above 0 and slip"):
        attach(WheelTable(recorded, None, None, "made"), path)


@pytest.fixture
def explained(tmp_path):
    """A recording without an effect, and how to write some of its own rows as the simulation."""
    made = conceal(404, (), "plain", protocol="field")
    folder = made.write(tmp_path / "recording")

    def write(rows: slice) -> None:
        columns = {name: made.recorded.columns[name] for name in ("time_s", "torque_Nm", "sinkage_m")}
        table = WheelTable({name: values[rows] for name, values in columns.items()}, None, None, "sim")
        write_wheel_file(table, tmp_path / "sim.csv")

    return folder, write


def folder_explained(folder):
    return explain(folder, simulated=folder.parent / "sim.csv", catalogue=["slope_gravity", "torque_offset"])
