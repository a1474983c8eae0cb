"""The peak of normal stress lies elsewhere than midway, and moves forward with slip."""

from __future__ import annotations

import numpy as np

from ..mechanics.textbook import PEAK_SHARE
from .effect import Contact, Drive, Effect, Parameter, Situation

_BRAKED = 0.02
"""Share of samples with negative slip from which on it matters what braked wheels do [-]."""

_PUBLISHED = (0.1, 0.6)
"""Wong & Reece (1967) have 0.18 on loose and 0.43 on compact sand, others up to midway [-]; with room."""

_FORWARD, _TOLD = 0.02, 2.5
"""Nobody has published a peak that lies beyond midway without slip: so much room, or so many standard deviations [-].
Of 41 shifts found where there was one none was beyond, of nine that stood in for what the catalogue lacked three."""

_MOVES = 0.25
"""Least a1 that was published with an a0 so much below midway, as a share of that [-], with room: Wong & Reece (1967)
have 0.32 with a0 = 0.18 on loose sand, a share of 1, and more on others."""

_A0 = Parameter("a0", "", 0.05, 0.95, 0.45, 0.12, PEAK_SHARE, published=_PUBLISHED)
_A1 = Parameter("a1", "", -0.8, 0.9, 0.15, 0.3)


class StressPeakShift(Effect):
    """Angle of the peak stress as a share of the entry angle, linear in the slip of a driven wheel."""

    slug = "stress_peak_shift"
    equation = "theta_m = (a0 + a1 i) theta_1"
    source = "J.-Y. Wong, A. R. Reece, J. Terramechanics 4(1) (1967), 81-98, driven wheels"
    parameters = (_A0, _A1)

    def contact(self, contact: Contact, drive: Drive, values: np.ndarray) -> None:
        share = values[0] + (values[1] * self.moving(drive.slip) if len(values) > 1 else 0.0)
        # Shifted from where it is, which an exit angle may have moved: at its null the effect is nothing beside others.
        contact.theta_m = contact.theta_m + (np.clip(share, 0.02, 0.98) - PEAK_SHARE) * contact.theta_1

    def unheard_of(self, values: np.ndarray, sd: np.ndarray) -> list[str]:
        beyond = super().unheard_of(values, sd)
        if not beyond and values[0] > PEAK_SHARE + max(_FORWARD, _TOLD * sd[0]):
            beyond.append(f"a0 = {values[0]:.3g}")
        if len(values) > 1 and values[1] + 2.0 * sd[1] < _MOVES * max(PEAK_SHARE - values[0], 0.0):
            beyond.append(f"a0 = {values[0]:.3g} beside a1 = {values[1]:.3g}")
        return beyond

    def moving(self, slip: np.ndarray) -> np.ndarray:
        """Give the slip (n,) that moves the peak."""
        return np.maximum(slip, 0.0)


class PeakMovesBack(StressPeakShift):
    """The same line goes on below zero slip: the peak of a braked wheel moves back."""

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


def forms(situation: Situation) -> tuple[Effect, ...]:
    """Give the forms that these data can show."""
    if not situation.drive.has("slip"):
        return (PeakElsewhere(),)
    with np.errstate(invalid="ignore"):
        braked = float(np.mean(situation.drive.slip < 0.0))
    return named(situation) if braked > _BRAKED else (StressPeakShift(),)


def named(situation: Situation) -> tuple[Effect, ...]:
    """Give the forms that a simulation may ask for, whatever its slips."""
    return StressPeakShift(), PeakMovesBack(), PeakMovesForward()
