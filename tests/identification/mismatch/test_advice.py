"""What `explain` advises and notes: measurements that would tell, rows of other wheels, channels nobody simulated."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from bevameter import Wheel, explain
from bevameter.framework.core.recording.types import WheelTable
from bevameter.framework.core.recording.write import write_wheel_file
from bevameter.framework.scenario.concealed.conceal import conceal
from bevameter.identification.effects.catalogue import effects_for
from bevameter.identification.effects.drive import drive_of, order_of, select_rows
from bevameter.identification.identify import felt_rows, open_recording
from bevameter.identification.mismatch.fit.beside import attach
from bevameter.identification.mismatch.fit.samples import gather
from bevameter.identification.mismatch.fit.simulated import as_differences
from bevameter.identification.mismatch.fit.trial import situation, textbook_trial, try_adding
from bevameter.identification.mismatch.name.would_tell import _expected, _hypothetical, would_tell


@pytest.fixture(scope="module")
def steady(tmp_path_factory):
    """Trials that hide a torque sensor's wrong zero."""
    made = conceal(7325, ("torque_offset",), "plain", protocol="steady")
    return made, made.write(tmp_path_factory.mktemp("made") / "steady")


def test_an_offset_and_friction_are_told_apart_with_the_wheel_at_rest(steady):
    _, folder = steady
    rows = felt_rows(open_recording(folder, None))
    problem, textbook = textbook_trial(gather(rows.table, rows.wheel, rows.vehicle))
    effects = effects_for(situation(problem, textbook.fitted), ["torque_offset", "drivetrain_friction"])
    offset, coulomb = (
        try_adding(problem, textbook, textbook, next(each for each in effects if each.name == name))
        for name in ("torque_offset", "drivetrain_friction[coulomb]")
    )
    assert abs(offset.gain - coulomb.gain) < 1.0
    for pair in ((offset, coulomb), (coulomb, offset)):
        assert "with the wheel lifted and at rest" in would_tell(problem, *pair)


def test_two_parameters_of_which_each_undoes_the_other_are_no_obstacle():
    """An offset and Coulomb friction of a wheel that turns one way: columns that are equal to the last bit."""
    rows, noise = 64, np.array([np.nan, 2.0**-24, np.nan, np.nan, np.nan])
    truth = np.tile(np.cos(np.arange(rows))[:, None], 5)
    predicted = SimpleNamespace(predict=lambda *_: SimpleNamespace(channels=truth))
    one = SimpleNamespace(channels=np.zeros((rows, 5)), by_parameter=np.ones((rows, 5, 1)))
    two = SimpleNamespace(channels=np.zeros((rows, 5)), by_parameter=np.ones((rows, 5, 2)))
    right = SimpleNamespace(model=predicted, vector=np.zeros(0))
    nats = [
        _expected(None, np.zeros((rows, 2)), noise, right, SimpleNamespace(model=model, vector=np.zeros(0)), None)
        for model in (SimpleNamespace(linearise=lambda *_, given=given: given) for given in (one, two))
    ]
    scatter = float(np.sum((truth[:, 1] - truth[:, 1].mean()) ** 2))
    assert nats == pytest.approx([0.5 * scatter / 2.0**-48] * 2, rel=1e-9)


def test_another_drive_runs_on_the_track_that_is_known():
    angle = np.linspace(0.0, 2.0 * np.pi, 1000)
    columns = {
        "time_s": np.arange(1000.0), "load_N": np.full(1000, 80.0), "slip": np.full(1000, 0.2),
        "x_m": 5.0 * np.cos(angle), "y_m": 5.0 * np.sin(angle),
    }  # fmt: skip
    wheel = Wheel(radius_m=0.1, width_m=0.1)
    table = WheelTable(columns, None, None, "made")
    drive = drive_of(table, wheel, order_of(table)[1])
    other = _hypothetical(drive, np.tile([80.0, 0.2], (240, 1)), {}, 0.1, wheel.radius_m)
    np.testing.assert_allclose(np.hypot(other.x_m, other.y_m), 5.0)
    np.testing.assert_allclose(other.place_m, np.linspace(0.0, 10.0 * np.pi, 240), atol=0.05)
    # Of fewer rows than the other drive has, each has a moment of its own all the same.
    short = select_rows(drive, np.arange(60))
    assert (np.diff(_hypothetical(short, np.tile([80.0, 0.2], (240, 1)), {}, 0.1, wheel.radius_m).time_s) > 0.0).all()


def test_of_several_wheels_the_one_with_most_rows_is_explained_and_the_others_are_spoken_of(steady, tmp_path):
    made, _ = steady
    columns = {name: np.concatenate([values, values[:9]]) for name, values in made.recorded.columns.items()}
    count = len(columns["load_N"])
    other = np.arange(count) >= count - 9
    columns["radius_m"] = np.where(other, 2.0, 1.0) * made.vehicle["radius_m"]
    columns["width_m"] = np.full(count, made.vehicle["width_m"])
    runs = np.concatenate([made.recorded.run, [f"other {number}" for number in range(9)]])
    write_wheel_file(WheelTable(columns, None, runs, tmp_path / "tests.csv"), tmp_path / "tests.csv")
    answer = explain(tmp_path / "tests.csv", catalogue=["torque_offset"])
    assert answer.n <= count - 9
    assert answer.simulator.wheel.radius_m == pytest.approx(made.vehicle["radius_m"])
    assert any("rows of 2 wheels" in note and "a file of their own" in note for note in answer.notes)


def test_a_channel_that_the_other_simulator_lacks_is_named(steady, tmp_path):
    made, folder = steady
    rows = felt_rows(open_recording(folder, None))
    columns = {"torque_Nm": np.asarray(made.oracle.torque_Nm)}
    write_wheel_file(WheelTable(columns, None, made.recorded.run, tmp_path / "sim.csv"), tmp_path / "sim.csv")
    table = attach(rows.table, tmp_path / "sim.csv", rows.wheel)
    samples, _ = as_differences(gather(table, rows.wheel, rows.vehicle), tmp_path / "sim.csv")
    assert "sinkage_m is recorded but not simulated: it is left out" in samples.notes
    assert not np.isfinite(samples.measured[:, 2]).any()
