"""Soil is stiffer or stronger the faster it is loaded."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..effect import Contact, Drive, Effect, Parameter, Situation
from ..registry import register

_LEAST_SPEED_M_S = 1e-3

_PRIOR = (
    "engineering judgement. The strength of clay grows by some 10 % a tenfold rate, a power of 0.04 (F. H. Kulhawy, "
    "P. W. Mayne, EPRI EL-6800 (1990)). That of wet soil grows by more"
)


@register
class RateDependence(Effect):
    """Stiffness and strength grow with powers of the rim speed."""

    slug = "rate_dependence"
    title = "rate dependence"
    what_happens = "soil is stiffer or stronger the faster it is loaded"
    check = "drive at speeds from a third to three times the present one at the same load and slip"
    equation = "stiffness ~ (r omega / v0)^m, strength ~ (r omega / v0)^s, v0 the drive's mean speed"
    source = (
        "after R. G. Pope, J. Terramechanics 6(4) (1969), and Grahn, J. Terramechanics 28 (1991): powers of the speed"
    )
    needs = ("rim_speed_m_s",)
    belongs_to = "ground"

    def __init__(self, form: str, speed_m_s: float) -> None:
        self.form = form
        self.constants = {"v0": speed_m_s}
        stiffness, strength = (
            Parameter("m", "", 0.0, 0.6, 0.05, 0.15, _PRIOR),
            Parameter("s", "", 0.0, 0.6, 0.05, 0.1, _PRIOR),
        )
        self.parameters = {"stiffness": (stiffness,), "strength": (strength,), "both": (stiffness, strength)}[form]

    @classmethod
    def forms(cls, situation: Situation) -> Sequence[Effect]:
        """Give the forms whose speed varies."""
        drive = situation.drive
        answer: list[Effect] = []
        if drive.has("rim_speed_m_s"):
            mean = _mean(drive.rim_speed_m_s)
            answer += [RateDependence(form, mean) for form in ("stiffness", "strength", "both")]
        if drive.has("travel_speed_m_s"):
            answer.append(PenetrationRate(_mean(drive.travel_speed_m_s)))
        return answer

    def contact(self, contact: Contact, drive: Drive, values: np.ndarray) -> None:
        fast = np.maximum(np.abs(drive.rim_speed_m_s), _LEAST_SPEED_M_S) / self.constants["v0"]
        fast = np.where(np.isfinite(fast), fast, 1.0)
        if self.form != "strength":
            contact.stiffness_Pa = contact.stiffness_Pa * fast ** values[0]
        if self.form != "stiffness":
            factor = fast ** values[-1]
            contact.c_Pa, contact.tan_phi = contact.c_Pa * factor, contact.tan_phi * factor


class PenetrationRate(RateDependence):
    """Pressure grows with a power of the speed at which the rim enters the ground."""

    form = "penetration"
    equation = "stiffness ~ (V sin theta_1 / w0)^p, w0 the drive's mean travel speed"
    source = "after M. Grahn, J. Terramechanics 28 (1991), 351-362: pressure-sinkage with the penetration velocity"
    needs = ("travel_speed_m_s",)
    parameters = (Parameter("p", "", 0.0, 0.6, 0.05, 0.15, _PRIOR),)

    def __init__(self, speed_m_s: float) -> None:
        self.constants = {"w0": speed_m_s}

    def contact(self, contact: Contact, drive: Drive, values: np.ndarray) -> None:
        entering = np.maximum(np.abs(drive.travel_speed_m_s) * np.sin(contact.theta_1), _LEAST_SPEED_M_S)
        fast = entering / self.constants["w0"]
        contact.stiffness_Pa = contact.stiffness_Pa * np.where(np.isfinite(fast), fast, 1.0) ** values[0]


def _mean(speed_m_s: np.ndarray) -> float:
    """Geometric mean of a speed's absolute value."""
    return float(np.exp(np.nanmean(np.log(np.maximum(np.abs(speed_m_s), _LEAST_SPEED_M_S)))))
