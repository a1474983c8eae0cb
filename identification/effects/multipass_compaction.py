"""Later wheels run on soil that the earlier ones have compacted."""

from __future__ import annotations

import numpy as np

from .effect import Contact, Drive, Effect, Parameter, Situation


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

    def contact(self, contact: Contact, drive: Drive, values: np.ndarray) -> None:
        later = np.nan_to_num(drive.pass_number, nan=1.0) - 1.0
        worked = np.where(later > 0.0, -np.expm1(-drive.slip_before / values[2]) + values[3] * later, 0.0)
        contact.stiffness_Pa = contact.stiffness_Pa * np.exp(values[0] * worked)
        factor = np.exp(values[1] * worked)
        contact.c_Pa, contact.tan_phi = contact.c_Pa * factor, contact.tan_phi * factor


def forms(situation: Situation) -> tuple[Effect, ...]:
    """Give the forms that these data can show: the number of passes has to vary."""
    if not situation.drive.has("pass_number"):
        return ()
    numbers = situation.drive.pass_number
    alone = MultipassCompaction(len(np.unique(numbers[np.isfinite(numbers)])))
    if not situation.drive.has("slip"):
        return (alone,)
    return alone, CompactionBySlip()


def named(situation: Situation) -> tuple[Effect, ...]:
    """Give the forms that a simulation may ask for: the pace may be stated whatever the number of passes."""
    if not situation.drive.has("pass_number"):
        return ()
    return MultipassCompaction(2), MultipassCompaction(3), CompactionBySlip()
