"""The peak of normal stress lies elsewhere than midway, and moves forward with slip."""

from __future__ import annotations

import numpy as np

from ..wheel_soil import PEAK_SHARE
from .effect import Contact, Drive, Effect, Parameter, Situation


class StressPeakShift(Effect):
    """Angle of the peak stress as a share of the entry angle, linear in slip."""

    slug = "stress_peak_shift"
    equation = "theta_m = (a0 + a1 i) theta_1"
    source = "J.-Y. Wong, A. R. Reece, J. Terramechanics 4(1) (1967), 81-98, driven wheels"

    def __init__(self, slip_varies: bool) -> None:
        a0 = Parameter("a0", "", 0.05, 0.95, 0.45, 0.12, PEAK_SHARE)
        a1 = Parameter("a1", "", -0.8, 0.9, 0.15, 0.3)
        self.parameters = (a0, a1) if slip_varies else (a0,)

    def contact(self, contact: Contact, drive: Drive, values: np.ndarray) -> None:
        share = values[0] + (values[1] * np.maximum(drive.slip, 0.0) if len(values) > 1 else 0.0)
        contact.theta_m = np.clip(share, 0.02, 0.98) * contact.theta_1


def forms(situation: Situation) -> tuple[Effect, ...]:
    """Give the form that these data can show."""
    return (StressPeakShift(situation.drive.has("slip")),)
