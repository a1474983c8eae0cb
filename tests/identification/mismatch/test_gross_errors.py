"""Trials that are grossly wrong: left out where they stand alone, kept where several of like conditions agree."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from bevameter import Vehicle, Wheel, explain
from bevameter.framework.core.recording.types import WheelTable
from bevameter.identification.effects.catalogue import effects_for
from bevameter.identification.mechanics.soil import Soil
from bevameter.identification.mismatch.explain import _trials_left_out
from bevameter.identification.mismatch.fit.fitting import Fitted
from bevameter.identification.mismatch.fit.gross_errors import outlying
from bevameter.identification.mismatch.fit.samples import Samples, gather
from bevameter.identification.mismatch.fit.textbook import fit_textbook
from bevameter.identification.mismatch.fit.trial import situation, textbook_trial, try_adding
from bevameter.identification.noise import from_running_median
from bevameter.identification.simulate import simulate
from concealed.conceal import conceal

WHEEL = Wheel(radius_m=0.2, width_m=0.15)
VEHICLE = Vehicle(name="made", wheels=(WHEEL,))
TRIALS = 150


def table(wrong: dict[int, float]) -> WheelTable:
    """Trials at scattered loads and slips of a wheel that sinks as it slips; loads of some rows read wrong."""
    rng = np.random.default_rng(8)
    load, slip = rng.uniform(120.0, 480.0, TRIALS), rng.uniform(-0.1, 0.6, TRIALS)
    run = np.array([f"trial {row}" for row in range(TRIALS)])
    bare = WheelTable({"load_N": load, "slip": slip}, None, run, "made")
    made = simulate(VEHICLE, Soil(1000.0, 0.52, 0.015, 3e5, 1.0), bare, ["slip_sinkage:n1=0.2"])
    columns = {
        name: made[name] * (1.0 + 0.01 * rng.normal(size=TRIALS))
        for name in ("load_N", "torque_Nm", "sinkage_m", "drawbar_pull_N")
    }
    for row, times in wrong.items():
        columns["load_N"][row] *= times
    return WheelTable({**columns, "slip": slip}, None, run, "made")


def written(rows: WheelTable, folder: Path) -> Path:
    """A file of these rows."""
    pd.DataFrame({"run": rows.run, **rows.columns}).to_csv(folder / "wheel.csv", index=False)
    return folder / "wheel.csv"


@pytest.fixture(scope="module")
def fitted() -> tuple[Samples, Fitted]:
    problem, textbook = fit_textbook(gather(table({}), WHEEL, VEHICLE))
    return problem.samples, textbook


@pytest.mark.parametrize("wrong", [{}, {11: 0.2, 40: 3.0}])
def test_loads_that_read_wrong_hide_nothing(tmp_path, wrong):
    answer = explain(written(table(wrong), tmp_path), vehicle=VEHICLE)
    assert [each.effect for each in answer.missing] == ["slip_sinkage"]
    assert answer.missing[0].probability > 0.9
    assert answer.missing[0].parameters["n1"].value == pytest.approx(0.2, abs=0.03)
    assert answer.n == TRIALS - len(wrong)
    assert all(fit.rmse_after < 1.3 * fit.noise for fit in answer.fits.values())
    told = [note for note in answer.notes if "trials left out" in note]
    assert bool(told) == bool(wrong)
    if wrong:
        rows = table(wrong)
        each = [f"slip {rows['slip'][row]:.3g} at {rows['load_N'][row]:.4g} N" for row in wrong]
        assert told == [
            "2 of 150 trials left out as gross errors, alone far from what was found, or from what it is without an "
            f"effect that they alone ask for: {'; '.join(each)}"
        ]


def test_trials_that_agree_with_the_next_are_no_errors(fitted):
    samples, textbook = fitted

    def found(rows, away: float = 30.0) -> list[int]:
        left = textbook.innovations.copy()
        left[rows, 1] += away * left[:, 1].std()
        return sorted(np.flatnonzero(outlying(samples, replace(textbook, innovations=left))))

    assert found([]) == []
    assert found([7]) == [7]
    assert found([7], away=6.0) == []
    # More than a few are what the model misses, and of a short table nobody knows what is usual.
    assert found(list(range(0, TRIALS, 10))) == []
    few = samples.select(np.arange(19))
    assert not outlying(few, replace(textbook, innovations=50.0 * textbook.innovations[:19])).any()
    # Nor are those at one end of the slips, where all agree, errors; one in the middle is.
    slip = np.linspace(-0.1, 0.5, TRIALS)
    slip[-3:] = 0.9, 0.901, 0.902
    samples = replace(samples, drive=replace(samples.drive, load_N=np.full(TRIALS, 300.0), slip=slip))
    assert found([40, TRIALS - 3, TRIALS - 2, TRIALS - 1]) == [40]
    # Two that agree are no errors, nor is what lies beyond all others, nor one towards which its neighbours go.
    assert found([40, TRIALS - 2, TRIALS - 1]) == [40]
    samples = replace(samples, drive=replace(samples.drive, slip=np.append(slip[:-3], [0.5, 0.5, 0.9])))
    assert found([40, TRIALS - 1]) == [40]
    left = textbook.innovations.copy()
    left[40, 1] += 30.0 * left[:, 1].std()
    left[41, 1] += 6.0 * left[:, 1].std()
    graded = replace(textbook, innovations=left)
    assert not outlying(samples, graded).any()
    # All that is left out is few.
    lonely = replace(textbook, innovations=np.where(np.arange(TRIALS)[:, None] == 40, left, textbook.innovations))
    assert outlying(samples, lonely, already=6).any()
    assert not outlying(samples, lonely, already=7).any()


def test_each_channel_may_have_a_few_gross_errors_of_its_own(fitted):
    samples, textbook = fitted
    left = textbook.innovations.copy()
    wrong = [[3, 7, 77], [15, 90, 33], [60, 105]]
    for channel, rows in enumerate(wrong):
        left[rows, channel] += 30.0 * left[:, channel].std()
    found = outlying(samples, replace(textbook, innovations=left))
    assert set(np.flatnonzero(found)) == {row for rows in wrong for row in rows}
    # More than a few of one channel are what the model misses of it.
    left[[21, 30, 51, 66, 110], 0] += 30.0 * left[:, 0].std()
    assert not outlying(samples, replace(textbook, innovations=left)).any()


def test_loads_may_have_a_few_gross_errors_beside_those_of_the_answers(fitted):
    samples, textbook = fitted
    left, residuals = textbook.innovations.copy(), textbook.residuals.copy()
    loads, alone = [33, 77, 105], [[3, 7], [15, 90], [60]]
    for rows in (left, residuals):
        away = 30.0 * rows.std(axis=0)
        rows[loads] += away
        for channel, wrong in enumerate(alone):
            rows[wrong, channel] += away[channel]
    # An answer that is wrong shows in the innovations of another one, too.
    left[alone[0], 1] += 15.0 * textbook.innovations[:, 1].std()
    found = outlying(samples, replace(textbook, innovations=left, residuals=residuals))
    assert np.flatnonzero(found).tolist() == sorted(loads + alone[0] + alone[1] + alone[2])
    # More than a few loads are what the model misses.
    more = [*loads, 21, 30, 51, 66, 110]
    left[more[3:]] += 30.0 * textbook.innovations.std(axis=0)
    residuals[more[3:]] += 30.0 * textbook.residuals.std(axis=0)
    assert not outlying(samples, replace(textbook, innovations=left, residuals=residuals)).any()


@pytest.mark.parametrize("every", [1, 2])
@pytest.mark.filterwarnings("error")
def test_a_channel_that_comes_late_is_no_gross_error_where_it_jumps(every):
    rng = np.random.default_rng(7)
    time_s = np.arange(600) / 10.0
    slip = np.repeat([0.05, 0.3, 0.1, 0.5, 0.2, 0.4], 100)
    bare = WheelTable({"time_s": time_s, "load_N": np.full(600, 300.0), "slip": slip}, None, None, "made")
    made = simulate(VEHICLE, Soil(1000.0, 0.52, 0.015, 3e5, 1.0), bare, ["time_lag:form=torque_Nm,tau=0.15"])
    noise = {"load_N": 2.0, "slip": 0.002, "torque_Nm": 0.05, "sinkage_m": 5e-5, "drawbar_pull_N": 0.5}
    columns = {name: made[name] + sd * rng.normal(size=600) for name, sd in noise.items()}
    read = np.arange(600) % every == 0
    columns["torque_Nm"] = np.where(read, columns["torque_Nm"], np.nan)
    samples = gather(WheelTable({"time_s": time_s, **columns}, None, None, "made"), WHEEL, VEHICLE)
    problem, textbook = textbook_trial(samples)
    assert np.isfinite(problem.samples.measured[read, 1]).all()
    lags = {each.form: each for each in effects_for(situation(problem, textbook.fitted), ["time_lag"])}
    trial = try_adding(problem, textbook, textbook, lags["torque_Nm"])
    # Of jumps alone the readings tell a delay to half of the time from one to the next.
    assert trial.fitted.vector[-1] == pytest.approx(0.15, abs=0.01 if every == 1 else 0.1)


def test_beside_a_quick_channel_a_gross_error_shows_in_what_a_fit_leaves():
    """Torque goes with a load that differs from row to row: among measured values its errors do not stand out."""
    rng = np.random.default_rng(3)
    time_s = np.arange(400) / 10.0
    slip, load = 0.3 + 0.2 * np.sin(0.4 * time_s), 300.0 + 30.0 * rng.normal(size=400)
    bare = WheelTable({"time_s": time_s, "load_N": load, "slip": slip}, None, None, "made")
    made = simulate(VEHICLE, Soil(1000.0, 0.52, 0.015, 3e5, 1.0), bare)
    noise = {"load_N": 2.0, "slip": 0.01, "torque_Nm": 0.1, "sinkage_m": 1e-4, "drawbar_pull_N": 1.0}
    columns = {name: made[name] + sd * rng.normal(size=400) for name, sd in noise.items()}
    rows = [30, 31, 200]
    columns["torque_Nm"][rows] += 9.0
    precise = Vehicle(name="made", wheels=(WHEEL,), noise=noise)
    samples = gather(WheelTable({"time_s": time_s, **columns}, None, None, "made"), WHEEL, precise)
    assert np.isfinite(samples.measured[rows, 1]).all()
    problem, fitted = fit_textbook(samples)
    assert np.flatnonzero(np.isnan(problem.samples.measured[:, 1])).tolist() == rows
    assert fitted.noise.answers[problem.answers.index(1)] < 0.5
    assert any(note.startswith("3 values stand alone far from their neighbours") for note in problem.samples.notes)
    # Of a row in which nothing else was seen nothing is taken.
    lonely = samples.measured.copy()
    lonely[200, [2, 4]] = np.nan
    cleared = fit_textbook(replace(samples, measured=lonely))[0].samples.measured
    assert np.flatnonzero(np.isnan(cleared[:, 1])).tolist() == rows[:2]


def test_neighbours_are_those_of_the_same_stretch():
    values = np.concatenate([np.arange(10.0), 100.0 + np.arange(10.0), [7.0, np.nan, 7.0]])
    values[[4, 12]] += 50.0
    away = from_running_median(values, np.repeat([0, 1, 2], [10, 10, 3]))
    assert np.flatnonzero(away > 3.0).tolist() == [4, 12]
    assert away[4] == pytest.approx(49.0, abs=1.0)
    assert np.isnan(away[20:]).all(), "too few to tell"


def test_a_note_names_the_first_few_trials_that_are_left_out(fitted):
    samples, _ = fitted
    assert _trials_left_out(samples, np.arange(6, TRIALS)).count("slip") == 6
    assert "more" not in _trials_left_out(samples, np.arange(6, TRIALS))
    many = _trials_left_out(samples, np.arange(9, TRIALS))
    assert many.startswith("9 of 150 trials")
    assert many.count("slip") == 6
    assert many.endswith("; 3 more")


@pytest.mark.parametrize(("deeper", "named"), [(0.0, []), (0.2, ["slip_sinkage"])])
def test_an_effect_that_only_bends_towards_one_wrong_load_is_none(tmp_path, deeper, named):
    """A flattening tyre makes up for the sinkage of a load that reads half as much more, not for its torque; beside
    what is there it is found, too.
    """
    path = conceal(792937, (), protocol="steady").write(tmp_path)
    rows = pd.read_csv(path / "wheel.csv")
    rows["sinkage_m"] *= 1.0 + deeper * rows["slip"]
    rows.to_csv(path / "wheel.csv", index=False)
    answer = explain(path, catalogue=["tyre_deflection", "hard_layer", "slip_sinkage"])
    assert [each.effect for each in answer.missing if each.probability > 0.1] == named
    assert any(note.startswith("1 of 54 trials left out as gross errors") for note in answer.notes)
