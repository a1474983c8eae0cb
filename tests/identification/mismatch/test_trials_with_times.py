"""Steady trials that carry the time at which each was made: no row follows from the one before."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from bevameter import Vehicle, Wheel, explain, identify
from bevameter.framework.core.recording.types import WheelTable
from bevameter.identification.effects.catalogue import effects_for
from bevameter.identification.mechanics.soil import Soil
from bevameter.identification.mechanics.textbook import equilibrium
from bevameter.identification.mismatch.fit.samples import gather
from bevameter.identification.mismatch.fit.trial import situation, textbook_trial
from bevameter.identification.trials import is_of_trials

WHEEL = Wheel(radius_m=0.2, width_m=0.15)
SOIL = Soil(c_Pa=1000.0, phi_rad=math.radians(30.0), k_m=0.015, stiffness_Pa=3e5, n=1.0)
SLIPS, LOADS, REPEATS = np.linspace(0.05, 0.6, 8), (150.0, 300.0, 450.0), 3


def trials(order: np.ndarray | None = None, drift_Nm: float = 0.0) -> WheelTable:
    """A table of each slip at each load three times, in a given order, a minute and more apart."""
    rng = np.random.default_rng(3)
    load, slip = (each.ravel() for each in np.meshgrid(np.repeat(LOADS, REPEATS), SLIPS))
    order = rng.permutation(len(load)) if order is None else order
    load, slip = load[order], slip[order]
    state = equilibrium(WHEEL, SOIL, load, slip)
    time_s = 70.0 * np.arange(len(load)) + rng.uniform(0.0, 20.0, len(load))
    answers = np.column_stack([state.torque_Nm, state.sinkage_m, state.drawbar_pull_N])
    answers += 0.01 * np.ptp(answers, axis=0) * rng.normal(size=answers.shape)
    answers[:, 0] += drift_Nm * time_s / time_s[-1]
    names = ("torque_Nm", "sinkage_m", "drawbar_pull_N")
    columns = {"time_s": time_s, "load_N": load, "slip": slip, **dict(zip(names, answers.T, strict=True))}
    return WheelTable(columns, None, None, "made")


def written(table: WheelTable, folder: Path) -> Path:
    path = folder / "wheel.csv"
    columns = np.column_stack(list(table.columns.values()))
    np.savetxt(path, columns, delimiter=",", header=",".join(table.columns), comments="")
    return path


def gathered(table: WheelTable):
    return gather(table, WHEEL, Vehicle(name="made", wheels=(WHEEL,)))


def test_the_noise_is_that_of_repeats_and_not_of_the_order():
    table = trials()
    samples = gathered(table)
    assert any("steady trial" in note for note in samples.notes)
    assert "slips held out" in samples.split
    assert not samples.drive.timed
    assert np.isnan(samples.position).all()
    truth = 0.01 * np.ptp(equilibrium(WHEEL, SOIL, table["load_N"], table["slip"]).torque_Nm)
    assert 0.5 * truth < samples.noise[1] < 2.0 * truth


def test_what_wanders_with_time_is_looked_for_and_what_comes_late_is_not():
    samples = gathered(trials())
    problem, textbook = textbook_trial(samples)
    slugs = {effect.slug for effect in effects_for(situation(problem, textbook.fitted))}
    assert "drift" in slugs
    assert not slugs & {"time_lag", "inertia", "soil_patch"}


@pytest.mark.parametrize(("drift_Nm", "verdict"), [(0.0, "none"), (3.0, "instrument")])
def test_a_drift_over_trials_is_told(tmp_path, drift_Nm, verdict):
    path = written(trials(drift_Nm=drift_Nm), tmp_path)
    answer = explain(path, vehicle=Vehicle(name="made", wheels=(WHEEL,)), catalogue=["drift", "torque_gain"])
    assert answer.verdict == verdict
    assert [each.effect for each in answer.missing] == (["drift"] if drift_Nm else [])


def test_the_soil_of_such_trials_is_identified(tmp_path):
    found = identify(written(trials(), tmp_path), vehicle=Vehicle(name="made", wheels=(WHEEL,)))
    assert found.overall is not None
    assert any("steady trial" in problem for problem in found.problems)
    for name in ("c_Pa", "phi_rad"):
        quantity = found.overall.parameters[name]
        assert abs(quantity.value - getattr(SOIL, name)) < 3.0 * quantity.sd
    phi = found.overall.parameters["phi_rad"]
    assert phi.high - phi.low < math.radians(8.0)


def test_rows_that_follow_from_one_another_are_no_trials():
    rng = np.random.default_rng(0)
    time_s = 0.1 * np.arange(400)
    noise = 0.01 * rng.normal(size=400)
    smooth = {"time_s": time_s, "load_N": 100.0 + 30.0 * np.sin(time_s), "slip": 0.3 + 0.2 * np.sin(time_s / 2) + noise}
    steps = {**smooth, "slip": np.repeat(rng.uniform(0.05, 0.6, 20), 20) + noise}
    unsteady = {**smooth, "slip": rng.uniform(0.05, 0.6, 400)}
    still = {**smooth, "load_N": 100.0 + rng.normal(size=400), "slip": 0.2 + noise}
    for columns in (smooth, steps, still, unsteady):
        assert not is_of_trials(WheelTable(columns, None, None, "made"))
    assert is_of_trials(trials())
    # Slip by slip, load after load; were repeats to follow each other, they would tell the noise as they stand.
    one_by_one = np.arange(len(SLIPS) * len(LOADS) * REPEATS).reshape(len(SLIPS), -1).T.ravel()
    assert is_of_trials(trials(one_by_one))


@pytest.mark.parametrize(("runs", "said"), [(1, True), (24, False)])
def test_rows_of_a_run_without_a_clock_are_said_to_be_taken_for_trials(runs, said):
    table = trials()
    columns = {name: values for name, values in table.columns.items() if name != "time_s"}
    run = np.array([f"run {row % runs}" for row in range(len(table))])
    samples = gather(WheelTable(columns, None, run, "made"), WHEEL, Vehicle(name="made", wheels=(WHEEL,)))
    assert any("have no time_s: each is taken for a steady trial" in note for note in samples.notes) == said
