"""On a slope, weight has a component along the track."""

from __future__ import annotations

import numpy as np
from scipy.constants import g as GRAVITY_M_S2

from .effect import PULL, Contact, Drive, Effect, Parameter, Situation

_SLOPES = 0.01
"""Pitch from which on ground that is inclined alike everywhere is a slope, and not how the sensor is mounted [rad]."""


class SlopeGravity(Effect):
    """Drawbar pull has to hold a weight on the slope: a share of the wheel's load, which is normal to the ground."""

    slug = "slope_gravity"
    form = "load"
    equation = "DP -= s W tan(pitch)"
    source = "statics"
    needs = ("pitch_rad",)
    parameters = (Parameter("s", "", 0.0, 3.0, 0.5, 1.0),)

    def act(self, channels: np.ndarray, contact: Contact, drive: Drive, values: np.ndarray) -> None:
        channels[:, PULL] -= values[0] * drive.load_N * np.tan(np.nan_to_num(drive.pitch_rad))


class HeldMass(SlopeGravity):
    """Drawbar pull has to hold a mass on the slope, whatever the load on the wheel."""

    form = "mass"
    equation = "DP -= m g sin(pitch)"

    def __init__(self, load_N: float) -> None:
        usual = load_N / GRAVITY_M_S2
        self.parameters = (Parameter("m", "kg", 0.0, 3.0 * usual, 0.5 * usual, usual),)

    def act(self, channels: np.ndarray, contact: Contact, drive: Drive, values: np.ndarray) -> None:
        channels[:, PULL] -= values[0] * GRAVITY_M_S2 * np.sin(np.nan_to_num(drive.pitch_rad))


def forms(situation: Situation) -> tuple[Effect, ...]:
    """Give the forms that these data can show: pitch has to vary, or the slope to be one, and the pull be measured."""
    drive = situation.drive
    seen = drive.pitch_rad[np.isfinite(drive.pitch_rad)]
    steady = len(seen) > 0.5 * len(drive) and abs(float(np.mean(seen))) > _SLOPES
    if not (situation.seen(PULL) and (drive.has("pitch_rad") or steady)):
        return ()
    return SlopeGravity(), HeldMass(float(np.nanmean(drive.load_N)))
