"""Another simulator's output: what it gives for the same drive, and effects as differences to it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from ....framework.core.errors import InputError
from ....framework.core.recording.types import WheelTable
from ....framework.core.recording.wheel_file import read_wheel_file
from ...augmented import AugmentedWheel
from ...effects.effect import LOAD, SLIP
from ...forward import CHANNELS
from .samples import ANSWERS, SIMULATED, Samples
from .textbook import fit_textbook

_IMPOSED = CHANNELS[LOAD], CHANNELS[SLIP]
"""What a drive imposes on a wheel, and a simulator is given."""

_MOST_SLIP = 0.995
"""A simulated wheel that slips by so much has no answer: it is stuck [-]."""

_APART = 2.05
"""Samples of the recording between two simulated ones at most."""


def attach(table: WheelTable, path: str | Path) -> WheelTable:
    """Give a recording's table columns with the simulator's answers for each row, by run or by time.

    They come with the load [N] and slip that it simulated: those of its file or, where that has none, those recorded.

    Parameters
    ----------
    table
        The recording's rows, with load and slip.
    path
        The simulator's file.

    Raises
    ------
    InputError
        The file has no answer, or neither the clock nor the runs of the recording, or its wheel is stuck throughout.
    """
    simulated = read_wheel_file(Path(path))
    names = [CHANNELS[channel] for channel in ANSWERS if CHANNELS[channel] in simulated]
    if not names:
        raise InputError(path, "nothing to compare", expected="torque_Nm, sinkage_m or drawbar_pull_N")
    given = [name for name in _IMPOSED if name in simulated]
    if "time_s" in table and "time_s" in simulated:
        columns = {name: _by_time(table, simulated, name) for name in (*names, *given)}
    elif table.run is not None and simulated.run is not None:
        columns = {name: _by_run(table.run, simulated.run, simulated[name]) for name in (*names, *given)}
    else:
        raise InputError(
            path, "neither time_s nor run in both files", expected="the clock or the runs of the recording"
        )
    if not any(np.isfinite(columns[name]).any() for name in names):
        raise InputError(path, "no row has the time or the run of one of the recording's", expected="the same drive")
    load, slip = (_own_or_recorded(columns.get(name), table[name]) for name in _IMPOSED)
    moves = (load > 0.0) & (slip < _MOST_SLIP)
    answers = {name: np.where(moves, columns[name], np.nan) for name in names}
    if not any(np.isfinite(values).any() for values in answers.values()):
        raise InputError(
            path, "no row has an answer of a wheel that carries load and moves",
            expected=f"load_N above 0 and slip below {_MOST_SLIP}",
        )  # fmt: skip
    columns = {**answers, **dict(zip(_IMPOSED, (load, slip), strict=True))}
    columns = {SIMULATED + name: values for name, values in columns.items()}
    return WheelTable({**table.columns, **columns}, table.wheel, table.run, table.source)


def _own_or_recorded(own: np.ndarray | None, recorded: np.ndarray) -> np.ndarray:
    """Values (n,) of the simulator's own, where it has some, and of the recording's elsewhere."""
    return recorded if own is None else np.where(np.isfinite(own), own, recorded)


def _by_run(wanted: np.ndarray, runs: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Mean of the simulated rows of each run."""
    means = {
        run: float(np.nanmean(values[runs == run])) for run in np.unique(runs) if np.isfinite(values[runs == run]).any()
    }
    return np.array([means.get(run, np.nan) for run in wanted])


def _by_time(table: WheelTable, simulated: WheelTable, name: str) -> np.ndarray:
    """Interpolate within each wheel and run that both name; NaN outside the simulated time."""
    answer = np.full(len(table), np.nan)
    rows_of, simulated_of = _labels(table, simulated)
    for label in np.unique(rows_of):
        rows, of = rows_of == label, simulated_of == label
        time_s, values = simulated["time_s"][of], simulated[name][of]
        good = np.isfinite(time_s) & np.isfinite(values)
        if good.any():
            order = np.argsort(time_s[good])
            wanted, time_s = table["time_s"][rows], time_s[good][order]
            interpolated = np.interp(wanted, time_s, values[good][order], left=np.nan, right=np.nan)
            answer[rows] = np.where(_near(wanted, time_s), interpolated, np.nan)
    return answer


def _near(wanted: np.ndarray, time_s: np.ndarray) -> np.ndarray:
    """(k,) True for times with a simulated one (m,), ascending, at them or close by on both sides.

    What happens between two that lie further apart than two samples of the recording is not told by a straight line.
    """
    after = np.clip(np.searchsorted(time_s, wanted), 0, len(time_s) - 1)
    before = np.maximum(after - 1, 0)
    farthest = _APART * float(np.median(np.diff(np.unique(wanted)))) if len(np.unique(wanted)) > 1 else 0.0
    away = np.minimum(np.abs(time_s[after] - wanted), np.abs(time_s[before] - wanted))
    return (time_s[after] - time_s[before] <= farthest) | (away <= 1e-3 * farthest)


def _labels(*tables: WheelTable) -> list[np.ndarray]:
    """Number wheel and run of each row alike in several tables, as far as all of them name them."""
    labels = [np.full(len(table), "", dtype=object) for table in tables]
    for names in ([table.wheel for table in tables], [table.run for table in tables]):
        if all(each is not None for each in names):
            labels = [label + "/" + np.asarray(each, dtype=object) for label, each in zip(labels, names, strict=True)]
    return [label.astype(str) for label in labels]


def as_differences(samples: Samples, source: str | Path) -> tuple[Samples, np.ndarray]:
    """Samples whose textbook wheel answers like the other simulator, and that simulator's own residuals (n, 5).

    The textbook wheel is fitted to what the other simulated, at the load and slip that this did it for, which have no
    errors; what it misses of that is taken off the recording. An effect then counts by its difference: our model with
    it minus our model without. `source` is the simulator's file.
    """
    if samples.simulated is None:
        raise ValueError("no simulated channels attached")
    if not np.isfinite(np.where(_answers(samples), samples.simulated, np.nan)).any():
        names = " or ".join(CHANNELS[channel] for channel in samples.answers)
        raise InputError(source, "has no answer that was recorded", expected=names)
    imitated = _simulated(samples, samples.simulated)
    seen = np.isfinite(imitated.measured[:, ANSWERS]).any(axis=1)
    if seen.sum() < 0.5 * len(samples):
        raise InputError(
            source, f"has values for {int(seen.sum())} of {len(samples)} rows",
            expected="the whole drive, as often as it was recorded",
        )  # fmt: skip
    if np.array_equal(imitated.measured[:, ANSWERS], samples.measured[:, ANSWERS], equal_nan=True):
        raise InputError(source, "gives just what was recorded", expected="what another simulator gives for the drive")
    problem, fitted = fit_textbook(imitated)
    model = AugmentedWheel(samples.wheel)
    imitation = model.predict(imitated.drive, problem.imposed, fitted.vector, fitted.theta_1).channels
    residuals = samples.measured - samples.simulated
    measured = np.where(_answers(samples), residuals + imitation, samples.measured)
    short = int((~seen).sum())
    left_out = [f"{short} of {len(samples)} rows have no simulated value: they are left out"] if short else []
    for channel in ANSWERS:
        recorded, known = channel in samples.answers, bool(np.isfinite(samples.simulated[:, channel]).any())
        if recorded != known and not any(note.startswith(CHANNELS[channel]) for note in samples.notes):
            how = "recorded but not simulated" if recorded else "simulated but not recorded"
            left_out.append(f"{CHANNELS[channel]} is {how}: it is left out")
    return replace(samples, measured=measured, notes=(*samples.notes, *left_out)), residuals


def _simulated(samples: Samples, simulated: np.ndarray) -> Samples:
    """Samples of what another simulator gives (n, 5), load and slip with it."""
    given, noise = simulated[:, [LOAD, SLIP]], samples.noise.copy()
    noise[[LOAD, SLIP]] = 0.0
    measured = np.where(_answers(samples), simulated, samples.measured)
    measured[:, [LOAD, SLIP]] = given
    drive = replace(samples.drive, load_N=given[:, 0], slip=given[:, 1])
    return replace(samples, measured=measured, drive=drive, noise=noise)


def _answers(samples: Samples) -> np.ndarray:
    """(n, 5) True for the channels that a simulator answers with and that were recorded."""
    answer = np.zeros_like(samples.measured, dtype=bool)
    answer[:, samples.answers] = True
    return answer
