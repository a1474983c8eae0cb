"""Another simulator's output: its residuals, and effects as differences from it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from ...framework.core.errors import InputError
from ..effects.effect import LOAD, SLIP
from ..mechanics.augmented import AugmentedWheel
from ..mechanics.textbook import CHANNELS
from .fit import fit_textbook
from .latent import exact
from .likelihood import Problem
from .samples import ANSWERS, LEAST_ROWS, Samples

_FLAT = 1e-9
"""Share of its size by which a channel scatters that another simulator gives the same value throughout [-]."""

_LEAST_SHARE = 0.5
"""Share of the rows that the other simulator has to answer in [-]."""

_SAME_LOAD, _SAME_SLIP = 0.01, 0.005
"""Median differences in load, as a share, and in slip, above which a note reports them [-]."""


def as_differences(samples: Samples, source: str | Path) -> tuple[Samples, np.ndarray]:
    """Samples whose textbook wheel answers like the other simulator, and what that simulator misses (n, 5), SI.

    The textbook wheel is fitted to what the other simulated, at the load and slip that this did it for, which have no
    errors; what it misses of that is taken off the recording. An effect then counts by its difference: our model with
    it minus our model without. What the other simulator misses is computed at the recorded load and slip: where it ran
    at others, by the textbook wheel. `source` is the simulator's file.
    """
    if samples.simulated is None:
        raise ValueError("no simulated channels attached")
    answers = list(samples.answers)
    if not np.isfinite(samples.simulated[:, answers]).any():
        names = " or ".join(CHANNELS[channel] for channel in answers)
        raise InputError(source, "has no answer that was recorded", expected=names)
    imitated = _simulated(samples, samples.simulated)
    seen = np.asarray(np.isfinite(imitated.measured[:, answers]).any(axis=1))
    if seen.sum() < _LEAST_SHARE * len(samples):
        raise InputError(
            source, f"has values of a wheel that carries load and moves in {int(seen.sum())} of {len(samples)} rows",
            expected="the whole drive, as often as it was recorded",
        )  # fmt: skip
    apart = imitated.measured[:, answers] - samples.measured[:, answers]
    if not np.any(apart[np.isfinite(apart)]):
        raise InputError(source, "gives just what was recorded", expected="what another simulator gives for the drive")
    problem, fitted = fit_textbook(imitated)
    model = AugmentedWheel(samples.wheel)
    there = model.predict(imitated.drive, problem.imposed, fitted.vector, fitted.theta_1).channels[:, answers]
    recorded = Problem(samples)
    here = recorded.linearise(model, fitted.vector, None)
    beyond = there - samples.simulated[:, answers]
    measured, missed = samples.measured.copy(), np.full_like(samples.measured, np.nan)
    measured[:, answers] += beyond
    missed[:, answers] = recorded.residuals(here) + beyond
    notes = (*samples.notes, *_another_drive(samples, samples.simulated), *_left_out(samples, samples.simulated, seen))
    return replace(samples, measured=measured, notes=notes), missed


def _simulated(samples: Samples, simulated: np.ndarray) -> Samples:
    """Samples of what another simulator gives (n, 5), load and slip with it."""
    given, noise, answers = simulated[:, [LOAD, SLIP]], samples.noise.copy(), list(samples.answers)
    # Rows without an answer count for nothing, at whatever load and slip.
    given = np.where(np.isfinite(given), given, samples.measured[:, [LOAD, SLIP]])
    measured = samples.measured.copy()
    measured[:, [LOAD, SLIP]], measured[:, answers] = given, simulated[:, answers]
    drive = replace(samples.drive, load_N=given[:, 0], slip=given[:, 1])
    return replace(
        samples, measured=measured, drive=drive, noise=noise, load=exact(given[:, 0]), slip=exact(given[:, 1])
    )


def _another_drive(samples: Samples, simulated: np.ndarray) -> list[str]:
    """Say by how much the other simulator's load and slip (n, 5) are not those recorded."""
    load = float(np.nanmedian(np.abs(simulated[:, LOAD] / samples.measured[:, LOAD] - 1.0)))
    slip = float(np.nanmedian(np.abs(simulated[:, SLIP] - samples.measured[:, SLIP])))
    if load <= _SAME_LOAD and slip <= _SAME_SLIP:
        return []
    return [
        "the other simulator ran at another load or slip than was recorded (medians of the differences: "
        f"{100.0 * load:.2g} % of the load, {slip:.2g} of slip): the errors are corrected for it by the textbook "
        "wheel fitted to that simulator"
    ]


def _left_out(samples: Samples, simulated: np.ndarray, seen: np.ndarray) -> list[str]:
    """Say which rows, (n,) not `seen`, and which channels are not compared with the simulated ones (n, 5)."""
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
