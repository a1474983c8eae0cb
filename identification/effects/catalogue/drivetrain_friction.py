"""Torque measured at the motor includes what gears and bearings lose."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ....framework.core.vehicle import Wheel
from ..effect import TORQUE, Contact, Drive, Effect, Parameter, Situation
from ..registry import register

_TURNS_BACK = 0.02
"""Share of rows in which a wheel turns backwards above which it runs both ways [-]."""

_HELD = 0.02
"""Scatter of a constant load, as a share of its mean [-]."""

_WHOLE = "coulomb+viscous+load"
"""The form with all three parts."""

_ONE_WAY = (
    "in this recording the wheel turns one way only. The constant T_c of the friction may be a wrong zero of the "
    "torque sensor, wholly or in part: read the torque with the wheel lifted and at rest"
)

_PRIOR = "engineering judgement: gears and bearings lose 5 to 20 % of the usual torque"


@register
class DrivetrainFriction(Effect):
    """Coulomb, viscous and load-dependent friction, which of them the form says."""

    slug = "drivetrain_friction"
    title = "drivetrain friction"
    what_happens = "torque measured at the motor includes gear and bearing losses"
    check = "turn the lifted wheel both ways at several speeds and read the torque"
    source = "B. Armstrong-Helouvry et al., Automatica 30 (1994)"
    changes = (TORQUE,)

    def __init__(
        self, form: str, torque_Nm: float, load_N: float, rate_rad_s: float, *, one_way: bool = False,
        whole: bool = False,
    ) -> None:  # fmt: skip
        usual = 0.1 * torque_Nm
        parts = {
            "coulomb": Parameter("T_c", "N m", 0.0, 20.0 * usual, usual, usual, _PRIOR),
            "viscous": _viscous(usual, rate_rad_s),
            "load": Parameter("mu", "m", 0.0, 20.0 * usual / load_N, 0.0, usual / load_N, _PRIOR),
        }  # fmt: skip
        self.form = form
        self._whole = (torque_Nm, load_N, rate_rad_s) if whole else None
        self._one_way, self._terms = one_way, form.split("+")
        self.remark = _ONE_WAY if one_way and "coulomb" in self._terms else ""
        self.needs = ("rim_speed_m_s",) if "viscous" in self._terms else ()
        self.parameters = tuple(parts[term] for term in self._terms)
        shown = {"coulomb": "T_c sign(omega)", "viscous": "b_v omega", "load": "mu W sign(omega)"}
        self.equation = "T += " + " + ".join(shown[term] for term in self._terms)

    @classmethod
    def forms(cls, situation: Situation) -> Sequence[Effect]:
        """Give the parts that the ranges of load and speed identify, where torque was measured."""
        if not situation.measures(TORQUE):
            return ()
        drive = situation.drive
        rate = np.abs(drive.rim_speed_m_s) / situation.wheel.radius_m
        usual = float(np.nanmean(rate)) if np.isfinite(rate).any() else 1.0
        names = ["coulomb", "load", "coulomb+load"] if drive.has("load_N") else ["coulomb"]
        if drive.has("rim_speed_m_s"):
            names += ["viscous", "coulomb+viscous"]
        load, torque, usual = float(np.nanmean(drive.load_N)), float(situation.typical[TORQUE]), max(usual, 1e-6)
        known = drive.rim_speed_m_s[np.isfinite(drive.rim_speed_m_s)]
        one_way = not len(known) or float(min(np.mean(known > 0.0), np.mean(known < 0.0))) < _TURNS_BACK
        # At a constant load the part that follows load is Coulomb's.
        whole = {"coulomb+viscous"} if np.nanstd(drive.load_N) > _HELD * load else set()
        answer: list[Effect] = [
            DrivetrainFriction(name, torque, load, usual, one_way=one_way, whole=name in whole) for name in names
        ]
        return [*answer, Stribeck(torque, usual, one_way=one_way)] if drive.has("rim_speed_m_s") else answer

    def extensions(self) -> list[Effect]:
        return [DrivetrainFriction(_WHOLE, *self._whole, one_way=self._one_way)] if self._whole else []

    def act(self, channels: np.ndarray, contact: Contact, drive: Drive, values: np.ndarray) -> None:
        rate, sense = _turning(drive, contact.wheel)
        parts = {"coulomb": sense, "viscous": rate, "load": sense * drive.load_N}
        for term, value in zip(self._terms, values, strict=True):
            channels[:, TORQUE] += value * parts[term]


class Stribeck(DrivetrainFriction):
    """Friction falls from breakaway to Coulomb's as the wheel turns faster; with a viscous part it rises again."""

    needs = ("rim_speed_m_s",)

    def __init__(self, torque_Nm: float, rate_rad_s: float, *, viscous: bool = False, one_way: bool = False) -> None:
        usual = 0.1 * torque_Nm
        self._made_of = torque_Nm, rate_rad_s, one_way
        self.form = "stribeck" + "+viscous" * viscous
        self.remark = _ONE_WAY if one_way else ""
        self.equation = "T += [T_c + T_s exp(-(omega / omega_s)^2)] sign(omega)" + " + b_v omega" * viscous
        self.parameters = (
            Parameter("T_c", "N m", 0.0, 20.0 * usual, usual, usual, _PRIOR),
            Parameter("T_s", "N m", 0.0, 40.0 * usual, usual, usual, _PRIOR),
            Parameter(
                "omega_s", "rad/s", 0.05 * rate_rad_s, 5.0 * rate_rad_s, 0.7 * rate_rad_s, rate_rad_s,
                "engineering judgement: a Stribeck speed that shows was driven", null=0.7 * rate_rad_s,
            ),
            *([_viscous(usual, rate_rad_s)] if viscous else []),
        )  # fmt: skip

    def extensions(self) -> list[Effect]:
        torque_Nm, rate_rad_s, one_way = self._made_of
        return [] if len(self.parameters) > 3 else [Stribeck(torque_Nm, rate_rad_s, viscous=True, one_way=one_way)]

    def act(self, channels: np.ndarray, contact: Contact, drive: Drive, values: np.ndarray) -> None:
        rate, sense = _turning(drive, contact.wheel)
        channels[:, TORQUE] += sense * (values[0] + values[1] * np.exp(-((rate / values[2]) ** 2)))
        if len(values) > 3:
            channels[:, TORQUE] += values[3] * rate


def _viscous(usual: float, rate_rad_s: float) -> Parameter:
    return Parameter("b_v", "N m s", 0.0, 20.0 * usual / rate_rad_s, 0.0, usual / rate_rad_s, _PRIOR)


def _turning(drive: Drive, wheel: Wheel) -> tuple[np.ndarray, np.ndarray]:
    """Wheel speed (n,) [rad/s], its mean where it was not observed, and its sign."""
    rate = drive.rim_speed_m_s / wheel.radius_m
    rate = np.where(np.isfinite(rate), rate, np.nanmean(rate) if np.isfinite(rate).any() else 1.0)
    return rate, np.sign(rate)
