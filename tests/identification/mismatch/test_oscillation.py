"""What swings by the clock is found in what a fit leaves, and noise, ground and memory are no oscillation."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from bevameter import explain
from bevameter.framework.scenario.concealed.conceal import conceal
from bevameter.identification.mismatch.locate.oscillation import oscillations
from scipy.signal import lfilter

ROWS, STEP_S = 1000, 0.05
TIME_S = STEP_S * np.arange(ROWS)


def left(innovations: np.ndarray, time_s: np.ndarray = TIME_S, runs=None):
    drive = SimpleNamespace(timed=True, time_s=time_s, runs=(np.arange(len(time_s)),) if runs is None else runs)
    problem = SimpleNamespace(samples=SimpleNamespace(drive=drive), answers=[1, 4])
    fitted = SimpleNamespace(innovations=innovations, noise=SimpleNamespace(answers=np.array([0.2, 3.0])))
    return oscillations(problem, fitted)


@pytest.mark.parametrize("frequency_Hz", [0.8, 3.1, 7.7])
@pytest.mark.parametrize("pieces", [1, 3])
def test_a_line_that_beats_is_found_with_its_amplitude(rng, frequency_Hz, pieces):
    swing = np.sin(2.0 * np.pi * frequency_Hz * TIME_S) * (1.0 + 0.5 * np.sin(0.6 * TIME_S))
    noise = rng.normal(size=(ROWS, 2))
    clock = TIME_S + 100.0 * (np.arange(ROWS) * pieces // ROWS)
    (line,) = left(noise + [[0.0, 0.7]] * swing[:, None], clock, tuple(np.array_split(np.arange(ROWS), pieces)))
    assert line.channel == "drawbar_pull_N"
    assert line.frequency_Hz == pytest.approx(frequency_Hz, abs=0.1)
    assert line.amplitude == pytest.approx(3.0 * 0.7 * np.sqrt(1.125), rel=0.3)


@pytest.mark.parametrize("memory", [0.0, 0.8, -0.5])
def test_noise_is_no_oscillation(rng, memory):
    """One in ten thousand may be, white or with a memory; of these 300 none."""
    noise = lfilter([1.0], [1.0, -memory], rng.normal(size=(300, ROWS, 2)), axis=1)
    assert sum(bool(left(each)) for each in noise) == 0


def test_rows_without_an_even_clock_have_none(rng):
    swing = np.sin(2.0 * np.pi * 3.1 * TIME_S)[:, None] + rng.normal(size=(ROWS, 2))
    assert left(swing)
    assert left(swing, TIME_S + 0.1 * STEP_S * rng.uniform(-1.0, 1.0, ROWS))
    assert left(0.0 * swing) == ()
    assert left(swing, np.sort(rng.uniform(0.0, 50.0, ROWS))) == ()
    assert left(swing[:40], TIME_S[:40]) == ()


def test_a_resonance_is_a_note_of_the_answer(tmp_path):
    made = conceal(792031, (), "hidden", "bench", samples=600)
    columns, clock = made.recorded.columns, made.recorded.columns["time_s"]
    spread = 1.5 * made.truth["noise"]["torque_Nm"]
    frequency_Hz = 0.3 * made.truth["rate_Hz"]
    columns["torque_Nm"] = columns["torque_Nm"] + spread * np.sin(2.0 * np.pi * frequency_Hz * clock)
    answer = explain(made.write(tmp_path / "swings"), catalogue=["slip_sinkage", "torque_gain"])
    assert answer.verdict == "none"
    (note,) = [note for note in answer.notes if "oscillates" in note]
    assert f"torque T oscillates at {frequency_Hz:.2g}" in note
    assert "times in a usual turn of the wheel" in note
