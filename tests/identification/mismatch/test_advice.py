"""What `explain` advises and notes: measurements that would tell, rows of other wheels, channels nobody simulated."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from bevameter import SoilKnowledge, Wheel, explain
from bevameter.framework.core.recording.types import WheelTable
from bevameter.framework.core.recording.wheel_file import write_wheel_file
from bevameter.identification.effects.catalogue import SLUGS, effects_for
from bevameter.identification.effects.drive import drive_of, order_of, select_rows
from bevameter.identification.felt_rows import felt_rows
from bevameter.identification.identify import open_recording
from bevameter.identification.mismatch.fit.beside import attach
from bevameter.identification.mismatch.fit.samples import gather
from bevameter.identification.mismatch.fit.simulated import as_differences
from bevameter.identification.mismatch.fit.trial import situation, textbook_trial, try_adding
from bevameter.identification.mismatch.name import would_tell as module
from bevameter.identification.mismatch.name.would_tell import (
    _driven,
    _drives,
    _expected,
    _hypothetical,
    _known_soil,
    would_tell,
)
from concealed.conceal import conceal


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


@pytest.fixture(scope="module")
def friction(steady):
    """Problem, and trials of an offset, of Coulomb friction and of slip-sinkage, on the steady trials."""
    _, folder = steady
    rows = felt_rows(open_recording(folder, None))
    problem, textbook = textbook_trial(gather(rows.table, rows.wheel, rows.vehicle))
    forms = {each.name: each for each in effects_for(situation(problem, textbook.fitted), SLUGS)}
    names = ("torque_offset", "drivetrain_friction[coulomb]", "slip_sinkage[exponent]", "torque_gain")
    return problem, [try_adding(problem, textbook, textbook, forms[name]) for name in names]


def test_one_measurement_is_proposed_for_all_that_look_alike_or_it_says_for_which(friction):
    problem, (offset, coulomb, _, gain) = friction
    text = would_tell(problem, offset, coulomb, gain)
    assert text.startswith("read the torque with the wheel lifted and at rest (expected ")
    assert "for or against" not in text
    alone = [float(would_tell(problem, offset, each).partition("expected ")[2].split()[0]) for each in (coulomb, gain)]
    assert f"expected {min(alone):.0f} nats" in text
    # At rest neither friction nor a gain shows.
    text = would_tell(problem, coulomb, offset, gain)
    assert "for or against torque offset)" in text or "for or against" not in text


def test_what_was_driven_already_is_not_proposed(friction):
    problem, (offset, _, sinks, _) = friction
    slip = problem.imposed[:, 1]
    assert _driven(slip, np.linspace(slip.min(), slip.max(), 9))
    assert not _driven(slip, np.linspace(-0.5, 0.9, 9))
    assert not _driven(np.full(5, np.nan), np.linspace(0.0, 1.0, 9))
    texts = [text for _, text in _drives(problem, sinks, offset)]
    quantiles = np.quantile(slip, [0.05, 0.95])
    assert ("drive with slips from 0 to 0.6" in texts) == (min(quantiles[1], 0.6) - max(quantiles[0], 0.0) < 0.51)
    wide = SimpleNamespace(
        samples=problem.samples, answers=problem.answers, known=problem.known,
        imposed=np.column_stack([problem.imposed[:, 0], np.linspace(-0.05, 0.7, len(slip))]),
    )  # fmt: skip
    assert "drive with slips from 0 to 0.6" not in [text for _, text in _drives(wide, sinks, offset)]


def test_what_the_present_drive_would_tell_once_more_is_nobodys_merit(friction, monkeypatch):
    problem, (offset, coulomb, _, _) = friction
    monkeypatch.setattr(module, "_expected", lambda *_: 50.0)
    assert {nats for nats, _ in _drives(problem, offset, coulomb)} == {0.0}


def test_a_form_that_is_doubted_without_a_rival_is_checked_by_the_soil_if_that_is_not_known(friction):
    problem, (offset, *_) = friction
    assert "shear test (--soil), which the soil found agrees with" in would_tell(problem, offset)
    told = SimpleNamespace(known=SoilKnowledge({"c_Pa": 500.0, "phi_rad": 0.5}))
    assert would_tell(told, offset) == ""
    assert _known_soil(told, offset, offset) == []


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
