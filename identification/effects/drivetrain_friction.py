"""Torque measured at the motor includes what gears and bearings lose."""

from __future__ import annotations

import numpy as np

from ...framework.core.vehicle import Wheel
from .effect import TORQUE, Contact, Drive, Effect, Parameter, Situation

_TURNS_BACK = 0.02
"""Share of rows in which a wheel turns back from which on it does [-]."""

_HELD = 0.02
"""Scatter of a load that is held, a share of its mean [-]."""

_WHOLE = "coulomb+viscous+load"
"""The form with all three parts."""

_ONE_WAY = (
    "as far as was recorded the wheel turns one way only: the constant T_c of the friction may be, or be partly, a "
    "wrong zero of the torque sensor; read the torque with the wheel lifted and at rest"
)


class DrivetrainFriction(Effect):
    """Coulomb, viscous and load-dependent friction, which of them the form says."""

    slug = "drivetrain_friction"
    source = "B. Armstrong-Helouvry et al., Automatica 30 (1994)"

    def __init__(
        self, form: str, torque_Nm: float, load_N: float, rate_rad_s: float, *, one_way: bool = False,
        whole: bool = False,
    ) -> None:  # fmt: skip
        usual = 0.1 * torque_Nm
        parts = {
            "coulomb": Parameter("T_c", "N m", 0.0, 20.0 * usual, usual, usual),
            "viscous": _viscous(usual, rate_rad_s),
            "load": Parameter("mu", "m", 0.0, 20.0 * usual / load_N, 0.0, usual / load_N),
        }  # fmt: skip
        self.form = form
        self.freed = form == _WHOLE
        self._freer = [DrivetrainFriction(_WHOLE, torque_Nm, load_N, rate_rad_s, one_way=one_way)] if whole else []
        # What follows neither load nor speed is no more than a wrong zero of the torque.
        self.said_by = "torque_offset" if form == "coulomb" else ""
        self._terms = form.split("+")
        self.remark = _ONE_WAY if one_way and "coulomb" in self._terms else ""
        self.needs = ("rim_speed_m_s",) if "viscous" in self._terms else ()
        self.parameters = tuple(parts[term] for term in self._terms)
        shown = {"coulomb": "T_c sign(omega)", "viscous": "b_v omega", "load": "mu W sign(omega)"}
        self.equation = "T += " + " + ".join(shown[term] for term in self._terms)

    def freer(self) -> list[Effect]:
        return list(self._freer)

    def act(self, channels: np.ndarray, contact: Contact, drive: Drive, values: np.ndarray) -> None:
        rate, sense = _turning(drive, contact.wheel)
        parts = {"coulomb": sense, "viscous": rate, "load": sense * drive.load_N}
        for term, value in zip(self._terms, values, strict=True):
            channels[:, TORQUE] += value * parts[term]


class Stribeck(Effect):
    """Friction falls from breakaway to Coulomb's as the wheel turns faster; with a viscous part it rises again."""

    slug = "drivetrain_friction"
    source = DrivetrainFriction.source
    needs = ("rim_speed_m_s",)

    def __init__(self, torque_Nm: float, rate_rad_s: float, *, viscous: bool = False, one_way: bool = False) -> None:
        usual = 0.1 * torque_Nm
        self.form = "stribeck" + "+viscous" * viscous
        self.freed = viscous
        self.remark = _ONE_WAY if one_way else ""
        self.equation = "T += [T_c + T_s exp(-(omega / omega_s)^2)] sign(omega)" + " + b_v omega" * viscous
        self.parameters = (
            Parameter("T_c", "N m", 0.0, 20.0 * usual, usual, usual),
            Parameter("T_s", "N m", 0.0, 40.0 * usual, usual, usual),
            Parameter("omega_s", "rad/s", 0.05 * rate_rad_s, 5.0 * rate_rad_s, 0.7 * rate_rad_s, rate_rad_s,
                      0.7 * rate_rad_s),
            *([_viscous(usual, rate_rad_s)] if viscous else []),
        )  # fmt: skip
        self._freer = [] if viscous else [Stribeck(torque_Nm, rate_rad_s, viscous=True, one_way=one_way)]

    def freer(self) -> list[Effect]:
        return list(self._freer)

    def act(self, channels: np.ndarray, contact: Contact, drive: Drive, values: np.ndarray) -> None:
        rate, sense = _turning(drive, contact.wheel)
        channels[:, TORQUE] += sense * (values[0] + values[1] * np.exp(-((rate / values[2]) ** 2)))
        if len(values) > 3:
            channels[:, TORQUE] += values[3] * rate


def _viscous(usual: float, rate_rad_s: float) -> Parameter:
    return Parameter("b_v", "N m s", 0.0, 20.0 * usual / rate_rad_s, 0.0, usual / rate_rad_s)


def _turning(drive: Drive, wheel: Wheel) -> tuple[np.ndarray, np.ndarray]:
    """Wheel speed (n,) [rad/s], its mean where it was not observed, and its sense."""
    rate = drive.rim_speed_m_s / wheel.radius_m
    rate = np.where(np.isfinite(rate), rate, np.nanmean(rate) if np.isfinite(rate).any() else 1.0)
    return rate, np.sign(rate)


def forms(situation: Situation) -> tuple[Effect, ...]:
    """Give the forms that these data can show: torque has to be measured."""
    if not situation.seen(TORQUE):
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
    # A load that is held is no other part than Coulomb's.
    whole = {"coulomb+viscous"} if np.nanstd(drive.load_N) > _HELD * load else set()
    answer: list[Effect] = [
        DrivetrainFriction(name, torque, load, usual, one_way=one_way, whole=name in whole) for name in names
    ]
    if drive.has("rim_speed_m_s"):
        answer.append(Stribeck(torque, usual, one_way=one_way))
    return tuple(answer)
