"""Later wheels run on soil that the earlier ones have compacted."""

from __future__ import annotations

import numpy as np

from .effect import Contact, Drive, Effect, Parameter, Situation

_CELLS = 50
"""Stretches of the track over which the slip of an earlier pass is averaged: its noise is no compaction."""


class MultipassCompaction(Effect):
    """Stiffness and strength rise with the number of passes, and saturate."""

    slug = "multipass_compaction"
    equation = "ln stiffness += A [1 - exp(-(N - 1) / N0)], ln strength += B [1 - exp(-(N - 1) / N0)]"
    source = "after I. C. Holm, J. Terramechanics 6 (1969), and C. Senatore, C. Sandu, J. Terramechanics 48 (2011)"
    needs = ("pass_number",)

    def __init__(self, passes: int) -> None:
        gains = (Parameter("A", "", 0.0, 4.0, 0.3, 0.6), Parameter("B", "", -1.0, 2.0, 0.0, 0.2))
        pace = Parameter("N0", "", 0.2, 8.0, 1.0, 1.0, 1.0)
        self.parameters = (*gains, pace) if passes > 2 else gains

    def contact(self, contact: Contact, drive: Drive, values: np.ndarray) -> None:
        pace = values[2] if len(values) > 2 else 1.0
        run = np.where(np.isfinite(drive.pass_number), drive.pass_number, 1.0)
        worked = -np.expm1(-(run - 1.0) / pace)
        contact.stiffness_Pa = contact.stiffness_Pa * np.exp(values[0] * worked)
        factor = np.exp(values[1] * worked)
        contact.c_Pa, contact.tan_phi = contact.c_Pa * factor, contact.tan_phi * factor


class CompactionBySlip(Effect):
    """The more a wheel slipped, the more it compacts for the next one."""

    slug = "multipass_compaction"
    form = "by slip"
    remembers = True
    equation = "ln stiffness += A s, ln strength += B s, s = 1 - exp(-|i_before| / i0) + q (N - 1) for N > 1"
    source = "after C. Senatore, C. Sandu, J. Terramechanics 48 (2011): density by the slip of the pass before"
    needs = ("pass_number",)
    parameters = (
        Parameter("A", "", 0.0, 4.0, 0.3, 0.6), Parameter("B", "", -1.0, 2.0, 0.0, 0.2),
        Parameter("i0", "", 0.02, 2.0, 0.2, 0.3, 0.2), Parameter("q", "", 0.0, 1.0, 0.2, 0.2, 0.2),
    )  # fmt: skip

    def __init__(self, drive: Drive) -> None:
        self._known = drive, slip_before(drive)

    def contact(self, contact: Contact, drive: Drive, values: np.ndarray) -> None:
        of, before = self._known
        if of is not drive:
            before = slip_before(drive)
            self._known = drive, before
        later = np.nan_to_num(drive.pass_number, nan=1.0) - 1.0
        worked = np.where(later > 0.0, -np.expm1(-before / values[2]) + values[3] * later, 0.0)
        contact.stiffness_Pa = contact.stiffness_Pa * np.exp(values[0] * worked)
        factor = np.exp(values[1] * worked)
        contact.c_Pa, contact.tan_phi = contact.c_Pa * factor, contact.tan_phi * factor


def slip_before(drive: Drive) -> np.ndarray:
    """Size of the slip of the wheel that ran before at the same place (n,) [-]; on first passes it says nothing.

    Of the stretches before one of a later pass those count that are of the last lower pass since the track was fresh;
    where none is, or beyond their places, the mean slip stands in.
    """
    slip = np.abs(drive.slip)
    answer = np.full(len(drive), slip.mean())
    ends = np.flatnonzero(np.diff(drive.stretch)) + 1
    stretches = np.split(np.arange(len(drive)), ends)
    numbers = np.nan_to_num(drive.pass_number[[rows[0] for rows in stretches]], nan=1.0)
    for each, rows in enumerate(stretches):
        earlier = _last_pass(numbers[: each + 1])
        if len(earlier):
            answer[rows] = _along(drive, np.concatenate([stretches[one] for one in earlier]), rows)
    return answer


def _last_pass(numbers: np.ndarray) -> np.ndarray:
    """Which of the stretches before the last one are of the last lower pass on its track, by their passes' numbers."""
    own = numbers[-1]
    others = np.flatnonzero(numbers != own)
    before = numbers[: others[-1] + 1] if len(others) else numbers[:0]
    fresh = np.flatnonzero(before >= own)
    start = fresh[-1] + 1 if len(fresh) else 0
    lower = before[start:]
    return start + np.flatnonzero(lower == lower.max()) if len(lower) else np.empty(0, dtype=int)


def _along(drive: Drive, earlier: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """Size of the slip of some rows, averaged over equal stretches of their track, at the places of others."""
    slip, place = np.abs(drive.slip[earlier]), drive.place_m[earlier]
    mean, here = slip.mean(), drive.place_m[rows]
    if not np.isfinite(place).all() or not np.ptp(place) > 0.0:
        return np.full(len(rows), mean)
    cell = np.minimum(((place - place.min()) / np.ptp(place) * _CELLS).astype(int), _CELLS - 1)
    count = np.bincount(cell, minlength=_CELLS)
    there = count > 0
    at, of = np.array([np.bincount(cell, values, _CELLS)[there] for values in (place, slip)]) / count[there]
    half = 0.5 * np.ptp(place) / _CELLS
    covered = (here >= place.min() - half) & (here <= place.max() + half)
    return np.where(covered, np.interp(here, at, of), mean)


def forms(situation: Situation) -> tuple[Effect, ...]:
    """Give the forms that these data can show: the number of passes has to vary."""
    if not situation.drive.has("pass_number"):
        return ()
    numbers = situation.drive.pass_number
    alone = MultipassCompaction(len(np.unique(numbers[np.isfinite(numbers)])))
    if not situation.drive.has("slip"):
        return (alone,)
    return alone, CompactionBySlip(situation.drive)


def named(situation: Situation) -> tuple[Effect, ...]:
    """Give the forms that a simulation may ask for: the pace may be stated whatever the number of passes."""
    if not situation.drive.has("pass_number"):
        return ()
    return MultipassCompaction(2), MultipassCompaction(3), CompactionBySlip(situation.drive)
