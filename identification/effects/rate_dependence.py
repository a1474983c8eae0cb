"""Soil is stiffer or stronger the faster it is loaded."""

from __future__ import annotations

import numpy as np

from .effect import Contact, Drive, Effect, Parameter, Situation

_LEAST_SPEED_M_S = 1e-3


class RateDependence(Effect):
    """Stiffness and strength grow with powers of the rim's speed."""

    slug = "rate_dependence"
    equation = "stiffness ~ (r omega / v0)^m, strength ~ (r omega / v0)^s, v0 the drive's mean speed"
    source = (
        "after R. G. Pope, J. Terramechanics 6(4) (1969), and Grahn, J. Terramechanics 28 (1991): powers of the speed"
    )
    needs = ("rim_speed_m_s",)
    _stiffness = Parameter("m", "", 0.0, 0.6, 0.05, 0.15)
    _strength = Parameter("s", "", 0.0, 0.6, 0.05, 0.1)

    def __init__(self, form: str, speed_m_s: float) -> None:
        self.form = form
        self.constants = {"v0": speed_m_s}
        self.parameters = {
            "stiffness": (self._stiffness,),
            "strength": (self._strength,),
            "both": (self._stiffness, self._strength),
        }[form]

    def contact(self, contact: Contact, drive: Drive, values: np.ndarray) -> None:
        fast = np.maximum(np.abs(drive.rim_speed_m_s), _LEAST_SPEED_M_S) / self.constants["v0"]
        fast = np.where(np.isfinite(fast), fast, 1.0)
        if self.form != "strength":
            contact.stiffness_Pa = contact.stiffness_Pa * fast ** values[0]
        if self.form != "stiffness":
            factor = fast ** values[-1]
            contact.c_Pa, contact.tan_phi = contact.c_Pa * factor, contact.tan_phi * factor


def forms(situation: Situation) -> tuple[Effect, ...]:
    """Give the forms that these data can show: the rim's speed has to vary."""
    drive = situation.drive
    if not drive.has("rim_speed_m_s"):
        return ()
    speed = np.maximum(np.abs(drive.rim_speed_m_s), _LEAST_SPEED_M_S)
    mean = float(np.exp(np.nanmean(np.log(speed))))
    return tuple(RateDependence(form, mean) for form in ("stiffness", "strength", "both"))
