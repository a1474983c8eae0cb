"""Later wheels run on soil that the earlier ones have compacted."""

from __future__ import annotations

import math

import numpy as np

from .effect import Contact, Drive, Effect, Parameter, Situation
from .positions import runs_of

_CELLS, _MOST_CELLS = 50, 10000
"""Pieces of a stretch over which the slip of an earlier pass is averaged (its noise is no compaction), and the most of
all places.
"""


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

    That is the last one of a lower pass in a stretch before. Where none of these ran their mean stands in, and where
    there is none that of all. Where places are not known throughout it is the mean of the last lower pass.
    """
    slip = np.abs(drive.slip)
    answer = np.full(len(drive), slip.mean())
    stretches = runs_of(drive.stretch)
    numbers = np.nan_to_num(drive.pass_number[[rows[0] for rows in stretches]], nan=1.0)
    place = drive.place_m
    if not np.isfinite(place).all():
        for each, rows in enumerate(stretches):
            if len(last_pass := _last_pass(numbers[: each + 1])):
                answer[rows] = slip[np.concatenate([stretches[one] for one in last_pass])].mean()
        return answer
    cell = _cells(place, stretches)
    left = {number: np.full((2, int(cell.max()) + 1), math.nan) for number in np.unique(numbers).tolist()}
    for number, rows in zip(numbers.tolist(), stretches, strict=True):
        there = np.flatnonzero(np.isfinite(left[number][0]))
        if len(there):
            at, ran = left[number][:, there]
            nearest = np.searchsorted(0.5 * (at[1:] + at[:-1]), place[rows])
            near = np.abs(there[nearest] - cell[rows]) <= 1
            answer[rows] = np.where(near, ran[nearest], ran.mean())
        cells, means = _means(cell[rows], place[rows], slip[rows])
        for later, grid in left.items():
            if later > number:
                grid[:, cells] = means
    return answer


def _last_pass(numbers: np.ndarray) -> np.ndarray:
    """Which of the stretches before the last one are of the last lower pass since the track was fresh."""
    own = numbers[-1]
    others = np.flatnonzero(numbers != own)
    before = numbers[: others[-1] + 1] if len(others) else numbers[:0]
    fresh = np.flatnonzero(before >= own)
    start = fresh[-1] + 1 if len(fresh) else 0
    lower = before[start:]
    return start + np.flatnonzero(lower == lower.max()) if len(lower) else np.empty(0, dtype=int)


def _cells(place_m: np.ndarray, stretches: list[np.ndarray]) -> np.ndarray:
    """Number of the cell of each place (n,), `_CELLS` of them in a usual stretch, and none that a wheel steps over."""
    usual = float(np.median([np.ptp(place_m[rows]) for rows in stretches]))
    step = float(np.median(np.abs(np.diff(place_m)))) if len(place_m) > 1 else 0.0
    width = max(usual / _CELLS, 2.0 * step, float(np.ptp(place_m)) / _MOST_CELLS)
    return np.floor((place_m - place_m.min()) / width).astype(int) if width > 0.0 else np.zeros(len(place_m), dtype=int)


def _means(cell: np.ndarray, place_m: np.ndarray, slip: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Cells (k,) that a stretch ran through, and its mean places and slips there (2, k)."""
    ran, which = np.unique(cell, return_inverse=True)
    count = np.bincount(which)
    return ran, np.array([np.bincount(which, values) / count for values in (place_m, slip)])


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
