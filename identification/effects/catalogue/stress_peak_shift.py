"""The peak of normal stress lies elsewhere than midway, and moves forward with slip."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...mechanics.textbook import PEAK_SHARE
from ..effect import Contact, Drive, Effect, Parameter, Situation
from ..registry import register

_BRAKED = 0.02
"""Share of samples with negative slip above which the laws of braked wheels differ [-]."""

_A0 = Parameter(
    "a0", "", 0.05, 0.95, 0.45, 0.12,
    "J.-Y. Wong, A. R. Reece (1967): 0.18 on loose and 0.43 on compact sand; others 0.4 to 0.5", null=PEAK_SHARE,
)  # fmt: skip
_A1 = Parameter("a1", "", -0.8, 0.9, 0.15, 0.3, "J.-Y. Wong, A. R. Reece (1967): 0.32 on loose and on compact sand")


@register
class StressPeakShift(Effect):
    """Angle of the peak stress as a share of the entry angle, linear in the slip of a driven wheel."""

    slug = "stress_peak_shift"
    title = "shift of the peak stress"
    what_happens = "the peak of normal stress moves along the rim with slip"
    check = "measure the normal stress around the rim with pressure sensors at two slips"
    of_any_wheel = True
    belongs_to = "ground"
    equation = "theta_m = (a0 + a1 i) theta_1"
    source = "J.-Y. Wong, A. R. Reece, J. Terramechanics 4(1) (1967), 81-98, driven wheels"
    parameters = (_A0, _A1)

    @classmethod
    def forms(cls, situation: Situation) -> Sequence[Effect]:
        """Give the forms that the range of slip identifies."""
        if not situation.drive.has("slip"):
            return (PeakElsewhere(),)
        with np.errstate(invalid="ignore"):
            braked = float(np.mean(situation.drive.slip < 0.0))
        return cls.forms_by_name(situation) if braked > _BRAKED else (StressPeakShift(),)

    @classmethod
    def forms_by_name(cls, situation: Situation) -> Sequence[Effect]:
        """Give all forms, whatever the slip."""
        return StressPeakShift(), PeakMovesBack(), PeakMovesForward()

    def contact(self, contact: Contact, drive: Drive, values: np.ndarray) -> None:
        share = values[0] + (values[1] * self.moving(drive.slip) if len(values) > 1 else 0.0)
        # Relative to where the peak is, which an exit angle may have moved: at its null the effect does nothing.
        contact.theta_m = contact.theta_m + (np.clip(share, 0.02, 0.98) - PEAK_SHARE) * contact.theta_1

    def moving(self, slip: np.ndarray) -> np.ndarray:
        """Give the slip (n,) that moves the peak."""
        return np.maximum(slip, 0.0)


class PeakMovesBack(StressPeakShift):
    """The same line continues below zero slip: the peak of a braked wheel moves back."""

    form = "braked wheels back"
    equation = "theta_m = (a0 + a1 i) theta_1, i < 0 too"
    source = "G. Ishigami et al., J. Field Robotics 24(3) (2007), 233-250, for slips from -1 to 1"

    def moving(self, slip: np.ndarray) -> np.ndarray:
        return slip


class PeakMovesForward(StressPeakShift):
    """A braked wheel moves the peak as a driven one does."""

    form = "braked wheels alike"
    equation = "theta_m = (a0 + a1 |i|) theta_1"
    source = "after J.-Y. Wong, A. R. Reece, J. Terramechanics 4(2) (1967), 7-25, towed wheels: linear in skid"

    def moving(self, slip: np.ndarray) -> np.ndarray:
        return np.abs(slip)


class PeakElsewhere(StressPeakShift):
    """Angle of the peak stress as a share of the entry angle: where slip does not vary."""

    equation = "theta_m = a0 theta_1"
    parameters = (_A0,)
