"""Torque measured at the motor includes what gears and bearings lose."""

from __future__ import annotations

import numpy as np

from .effect import TORQUE, Contact, Drive, Effect, Parameter, Situation


class DrivetrainFriction(Effect):
    """Coulomb, viscous and load-dependent friction, which of them the form says."""

    slug = "drivetrain_friction"
    source = "B. Armstrong-Helouvry et al., Automatica 30 (1994)"

    def __init__(self, form: str, torque_Nm: float, load_N: float, rate_rad_s: float) -> None:
        usual = 0.1 * torque_Nm
        parts = {
            "coulomb": Parameter("T_c", "N m", 0.0, 20.0 * usual, usual, usual),
            "viscous": Parameter("b_v", "N m s", 0.0, 20.0 * usual / rate_rad_s, 0.0,
                                 usual / rate_rad_s),
            "load": Parameter("mu", "m", 0.0, 20.0 * usual / load_N, 0.0, usual / load_N),
        }  # fmt: skip
        self.form = form
        self._terms = form.split("+")
        self.needs = ("rim_speed_m_s",) if "viscous" in self._terms else ()
        self.parameters = tuple(parts[term] for term in self._terms)
        shown = {"coulomb": "T_c sign(omega)", "viscous": "b_v omega", "load": "mu W sign(omega)"}
        self.equation = "T += " + " + ".join(shown[term] for term in self._terms)

    def act(self, channels: np.ndarray, contact: Contact, drive: Drive, values: np.ndarray) -> None:
        rate = drive.rim_speed_m_s / contact.wheel.radius_m
        rate = np.where(np.isfinite(rate), rate, np.nanmean(rate) if np.isfinite(rate).any() else 1.0)
        sense = np.where(np.abs(rate) > 0.0, np.sign(rate), 0.0)
        parts = {"coulomb": sense, "viscous": rate, "load": sense * drive.load_N}
        for term, value in zip(self._terms, values, strict=True):
            channels[:, TORQUE] += value * parts[term]


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
    load = float(np.nanmean(drive.load_N))
    return tuple(DrivetrainFriction(name, float(situation.typical[TORQUE]), load, max(usual, 1e-6)) for name in names)
