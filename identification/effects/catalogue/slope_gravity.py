"""On a slope, weight has a component along the track."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.constants import g as GRAVITY_M_S2

from ..effect import PULL, Contact, Drive, Effect, Parameter, Situation
from ..registry import register

_SLOPE = 0.01
"""Mean pitch above which ground of constant slope is inclined; below, it may be the mounting of the sensor [rad]."""


@register
class SlopeGravity(Effect):
    """The drawbar pull has to hold a weight on the slope, a share of the load, which is normal to it."""

    slug = "slope_gravity"
    title = "gravity on the slope"
    what_happens = "on a slope, weight has a component along the track"
    check = "drive the same slope up and down and compare the drawbar pull"
    form = "load"
    equation = "DP -= s W tan(pitch)"
    source = "statics"
    needs = ("pitch_rad",)
    changes = (PULL,)
    parameters = (
        Parameter(
            "s",
            "",
            0.0,
            3.0,
            0.5,
            1.0,
            "statics: 1 where the wheel pulls the weight that it carries, more of a trailer",
        ),
    )

    @classmethod
    def forms(cls, situation: Situation) -> Sequence[Effect]:
        """Give the forms where the drawbar pull was measured and pitch varies, or is that of a slope."""
        drive = situation.drive
        seen = drive.pitch_rad[np.isfinite(drive.pitch_rad)]
        steady = len(seen) > 0.5 * len(drive) and abs(float(np.mean(seen))) > _SLOPE
        if not (situation.measures(PULL) and (drive.has("pitch_rad") or steady)):
            return ()
        return SlopeGravity(), HeldMass(float(np.nanmean(drive.load_N)))

    def act(self, channels: np.ndarray, contact: Contact, drive: Drive, values: np.ndarray) -> None:
        channels[:, PULL] -= values[0] * drive.load_N * np.tan(np.nan_to_num(drive.pitch_rad))


class HeldMass(SlopeGravity):
    """The drawbar pull has to hold a mass on the slope, whatever the load on the wheel."""

    form = "mass"
    equation = "DP -= m g sin(pitch)"

    def __init__(self, load_N: float) -> None:
        usual = load_N / GRAVITY_M_S2
        source = "statics: the mass that the wheel carries, more of a trailer"
        self.parameters = (Parameter("m", "kg", 0.0, 3.0 * usual, 0.5 * usual, usual, source),)

    def act(self, channels: np.ndarray, contact: Contact, drive: Drive, values: np.ndarray) -> None:
        channels[:, PULL] -= values[0] * GRAVITY_M_S2 * np.sin(np.nan_to_num(drive.pitch_rad))
