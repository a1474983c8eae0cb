"""Another simulator's answers put beside a recording's rows: only where it has some, or close by on both sides."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from bevameter import InputError, Vehicle, Wheel, explain, load_vehicle
from bevameter.framework.core.recording.types import WheelTable
from bevameter.framework.core.recording.wheel_file import derive, read_wheel_file, slip_from_speeds, write_wheel_file
from bevameter.framework.core.soil import SoilKnowledge
from bevameter.identification.felt_rows import felt_rows
from bevameter.identification.identify import open_recording
from bevameter.identification.mechanics.soil import Soil
from bevameter.identification.mechanics.textbook import equilibrium
from bevameter.identification.mismatch.fit.beside import attach
from bevameter.identification.mismatch.fit.load_and_slip import gathered
from bevameter.identification.mismatch.fit.samples import SIMULATED
from bevameter.identification.mismatch.fit.simulated import as_differences
from bevameter.identification.mismatch.fit.textbook import fit_textbook
from bevameter.identification.simulate import simulate
from concealed.conceal import conceal

TIME_S = 0.1 * np.arange(300)


WHEEL = Wheel(radius_m=0.2, width_m=0.1)
RECORDED = {"time_s": TIME_S, "torque_Nm": np.zeros(300), "load_N": np.full(300, 60.0), "slip": np.full(300, 0.1)}


def attached(folder, columns, recorded=None, **labels) -> WheelTable:
    """What another simulator gives in a file's columns, beside a recording's rows."""
    path = folder / "sim.csv"
    write_wheel_file(WheelTable(columns, labels.get("wheel"), labels.get("run"), path), path)
    columns = RECORDED if recorded is None else recorded
    return attach(WheelTable(columns, labels.get("wheel"), labels.get("runs"), "made"), path, WHEEL)


def beside(folder, time_s) -> np.ndarray:
    """Simulated torque (300,) beside a recording's rows, where it is a ramp of time."""
    return attached(folder, {"time_s": time_s, "torque_Nm": 2.0 * time_s})[SIMULATED + "torque_Nm"]


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
    with pytest.raises(InputError, match=r"moves for \d+ of \d+ rows .*as often as it was recorded"):
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


def compared(folder, simulated):
    """Fits of a recording's textbook wheel, by itself and beside another simulator, and what that misses (n, 5)."""
    path = folder.parent / "sim.csv"
    write_wheel_file(simulated, path)
    rows = felt_rows(open_recording(folder, None))
    samples = gathered(attach(rows.table, path, rows.wheel), rows.wheel, rows.vehicle, SoilKnowledge())
    differences, missed = as_differences(samples, path)
    return differences, *(fit_textbook(each)[1] for each in (samples, differences)), missed


@pytest.fixture(scope="module", params=["field", "bench", "steady"])
def ours(request, tmp_path_factory):
    return our_own(request.param, tmp_path_factory.mktemp("ours"))


@pytest.fixture(scope="module")
def ours_steady(tmp_path_factory):
    return our_own("steady", tmp_path_factory.mktemp("ours"))


def our_own(protocol, place):
    """A recording without an effect, and our own wheel on its very soil at a load and a slip of any size."""
    made = conceal(405, (), "plain", protocol=protocol)
    folder = made.write(place / "made")
    drive = read_wheel_file(folder / "wheel.csv")
    if "slip" not in drive:
        drive = derive(drive, load_vehicle(folder / "vehicle.toml").wheels[0])

    def simulated(load=1.0, slip=1.0, speed=1.0):
        changed = {"load_N": load * drive["load_N"], "slip": slip * drive["slip"]}
        if speed != 1.0:
            changed["travel_speed_m_s"] = speed * drive["travel_speed_m_s"]
            radius = load_vehicle(folder / "vehicle.toml").wheels[0].radius_m
            changed["slip"] = slip_from_speeds(radius * drive["wheel_speed_rad_s"], changed["travel_speed_m_s"])
        given = replace(drive, columns={**drive.columns, **changed})
        return simulate(folder / "vehicle.toml", SoilKnowledge(made.truth["soil"]), given)

    return folder, simulated


def without(table: WheelTable, *names: str) -> WheelTable:
    return replace(table, columns={name: values for name, values in table.columns.items() if name not in names})


def check_as_alone(folder, table, nats=1.0):
    differences, alone, together, missed = compared(folder, table)
    np.testing.assert_allclose(together.noise.answers, alone.noise.answers, rtol=0.02)
    assert together.score == pytest.approx(alone.score, abs=nats)
    left = np.sqrt(np.nanmean(missed[:, differences.answers] ** 2, axis=0))
    np.testing.assert_allclose(left, np.sqrt(np.nanmean(alone.residuals**2, axis=0)), rtol=0.1)
    return differences


def test_our_own_wheel_as_the_other_simulator_leaves_what_it_leaves_alone(ours):
    """Errors of load and slip, which the simulator was given as well, once counted twice."""
    folder, simulated = ours
    assert not any("another load" in note for note in check_as_alone(folder, simulated()).notes)
    check_as_alone(folder, without(simulated(), "load_N", "slip"))


def test_one_that_ran_at_a_load_and_a_slip_of_its_own_is_compared_at_these(ours):
    """What that makes was once taken for another soil."""
    folder, simulated = ours
    notes = check_as_alone(folder, simulated(load=1.1, slip=0.9)).notes
    assert any(note.startswith("the other simulator ran at another load or slip") for note in notes)
    assert any("10 % of the load" in note for note in notes)


@pytest.mark.parametrize("ours", ["field"], indirect=True)
def test_slip_of_the_other_simulator_follows_from_its_speeds(ours):
    """The recorded slip was once taken for it, and a wheel of another radius found."""
    folder, simulated = ours
    check_as_alone(folder, without(simulated(speed=1.08), "slip"))


@pytest.mark.parametrize("ours", ["field", "bench"], indirect=True)
@pytest.mark.parametrize("lacking", [(), ("load_N", "slip")])
def test_one_at_half_the_rate_leaves_no_less(ours, lacking):
    """Load and slip of rows between its own are those between theirs, as its answers are."""
    folder, simulated = ours
    half = simulated()
    check_as_alone(folder, without(half.select(np.arange(0, len(half), 2)), *lacking), nats=30.0)


def test_rows_of_a_run_are_compared_one_by_one_where_there_are_as_many_and_their_means_else(tmp_path):
    runs = np.array(["a", "a", "b", "b", "c"])
    recorded = {"torque_Nm": np.zeros(5), "load_N": np.array([10.0, 20.0, 30.0, 50.0, 9.0]), "slip": np.full(5, 0.1)}
    simulated = {"torque_Nm": np.array([1.0, 2.0, 3.0])}
    table = attached(tmp_path, simulated, recorded, run=np.array(["b", "a", "a"]), runs=runs)
    np.testing.assert_array_equal(table[SIMULATED + "torque_Nm"], [2.0, 3.0, 1.0, 1.0, np.nan])
    np.testing.assert_array_equal(table[SIMULATED + "load_N"], [10.0, 20.0, 40.0, 40.0, np.nan])


def test_of_trials_with_a_clock_only_those_simulated_are_compared(ours_steady):
    """What load and slip lie between two of them was not simulated, nor recorded."""
    folder, simulated = ours_steady
    table = simulated()
    clock = WheelTable({"time_s": 30.0 * np.arange(len(table)), **table.columns}, None, None, table.source)
    recorded = read_wheel_file(folder / "wheel.csv")
    recorded = WheelTable({"time_s": clock["time_s"], **recorded.columns}, None, None, recorded.source)
    path = folder.parent / "every_other.csv"
    write_wheel_file(clock.select(np.arange(0, len(clock), 2)), path)
    answered = np.isfinite(attach(recorded, path, WHEEL)[SIMULATED + "torque_Nm"])
    np.testing.assert_array_equal(answered, np.arange(len(clock)) % 2 == 0)


def test_a_channel_that_is_the_same_throughout_is_compared(ours_steady):
    """Its scatter is a rounding error, and was once taken for its noise."""
    folder, simulated = ours_steady
    table = simulated()
    constant = replace(table, columns={**table.columns, "sinkage_m": np.full(len(table), 0.006)})
    differences, _, together, _ = compared(folder, constant)
    assert np.isfinite(together.score)
    assert np.isfinite(differences.measured[:, 2]).sum() > 70
    assert "the other simulator's sinkage_m never changes" in differences.notes


def test_values_that_were_not_logged_are_between_their_neighbours(tmp_path):
    every_other = np.where(np.arange(300) % 2 == 0, 2.0 * TIME_S, np.nan)
    load = np.where(np.arange(300) % 2 == 1, 70.0, np.nan)
    beside_it = attached(tmp_path, {"time_s": TIME_S, "torque_Nm": every_other, "load_N": load})
    np.testing.assert_allclose(beside_it[SIMULATED + "torque_Nm"][1:-1], 2.0 * TIME_S[1:-1])
    np.testing.assert_allclose(beside_it[SIMULATED + "load_N"][1:-1], 70.0)


def test_a_copy_of_the_recording_is_refused_though_some_of_its_values_are_left_out(explained):
    folder, _ = explained
    table = read_wheel_file(folder / "wheel.csv")
    torque = table["torque_Nm"].copy()
    torque[500] = 50.0
    write_wheel_file(replace(table, columns={**table.columns, "torque_Nm": torque}), folder / "wheel.csv")
    write_wheel_file(read_wheel_file(folder / "wheel.csv"), folder.parent / "sim.csv")
    with pytest.raises(InputError, match="gives just what was recorded"):
        folder_explained(folder)


@pytest.mark.parametrize("side", ["simulated", "recorded"])
def test_rows_that_only_one_file_tells_apart_are_refused(tmp_path, side):
    """Wheel a was once compared at wheel b's load and slip."""
    names = np.where(np.arange(300) % 2 == 0, "a", "b")
    path = tmp_path / "sim.csv"
    simulated = {"time_s": TIME_S, "torque_Nm": np.ones(300)}
    write_wheel_file(WheelTable(simulated, names if side == "recorded" else None, None, path), path)
    recorded = WheelTable(RECORDED, names if side == "simulated" else None, None, "made")
    with pytest.raises(InputError, match=r"no column wheel \(expected which of a, b each row is of\)"):
        attach(recorded, path, WHEEL)


def test_a_run_that_is_not_named_is_refused_where_clocks_start_anew_only(tmp_path):
    runs = np.repeat(["a", "b"], 150)
    told = {"time_s": TIME_S, "torque_Nm": np.ones(300)}
    assert np.isfinite(attached(tmp_path, told, runs=runs)[SIMULATED + "torque_Nm"]).all()
    anew = {**RECORDED, "time_s": np.tile(TIME_S[:150], 2)}
    with pytest.raises(InputError, match=r"no column run \(expected which of a, b"):
        attached(tmp_path, {name: values[:150] for name, values in told.items()}, anew, runs=runs)


def test_a_time_that_stands_twice_is_refused(tmp_path):
    time_s = np.where(np.arange(300) == 7, TIME_S[6], TIME_S)
    with pytest.raises(InputError, match=r"column time_s: 0.6 s in two rows"):
        attached(tmp_path, {"time_s": time_s, "torque_Nm": np.ones(300)})


def test_a_wheel_that_rolls_has_no_sign_of_slip(tmp_path):
    rolls = {**RECORDED, "slip": np.full(300, -0.01)}
    beside_it = attached(tmp_path, {"time_s": TIME_S, "torque_Nm": np.ones(300), "slip": np.full(300, 0.01)}, rolls)
    np.testing.assert_array_equal(beside_it[SIMULATED + "slip"], 0.01)


@pytest.mark.parametrize("every", [1, 2])
def test_a_simulated_wheel_that_is_stuck_answers_nothing(tmp_path, every):
    """Nor does a row between one that is stuck and one that is not."""
    stuck = np.arange(300) % 20 == 10
    load, slip = np.where(np.arange(300) == 40, -1.0, 50.0), np.where(stuck, 1.0, 0.2)
    columns = {"time_s": TIME_S, "torque_Nm": np.where(stuck, 1e3, 1.0), "slip": slip, "load_N": load}
    beside_it = attached(tmp_path, {name: values[::every] for name, values in columns.items()})
    lost = stuck | (load < 0.0)
    near = np.convolve(lost, np.ones(2 * every - 1), "same") > 0.0
    near[299] |= every == 2
    np.testing.assert_array_equal(np.isnan(beside_it[SIMULATED + "torque_Nm"]), near)
    np.testing.assert_allclose(beside_it[SIMULATED + "torque_Nm"][~near], 1.0)
    with pytest.raises(InputError, match=r"a wheel that carries load and moves \(expected load_N above 0 and slip"):
        attached(tmp_path, {**columns, "slip": np.ones(300)})


def test_what_load_or_slip_an_answer_is_of_is_not_guessed(tmp_path):
    """The recorded slip once stood in for one that the other simulator did not say."""
    unsaid = (np.arange(300) >= 100) & (np.arange(300) < 140)
    slip = np.where(unsaid, np.nan, 0.5)
    beside_it = attached(tmp_path, {"time_s": TIME_S, "torque_Nm": np.ones(300), "slip": slip})
    np.testing.assert_array_equal(np.isnan(beside_it[SIMULATED + "torque_Nm"]), unsaid)
    np.testing.assert_array_equal(beside_it[SIMULATED + "slip"], slip)


@pytest.mark.parametrize(
    ("name", "values", "said"),
    [
        ("load_N", np.full(300, 6.12), r"column load_N: 6.12 N \(median\) where 60 N was recorded"),
        ("load_N", np.full(300, 0.06), r"column load_N: 0.06 N \(median\) where 60 N was recorded"),
        ("load_N", np.full(300, -60.0), r"column load_N: -60 \(median\), 100 % of the rows below 0"),
        ("slip", np.full(300, -0.1), r"column slip: -0.1 \(median\) where 0.1 was recorded .expected the same sign"),
        ("sinkage_m", np.full(300, 20.0), r"column sinkage_m: 20 m \(median\)"),
    ],
)
def test_a_column_that_cannot_be_the_drives_is_refused(tmp_path, name, values, said):
    with pytest.raises(InputError, match=said):
        attached(tmp_path, {"time_s": TIME_S, "torque_Nm": np.ones(300), name: values})


def test_a_recording_that_is_stuck_is_not_put_down_to_the_other_simulator(tmp_path):
    beside_it = attached(
        tmp_path, {"time_s": TIME_S, "torque_Nm": np.ones(300)}, {**RECORDED, "slip": np.ones(300)}
    )  # fmt: skip
    assert np.isnan(beside_it[SIMULATED + "torque_Nm"]).all()


@pytest.fixture
def explained(tmp_path):
    """A recording without an effect, and how to write some of its own rows as the simulation, a little changed."""
    made = conceal(404, (), "plain", protocol="field")
    folder = made.write(tmp_path / "recording")

    def write(rows: slice) -> None:
        columns = {name: made.recorded.columns[name] for name in ("time_s", "torque_Nm", "sinkage_m")}
        columns["torque_Nm"] = 1.01 * columns["torque_Nm"]
        table = WheelTable({name: values[rows] for name, values in columns.items()}, None, None, "sim")
        write_wheel_file(table, tmp_path / "sim.csv")

    return folder, write


def folder_explained(folder):
    return explain(folder, simulated=folder.parent / "sim.csv", catalogue=["slope_gravity", "torque_offset"])


def test_rows_that_stand_twice_or_are_of_another_wheel_do_not_shift_those_compared(tmp_path):
    """Row by row they belong together: left out of one file only, means of runs would be compared."""
    rng = np.random.default_rng(3)
    load, slip = np.repeat([60.0, 120.0, 180.0], 8), np.tile(np.linspace(0.05, 0.6, 8), 3)
    wheel = Wheel(radius_m=0.15, width_m=0.12)
    state = equilibrium(wheel, Soil(800.0, 0.55, 0.012, 1.2e6, 1.0), load, slip)
    true = {"load_N": load, "slip": slip, "torque_Nm": state.torque_Nm, "sinkage_m": state.sinkage_m}
    rows = np.sort(np.r_[np.arange(24), 3, 11, 19])
    run = np.repeat(["a", "b", "c"], 8)[rows]
    noisy = true | {"torque_Nm": state.torque_Nm + rng.normal(scale=0.03, size=24)}
    for name, columns in (("wheel.csv", noisy), ("other.csv", true)):
        table = WheelTable({key: values[rows] for key, values in columns.items()}, None, run, tmp_path / name)
        write_wheel_file(table, tmp_path / name)
    answer = explain(tmp_path / "wheel.csv", vehicle=Vehicle(wheels=(wheel,)), simulated=tmp_path / "other.csv")
    assert answer.verdict == "none"
    assert answer.fits["torque_Nm"].rmse_before == pytest.approx(0.03, rel=0.5)
    radius = np.where(np.arange(len(rows)) < 8, 0.1, 0.15)
    both = WheelTable({k: v[rows] for k, v in noisy.items()} | {"radius_m": radius, "width_m": np.full(27, 0.12)},
                      None, run, tmp_path / "both.csv")  # fmt: skip
    write_wheel_file(both, tmp_path / "both.csv")
    with pytest.raises(InputError, match="rows of other wheels"):
        explain(tmp_path / "both.csv", vehicle=Vehicle(wheels=(wheel,)), simulated=tmp_path / "other.csv")
