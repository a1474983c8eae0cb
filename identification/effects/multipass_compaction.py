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
    equation = "ln stiffness += A s, ln strength += B s, s = 1 - exp(-|i_before| / i0) + q (N - 1) for N > 1"
    source = "after C. Senatore, C. Sandu, J. Terramechanics 48 (2011): density by the slip of the pass before"
    needs = ("pass_number",)
    parameters = (
        Parameter("A", "", 0.0, 4.0, 0.3, 0.6), Parameter("B", "", -1.0, 2.0, 0.0, 0.2),
        Parameter("i0", "", 0.02, 2.0, 0.2, 0.3, 0.2), Parameter("q", "", 0.0, 1.0, 0.2, 0.2, 0.2),
    )  # fmt: skip

    def __init__(self, drive: Drive) -> None:
        self._earlier = {number: _slip_along(drive, drive.pass_number == number - 1.0) for number in _passes(drive)}

    def contact(self, contact: Contact, drive: Drive, values: np.ndarray) -> None:
        worked = np.zeros(len(drive))
        for number, (place, slip) in self._earlier.items():
            rows = drive.pass_number == number
            if number <= 1.0 or not len(slip):
                continue
            here = drive.place_m[rows]
            before = np.full(len(here), slip.mean())
            if len(place) > 1:
                before = np.where(np.isfinite(here), np.interp(here, place, slip), before)
            worked[rows] = -np.expm1(-before / values[2]) + values[3] * (number - 1.0)
        contact.stiffness_Pa = contact.stiffness_Pa * np.exp(values[0] * worked)
        factor = np.exp(values[1] * worked)
        contact.c_Pa, contact.tan_phi = contact.c_Pa * factor, contact.tan_phi * factor


def _passes(drive: Drive) -> list[float]:
    """Numbers of passes, each once, in order."""
    return np.unique(drive.pass_number[np.isfinite(drive.pass_number)]).tolist()


def _slip_along(drive: Drive, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Mean size of the slip of some rows over equal stretches of the track: places and slips (k,).

    Without a track it is one slip, nowhere, and none where there are no rows.
    """
    slip = np.abs(drive.slip[rows])
    place = drive.place_m[rows]
    if len(slip) < 2 or not np.isfinite(place).all() or not np.ptp(place) > 0.0:
        return np.empty(0), slip.mean(keepdims=True) if len(slip) else slip
    cell = np.minimum(((place - place.min()) / np.ptp(place) * _CELLS).astype(int), _CELLS - 1)
    count = np.bincount(cell, minlength=_CELLS)
    there = count > 0
    means = np.array([np.bincount(cell, values, _CELLS)[there] for values in (place, slip)]) / count[there]
    return means[0], means[1]


def forms(situation: Situation) -> tuple[Effect, ...]:
    """Give the forms that these data can show: the number of passes has to vary."""
    if not situation.drive.has("pass_number"):
        return ()
    alone = MultipassCompaction(len(_passes(situation.drive)))
    if not situation.drive.has("slip"):
        return (alone,)
    return alone, CompactionBySlip(situation.drive)


def named(situation: Situation) -> tuple[Effect, ...]:
    """Give the forms that a simulation may ask for: the pace may be stated whatever the number of passes."""
    if not situation.drive.has("pass_number"):
        return ()
    return MultipassCompaction(2), MultipassCompaction(3), CompactionBySlip(situation.drive)
