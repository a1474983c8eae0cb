"""What swings by the clock is found in what a fit leaves, and noise, ground and memory are no oscillation."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from bevameter import explain
from bevameter.identification.mismatch.locate.oscillation import oscillations
from concealed.conceal import conceal
from scipy.signal import butter, lfilter

ROWS, STEP_S = 1000, 0.05
TIME_S = STEP_S * np.arange(ROWS)


def left(residuals: np.ndarray, time_s: np.ndarray = TIME_S, runs=None, slip=None):
    rows = len(time_s)
    drive = SimpleNamespace(
        timed=True, time_s=time_s, runs=(np.arange(rows),) if runs is None else runs,
        load_N=80.0 + 20.0 * np.sin(0.3 * time_s), slip=0.2 + 0.1 * np.cos(0.2 * time_s) if slip is None else slip,
    )  # fmt: skip
    problem = SimpleNamespace(samples=SimpleNamespace(drive=drive), answers=[1, 4])
    return oscillations(problem, SimpleNamespace(residuals=residuals))


@pytest.mark.parametrize("frequency_Hz", [0.8, 3.1, 7.7])
@pytest.mark.parametrize("pieces", [1, 3])
def test_a_line_that_beats_is_found_with_its_amplitude(rng, frequency_Hz, pieces):
    swing = np.sin(2.0 * np.pi * frequency_Hz * TIME_S) * (1.0 + 0.5 * np.sin(0.6 * TIME_S))
    noise = rng.normal(size=(ROWS, 2))
    clock = TIME_S + 100.0 * (np.arange(ROWS) * pieces // ROWS)
    residuals = [0.2, 3.0] * (noise + [[0.0, 0.7]] * swing[:, None])
    (line,) = left(residuals, clock, tuple(np.array_split(np.arange(ROWS), pieces)))
    assert line.channel == "drawbar_pull_N"
    assert line.frequency_Hz == pytest.approx(frequency_Hz, abs=0.1)
    assert line.amplitude == pytest.approx(3.0 * 0.7 * np.sqrt(1.125), rel=0.3)


@pytest.mark.parametrize("memory", [0.0, 0.8, -0.5])
@pytest.mark.parametrize("rows", [130, 300, 1000])
def test_noise_is_no_oscillation(rng, memory, rows):
    noise = lfilter([1.0], [1.0, -memory], rng.normal(size=(400, rows, 2)), axis=1)
    assert sum(bool(left(each, TIME_S[:rows])) for each in noise) == 0


def test_the_stronger_of_two_lines_is_told(rng):
    slow, fast = (np.sin(2.0 * np.pi * frequency_Hz * TIME_S) for frequency_Hz in (3.03, 6.06))
    residuals = rng.normal(size=(ROWS, 2)) + (2.0 * slow + 8.0 * fast)[:, None]
    assert [line.frequency_Hz for line in left(residuals)] == pytest.approx([6.06, 6.06], abs=0.1)
    assert [line.amplitude for line in left(residuals)] == pytest.approx([8.0, 8.0], rel=0.1)


def test_what_slip_does_itself_is_no_oscillation(rng):
    swing = np.sin(2.0 * np.pi * 1.5 * TIME_S)
    twice = rng.normal(size=(ROWS, 2)) + (swing**2)[:, None] * 3.0
    assert left(twice)[0].frequency_Hz == pytest.approx(3.0, abs=0.1)
    assert left(twice, slip=0.2 + 0.1 * swing) == ()


def test_rows_without_an_even_clock_have_none(rng):
    swing = np.sin(2.0 * np.pi * 3.1 * TIME_S)[:, None] + rng.normal(size=(ROWS, 2))
    assert left(swing)
    assert left(swing, TIME_S + 0.1 * STEP_S * rng.uniform(-1.0, 1.0, ROWS))
    assert left(0.0 * swing) == ()
    assert left(swing, np.sort(rng.uniform(0.0, 50.0, ROWS))) == ()
    assert left(swing[:40], TIME_S[:40]) == ()
    slow = np.where(np.arange(ROWS)[:, None] % 4 == 0, lfilter([1.0], [1.0, -0.98], swing, axis=0), np.nan)
    assert left(slow) == ()
    lost = np.delete(np.arange(ROWS), [400, 401])
    assert left(swing[lost], TIME_S[lost])


def test_short_stretches_of_a_thinned_recording_tell_too(rng):
    clock = TIME_S + 100.0 * (np.arange(ROWS) // 50)
    runs = tuple(np.array_split(np.arange(ROWS), ROWS // 50))
    swing = np.sin(2.0 * np.pi * 3.1 * clock)[:, None]
    assert [line.frequency_Hz for line in left(rng.normal(size=(ROWS, 2)) + swing, clock, runs)] == pytest.approx(
        [3.1, 3.1], abs=0.3
    )


FILTERS = {
    "white": ([1.0], [1.0]), "memory": ([1.0], [1.0, -0.8]), "Butterworth": butter(2, 0.3), "steep": butter(4, 0.4),
    "mean": (np.full(3, 1.0 / 3.0), [1.0]),
}  # fmt: skip


@pytest.mark.parametrize("kind", FILTERS)
@pytest.mark.parametrize(("rows", "pieces"), [(1000, 20), (300, 1), (150, 3), (50, 1)])
@pytest.mark.parametrize("white", [0.0, 0.3])
def test_noise_behind_a_filter_is_no_oscillation(rng, kind, rows, pieces, white):
    """A slope or an edge of a spectrum is no line, in pieces of a thinned recording either."""
    clock = STEP_S * np.arange(rows) + 100.0 * (np.arange(rows) * pieces // rows)
    noise = lfilter(*FILTERS[kind], rng.normal(size=(150, rows + 60, 2)), axis=1)[:, 60:]
    noise = noise / noise.std() + white * rng.normal(size=noise.shape)
    assert sum(bool(left(each, clock, tuple(np.array_split(np.arange(rows), pieces)))) for each in noise) == 0


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
