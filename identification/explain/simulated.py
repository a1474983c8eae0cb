"""Comparison with another simulator: its residuals, and effects as differences from it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from ...framework.core.errors import InputError
from ..effects.effect import LOAD, SLIP
from ..mechanics.textbook import CHANNELS
from .fit import fit_textbook
from .latent import exact
from .likelihood import Problem
from .samples import ANSWERS, LEAST_ROWS, Samples

_FLAT = 1e-9
"""Least standard deviation, relative to its size, of a channel of another simulator that changes [-]."""

_LEAST_SHARE = 0.5
"""Least share of the rows for which the other simulator has values [-]."""

_SAME_LOAD, _SAME_SLIP = 0.01, 0.005
"""Median differences in load, as a share, and in slip, above which a note reports them [-]."""


def as_differences(samples: Samples, source: str | Path) -> tuple[Samples, np.ndarray]:
    """Return samples relative to another simulator, and the residuals of that simulator (n, 5), SI.

    The textbook wheel is fitted to the other simulator's channels at its load and slip, which have no errors. The
    residuals of this fit are subtracted from the recording: an effect then counts by the difference between our model
    with it and without. The other simulator's residuals are for the recorded load and slip: the textbook wheel corrects
    for other ones. `source` is the simulator's file.
    """
    if samples.simulated is None:
        raise ValueError("no simulated channels attached")
    answers = list(samples.answers)
    if not np.isfinite(samples.simulated[:, answers]).any():
        names = " or ".join(CHANNELS[channel] for channel in answers)
        raise InputError(source, "has no answer that was recorded", expected=names)
    imitation = _samples_of(samples, samples.simulated)
    seen = np.asarray(np.isfinite(imitation.measured[:, answers]).any(axis=1))
    if seen.sum() < _LEAST_SHARE * len(samples):
        raise InputError(
            source, f"has values of a wheel that carries load and moves in {int(seen.sum())} of {len(samples)} rows",
            expected="the whole drive, as often as it was recorded",
        )  # fmt: skip
    difference = imitation.measured[:, answers] - samples.measured[:, answers]
    if not np.any(difference[np.isfinite(difference)]):
        raise InputError(source, "gives just what was recorded", expected="what another simulator gives for the drive")
    problem, fitted = fit_textbook(imitation)
    model = fitted.model
    there = model.predict(imitation.drive, problem.imposed, fitted.vector, fitted.theta_1).channels[:, answers]
    recorded = Problem(samples)
    here = recorded.linearise(model, fitted.vector, None)
    correction = there - samples.simulated[:, answers]
    measured, residuals = samples.measured.copy(), np.full_like(samples.measured, np.nan)
    measured[:, answers] += correction
    residuals[:, answers] = recorded.residuals(here) + correction
    notes = _drive_notes(samples, samples.simulated) + _omission_notes(samples, samples.simulated, seen)
    return replace(samples, measured=measured, notes=(*samples.notes, *notes)), residuals


def _samples_of(samples: Samples, simulated: np.ndarray) -> Samples:
    """Samples of another simulator's channels (n, 5), with its load and slip."""
    given, noise, answers = simulated[:, [LOAD, SLIP]], samples.noise.copy(), list(samples.answers)
    # Rows without a predicted channel have no weight, whatever their load and slip.
    given = np.where(np.isfinite(given), given, samples.measured[:, [LOAD, SLIP]])
    measured = samples.measured.copy()
    measured[:, [LOAD, SLIP]], measured[:, answers] = given, simulated[:, answers]
    drive = replace(samples.drive, load_N=given[:, 0], slip=given[:, 1])
    return replace(
        samples, measured=measured, drive=drive, noise=noise, load=exact(given[:, 0]), slip=exact(given[:, 1])
    )


def _drive_notes(samples: Samples, simulated: np.ndarray) -> list[str]:
    """Notes on differences of the other simulator's load and slip (n, 5) from those recorded."""
    load = float(np.nanmedian(np.abs(simulated[:, LOAD] / samples.measured[:, LOAD] - 1.0)))
    slip = float(np.nanmedian(np.abs(simulated[:, SLIP] - samples.measured[:, SLIP])))
    if load <= _SAME_LOAD and slip <= _SAME_SLIP:
        return []
    return [
        "the other simulator ran at another load or slip than was recorded (medians of the differences: "
        f"{100.0 * load:.2g} % of the load, {slip:.2g} of slip): the errors are corrected for it by the textbook "
        "wheel fitted to that simulator"
    ]


def _omission_notes(samples: Samples, simulated: np.ndarray, seen: np.ndarray) -> list[str]:
    """Notes on rows, (n,) not `seen`, and channels that are not compared with the simulated ones (n, 5)."""
    short = int((~seen).sum())
    notes = [f"{short} of {len(samples)} rows have no simulated value: they are left out"] if short else []
    for channel in ANSWERS:
        recorded, known = channel in samples.answers, np.isfinite(simulated[:, channel]).sum() >= LEAST_ROWS
        if recorded != known and not any(note.startswith(CHANNELS[channel]) for note in samples.notes):
            how = "recorded but not simulated" if recorded else "simulated but not recorded"
            notes.append(f"{CHANNELS[channel]} is {how}: it is left out")
        elif (
            known
            and recorded
            and not np.nanstd(simulated[:, channel]) > _FLAT * np.nanmax(np.abs(simulated[:, channel]))
        ):
            notes.append(f"the other simulator's {CHANNELS[channel]} never changes")
    return notes
